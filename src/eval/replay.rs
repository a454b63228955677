//! Re-runs recorded demonstrations in the simulator: are their actions possible, their goals met, their skills complete, and
//! do their targets appear where they were recorded?

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use anyhow::Context;
use rayon::prelude::*;
use serde::Serialize;

use crate::agent::{Decision, Policy};
use crate::data::Dataset;
use crate::domain::task::SceneRef;
use crate::domain::world::Instance;
use crate::domain::{ActionType, Scene, Task, Trajectory, World};
use crate::env::HouseEnvironment;
use crate::episode::rollout::{Observer, Rollout, Tick};
use crate::house::bounds::projected_bounds;
use crate::house::goals::goal_met;
use crate::house::grading::{Grader, Grading};
use crate::house::{House, Outcome, Replay};

/// Which demonstrations to replay, and what to compare beside their outcomes.
#[derive(Clone, Debug, Default)]
pub(crate) struct ReplayOptions {
    /// Only demonstrations of this split; of all without.
    pub(crate) split: Option<String>,
    /// Compare projected with recorded boxes.
    pub(crate) boxes: bool,
    /// Ask whether an agent there would have seen and reached what was acted on.
    pub(crate) sight: bool,
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
    /// How well projected boxes fit the recorded ones, where that was asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) boxes: Option<BoxReport>,
    /// Every failure: which, the trajectory, and why.
    #[serde(skip)]
    pub(crate) failed: Vec<ReplayFailure>,
}

/// A check that one demonstration, or task of an official set, did not pass.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct ReplayFailure {
    /// `legal`, `seen`, `goals`, `skills_class`, `skills_strict`; for a task of an official set, `task_class` or `task_strict`.
    pub(crate) what: &'static str,
    /// The id of the trajectory or task.
    pub(crate) id: String,
    /// What the simulator found instead.
    pub(crate) reason: String,
}

/// How many tasks of a set the expert's recorded actions complete.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct SetReport {
    /// How many tasks the set has.
    pub(crate) tasks: usize,
    /// How many are completed, graded by class.
    pub(crate) class: usize,
    /// Completed, graded as the released code does.
    pub(crate) strict: usize,
}

/// How well the boxes of targets, as the simulator projects them, fit those that ALFRED recorded.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct BoxReport {
    /// How many boxes were compared.
    pub(crate) n: usize,
    /// Median intersection over union, first pickups of objects that nothing moved before.
    pub(crate) pickup_median_iou: f64,
    /// The same of receptacles that something is put into.
    pub(crate) put_median_iou: f64,
    /// By what was done and the target's class.
    pub(crate) per_class: BTreeMap<String, ClassBoxes>,
}

/// The same for one action and class.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ClassBoxes {
    /// How many boxes of it were compared.
    pub(crate) n: usize,
    /// Median intersection over union of projected and recorded box.
    pub(crate) median_iou: f64,
}

