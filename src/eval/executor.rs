//! What all workers of an evaluation share.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::plan::EvaluationPlan;
use super::work_queue::WorkQueue;
use crate::agent::policy_source::MakePolicy;
use crate::agent::served::ServerGone;
use crate::episode::record::Episode;

/// What is played, by whom, and whom to tell.
pub(crate) struct Executor {
    pub(crate) evaluation: EvaluationPlan,
    pub(crate) make_policy: Arc<MakePolicy>,
    /// Set from outside: what is under way is dropped.
    pub(crate) stop: Arc<AtomicBool>,
    /// Set when nobody takes the episodes any more.
    pub(crate) give_up: AtomicBool,
    /// Why the policy cannot be evaluated like this at all: a decision shows it.
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
    /// Ends the run, with nothing recorded of what is under way: the policy cannot be evaluated like this, or any longer.
    pub(crate) fn refuse(&self, problem: String) {
        self.refusal.get_or_init(|| problem);
        self.give_up.store(true, Ordering::Relaxed);
    }

    /// The same, where it is an error that no other episode is spared.
    pub(crate) fn refuse_if_gone(&self, error: &anyhow::Error) {
        if error.is::<ServerGone>() {
            self.refuse(error.to_string());
        }
    }

    /// Tells the thread that waits; false when nobody waits any more.
    pub(crate) fn send(&self, message: Message) -> bool {
        self.sender.lock().unwrap_or_else(PoisonError::into_inner).send(message).is_ok()
    }
}
