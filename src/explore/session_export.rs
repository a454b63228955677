//! What a person explored, as an ordinary run: a branch an episode. The folder holds the tasks too, so that it can be opened
//! and verified by itself.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, ensure};
use sha2::{Digest, Sha256};

use super::explored_run::{self, SCENES};
use crate::agent::ExpertPolicy;
use crate::agent::policy_place::PolicyPlace;
use crate::data::{json, taskset};
use crate::domain::task::SceneRef;
use crate::domain::{Scene, Task, TaskSet};
use crate::episode::record::Episode;
use crate::episode::rollout::{End, Rollout};
use crate::episode::scenes::Scenes;
use crate::house::House;
use crate::house::grading::{Grader, Grading};

/// The tasks and episodes of an exploration, a branch each.
#[derive(Clone, Debug)]
pub(crate) struct SessionExport {
    pub(crate) scene: Arc<Scene>,
    /// What was asked at the start, under each branch's name.
    pub(crate) tasks: Vec<Task>,
    /// What was done.
    pub(crate) episodes: Vec<Episode>,
    /// Where policies were that are none of the program's own.
    pub(crate) places: Vec<PolicyPlace>,
}

/// The most steps that the expert is given for a task.
const MOST: u32 = 1000;

/// Writes an exploration into a new run folder.
///
/// # Errors
/// When the folder holds something else, or cannot be written to.
pub(crate) fn write(explored: &SessionExport, path: &Path) -> anyhow::Result<()> {
    let named = explored.tasks.iter().any(|task| matches!(task.scene, SceneRef::Named(_)));
    let set = TaskSet {
        format_version: TaskSet::FORMAT,
        name: "explored".into(),
        scenes: named.then(|| SCENES.to_string()),
        tasks: explored.tasks.clone(),
    };
    let scenes_hash = json::hex(&Sha256::digest(serde_json::to_vec(&*explored.scene)?));
    let scene = named.then_some(&*explored.scene);
    explored_run::write(path, &set, scenes_hash, scene, (&explored.episodes, &explored.places))
}

/// A task without subtasks: nobody grades what a person made up.
pub(crate) fn ungraded(scene: SceneRef) -> Task {
    Task {
        id: String::new(),
        scene,
        start: None,
        instruction: "look around".into(),
        sentences: Vec::new(),
        roles: Vec::new(),
        subtasks: Vec::new(),
        expert_steps: 0,
        horizon: 0,
        goal: None,
        source: None,
        env: None,
        seed: None,
        reworded: false,
    }
}

/// What is left of a task from the present state of a rollout; things that were chosen for earlier subtasks stay chosen.
///
/// # Errors
/// When it is not graded, nothing is left, or the expert cannot do it.
pub(crate) fn rest_of(task: Task, rollout: &Rollout) -> anyhow::Result<Task> {
    let grader = rollout.env.grader.as_ref().context("this instruction is not graded, so it cannot be a task")?;
    let done = grader.completed();
    let subtasks = grader.subtasks().get(done..).unwrap_or_default().to_vec();
    ensure!(!subtasks.is_empty(), "every subtask is done here; go back to a step where something is left to do");
    let mut roles = task.roles.clone();
    for (at, role) in (0u8..).zip(&mut roles) {
        role.bound = grader.binding(at);
    }
    let sentences = task.sentences.get(done..).unwrap_or_default().to_vec();
    let instruction = match (done, sentences.is_empty()) {
        (0, _) | (_, true) => task.instruction.clone(),
        (_, false) => sentences.join(" "),
    };
    let mut rest = Task { roles, subtasks, sentences, instruction, goal: None, source: None, ..task };
    if rest.sentences.len() != rest.subtasks.len() {
        rest.sentences.clear();
    }
    rest.expert_steps = expert_steps(&rest, rollout.env.house.scene())?;
    rest.horizon = 2 * rest.expert_steps;
    Ok(rest)
}

fn expert_steps(task: &Task, scene: &Arc<Scene>) -> anyhow::Result<u32> {
    let world = task.start.clone().context("the task has no start")?;
    let grader = Grader::new(Grading::Class, &task.roles, &task.subtasks, None, (scene, &world));
    let house = House::new(scene.clone(), world);
    let mut rollout = Rollout::in_house(house, task.instruction.clone(), Some(grader), Some(MOST));
    rollout.run(&mut ExpertPolicy::new(), &mut ())?;
    ensure!(rollout.end() == Some(End::Success), "the expert does not finish this within {MOST} steps");
    Ok(rollout.steps())
}

/// Adds a task to a task file, which is made where there is none; returns the id that it has there and how many tasks there are.
///
/// # Errors
/// When the file is no task file, or cannot be written.
pub(crate) fn add_task(path: &Path, mut task: Task, scene: &Scene) -> anyhow::Result<(String, usize)> {
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir()) {
        anyhow::bail!("{}: there is no folder {}; make it first", path.display(), folder.display());
    }
    let mut set = if path.exists() {
        taskset::read(path)?.value
    } else {
        let name = path.file_stem().map_or_else(|| "tasks".into(), |name| name.to_string_lossy().into_owned());
        TaskSet { format_version: TaskSet::FORMAT, name, scenes: None, tasks: Vec::new() }
    };
    if let SceneRef::Named(name) = &task.scene {
        let folder = set.scenes.get_or_insert_with(|| SCENES.into()).clone();
        let file = path.parent().unwrap_or(Path::new("")).join(folder).join(format!("{name}.json"));
        if !file.exists() {
            json::write(&file, scene)?;
        }
    }
    let taken = |id: &String| set.tasks.iter().any(|task| task.id == *id);
    let mut ids = std::iter::once(task.id.clone()).chain((2..).map(|number| format!("{}-{number}", task.id)));
    let id = ids.find(|id| !taken(id)).unwrap_or_default();
    task.id.clone_from(&id);
    set.tasks.push(task);
    Scenes::of(path, &set).check(&set.tasks)?;
    taskset::write(path, &set)?;
    Ok((id, set.tasks.len()))
}
