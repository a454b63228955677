//! A chain as the screen shows it, and the work that fills it in.

use std::sync::atomic::AtomicBool;

use super::worker::Report;
use crate::agent::Policy;
use crate::run::chain::{Chain, Draws, Play, Trials, trials};

/// What is known of a chain so far.
#[derive(Clone, Debug, Default)]
pub struct Chained {
    /// The instructions.
    pub links: Vec<String>,
    /// Subtasks of a task grade them.
    pub graded: bool,
    /// Told link by link.
    pub by_link: Option<Play>,
    /// Told all at once.
    pub as_one: Option<Play>,
    /// How often each link was done from both entries.
    pub trials: Option<Trials>,
}

impl Chained {
    /// Follows a chain both ways; with `draws`, also links by themselves. Tells what is known as it goes.
    ///
    /// # Errors
    /// Whatever the policy reports.
    pub fn work(
        chain: &Chain,
        policy: &mut dyn Policy,
        draws: Option<Draws>,
        stop: &AtomicBool,
        tell: &dyn Fn(Report) -> bool,
    ) -> anyhow::Result<()> {
        let mut known = Chained { links: chain.links.clone(), graded: chain.graded.is_some(), ..Chained::default() };
        let show = |known: &Chained, what: &str| {
            tell(Report::Chained(Box::new(known.clone()))) && tell(Report::Working(Some(what.into())))
        };
        show(&known, "chain: link by link");
        let play = chain.play(policy, false, stop)?;
        known.by_link = Some(play.clone());
        show(&known, "chain: as one instruction");
        known.as_one = Some(chain.play(policy, true, stop)?);
        show(&known, "chain");
        if let Some(draws) = draws {
            let links = if draws.only.is_some() { 1 } else { chain.links.len() };
            let all = 2 * draws.times as usize * links;
            let mut shown = known.clone();
            let found = trials(chain, &play, policy, draws, stop, &mut |found| {
                shown.trials = Some(found.clone());
                let done: u32 = found.expert.iter().chain(&found.own).map(|rate| rate.of).sum();
                show(&shown, &format!("links: {done} of at most {all} plays"));
            })?;
            known.trials = Some(found);
            show(&known, "links");
        }
        Ok(())
    }
}
