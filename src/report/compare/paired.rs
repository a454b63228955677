//! Two runs side by side: what each made of the same episodes.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::episode::record::{Episode, EpisodeKey};
use crate::report::estimates::{BOOTSTRAP_SEED, interval_method};
use crate::report::shell_word::shell_word;
use crate::report::stats;
use crate::report::stats::Interval;
use crate::run_dir::reader::RecordedRun;

/// A difference of two means, second less first, and its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PairedDifference {
    /// The mean over the first run's paired episodes.
    pub(crate) first: f64,
    /// The mean over the second run's paired episodes.
    pub(crate) second: f64,
    /// `second` less `first`.
    pub(crate) difference: f64,
    /// The 95 % interval of the difference: paired bootstrap over tasks, or, where that has no width, a bound.
    pub(crate) interval: Interval,
}

/// An episode in which one run succeeded and the other did not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct OutcomeChange {
    /// The id of the task.
    pub(crate) task: String,
    /// The episode's seed.
    pub(crate) seed: u64,
    /// What the agent was told in the second run.
    pub(crate) instruction: String,
    /// Completed subtasks in the first run and in the second, and of how many.
    pub(crate) completed: [u32; 3],
    /// The command that opens the first run's episode.
    pub(crate) open_first: String,
    /// The command that opens the second run's episode.
    pub(crate) open_second: String,
}

/// Two runs compared episode by episode: same task, same seed, same start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PairedComparison {
    /// The first run's folder.
    pub(crate) first: String,
    /// The second run's folder.
    pub(crate) second: String,
    /// Pairs of episodes: same task, seed and start, with the task's own instruction.
    pub(crate) pairs: usize,
    /// Episodes of either run without a counterpart.
    pub(crate) unpaired: usize,
    /// Of those, episodes whose counterpart began in another state.
    pub(crate) start_mismatches: usize,
    /// The share of successes.
    pub(crate) success: PairedDifference,
    /// Completed subtasks of an episode.
    pub(crate) completed_subtasks: PairedDifference,
    /// Completed subtasks as a share of those that were asked.
    pub(crate) progress: PairedDifference,
    /// McNemar's discordant pairs: tasks that the first run solved more often, and those that the second did.
    pub(crate) discordant_tasks: [usize; 2],
    /// Two-sided exact McNemar test of equal success, a task a pair: several seeds of a task are alike.
    pub(crate) mcnemar_p: f64,
    /// Only the first run succeeded.
    pub(crate) regressions: Vec<OutcomeChange>,
    /// Only the second run succeeded.
    pub(crate) fixes: Vec<OutcomeChange>,
    /// How the intervals and the test were made.
    pub(crate) methods: String,
}

impl PairedComparison {
    /// Pairs the episodes of two runs.
    ///
    /// # Errors
    /// When they have no episode in common.
    pub(crate) fn of(first: &RecordedRun, second: &RecordedRun) -> anyhow::Result<PairedComparison> {
        let mut others: BTreeMap<EpisodeKey, &Episode> = second
            .episodes
            .iter()
            .filter(|episode| episode.is_plain())
            .map(|episode| (episode.key(), episode))
            .collect();
        // By task, in the first run's order.
        let mut groups: Vec<Vec<(&Episode, &Episode)>> = Vec::new();
        let mut places: BTreeMap<&str, usize> = BTreeMap::new();
        let (mut unpaired, mut start_mismatches) = (0, 0);
        for episode in first.episodes.iter().filter(|episode| episode.is_plain()) {
            match others.remove(&episode.key()) {
                // An episode that failed before it had a start is no success from any start.
                Some(other) if episode.start_hash == other.start_hash => {
                    let place = *places.entry(&episode.task).or_insert(groups.len());
                    if place == groups.len() {
                        groups.push(Vec::new());
                    }
                    groups[place].push((episode, other));
                }
                Some(_) => (unpaired, start_mismatches) = (unpaired + 2, start_mismatches + 2),
                None => unpaired += 1,
            }
        }
        unpaired += others.len();
        let all: Vec<(&Episode, &Episode)> = groups.iter().flatten().copied().collect();
        anyhow::ensure!(
            !all.is_empty(),
            "{} and {} have no episode in common: they pair by task, seed and start",
            first.path.display(),
            second.path.display()
        );
        let change = |(a, b): &(&Episode, &Episode)| -> anyhow::Result<OutcomeChange> {
            Ok(OutcomeChange {
                task: a.task.clone(),
                seed: a.seed,
                instruction: b.instruction.clone(),
                completed: [a.completed, b.completed, b.of],
                open_first: format!("sprint open {}", shell_word(&first.reference(&a.key())?)),
                open_second: format!("sprint open {}", shell_word(&second.reference(&b.key())?)),
            })
        };
        let only = |wanted: bool| -> anyhow::Result<Vec<OutcomeChange>> {
            all.iter().filter(|(a, b)| a.success == wanted && b.success != wanted).map(change).collect()
        };
        let (regressions, fixes) = (only(true)?, only(false)?);
        let solved = |of: fn(&(&Episode, &Episode)) -> bool, group: &[_]| group.iter().filter(|pair| of(pair)).count();
        let discordant_tasks = |toward: Ordering| {
            let lean = |group: &[_]| solved(|(a, _)| a.success, group).cmp(&solved(|(_, b)| b.success, group));
            groups.iter().filter(|group| lean(group) == toward).count()
        };
        let longest = all.iter().map(|(episode, _)| episode.of).max().map_or(0.0, f64::from);
        let discordant_tasks = [discordant_tasks(Ordering::Greater), discordant_tasks(Ordering::Less)];
        Ok(PairedComparison {
            first: first.path.display().to_string(),
            second: second.path.display().to_string(),
            pairs: all.len(),
            unpaired,
            start_mismatches,
            success: difference(&groups, Episode::succeeded, 1.0),
            completed_subtasks: difference(&groups, |episode| f64::from(episode.completed), longest),
            progress: difference(&groups, Episode::progress, 1.0),
            discordant_tasks,
            mcnemar_p: stats::mcnemar(discordant_tasks[0], discordant_tasks[1]),
            regressions,
            fixes,
            methods: format!(
                "differences by paired {}; success by McNemar's exact test over tasks, two-sided",
                interval_method()
            ),
        })
    }
}

