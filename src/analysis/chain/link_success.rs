//! Which link breaks a chain: each by itself, with drawn actions, from where the expert begins it and from where the agent does.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use super::{Chain, ChainRun, PATIENCE, SLACK};
use crate::agent::Policy;
use crate::domain::{Instance, World};
use crate::episode::rollout::{AfterEach, Rollout, Tick};
use crate::house::grading::{Grader, Grading};

/// How often a link was done from one entry state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LinkRate {
    /// Times it was done.
    pub(crate) done: u32,
    pub(crate) of: u32,
}

/// What is played to see which link breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draws {
    /// Plays of each link from each entry.
    pub(crate) times: u32,
    /// Only this link, from 0.
    pub(crate) only: Option<usize>,
}

impl Draws {
    /// Whether a link is played.
    pub(crate) fn include(self, link: usize) -> bool {
        self.only.is_none_or(|only| only == link)
    }
}

/// Which link breaks: how often each is done from the expert's entry state and from the agent's own.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct LinkSuccess {
    /// From where the expert begins each link.
    pub(crate) expert: Vec<LinkRate>,
    /// From where the agent itself began it; empty where it never got there.
    pub(crate) own: Vec<LinkRate>,
}

impl LinkSuccess {
    /// Takes over the rates of the links that another set of plays left out.
    pub(crate) fn fill(&mut self, earlier: &LinkSuccess) {
        let pairs = [(&mut self.expert, &earlier.expert), (&mut self.own, &earlier.own)];
        for (rates, before) in pairs {
            for (rate, before) in rates.iter_mut().zip(before).filter(|(rate, _)| rate.of == 0) {
                *rate = *before;
            }
        }
    }

    /// Whether every link was played.
    pub(crate) fn is_complete(&self) -> bool {
        self.expert.iter().all(|rate| rate.of > 0)
    }

    /// The link that breaks the chain, once every link was played: the one that is done least often from where the agent itself
    /// begins it. One that it never gets to breaks nothing.
    pub(crate) fn weakest(&self) -> Option<usize> {
        if !self.is_complete() {
            return None;
        }
        let share = |rate: &LinkRate| (rate.of > 0).then(|| f64::from(rate.done) / f64::from(rate.of));
        let own = self.own.iter().map(|rate| share(rate).unwrap_or(1.0));
        let worst = own.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        worst.filter(|(_, share)| *share < 1.0).map(|(link, _)| link)
    }
}

/// Plays links with drawn actions, from the expert's entry and from the agent's own (as `play` recorded it).
/// `visit` sees what was found after every play.
///
/// # Errors
/// When nobody grades the chain, the expert cannot follow it, or the policy fails.
pub(crate) fn trials(
    chain: &Chain,
    play: &ChainRun,
    policy: &mut dyn Policy,
    draws: Draws,
    stop: &AtomicBool,
    visit: &mut dyn FnMut(&LinkSuccess),
) -> anyhow::Result<LinkSuccess> {
    let entries = chain.expert().ok_or_else(|| {
        anyhow::anyhow!("these links are not graded, or the expert cannot follow them: use a task's own chain")
    })?;
    let links = chain.links.len();
    let mut found = LinkSuccess { expert: vec![LinkRate::default(); links], own: vec![LinkRate::default(); links] };
    policy.set_sampling(true);
    for draw in 0..draws.times {
        for (link, (steps, world, grader)) in entries.iter().enumerate().filter(|(link, _)| draws.include(*link)) {
            let own = play.outcomes.get(link).filter(|outcome| outcome.reached).map(|outcome| &outcome.entry);
            // The bindings of the agent's own things differ; what it holds or moved is still of the classes that are asked for.
            let mut starts = vec![(world, grader.clone(), true)];
            starts.extend(own.map(|own| (own, rebound(chain, link, own, grader), false)));
            for (start, grader, by_expert) in starts {
                if stop.load(Ordering::Relaxed) {
                    return Ok(found);
                }
                let house = chain.house(start);
                let mut rollout = Rollout::in_house(house, chain.links[link].clone(), Some(grader), None);
                policy.reset(0, u64::from(draw) * 1000 + link as u64);
                rollout.horizon = Some(PATIENCE * steps + SLACK);
                let mut done = false;
                let mut until_done = AfterEach(|_: &mut Rollout, tick: &Tick| {
                    done = tick.completed_one;
                    Ok(match done || stop.load(Ordering::Relaxed) {
                        true => ControlFlow::Break(()),
                        false => ControlFlow::Continue(()),
                    })
                });
                rollout.run(policy, &mut until_done)?;
                let rate = if by_expert { &mut found.expert[link] } else { &mut found.own[link] };
                rate.done += u32::from(done);
                rate.of += 1;
                visit(&found);
            }
        }
    }
    policy.set_sampling(false);
    Ok(found)
}

