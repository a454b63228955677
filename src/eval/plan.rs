//! What an evaluation plays: the same for all of its workers.

use std::sync::Arc;

use super::options::Options;
use crate::domain::Task;
use crate::episode::scenes::Scenes;

/// Tasks that fit their scenes, and how they are played. Copies share tasks and scenes.
#[derive(Clone)]
pub(crate) struct EvaluationPlan {
    pub(crate) tasks: Arc<[Task]>,
    pub(crate) scenes: Arc<Scenes>,
    pub(crate) options: Options,
}