/// The difference of a value that is 0 to `most`.
fn difference(groups: &[Vec<(&Episode, &Episode)>], value: fn(&Episode) -> f64, most: f64) -> PairedDifference {
    let first = stats::mean(groups.iter().flatten().map(|(a, _)| value(a)));
    let second = stats::mean(groups.iter().flatten().map(|(_, b)| value(b)));
    let differences: Vec<Vec<f64>> =
        groups.iter().map(|group| group.iter().map(|(a, b)| value(b) - value(a)).collect()).collect();
    let interval = stats::bounded_mean(&differences, [-most, most], BOOTSTRAP_SEED);
    PairedDifference { first, second, difference: second - first, interval }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::data::taskset::tests::sample_set;
    use crate::episode::instruction_variant::InstructionVariant;
    use crate::episode::scenes::Scenes;
    use crate::run_dir::episodes::tests::episode;
    use crate::run_dir::manifest::RunManifest;
    use crate::run_dir::manifest::tests::manifest;

    /// A run of the sample set in which these seeds of the first task succeeded.
    pub(crate) fn run(name: &str, outcomes: &[bool]) -> RecordedRun {
        let outcome = |(seed, &success): (u64, &bool)| Episode {
            seed,
            success,
            completed: if success { 2 } else { 1 },
            ..episode("first")
        };
        let set = sample_set();
        RecordedRun {
            path: name.into(),
            sources: vec![(name.into(), outcomes.len())],
            manifest: RunManifest { seeds: outcomes.len() as u64, ..manifest() },
            places: Vec::new(),
            scenes: Scenes::in_folder(None),
            set,
            episodes: (0..).zip(outcomes).map(outcome).collect(),
        }
    }

    #[test]
    fn regressions_and_fixes_are_told_apart_and_named_with_the_command_that_opens_them() {
        let (a, b) = (run("runs/a", &[true, true, false, false]), run("runs/b", &[true, false, true, false]));
        let paired = PairedComparison::of(&a, &b).unwrap();
        assert_eq!((paired.pairs, paired.unpaired), (4, 0));
        assert_eq!(paired.regressions.len(), 1);
        assert_eq!(paired.regressions[0].seed, 1);
        assert_eq!(paired.regressions[0].open_second, "sprint open runs/b#2");
        let spaced = PairedComparison::of(&a, &run("my runs/b", &[true, false, true, false])).unwrap();
        assert_eq!(spaced.regressions[0].open_second, "sprint open 'my runs/b#2'");
        assert_eq!(paired.fixes[0].completed, [1, 2, 2]);
        assert_eq!(paired.mcnemar_p, 1.0);
        assert_eq!(paired.success.difference, 0.0);
    }

    #[test]
    fn other_words_and_other_starts_are_not_compared() {
        let [a, b] = [("a", [true, true, true]), ("b", [true, false, false])].map(|(name, outcomes)| {
            let mut run = run(name, &outcomes);
            (run.episodes[1].variant, run.episodes[2].start_subtask) = (InstructionVariant::Swapped, 1);
            run
        });
        let paired = PairedComparison::of(&a, &b).unwrap();
        assert_eq!((paired.pairs, paired.unpaired, paired.regressions.len()), (1, 0, 0));
    }

    #[test]
    fn seeds_of_one_task_do_not_make_a_difference_certain() {
        let paired = PairedComparison::of(&run("a", &[false; 12]), &run("b", &[true; 12])).unwrap();
        assert_eq!((paired.fixes.len(), paired.discordant_tasks, paired.mcnemar_p), (12, [0, 1], 1.0));
    }

    #[test]
    fn an_episode_that_began_elsewhere_is_no_counterpart() {
        let (a, mut b) = (run("a", &[true, true]), run("b", &[false, false]));
        b.episodes[0].start_hash = "77".into();
        let paired = PairedComparison::of(&a, &b).unwrap();
        assert_eq!((paired.pairs, paired.unpaired, paired.start_mismatches), (1, 2, 2));
        b.episodes[1].seed = 9;
        assert!(PairedComparison::of(&a, &b).unwrap_err().to_string().contains("no episode in common"));
    }

    #[test]
    fn a_run_against_itself_differs_in_nothing() {
        let a = run("a", &[true, false, true]);
        let paired = PairedComparison::of(&a, &a).unwrap();
        assert_eq!(paired.success.difference, 0.0);
        // One task says little of others: on them the runs may differ either way.
        let [low, high] = paired.success.interval;
        assert!(low < -0.5 && low == -high, "{low} to {high}");
        assert!(paired.regressions.is_empty() && paired.fixes.is_empty());
    }
}
