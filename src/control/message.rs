//! What is said over a control socket: a JSON object a line, one question and its answer a connection.

use serde::{Deserialize, Serialize};

/// What is asked.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Question {
    /// How far it is.
    Status,
    /// What happens from now on, a line an event.
    Tail,
    /// That something is done.
    Do {
        /// What.
        order: Order,
    },
}

/// What can be done with something that runs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Order {
    /// Go no further for now.
    Pause,
    /// Go on.
    Resume,
    /// Save, and end.
    Stop,
    /// Tell the agent something else.
    Instruct(String),
}

/// What is answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Answer {
    Status(Status),
    /// It was done, in words.
    Done(String),
    /// It was not; why.
    Refused(String),
    /// Something happened.
    Line(String),
}

/// What runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Kind {
    Explore,
    Eval,
    Pretrain,
}

impl Kind {
    /// The subcommand.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Kind::Explore => "explore",
            Kind::Eval => "eval",
            Kind::Pretrain => "pretrain",
        }
    }
}

/// Whether it goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum State {
    Running,
    Paused,
    Stopping,
}

impl State {
    /// The state in a word.
    pub(crate) fn name(self) -> &'static str {
        match self {
            State::Running => "running",
            State::Paused => "paused",
            State::Stopping => "stopping",
        }
    }
}

/// How far something is.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Progress {
    /// What goes on: episodes, a training's stage, steps.
    pub(crate) stage: String,
    pub(crate) done: u64,
    /// Of how many, where that is known.
    pub(crate) of: Option<u64>,
    /// The latest numbers, in words.
    pub(crate) message: String,
}

/// What is told of something that runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Status {
    pub(crate) pid: u32,
    pub(crate) kind: Kind,
    /// The folder it writes, or what is explored.
    pub(crate) what: String,
    pub(crate) state: State,
    pub(crate) progress: Progress,
    /// What the agent is told, in an explorer.
    pub(crate) instruction: Option<String>,
}
