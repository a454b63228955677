//! Re-runs recorded demonstrations in the simulator: are their actions possible, their goals met, their skills complete, and
//! do their targets appear where they were recorded?

mod boxes;
mod failure;
mod sight;
mod task_sets;

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::Context;
use rayon::prelude::*;
use serde::Serialize;

pub(crate) use self::boxes::BoxReport;
use self::boxes::{Overlap, box_report, compare, note_moved};
pub(crate) use self::failure::ReplayFailure;
pub(crate) use self::sight::MissCount;
use self::sight::{Miss, misses, ranked};
pub(crate) use self::task_sets::SetReport;
use self::task_sets::{recorded, replay_set, scene_of};
use crate::data::Dataset;
use crate::domain::world::Instance;
use crate::domain::{ActionType, Scene, Trajectory};
use crate::house::goals::goal_met;
use crate::house::grading::{Grader, Grading};
use crate::house::{Outcome, Replay};

/// Which demonstrations to replay, and what to compare beside their outcomes.
#[derive(Clone, Debug, Default)]
pub(crate) struct ReplayOptions {
    /// Only demonstrations of this split; of all without.
    pub(crate) split: Option<String>,
    /// Compare projected with recorded boxes.
    pub(crate) boxes: bool,
    /// Ask whether an agent there would have seen and reached what was acted on.
    pub(crate) sight: bool,
    /// With `sight`, a folder that takes a picture of each interaction whose target was out of view or reach.
    pub(crate) pictures: Option<PathBuf>,
}

/// What a replay came to. Shares are of trajectories, from 0 to 1.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ReplayReport {
    /// How many demonstrations were replayed.
    pub(crate) trajectories: usize,
    /// Share whose every action is possible, sight and reach apart.
    pub(crate) legal: f64,
    /// Share in which everything acted on was in view and in reach then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) seen: Option<f64>,
    /// Share that meets ALFRED's goal at the end.
    pub(crate) goals: f64,
    /// Share that completes every skill, graded by class.
    pub(crate) skills_class: f64,
    /// Share that completes every skill, graded as the released code does.
    pub(crate) skills_strict: f64,
    /// How many trajectories failed at each of these.
    pub(crate) failures: BTreeMap<&'static str, usize>,
    /// The official task sets that the dataset holds, with the expert's recorded actions as the policy.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) task_sets: BTreeMap<String, SetReport>,
    /// What was acted on out of view or reach, by action, class, receptacle and cause, the most frequent first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) misses: Vec<MissCount>,
    /// How well projected boxes fit the recorded ones, where that was asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) boxes: Option<BoxReport>,
    /// Every failure: which, the trajectory, and why.
    #[serde(skip)]
    pub(crate) failed: Vec<ReplayFailure>,
}

