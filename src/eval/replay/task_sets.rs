//! The official task sets that a dataset holds, with the expert's recorded actions as the policy.

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::Context;
use serde::Serialize;

use super::failure::ReplayFailure;
use crate::data::Dataset;
use crate::domain::task::SceneRef;
use crate::domain::{Scene, Task, Trajectory};
use crate::house::Replay;
use crate::house::grading::{Grader, Grading};

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

/// The scene of that name.
pub(super) fn scene_of<'a>(
    scenes: &'a BTreeMap<String, Arc<Scene>>,
    reference: &SceneRef,
) -> anyhow::Result<&'a Arc<Scene>> {
    match reference {
        SceneRef::Named(name) => scenes.get(name).with_context(|| format!("no scene {name:?}")),
        SceneRef::Generated { .. } | SceneRef::Remote => {
            anyhow::bail!("generated scenes hold no recordings to replay")
        }
    }
}

/// The trajectories of those ids.
pub(super) fn recorded(dataset: &Dataset, ids: &[&str]) -> anyhow::Result<BTreeMap<String, Trajectory>> {
    let mut found = BTreeMap::new();
    for trajectory in dataset.trajectories()? {
        let trajectory = trajectory?;
        if ids.contains(&&*trajectory.id) {
            found.insert(trajectory.id.clone(), trajectory);
        }
    }
    Ok(found)
}

/// Lets the expert's recorded actions do the tasks of a set.
pub(super) fn replay_set(
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
        let new = |grading| Grader::new(grading, &task.roles, &task.subtasks, task.goal.as_ref(), (scene, start));
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