/// What one trajectory came to.
#[derive(Default)]
struct Replayed {
    failures: Vec<(&'static str, String)>,
    ious: Vec<(ActionType, &'static str, f32)>,
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
                done.failures.extend(unseen(scene, &trajectory).map(|reason| ("seen", reason)));
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

fn scene_of<'a>(scenes: &'a BTreeMap<String, Arc<Scene>>, reference: &SceneRef) -> anyhow::Result<&'a Arc<Scene>> {
    match reference {
        SceneRef::Named(name) => scenes.get(name).with_context(|| format!("no scene {name:?}")),
        SceneRef::Generated { .. } => anyhow::bail!("generated scenes hold no recordings to replay"),
    }
}

fn recorded(dataset: &Dataset, ids: &[&str]) -> anyhow::Result<BTreeMap<String, Trajectory>> {
    let mut found = BTreeMap::new();
    for trajectory in dataset.trajectories()? {
        let trajectory = trajectory?;
        if ids.contains(&&*trajectory.id) {
            found.insert(trajectory.id.clone(), trajectory);
        }
    }
    Ok(found)
}

fn replay_one(scene: &Scene, trajectory: &Trajectory, boxes: bool) -> Replayed {
    let mut replayed = Replayed::default();
    let mut replay = Replay::new(scene, trajectory.start.clone(), &trajectory.actions);
    let goal = trajectory.goal.as_ref();
    let new = |grading| Grader::new(grading, &trajectory.roles, &trajectory.skills, goal);
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
                replayed.ious.extend(compare(scene, replay.world(), action.kind, target, recorded, &moved));
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

/// The first action that an agent could not have taken because its target was out of view or reach, if there is one.
fn unseen(scene: &Arc<Scene>, trajectory: &Trajectory) -> Option<String> {
    /// Knows which action the rules alone would have allowed.
    #[derive(Default)]
    struct Sight {
        possible: bool,
        unseen: Option<String>,
    }
    impl Observer<HouseEnvironment> for Sight {
        fn before(
            &mut self,
            rollout: &mut Rollout,
            _policy: Option<&mut dyn Policy>,
            decision: &Decision,
        ) -> anyhow::Result<ControlFlow<()>> {
            let house = &rollout.env.house;
            let mut by_rules =
                Replay::new(house.scene(), house.world().clone(), std::slice::from_ref(&decision.action));
            self.possible = by_rules.step().is_some_and(|(_, outcome)| outcome.is_done());
            Ok(ControlFlow::Continue(()))
        }

        fn after(&mut self, _rollout: &mut Rollout, tick: &Tick) -> anyhow::Result<ControlFlow<()>> {
            let Tick { step, decision, outcome, .. } = tick;
            if let (true, Outcome::Impossible(reason)) = (self.possible, outcome) {
                self.unseen = Some(format!("action {}, {}: {reason}", step - 1, decision.action.kind));
                return Ok(ControlFlow::Break(()));
            }
            Ok(ControlFlow::Continue(()))
        }
    }
    let house = House::new(scene.clone(), trajectory.start.clone());
    let mut rollout = Rollout::in_house(house, String::new(), None, None);
    let mut sight = Sight::default();
    rollout.replay(trajectory.actions.iter().copied(), &mut sight).ok()?;
    sight.unseen
}

/// Marks an object and all it carries as moved.
fn note_moved(world: &World, index: u16, moved: &mut [bool]) {
    let carried: Vec<u16> = world.contents(Instance::Object(index)).collect();
    for index in carried.into_iter().chain([index]) {
        if let Some(moved) = moved.get_mut(usize::from(index)) {
            *moved = true;
        }
    }
}

/// How well the projected target fits the recorded box, for the interactions that are compared.
fn compare(
    scene: &Scene,
    world: &World,
    kind: ActionType,
    target: Instance,
    recorded: [u16; 4],
    moved: &[bool],
) -> Option<(ActionType, &'static str, f32)> {
    let counts = match (kind, target) {
        (ActionType::Pickup, Instance::Object(index)) => moved.get(usize::from(index)) == Some(&false),
        (ActionType::Put, _) => true,
        _ => false,
    };
    if !counts || recorded == [0; 4] {
        return None;
    }
    let class = world.class_of(scene, target)?.name();
    let projected = projected_bounds(scene, world, world.agent, target);
    Some((kind, class, projected.map_or(0.0, |projected| iou(projected, recorded.map(f32::from)))))
}

/// Intersection over union of two boxes, given by left, top, right and bottom edges.
pub(crate) fn iou(a: [f32; 4], b: [f32; 4]) -> f32 {
    let area = |[left, top, right, bottom]: [f32; 4]| (right - left).max(0.0) * (bottom - top).max(0.0);
    let shared = area([a[0].max(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].min(b[3])]);
    let all = area(a) + area(b) - shared;
    if all > 0.0 { shared / all } else { 0.0 }
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
        boxes: options.boxes.then(|| box_report(replayed)),
        task_sets: BTreeMap::new(),
        failures,
        failed,
    }
}

fn box_report(replayed: &[(String, Replayed)]) -> BoxReport {
    let all: Vec<_> = replayed.iter().flat_map(|(_, one)| one.ious.iter().copied()).collect();
    let median_of =
        |kind: ActionType| median(all.iter().filter(|(k, _, _)| *k == kind).map(|(_, _, iou)| *iou).collect());
    let mut classes: BTreeMap<String, Vec<f32>> = BTreeMap::new();
    for (kind, class, iou) in &all {
        classes.entry(format!("{kind} {class}")).or_default().push(*iou);
    }
    let class = |ious: Vec<f32>| ClassBoxes { n: ious.len(), median_iou: median(ious) };
    BoxReport {
        n: all.len(),
        pickup_median_iou: median_of(ActionType::Pickup),
        put_median_iou: median_of(ActionType::Put),
        per_class: classes.into_iter().map(|(name, ious)| (name, class(ious))).collect(),
    }
}

/// The middle value; 0 of nothing.
fn median(mut values: Vec<f32>) -> f64 {
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied().map_or(0.0, f64::from)
}

/// Lets the expert's recorded actions do the tasks of a set.
fn replay_set(
    tasks: &[Task],
    recorded: &BTreeMap<String, Trajectory>,
    scenes: &BTreeMap<String, Arc<Scene>>,
    failed: &mut Vec<ReplayFailure>,
) -> anyhow::Result<SetReport> {
    let mut report = SetReport { tasks: tasks.len(), ..SetReport::default() };
    for task in tasks {
        let scene = scene_of(scenes, &task.scene).with_context(|| task.id.clone())?;
        let (Some((id, first)), Some(start)) = (&task.source, &task.start) else { continue };
        let Some(trajectory) = recorded.get(id) else { continue };
        let from = trajectory.skill_range(usize::from(*first)).start;
        let rest = trajectory.actions.get(from..).unwrap_or_default();
        let actions = &rest[..rest.len().min(task.expert_steps as usize)];
        let mut replay = Replay::new(scene, start.clone(), actions);
        let new = |grading| Grader::new(grading, &task.roles, &task.subtasks, task.goal.as_ref());
        let mut graders = [new(Grading::Class), new(Grading::Strict)];
        while let Some((action, outcome)) = replay.step() {
            for grader in &mut graders {
                grader.observe(scene, replay.world(), action, outcome);
            }
        }
        let world = replay.finish();
        report.class += usize::from(graders[0].is_done());
        report.strict += usize::from(graders[1].is_done());
        for (what, grader) in [("task_class", &graders[0]), ("task_strict", &graders[1])] {
            if !grader.is_done() {
                let reason = format!("{id}: {}", grader.waits_for(scene, &world));
                failed.push(ReplayFailure { what, id: task.id.clone(), reason });
            }
        }
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlap_of_boxes_is_one_for_equal_and_zero_for_apart() {
        let unit = [0.0, 0.0, 10.0, 10.0];
        assert_eq!(iou(unit, unit), 1.0);
        assert_eq!(iou(unit, [20.0, 0.0, 30.0, 10.0]), 0.0);
        assert!((iou(unit, [5.0, 0.0, 15.0, 10.0]) - 1.0 / 3.0).abs() < 1e-6);
    }

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
                    |text: &[u8]| crate::data::alfred::import::parse_recording(text, "task/trial", "train").unwrap();
                assert_eq!(parse(&std::fs::read(&complete).unwrap()), parse(&stripped), "{}", complete.display());
                compared += 1;
            }
        }
        assert!(compared > 0);
    }
}