/// What one trajectory came to.
#[derive(Default)]
struct Replayed {
    failures: Vec<(&'static str, String)>,
    overlaps: Vec<Overlap>,
    misses: Vec<Miss>,
}

/// Replays a dataset's demonstrations on all cores; `progress` is called as they are done.
///
/// # Errors
/// When a file of the dataset cannot be read or names a scene that is absent.
pub(crate) fn replay(
    dataset: &Dataset,
    options: &ReplayOptions,
    progress: &(dyn Fn(u64) + Sync),
) -> anyhow::Result<ReplayReport> {
    let scenes = dataset.scenes()?;
    let wanted = |trajectory: &Trajectory| options.split.as_ref().is_none_or(|split| *split == trajectory.split);
    let replayed = dataset
        .trajectories()?
        .par_bridge()
        .map(|trajectory| {
            let trajectory = trajectory?;
            if !wanted(&trajectory) {
                return Ok(None);
            }
            let scene = scene_of(&scenes, &trajectory.scene).with_context(|| trajectory.id.clone())?;
            let mut done = replay_one(scene, &trajectory, options.boxes);
            if options.sight {
                let misses = misses(scene, &trajectory, options.pictures.as_deref())?;
                let first = misses.first().map(|(number, Miss { action, object, cause, .. })| {
                    ("seen", format!("action {number}, {action} {object}: {cause}"))
                });
                done.failures.extend(first);
                done.misses = misses.into_iter().map(|(_, miss)| miss).collect();
            }
            progress(1);
            Ok(Some((trajectory.id, done)))
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    let mut replayed: Vec<(String, Replayed)> = replayed.into_iter().flatten().collect();
    replayed.sort_by(|a, b| a.0.cmp(&b.0));
    let mut report = summarise(&replayed, options);
    for name in ["eval_100", "eval_chain", "eval_unseen"] {
        if dataset.folder().join("tasks").join(format!("{name}.json")).is_file() && options.split.is_none() {
            let set = dataset.tasks(name)?;
            let sources: Vec<&str> = set.tasks.iter().filter_map(|task| Some(&*task.source.as_ref()?.0)).collect();
            let recorded = recorded(dataset, &sources)?;
            let done = replay_set(&set.tasks, &recorded, &scenes, &mut report.failed)?;
            report.task_sets.insert(name.to_owned(), done);
        }
    }
    Ok(report)
}

fn replay_one(scene: &Scene, trajectory: &Trajectory, boxes: bool) -> Replayed {
    let mut replayed = Replayed::default();
    let mut replay = Replay::new(scene, trajectory.start.clone(), &trajectory.actions);
    let goal = trajectory.goal.as_ref();
    let new = |grading| Grader::new(grading, &trajectory.roles, &trajectory.skills, goal, (scene, &trajectory.start));
    let (mut class, mut strict) = (new(Grading::Class), new(Grading::Strict));
    let mut interactions = 0;
    let mut moved = vec![false; trajectory.start.objects.len()];
    let mut illegal = None;
    let mut number = 0;
    while let Some(action) = replay.upcoming() {
        if action.kind.is_interaction() {
            let recorded = trajectory.boxes.get(interactions).copied().unwrap_or_default();
            interactions += 1;
            if boxes && let Some(target) = action.target {
                replayed.overlaps.extend(compare(scene, replay.world(), action.kind, target, recorded, &moved));
            }
            if let (ActionType::Pickup, Some(Instance::Object(index))) = (action.kind, action.target) {
                note_moved(replay.world(), index, &mut moved);
            }
        }
        let Some((_, outcome)) = replay.step() else { break };
        if let Outcome::Impossible(reason) = outcome
            && illegal.is_none()
        {
            illegal = Some(format!("action {number}, {}: {reason}", action.kind));
        }
        class.observe(scene, replay.world(), action, outcome);
        strict.observe(scene, replay.world(), action, outcome);
        number += 1;
    }
    let world = replay.finish();
    replayed.failures.extend(illegal.map(|reason| ("legal", reason)));
    if let Some(goal) = goal
        && !goal_met(goal, scene, &world)
    {
        replayed.failures.push(("goals", format!("{:?} is not met at the end", goal.kind)));
    }
    for (what, grader) in [("skills_class", class), ("skills_strict", strict)] {
        if !grader.is_done() {
            let (at, of) = (grader.completed(), grader.total());
            replayed.failures.push((what, format!("{at} of {of}; {}", grader.waits_for(scene, &world))));
        }
    }
    replayed
}

fn summarise(replayed: &[(String, Replayed)], options: &ReplayOptions) -> ReplayReport {
    let mut failures: BTreeMap<&'static str, usize> =
        ["legal", "goals", "skills_class", "skills_strict"].map(|what| (what, 0)).into();
    failures.extend(options.sight.then_some(("seen", 0)));
    let mut failed = Vec::new();
    for (id, one) in replayed {
        for (what, reason) in &one.failures {
            *failures.entry(what).or_default() += 1;
            failed.push(ReplayFailure { what, id: id.clone(), reason: reason.clone() });
        }
    }
    let share = |what: &str| {
        let failed = failures.get(what).copied().unwrap_or_default();
        if replayed.is_empty() { 0.0 } else { 1.0 - failed as f64 / replayed.len() as f64 }
    };
    ReplayReport {
        trajectories: replayed.len(),
        legal: share("legal"),
        seen: options.sight.then(|| share("seen")),
        goals: share("goals"),
        skills_class: share("skills_class"),
        skills_strict: share("skills_strict"),
        boxes: options.boxes.then(|| {
            let all: Vec<Overlap> = replayed.iter().flat_map(|(_, one)| one.overlaps.iter().copied()).collect();
            box_report(&all)
        }),
        task_sets: BTreeMap::new(),
        misses: ranked(replayed.iter().flat_map(|(_, one)| one.misses.iter().copied())),
        failures,
        failed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alfreds_demonstrations_replay_and_its_counts_and_task_sets_come_out() {
        let Some(source) = crate::needed::alfred() else { return };
        let out = tempfile::tempdir().unwrap();
        let options = crate::data::alfred::ImportOptions::default();
        let summary = crate::data::alfred::import(&source, out.path(), &options, &|_| {}).unwrap();
        assert_eq!(summary.manifest.skipped, []);
        let train = summary.manifest.counts["train"];
        assert_eq!((train.trajectories, train.annotated_primitives, train.aligned_primitives), (6574, 73395, 73248));
        assert_eq!((train.spans, train.spans_after_holdout), (111_339, 110_828));
        assert_eq!(summary.manifest.counts["valid_seen"].trajectories, 251);
        assert_eq!(summary.manifest.held_out.len(), 20);
        let built: Vec<_> = summary.sets.iter().map(|set| set.tasks.as_ref().ok().copied()).collect();
        assert_eq!(built, [Some(100), Some(20), None]);

        let dataset = Dataset::open(out.path()).unwrap();
        let set = dataset.tasks("eval_100").unwrap();
        assert_eq!(set.tasks.iter().filter(|task| task.reworded).count(), 25);
        let report = replay(&dataset, &ReplayOptions { boxes: true, ..ReplayOptions::default() }, &|_| {}).unwrap();
        assert_eq!(report.trajectories, 6825);
        assert!(report.legal >= 0.999, "{}", report.legal);
        assert!(report.goals >= 0.995, "{}", report.goals);
        assert!(report.skills_class >= 0.995, "{}", report.skills_class);
        assert_eq!(report.task_sets["eval_100"], SetReport { tasks: 100, class: 100, strict: 87 });
        assert_eq!(report.task_sets["eval_chain"], SetReport { tasks: 20, class: 20, strict: 11 });
        let boxes = report.boxes.unwrap();
        assert!(boxes.pickup_median_iou >= 0.78, "{}", boxes.pickup_median_iou);
        assert!(boxes.put_median_iou >= 0.80, "{}", boxes.put_median_iou);
        let looking = ReplayOptions { split: Some("valid_seen".into()), sight: true, ..ReplayOptions::default() };
        let seen = replay(&dataset, &looking, &|_| {}).unwrap().seen.unwrap();
        assert!(seen >= 0.87, "{seen}");
    }

    #[test]
    fn complete_files_with_masks_and_images_say_the_same_as_those_without() {
        let Some(source) = crate::needed::alfred() else { return };
        let mut compared = 0;
        for task in std::fs::read_dir(source.join("data/json_2.1.0_originals/train")).unwrap() {
            for trial in std::fs::read_dir(task.unwrap().path()).unwrap() {
                let complete = trial.unwrap().path().join("traj_data.json");
                let stripped = source.join("data/json_2.1.0/train");
                let id = complete.strip_prefix(source.join("data/json_2.1.0_originals/train")).unwrap();
                let Ok(stripped) = std::fs::read(stripped.join(id)) else { continue };
                let parse =
                    |text: &[u8]| crate::data::alfred::checkout::parse_recording(text, "task/trial", "train").unwrap();
                assert_eq!(parse(&std::fs::read(&complete).unwrap()), parse(&stripped), "{}", complete.display());
                compared += 1;
            }
        }
        assert!(compared > 0);
    }
}
