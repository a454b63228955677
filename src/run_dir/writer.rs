//! The folder that an evaluation writes: a manifest, then an episode a line as they come, then the summary.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use sha2::{Digest, Sha256};

use super::manifest::Manifest;
use super::shard::Shard;
use crate::data::json;
use crate::domain::TaskSet;
use crate::episode::record::{Episode, Key};

/// An open run folder, which no other process writes to.
pub struct RunFolder {
    path: PathBuf,
    episodes: File,
    /// The episodes that were there when it was opened, without their traces.
    pub earlier: Vec<Episode>,
}

impl RunFolder {
    /// The file of a run's manifest.
    pub const MANIFEST: &str = "manifest.json";
    /// The file of a run's episodes.
    pub const EPISODES: &str = "episodes.jsonl";
    /// The file with the tasks that a run plays.
    pub const TASKS: &str = "tasks.json";
    /// The file of a run's summary.
    pub const SUMMARY: &str = "summary.json";
    /// How the names of files begin that are being written.
    const UNFINISHED: &str = ".sprint-";

    /// Opens a folder for this run: a new or empty one, or one that the same run began, which is then continued.
    ///
    /// # Errors
    /// When it holds something else (naming what differs), is being written to by another process, or cannot be written to.
    pub fn open(path: &Path, manifest: &Manifest) -> anyhow::Result<RunFolder> {
        let name = path.display();
        std::fs::create_dir_all(path).with_context(|| format!("cannot make the run folder {name}"))?;
        own_files_only(path)?;
        let manifest_path = path.join(Self::MANIFEST);
        if !manifest_path.exists() {
            only_begun(path)?;
        }
        let episodes_path = path.join(Self::EPISODES);
        let context = || format!("cannot write {}", episodes_path.display());
        let mut options = OpenOptions::new();
        let episodes = options.create(true).append(true).open(&episodes_path).with_context(context)?;
        match episodes.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!("{name}: another process is writing this run; wait for it to end"),
            // A file system without locks: the user has to see to it.
            Err(TryLockError::Error(_)) => {}
        }
        if manifest_path.exists() {
            let found = json::read::<Manifest>(&manifest_path, Manifest::FORMAT)?.value;
            let differences = found.differences(manifest);
            if !differences.is_empty() {
                bail!("{name} holds another run ({}); choose another folder with --out", differences.join("; "));
            }
        } else {
            json::write_pretty(&manifest_path, manifest)?;
        }
        let (mut earlier, whole) = read_episodes(&episodes_path)?;
        for episode in &mut earlier {
            episode.trace = Vec::new();
        }
        // What follows the last whole line is the rest of a write that was cut off.
        episodes.set_len(whole).with_context(context)?;
        remove_unfinished(path);
        Ok(RunFolder { path: path.to_owned(), episodes, earlier })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Appends an episode, as one write of one line.
    ///
    /// # Errors
    /// When the disk is full or the folder went away.
    pub fn append(&mut self, episode: &Episode) -> anyhow::Result<()> {
        let context = || format!("cannot write {}", self.path.join(Self::EPISODES).display());
        let mut line = serde_json::to_vec(episode).with_context(context)?;
        line.push(b'\n');
        self.episodes.write_all(&line).with_context(context)
    }

    /// Writes down which tasks are played, so that the folder can be opened without their file.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub fn write_tasks(&self, set: &TaskSet) -> anyhow::Result<()> {
        let path = self.path.join(Self::TASKS);
        if path.exists() { Ok(()) } else { json::write(&path, set) }
    }

    /// The episodes in the given order, without their traces, and the SHA-256 of their lines in that order: that of the file
    /// `episodes.jsonl` of a run that nothing went wrong in.
    ///
    /// # Errors
    /// When the file cannot be read any more.
    pub fn result(&self, order: &[Key]) -> anyhow::Result<(Vec<Episode>, String)> {
        let (episodes, _) = read_episodes(&self.path.join(Self::EPISODES))?;
        let mut by_key: BTreeMap<Key, Episode> = episodes.into_iter().map(|e| (e.key(), e)).collect();
        let mut digest = Sha256::new();
        let mut ordered = Vec::new();
        for key in order {
            let Some(mut episode) = by_key.remove(key) else { continue };
            digest.update(serde_json::to_vec(&episode)?);
            digest.update(b"\n");
            episode.trace = Vec::new();
            ordered.push(episode);
        }
        Ok((ordered, json::hex(&digest.finalize())))
    }
}

/// No file of the folder lies elsewhere: what is written stays in it.
fn own_files_only(path: &Path) -> anyhow::Result<()> {
    let entries = std::fs::read_dir(path).with_context(|| format!("cannot read {}", path.display()))?;
    for entry in entries {
        let entry = entry.with_context(|| format!("cannot read {}", path.display()))?;
        if entry.file_type().is_ok_and(|kind| kind.is_symlink()) {
            bail!("{}: a symbolic link; a run folder holds its own files, so remove it", entry.path().display());
        }
    }
    Ok(())
}

/// A folder without a manifest holds nothing, or what a run left that was killed before it had written one.
fn only_begun(path: &Path) -> anyhow::Result<()> {
    let name = path.display();
    for entry in std::fs::read_dir(path).with_context(|| format!("cannot read {name}"))? {
        let entry = entry.with_context(|| format!("cannot read {name}"))?;
        let file = entry.file_name();
        let file = file.to_string_lossy();
        let empty = || entry.metadata().is_ok_and(|metadata| metadata.is_file() && metadata.len() == 0);
        // The shares of a run lie in the folder that they are merged into.
        let begun = file.starts_with(RunFolder::UNFINISHED)
            || file == Shard::FOLDER
            || (file == RunFolder::EPISODES && empty());
        if !begun {
            bail!("{name} is not empty and holds no run; choose another folder with --out");
        }
    }
    Ok(())
}

