//! What all workers of an evaluation share.

use std::sync::atomic::AtomicBool;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::plan::EvaluationPlan;
use super::work_queue::WorkQueue;
use crate::agent::policy_source::MakePolicy;
use crate::episode::record::Episode;

/// What is played, by whom, and whom to tell.
pub(crate) struct Executor {
    pub(crate) evaluation: EvaluationPlan,
    pub(crate) make_policy: Arc<MakePolicy>,
    /// Set from outside: what is under way is dropped.
    pub(crate) stop: Arc<AtomicBool>,
    /// Set when nobody takes the episodes any more.
    pub(crate) give_up: AtomicBool,
    /// Why the policy cannot be evaluated like this at all: the first decision shows it.
    pub(crate) refusal: OnceLock<String>,
    pub(crate) queue: WorkQueue,
    pub(crate) sender: Mutex<Sender<Message>>,
}

/// What a worker tells.
pub(crate) enum Message {
    /// An episode is over; its position among what is wanted.
    Over(usize, Episode),
    /// The worker of that number is done.
    Done(usize),
}

impl Executor {
    /// Tells the thread that waits; false when nobody waits any more.
    pub(crate) fn send(&self, message: Message) -> bool {
        self.sender.lock().unwrap_or_else(PoisonError::into_inner).send(message).is_ok()
    }
}
