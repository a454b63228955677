//! Tasks: where an episode starts, what is asked, and for how long.

use serde::{Deserialize, Serialize};

use super::environment_name::EnvironmentName;
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
    /// None: the task plays in the environment that it names.
    #[serde(skip)]
    Remote,
}

impl SceneRef {
    fn remote() -> SceneRef {
        SceneRef::Remote
    }

    fn is_remote(&self) -> bool {
        *self == SceneRef::Remote
    }
}

/// One task: in House, or, with `env` and `seed`, in another environment, which says itself what is asked.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("if" = {"required": ["env"]}))]
#[schemars(extend("then" = {"required": ["seed"]}))]
#[schemars(extend("else" = {"required": ["scene", "instruction", "horizon"]}))]
pub struct Task {
    /// A name that is unique in its set.
    #[schemars(length(min = 1, max = 200))]
    pub id: String,
    /// Where it plays, in House.
    #[serde(default = "SceneRef::remote", skip_serializing_if = "SceneRef::is_remote")]
    pub scene: SceneRef,
    /// The environment that it plays in, where that is not House: `gym:ID` or `openenv:URL`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<String>")]
    pub env: Option<EnvironmentName>,
    /// The seed of the episode in that environment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// The state at the start; `None` for the state that the generator gives its house.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<World>,
    /// What the agent is told; in another environment, where this is absent, what that asks.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    #[schemars(length(min = 1, max = 2000))]
    pub(crate) instruction: String,
    /// One sentence for each subtask, when there are any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) sentences: Vec<String>,
    /// The parts that instances play.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 100))]
    pub roles: Vec<Role>,
    /// The steps, in order. Without any the instruction is read and graded as it was read, where a task is played or explored;
    /// all else needs them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 100))]
    pub subtasks: Vec<Subtask>,
    /// How many actions the expert takes; 0 where that is not known.
    #[serde(default)]
    pub(crate) expert_steps: u32,
    /// After how many actions the episode ends: twice the expert's; in another environment 1000 where this is absent.
    #[serde(default)]
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

impl Task {
    /// After how many actions an episode in another environment ends, where neither that nor the task says.
    pub(crate) const OWN_HORIZON: u32 = 1000;

    /// An episode of an environment with actions of its own, which says itself what is asked.
    pub(crate) fn remote(id: String, env: EnvironmentName, seed: u64) -> Task {
        Task {
            id,
            scene: SceneRef::Remote,
            env: Some(env),
            seed: Some(seed),
            start: None,
            instruction: String::new(),
            sentences: Vec::new(),
            roles: Vec::new(),
            subtasks: Vec::new(),
            expert_steps: 0,
            horizon: Task::OWN_HORIZON,
            goal: None,
            source: None,
            reworded: false,
        }
    }

    /// The environment that it plays in and its episode's seed, where that is not House.
    pub(crate) fn remote_episode(&self) -> Option<(&EnvironmentName, u64)> {
        Some((self.env.as_ref()?, self.seed?))
    }

    /// Whether its instruction is nothing but the sentences of its several steps, one after the other.
    pub(crate) fn is_joined(&self) -> bool {
        self.sentences.len() > 1 && self.instruction == self.sentences.join(" ")
    }
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
    /// The same, with what tasks in other environments leave out.
    pub(crate) fn filled(mut self) -> TaskSet {
        for task in self.tasks.iter_mut().filter(|task| task.env.is_some() && task.horizon == 0) {
            task.horizon = Task::OWN_HORIZON;
        }
        self
    }

    /// The format version this program reads and writes.
    pub(crate) const FORMAT: u32 = 1;
}
