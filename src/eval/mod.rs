//! Evaluation: task sets, workers that play them, verification and replay.

pub mod evaluation;
pub mod executor;
pub mod in_flight;
pub mod merge;
pub mod options;
pub mod plan;
pub mod progress_event;
pub mod replay;
pub mod schemas;
pub mod tasks;
pub mod verify;
pub mod work_queue;
pub mod worker;
pub mod worker_pool;