/// Files that a killed process did not get to rename are of no use to anyone; failing to remove them does no harm.
fn remove_unfinished(path: &Path) {
    let entries = std::fs::read_dir(path).into_iter().flatten().filter_map(Result::ok);
    for entry in entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(RunFolder::UNFINISHED)) {
        let _ = std::fs::remove_file(entry.path());
    }
}

/// Reads a run's episodes, with the length in bytes of its whole lines. A torn last line is left out; where an episode was
/// begun anew after an error, its last record counts.
///
/// # Errors
/// When a line before the last is not an episode, or one is there twice; names file and line.
pub fn read_episodes(path: &Path) -> anyhow::Result<(Vec<Episode>, u64)> {
    let name = path.display();
    let file = File::open(path).with_context(|| format!("cannot read {name}"))?;
    let mut reader = BufReader::new(file);
    let (mut episodes, mut places) = (Vec::<Episode>::new(), BTreeMap::<Key, (usize, usize)>::new());
    let (mut line, mut whole) = (Vec::new(), 0);
    for number in 1.. {
        line.clear();
        reader.read_until(b'\n', &mut line).with_context(|| format!("cannot read {name}"))?;
        if line.last() != Some(&b'\n') {
            break;
        }
        whole += line.len() as u64;
        let episode: Episode =
            serde_json::from_slice(&line).with_context(|| format!("{name}: line {number} is not an episode"))?;
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

/// The folder of a run that was given none: `runs/NAME-YYYYMMDD-HHMMSS`, in universal time. Where there is one already,
/// of a run that began in the same second or before the clock was set back, a number is added.
pub fn default_path(name: &str, unix_seconds: u64, is_taken: &dyn Fn(&Path) -> bool) -> PathBuf {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let name: String = name.trim().trim_start_matches('.').chars().take(60).map(plain).collect();
    let first = Path::new("runs").join(format!("{name}-{}", timestamp(unix_seconds)));
    let numbered = (2..10_000).map(|number| PathBuf::from(format!("{}-{number}", first.display())));
    std::iter::once(first.clone()).chain(numbered).find(|path| !is_taken(path)).unwrap_or(first)
}

/// `YYYYMMDD-HHMMSS` in universal time.
fn timestamp(unix_seconds: u64) -> String {
    let (days, second) = (unix_seconds / 86_400, unix_seconds % 86_400);
    // Howard Hinnant's calendar arithmetic, counting from 0000-03-01.
    let from_march = days + 719_468;
    let (era, day_of_era) = (from_march / 146_097, from_march % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    format!("{year:04}{month:02}{day:02}-{:02}{:02}{:02}", second / 3600, second / 60 % 60, second % 60)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
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

    #[test]
    fn the_same_run_is_continued_after_a_torn_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        RunFolder::open(&path, &manifest()).unwrap().append(&episode("a")).unwrap();
        let mut file = OpenOptions::new().append(true).open(path.join("episodes.jsonl")).unwrap();
        file.write_all(b"{\"task\":\"b\",\"se").unwrap();
        let mut again = RunFolder::open(&path, &manifest()).unwrap();
        assert_eq!(again.earlier, [episode("a")]);
        again.append(&episode("b")).unwrap();
        let (episodes, _) = read_episodes(&path.join("episodes.jsonl")).unwrap();
        assert_eq!(episodes, [episode("a"), episode("b")]);
    }

    #[test]
    fn a_folder_of_another_run_is_refused_and_the_difference_named() {
        let folder = tempfile::tempdir().unwrap();
        RunFolder::open(folder.path(), &manifest()).unwrap();
        let other = Manifest { seeds: 3, policy: "expert".into(), ..manifest() };
        let error = RunFolder::open(folder.path(), &other).err().unwrap().to_string();
        assert!(error.contains("seeds: 1, not 3") && error.contains("policy: \"random\", not \"expert\""), "{error}");
        assert!(!error.contains("grader"));
    }

    #[test]
    fn a_folder_of_something_else_is_refused_and_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("thesis.tex"), "x").unwrap();
        let error = RunFolder::open(folder.path(), &manifest()).err().unwrap().to_string();
        assert!(error.contains("not empty"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn two_writers_of_one_run_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let _first = RunFolder::open(folder.path(), &manifest()).unwrap();
        let error = RunFolder::open(folder.path(), &manifest()).err().unwrap().to_string();
        assert!(error.contains("another process"), "{error}");
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
            let _ = json::parse::<Manifest>(&damaged(text), Manifest::FORMAT);
        }
    }

    #[test]
    fn a_default_folder_is_named_by_set_and_time() {
        let first = Path::new("runs/eval-100-x-19700101-000000");
        assert_eq!(default_path("eval 100/x", 0, &|_| false), first);
        let second = default_path("eval 100/x", 0, &|path| path == first);
        assert_eq!(
            second,
            Path::new("runs/eval-100-x-19700101-000000-2"),
            "a clock that was set back finds no old folder"
        );
        assert_eq!(timestamp(951_826_153), "20000229-120913");
        assert_eq!(timestamp(1_767_225_599), "20251231-235959");
    }
}
