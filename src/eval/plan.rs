//! What an evaluation plays: the same for all of its workers.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::options::Options;
use crate::control::RunningClock;
use crate::domain::Task;
use crate::env::remote::RemoteSettings;
use crate::episode::scenes::Scenes;
use crate::episode::wish::Wish;

/// Tasks that fit their scenes, and how they are played. Copies share tasks and scenes.
#[derive(Clone)]
pub(crate) struct EvaluationPlan {
    pub(crate) tasks: Arc<[Task]>,
    pub(crate) scenes: Arc<Scenes>,
    pub(crate) options: Options,
    /// How environments in other processes are reached.
    pub(crate) remote: RemoteSettings,
    /// The time that it takes, which stands still while it is paused.
    pub(crate) clock: Arc<RunningClock>,
    /// What tasks without subtasks were read as, by their places.
    pub(crate) read: Arc<BTreeMap<usize, Wish>>,
}
