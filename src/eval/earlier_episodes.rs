//! Whether the episodes that a folder holds already are those of the run that goes on in it.

use std::collections::BTreeMap;

use super::plan::EvaluationPlan;
use crate::episode::instruction_variant;
use crate::run_dir::episode_spec::policy_seed;
use crate::run_dir::layout::EPISODES;
use crate::run_dir::manifest::RunManifest;
use crate::run_dir::record_check::RecordCheck;
use crate::run_dir::writer::RunWriter;

/// Checks that each episode that a folder holds already is one of this run.
///
/// # Errors
/// Names the first that is not, and why.
pub(super) fn check_earlier(plan: &EvaluationPlan, manifest: &RunManifest, folder: &RunWriter) -> anyhow::Result<()> {
    let EvaluationPlan { tasks, scenes, options, .. } = plan;
    let belonging = RecordCheck::new(manifest, tasks);
    let places: BTreeMap<&str, usize> = (0..).zip(tasks.iter()).map(|(at, task)| (task.id.as_str(), at)).collect();
    let mut starts: BTreeMap<usize, String> = BTreeMap::new();
    for episode in &folder.earlier {
        let mut misfit = belonging.check(episode).err();
        if let (None, Some(&at)) = (&misfit, places.get(episode.task.as_str())) {
            let (variant, chance) = (episode.variant, policy_seed(at, episode.seed));
            let told = instruction_variant::instruction_for(tasks, at, variant, options.step_by_step, chance);
            let is_remote = tasks[at].env.is_some();
            let start = match starts.get(&at) {
                // Where an episode starts elsewhere, and what it asks, only its environment knows.
                _ if is_remote => episode.start_hash.clone(),
                Some(start) => start.clone(),
                None => starts.entry(at).or_insert(scenes.setting(&tasks[at])?.world.digest()).clone(),
            };
            // An episode that could not be begun has no start.
            let begun = !episode.start_hash.is_empty();
            misfit = match () {
                () if episode.instruction != told && !(is_remote && tasks[at].instruction.is_empty()) => {
                    Some("instruction: not the one that the run gives")
                }
                () if begun && episode.start_hash != start => Some("start_hash: not the task's start"),
                () => None,
            }
            .map(|field| format!("{}: {field}", episode.key()));
        }
        if let Some(misfit) = misfit {
            let file = folder.path().join(EPISODES);
            anyhow::bail!(
                "{}: {misfit}; the line is not of this run: delete it, and its episode is played anew, or choose \
                 another folder with --out",
                file.display()
            );
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::episode::record::Episode;
    use crate::eval::evaluation::tests::{options, run, walker};

    /// Spoils a record.
    type Change<'a> = &'a dyn Fn(&mut Episode);

    #[test]
    fn a_run_goes_on_only_with_records_that_are_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let again = || run(folder.path(), options(), || walker(false, false), usize::MAX);
        let whole = again().unwrap().lines;
        let file = folder.path().join("episodes.jsonl");
        let first: Episode = serde_json::from_str(whole.lines().next().unwrap()).unwrap();
        let faults: [(Change<'_>, &str); 7] = [
            (&|it| it.task = "nobody".into(), "no task \"nobody\""),
            (&|it| it.seed = 4, "seed"),
            (&|it| it.steps = u32::MAX, "steps: 4294967295"),
            (&|it| it.completed = 99, "completed: 99"),
            (&|it| it.success = !it.success, "success"),
            (&|it| it.start_hash = "00".into(), "start_hash"),
            (&|it| it.instruction = "Dance.".into(), "instruction"),
        ];
        for (change, told) in faults {
            let mut changed = first.clone();
            change(&mut changed);
            let lines = whole.replacen(whole.lines().next().unwrap(), &serde_json::to_string(&changed).unwrap(), 1);
            std::fs::write(&file, &lines).unwrap();
            let error = again().err().unwrap().to_string();
            assert!(error.contains("episodes.jsonl") && error.contains(told), "{told}: {error}");
            assert_eq!(std::fs::read_to_string(&file).unwrap(), lines, "nothing is written");
        }
        std::fs::write(&file, &whole).unwrap();
        assert_eq!(again().unwrap().lines, whole);
    }
}
