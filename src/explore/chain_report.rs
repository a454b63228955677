//! What is known of a chain, and the work that finds it out.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::agent::Policy;
use crate::agent::registry::PolicyIdentity;
use crate::analysis::chain::{Chain, ChainRun, Draws, LinkSuccess, trials};

/// What is known of a chain so far, followed by one policy.
#[derive(Clone, Debug, Default)]
pub struct ChainReport {
    /// Who follows it.
    pub(crate) who: PolicyIdentity,
    /// The instructions, in the order in which they are followed.
    pub(crate) links: Vec<String>,
    /// The digest of the state in which it begins.
    pub(crate) start: String,
    /// Subtasks of a task grade them.
    pub(crate) graded: bool,
    /// Told link by link.
    pub(crate) by_link: Option<ChainRun>,
    /// Told all at once.
    pub(crate) as_one: Option<ChainRun>,
    /// How often each link was done from both entries.
    pub(crate) trials: Option<LinkSuccess>,
}

impl ChainReport {
    /// Nothing is known yet.
    pub(crate) fn new(chain: &Chain, who: PolicyIdentity) -> ChainReport {
        ChainReport {
            who,
            links: chain.links.clone(),
            start: chain.start.digest(),
            graded: chain.graded.is_some(),
            ..ChainReport::default()
        }
    }

    /// Whether both are about the same instructions from the same state.
    pub(crate) fn is_same_chain(&self, other: &ChainReport) -> bool {
        self.links == other.links && self.start == other.start
    }

    /// Follows a chain both ways, unless that is known; with `draws`, also links by themselves. Tells what is known and how far it
    /// is as it goes, and returns it. What is stopped is not finished: only what is whole is kept.
    ///
    /// # Errors
    /// Whatever the policy reports.
    pub(crate) fn fill_in(
        mut self,
        chain: &Chain,
        policy: &mut dyn Policy,
        draws: Option<Draws>,
        stop: &AtomicBool,
        tell: &dyn Fn(&ChainReport, String),
    ) -> anyhow::Result<ChainReport> {
        let stopped = || stop.load(Ordering::Relaxed);
        tell(&self, "link by link".into());
        let play = match self.by_link.take() {
            Some(play) => play,
            None => {
                let mut shown = self.clone();
                chain.play(policy, false, stop, &mut |play| {
                    let link = play.in_force.last().map_or(1, |link| link + 1);
                    let what = format!("link {link} of {}, step {}", chain.links.len(), play.link_values.len());
                    shown.by_link = Some(play.clone());
                    tell(&shown, what);
                })?
            }
        };
        if stopped() {
            return Ok(self);
        }
        self.by_link = Some(play.clone());
        if self.as_one.is_none() {
            let mut shown = self.clone();
            let whole = chain.play(policy, true, stop, &mut |play| {
                shown.as_one = Some(play.clone());
                tell(&shown, format!("as one instruction, step {}", play.link_values.len()));
            })?;
            self.as_one = Some(whole).filter(|_| !stopped());
        }
        tell(&self, "links".into());
        if let Some(draws) = draws.filter(|_| !stopped()) {
            let links = if draws.only.is_some() { 1 } else { chain.links.len() };
            let all = 2 * draws.times as usize * links;
            let earlier = self.trials.take().unwrap_or_default();
            let mut shown = self.clone();
            let mut found = trials(chain, &play, policy, draws, stop, &mut |found| {
                let done: u32 = found.expert.iter().chain(&found.own).map(|rate| rate.of).sum();
                let mut found = found.clone();
                found.fill(&earlier);
                shown.trials = Some(found);
                tell(&shown, format!("{done} of at most {all} plays of links"));
            })?;
            found.fill(&earlier);
            self.trials = Some(found);
            tell(&self, "links".into());
        }
        Ok(self)
    }
}
