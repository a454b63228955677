//! A run's `episodes.jsonl`, read back.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;

use anyhow::{Context, bail};

use crate::data::{plain_file, text_file};
use crate::episode::record::{Episode, EpisodeKey};

/// Reads a run's episodes, with the length in bytes of its whole lines. A torn last line is left out; where an episode was
/// begun anew after an error, its last record counts.
///
/// # Errors
/// When a line before the last is not an episode, contradicts itself, or is there twice; names file and line.
pub(crate) fn read_episodes(path: &Path) -> anyhow::Result<(Vec<Episode>, u64)> {
    let name = path.display();
    let file = plain_file::open(path).with_context(|| format!("cannot read {name}"))?;
    let mut reader = BufReader::new(file);
    let (mut episodes, mut places) = (Vec::<Episode>::new(), BTreeMap::<EpisodeKey, (usize, usize)>::new());
    let (mut line, mut whole) = (Vec::new(), 0);
    for number in 1.. {
        line.clear();
        reader.read_until(b'\n', &mut line).with_context(|| format!("cannot read {name}"))?;
        if line.last() != Some(&b'\n') {
            break;
        }
        whole += line.len() as u64;
        let context = || format!("{name}: line {number} is not an episode");
        let text = text_file::content(&line).with_context(context)?;
        let episode: Episode = serde_json::from_slice(text).with_context(context)?;
        if let Some(contradiction) = episode.contradiction() {
            bail!(
                "{name}: line {number} contradicts itself: {contradiction}; delete it, and the run's eval command plays its \
                 episode anew"
            );
        }
        let key = episode.key();
        match places.get(&key) {
            Some(&(place, _)) if episodes[place].error.is_some() && episodes[place].attempts < episode.attempts => {
                episodes[place] = episode;
            }
            Some((_, first)) => bail!("{name}: lines {first} and {number} are the same {key}"),
            None => {
                places.insert(key, (episodes.len(), number));
                episodes.push(episode);
            }
        }
    }
    Ok((episodes, whole))
}

#[cfg(test)]
pub(crate) mod tests {
    use serde_json::json;

    use super::*;
    use crate::data::json;
    use crate::episode::failure::Failure;
    use crate::episode::record::TraceStep;
    use crate::run_dir::manifest::RunManifest;
    use crate::run_dir::manifest::tests::manifest;

    pub(crate) fn episode(task: &str) -> Episode {
        Episode {
            task: task.into(),
            seed: 0,
            start_hash: "00".into(),
            instruction: "Go.".into(),
            completed: 1,
            of: 2,
            success: false,
            steps: 9,
            attempts: 1,
            ..Episode::default()
        }
    }

    /// Spoils a record.
    type Change<'a> = &'a dyn Fn(&mut Episode);

    #[test]
    fn a_record_that_its_own_steps_deny_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("episodes.jsonl");
        let plain = json!({"action": "LookUp", "outcome": "done"});
        let completing = json!({"action": "LookUp", "outcome": "done", "subtask": 0});
        let trace: Vec<TraceStep> = serde_json::from_value(json!([plain, completing, plain])).unwrap();
        let good = Episode { steps: 3, failure: Some(Failure::Stuck), trace, ..episode("a") };
        let read = |change: &dyn Fn(&mut Episode)| {
            let mut episode = good.clone();
            change(&mut episode);
            std::fs::write(&path, serde_json::to_string(&episode).unwrap() + "\n").unwrap();
            read_episodes(&path).map(drop).map_err(|error| format!("{error:#}"))
        };
        assert_eq!(read(&|_| ()), Ok(()));
        assert_eq!(read(&|it| it.trace.clear()), Ok(()), "a trace may have been left out");
        let faults: [(Change<'_>, &str); 4] = [
            (&|it| it.steps = 2, "line 1 contradicts itself: steps: 2, but its trace has 3"),
            (&|it| it.prefix_steps = 2, "steps: 3, but its trace has 1"),
            (&|it| it.completed = 0, "completed: 0, but its trace says 1"),
            (&|it| it.success = true, "failure: "),
        ];
        for (change, told) in faults {
            let said = read(change).unwrap_err();
            assert!(said.contains(told), "{told}: {said}");
        }
    }

    #[test]
    fn a_broken_or_doubled_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("episodes.jsonl");
        let line = serde_json::to_string(&episode("a")).unwrap();
        std::fs::write(&path, format!("{line}\n{{}}\n")).unwrap();
        assert!(read_episodes(&path).unwrap_err().to_string().contains("line 2"));
        std::fs::write(&path, format!("{line}\n{line}\n")).unwrap();
        assert!(read_episodes(&path).unwrap_err().to_string().contains("lines 1 and 2"));
    }

    #[test]
    fn a_file_saved_with_a_byte_order_mark_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("episodes.jsonl");
        std::fs::write(&path, format!("\u{feff}{}\n", serde_json::to_string(&episode("a")).unwrap())).unwrap();
        let (episodes, whole) = read_episodes(&path).unwrap();
        assert_eq!((episodes, whole), (vec![episode("a")], std::fs::metadata(&path).unwrap().len()));
    }

    proptest::proptest! {
        #![proptest_config(proptest::test_runner::Config::with_cases(200))]
        #[test]
        fn damaged_episodes_and_manifests_are_read_or_refused(
            edits in proptest::collection::vec((proptest::prelude::any::<usize>(), proptest::prelude::any::<u8>(), 0u8..4), 1..8),
        ) {
            let damaged = |text: String| {
                let mut bytes = text.into_bytes();
                for &(at, byte, edit) in &edits {
                    let at = at % bytes.len().max(1);
                    match edit {
                        0 => bytes.truncate(at),
                        1 if at < bytes.len() => bytes[at] = byte,
                        2 if at < bytes.len() => drop(bytes.remove(at)),
                        _ => bytes.insert(at.min(bytes.len()), byte),
                    }
                }
                bytes
            };
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("episodes.jsonl");
            let line = |task| serde_json::to_string(&episode(task)).unwrap() + "\n";
            std::fs::write(&path, damaged(line("a") + &line("b") + &line("c"))).unwrap();
            if let Ok((episodes, whole)) = read_episodes(&path) {
                proptest::prop_assert!(whole <= std::fs::metadata(&path).unwrap().len());
                proptest::prop_assert!(episodes.len() <= 11);
            }
            let text = serde_json::to_string_pretty(&manifest()).unwrap();
            let _ = json::parse::<RunManifest>(&damaged(text), RunManifest::FORMAT);
        }
    }
}
