//! Tasks: where an episode starts, what is asked, and for how long.

use serde::{Deserialize, Serialize};

use super::scene::Room;
use super::skill::{Goal, Role, Subtask};
use super::world::World;

/// Which scene a task plays in.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum SceneRef {
    /// The house that the generator makes of this room and seed.
    Generated {
        /// The kind of room.
        room: Room,
        /// The generator's seed.
        seed: u64,
    },
    /// A scene file of the dataset, by name.
    Named(String),
}

/// One task.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// A name that is unique in its set.
    #[schemars(length(min = 1, max = 200))]
    pub id: String,
    /// Where it plays.
    pub scene: SceneRef,
    /// The state at the start; `None` for the state that the generator gives its house.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<World>,
    /// What the agent is told.
    #[schemars(length(min = 1, max = 2000))]
    pub(crate) instruction: String,
    /// One sentence for each subtask, when there are any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) sentences: Vec<String>,
    /// The parts that instances play.
    #[schemars(length(max = 100))]
    pub roles: Vec<Role>,
    /// The steps, in order. Without any the instruction is read and graded as it was read, where a task is played or explored;
    /// all else needs them.
    #[schemars(length(max = 100))]
    pub subtasks: Vec<Subtask>,
    /// How many actions the expert takes; 0 where that is not known.
    #[serde(default)]
    pub(crate) expert_steps: u32,
    /// After how many actions the episode ends: twice the expert's.
    #[schemars(range(min = 1, max = 100_000))]
    pub horizon: u32,
    /// The goal of the whole ALFRED trajectory, for strict grading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<Goal>,
    /// The trajectory that it was cut from, and the subtask it starts at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) source: Option<(String, u8)>,
    /// The instruction is not the authors' own text (which only their file holds).
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) reworded: bool,
}

/// A file of tasks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TaskSet {
    /// Version of this format.
    #[schemars(extend("const" = TaskSet::FORMAT))]
    pub(crate) format_version: u32,
    /// What the set is called in reports.
    pub(crate) name: String,
    /// The folder of scene files, relative to this file; needed when a task names a scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenes: Option<String>,
    /// The tasks.
    #[schemars(length(min = 1))]
    pub tasks: Vec<Task>,
}

impl TaskSet {
    /// The format version this program reads and writes.
    pub(crate) const FORMAT: u32 = 1;
}
