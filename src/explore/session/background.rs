//! Work that takes long, on a thread of its own, one at a time; and what is kept of it.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use super::event::{EventSink, SessionEvent};
use crate::agent::Policy;
use crate::agent::registry::PolicyIdentity;
use crate::analysis::chain::Chain;
use crate::analysis::value_map::ValueMap;
use crate::domain::Action;
use crate::explore::chain_report::ChainReport;

/// For whom a value map was computed: who was asked, what it was told, and the house without the agent.
pub(super) type MapKey = (PolicyIdentity, String, String);

/// A link's words, and what was done for it.
pub(super) type LinkSteps = (String, Vec<Action>);

/// What is computed beside the episode, and what was found.
pub(super) struct Jobs {
    pub(super) background: Background,
    /// The chain that was followed last.
    pub(super) chain: Option<Chain>,
    /// Where it began: the branch and the step.
    pub(super) begun_at: (usize, u32),
    pub(super) results: Results,
}

/// What was found, shared with the thread that computes.
#[derive(Clone, Default)]
pub(super) struct Results {
    /// Finished value maps.
    pub(super) maps: Shared<HashMap<MapKey, Arc<ValueMap>>>,
    /// What is known of the chain, by each policy that followed it.
    pub(super) chains: Shared<HashMap<PolicyIdentity, ChainReport>>,
    /// The policy that worked in the background last: loading one takes a while.
    pub(super) spare: Shared<Option<(PolicyIdentity, Box<dyn Policy>)>>,
}

/// Something that the session and its background thread both change.
pub(super) struct Shared<T>(Arc<Mutex<T>>);

impl<T> Shared<T> {
    pub(super) fn lock(&self) -> MutexGuard<'_, T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Shared<T> {
        Shared(self.0.clone())
    }
}

impl<T: Default> Default for Shared<T> {
    fn default() -> Shared<T> {
        Shared(Arc::default())
    }
}

impl Jobs {
    pub(super) fn new(events: EventSink) -> Jobs {
        Jobs { background: Background::new(events), chain: None, begun_at: (0, 0), results: Results::default() }
    }

    /// Where the chain that was followed last began, and what that policy did for each link up to one, from 0.
    ///
    /// # Errors
    /// When no chain was followed so far.
    pub(super) fn link(&self, who: &PolicyIdentity, link: usize) -> anyhow::Result<((usize, u32), Vec<LinkSteps>)> {
        let chains = self.results.chains.lock();
        let report = chains.get(who).ok_or_else(|| anyhow::anyhow!("{} followed no chain yet", who.name))?;
        let outcomes = report.by_link.as_ref().map_or(&[][..], |play| play.outcomes.as_slice());
        anyhow::ensure!(
            outcomes.get(link).is_some_and(|outcome| outcome.reached),
            "link {} was not reached: a link before it failed",
            link + 1
        );
        let steps = report.links.iter().zip(outcomes).take(link + 1).map(|(words, outcome)| {
            let actions: Vec<Action> = outcome.taken.iter().map(|(action, _)| *action).collect();
            (words.clone(), actions)
        });
        Ok((self.begun_at, steps.collect()))
    }

    /// Forgets the chain, and stops what is under way.
    pub(super) fn leave_house(&mut self) {
        self.background.stop();
        self.chain = None;
        self.results.chains = Shared::default();
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Work {
    ValueMap,
    Chain,
}

/// A thread that computes.
pub(super) struct Background {
    permit: Permit,
    work: Option<Work>,
    thread: Option<JoinHandle<()>>,
}

/// The permission to go on working, and to tell of it. Work that was stopped tells nothing any more.
#[derive(Clone)]
pub(super) struct Permit {
    pub(super) stop: Arc<AtomicBool>,
    emitting: Shared<()>,
    events: EventSink,
}

impl Permit {
    fn new(events: EventSink) -> Permit {
        Permit { stop: Arc::default(), emitting: Shared::default(), events }
    }

    /// After this returns, nothing is told any more.
    fn revoke(&self) {
        let _silence = self.emitting.lock();
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Tells something, unless it was stopped.
    pub(super) fn emit(&self, event: SessionEvent) {
        let _telling = self.emitting.lock();
        if !self.stop.load(Ordering::Relaxed) {
            (self.events)(event);
        }
    }
}

impl Background {
    fn new(events: EventSink) -> Background {
        Background { permit: Permit::new(events), work: None, thread: None }
    }

    /// Stops what is under way and starts something else.
    pub(super) fn start(&mut self, work: Work, run: impl FnOnce(&Permit) + Send + 'static) {
        self.stop();
        self.work = Some(work);
        let permit = self.permit.clone();
        // Without a thread left nothing is computed; what is shown stays as it is.
        self.thread = std::thread::Builder::new().name("background".into()).spawn(move || run(&permit)).ok();
    }

    pub(super) fn stop(&mut self) {
        self.permit.revoke();
        *self = Background::new(self.permit.events.clone());
    }

    /// Stops what is under way if it is that; whether it was.
    pub(super) fn stop_if(&mut self, work: Work) -> bool {
        let is = self.work == Some(work);
        if is {
            self.stop();
        }
        is
    }

    /// Whether something is under way. Once it is not, everything was told.
    pub(super) fn is_working(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        self.permit.revoke();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_work_that_is_meant_is_stopped() {
        let mut background = Background::new(Arc::new(|_| ()));
        background.start(Work::Chain, |_| ());
        let permit = background.permit.clone();
        assert!(!background.stop_if(Work::ValueMap) && !permit.stop.load(Ordering::Relaxed));
        assert!(background.stop_if(Work::Chain) && permit.stop.load(Ordering::Relaxed));
        assert!(!background.stop_if(Work::Chain), "nothing is left to stop");
    }
}