/// A grader for a link from another state than the expert's: roles that the expert bound to things are bound to what is held
/// where that is of the class, and are free otherwise.
fn rebound(chain: &Chain, link: usize, world: &World, expert: &Grader) -> Grader {
    let Some((roles, subtasks)) = &chain.graded else { return expert.clone() };
    let held = world.held.map(|held| (Instance::Object(held), world.object(held).map(|o| o.class)));
    let mut roles = roles.clone();
    for role in &mut roles {
        role.bound = held.filter(|(_, class)| *class == Some(role.class)).map(|(instance, _)| instance);
    }
    Grader::new(Grading::Class, &roles, subtasks.get(link..).unwrap_or_default(), None, (&chain.scene, world))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::RandomPolicy;
    use crate::analysis::chain::testing::chain;

    #[test]
    fn trials_play_every_link_from_both_entries_and_can_be_stopped() {
        let chain = chain();
        let mut policy = RandomPolicy::new();
        let stop = AtomicBool::new(false);
        let play = chain.play(&mut policy, false, &stop, &mut |_| ()).unwrap();
        let mut seen = 0;
        let found =
            trials(&chain, &play, &mut policy, Draws { times: 2, only: None }, &stop, &mut |_| seen += 1).unwrap();
        assert_eq!(found.expert.iter().map(|rate| rate.of).collect::<Vec<_>>(), [2, 2]);
        assert_eq!(found.own[0].of, 2);
        assert_eq!(found.own[1].of, if play.outcomes[1].reached { 2 } else { 0 });
        assert_eq!(seen, found.expert.iter().chain(&found.own).map(|rate| rate.of).sum::<u32>());
        let one = Draws { times: 3, only: Some(1) };
        let only = trials(&chain, &play, &mut policy, one, &stop, &mut |_| ()).unwrap();
        assert_eq!(only.expert.iter().map(|rate| rate.of).collect::<Vec<_>>(), [0, 3]);
        stop.store(true, Ordering::Relaxed);
        assert_eq!(trials(&chain, &play, &mut policy, one, &stop, &mut |_| ()).unwrap().expert[1].of, 0);
        let ungraded = Chain { graded: None, ..chain };
        assert!(trials(&ungraded, &play, &mut policy, one, &stop, &mut |_| ()).is_err());
    }

    #[test]
    fn the_weakest_link_is_where_the_agent_does_worst() {
        let rate = |done| LinkRate { done, of: 4 };
        let trials = LinkSuccess { expert: vec![rate(4), rate(4), rate(3)], own: vec![rate(4), rate(1), rate(3)] };
        assert_eq!(trials.weakest(), Some(1));
        let early =
            LinkSuccess { expert: vec![rate(4), rate(4), rate(0)], own: vec![rate(4), rate(1), LinkRate::default()] };
        assert_eq!(early.weakest(), Some(1), "the third link is never reached, however badly it goes by itself");
        let mut some = trials.clone();
        (some.expert[0], some.own[0]) = (LinkRate::default(), LinkRate::default());
        assert_eq!((some.is_complete(), some.weakest()), (false, None), "the first link may break, too");
        let perfect = LinkSuccess { expert: vec![rate(4)], own: vec![rate(4)] };
        assert_eq!(perfect.weakest(), None);
    }
}
