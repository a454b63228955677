//! Evaluation: task sets, workers that play them, verification and replay.

mod earlier_episodes;
pub mod evaluation;
pub mod executor;
pub(crate) mod in_flight;
pub(crate) mod merge;
pub mod options;
pub(crate) mod plan;
pub(crate) mod progress_event;
pub(crate) mod replay;
pub mod schemas;
pub mod tasks;
pub(crate) mod read_tasks;
pub mod verify;
pub(crate) mod work_queue;
pub mod worker;
pub(crate) mod worker_pool;
