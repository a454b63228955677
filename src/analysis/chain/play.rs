//! A chain that is followed: how each link came out, and how warm every link was on the way.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Chain;
use crate::agent::{Decision, Policy};
use crate::domain::{Action, World};
use crate::env::{Environment, HouseEnvironment};
use crate::episode::failure::Failure;
use crate::episode::rollout::{Observer, Rollout, Tick};
use crate::episode::wish::explain;
use crate::house::Outcome;

/// How a link came out.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LinkOutcome {
    /// It was reached: the links before it were done.
    pub(crate) reached: bool,
    /// It was done; `None` where it is not graded.
    pub(crate) done: Option<bool>,
    pub(crate) steps: u32,
    /// What was done for it, and what came of that.
    pub(crate) taken: Vec<(Action, Outcome)>,
    /// Why it was not done, and what to do about it.
    pub(crate) failure: Option<(Failure, String)>,
    /// The state in which it began.
    pub(crate) entry: World,
    /// The state in which it ended.
    pub(crate) exit: World,
    /// What chaining would learn where the next link takes over; nothing without critics.
    pub(crate) handover: Option<Handover>,
}

/// The end of a link as equations 4 and 5 see it. Both end the link there, with what the next one makes of it as the reward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Handover {
    /// V of the exit state under the next link's instruction.
    pub(crate) worth: f32,
    /// min Q of the link's last action under the next link's instruction: equation 4 draws it to the target.
    pub(crate) next: f32,
    /// min Q of the link's last action under both instructions joined: equation 5 draws it to the target.
    pub(crate) joined: f32,
}

impl Handover {
    /// The reward: the worth within 0 to 1, where every return lies.
    pub(crate) fn target(self) -> f32 {
        self.worth.clamp(0.0, 1.0)
    }
}

/// A chain that was followed.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ChainRun {
    /// How each link came out, as far as it got.
    pub(crate) outcomes: Vec<LinkOutcome>,
    /// For every step, the value of each link: V under its instruction, or without critics the probability that its
    /// instruction gives to what was done.
    pub(crate) link_values: Vec<Vec<f32>>,
    /// They are V.
    pub(crate) by_value: bool,
    /// The link in force at every step.
    pub(crate) in_force: Vec<usize>,
}

impl Chain {
    /// Follows the chain: told all at once, or link by link as each is done. `visit` sees what is known before every step; `stop`
    /// ends it early.
    ///
    /// # Errors
    /// Whatever the policy reports.
    pub(crate) fn play(
        &self,
        policy: &mut dyn Policy,
        whole: bool,
        stop: &AtomicBool,
        visit: &mut dyn FnMut(&ChainRun),
    ) -> anyhow::Result<ChainRun> {
        let limits = self.limits();
        let told = |link: usize| if whole { self.whole() } else { self.links[link].clone() };
        let mut rollout = Rollout::in_house(self.house(&self.start), told(0), self.grader(), None);
        policy.reset(0, 0);
        let mut run = ChainRun::default();
        let all: u32 = limits.iter().sum();
        for (link, &limit) in limits.iter().enumerate() {
            let entry = rollout.env.house.world().clone();
            let begun = rollout.steps();
            let grader = rollout.env.grader.clone();
            rollout.instruction = told(link);
            let breaks = |before: &LinkOutcome| !before.reached || before.done == Some(false);
            let failed = run.outcomes.last().is_some_and(breaks);
            let until = if whole { all } else { begun + limit };
            let mut follower = LinkFollower {
                chain: self,
                link,
                until,
                stop,
                visit,
                run: &mut run,
                done: false,
                last: None,
                taken: Vec::new(),
            };
            if !failed && !follower.is_over(&rollout) {
                rollout.run(policy, &mut follower)?;
            }
            let (completed, last, taken) = (follower.done, follower.last, follower.taken);
            let handover = match (self.links.get(link + 1), last) {
                (Some(next_instruction), Some((next, joined))) => {
                    let values = asked(policy, &mut rollout, next_instruction, |policy, rollout| {
                        policy.values(0, &mut rollout.observation())
                    })?;
                    values.map(|values| Handover { worth: values.state, next, joined })
                }
                _ => None,
            };
            let (steps, exit) = (rollout.steps() - begun, rollout.env.house.world().clone());
            let done = self.graded.is_some().then_some(completed);
            let done = done.filter(|_| !failed);
            let failure = match (&grader, done, stop.load(Ordering::Relaxed)) {
                (Some(grader), Some(false), false) if !taken.is_empty() => {
                    let actions: Vec<Action> = taken.iter().map(|(action, _)| *action).collect();
                    explain(grader, &self.scene, &entry, &actions)?
                }
                _ => None,
            };
            run.outcomes.push(LinkOutcome { reached: !failed, done, taken, failure, steps, entry, exit, handover });
        }
        Ok(run)
    }
}

/// Watches one link being followed.
struct LinkFollower<'a> {
    chain: &'a Chain,
    link: usize,
    /// The step at which its time is over.
    until: u32,
    stop: &'a AtomicBool,
    visit: &'a mut dyn FnMut(&ChainRun),
    run: &'a mut ChainRun,
    done: bool,
    /// Of the last step: min Q of what was done, under the next link's instruction and under both joined.
    last: Option<(f32, f32)>,
    taken: Vec<(Action, Outcome)>,
}

impl LinkFollower<'_> {
    fn is_over(&self, rollout: &Rollout) -> bool {
        self.done || rollout.steps() >= self.until || self.stop.load(Ordering::Relaxed)
    }

    /// The value of every link before a step. With critics also min Q of what is done, under the next link's instruction and
    /// under both joined.
    fn link_values(
        &mut self,
        rollout: &mut Rollout,
        policy: &mut dyn Policy,
        decision: &Decision,
    ) -> anyhow::Result<Option<(f32, f32)>> {
        let action = decision.action;
        let class = action.target.and_then(|target| rollout.env.class_of(target));
        let values = |policy: &mut dyn Policy, rollout: &mut Rollout| policy.values(0, &mut rollout.observation());
        let mut link_values = Vec::with_capacity(self.chain.links.len());
        let mut next = None;
        for (link, instruction) in self.chain.links.iter().enumerate() {
            let value = match asked(policy, rollout, instruction, values)? {
                Some(values) => {
                    self.run.by_value = true;
                    if link == self.link + 1 {
                        next = values.q(action.kind, class);
                    }
                    values.state
                }
                None => {
                    let decided = asked(policy, rollout, instruction, |policy, rollout| rollout.decide(policy))?;
                    decided.distribution.and_then(|it| it.actions[action.kind.index()]).unwrap_or(0.0)
                }
            };
            link_values.push(value);
        }
        self.run.link_values.push(link_values);
        self.run.in_force.push(self.link);
        let Some(next) = next else { return Ok(None) };
        let both = self.chain.links[self.link..=self.link + 1].join(" ");
        let joined = asked(policy, rollout, &both, values)?.and_then(|values| values.q(action.kind, class));
        Ok(joined.map(|joined| (next, joined)))
    }
}

impl Observer<HouseEnvironment> for LinkFollower<'_> {
    fn before(
        &mut self,
        rollout: &mut Rollout,
        policy: Option<&mut dyn Policy>,
        decision: &Decision,
    ) -> anyhow::Result<ControlFlow<()>> {
        if let Some(policy) = policy {
            self.last = self.link_values(rollout, policy, decision)?;
        }
        (self.visit)(self.run);
        Ok(ControlFlow::Continue(()))
    }

    fn after(&mut self, rollout: &mut Rollout, tick: &Tick) -> anyhow::Result<ControlFlow<()>> {
        self.done = tick.completed_one;
        self.taken.push((tick.decision.action, tick.outcome));
        Ok(if self.is_over(rollout) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }
}

/// Asks a policy something under another instruction; it and the rollout are left as they were.
fn asked<T>(
    policy: &mut dyn Policy,
    rollout: &mut Rollout,
    instruction: &str,
    ask: impl FnOnce(&mut dyn Policy, &mut Rollout) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let state = policy.state(0);
    let before = std::mem::replace(&mut rollout.instruction, instruction.to_string());
    let answer = ask(policy, rollout);
    rollout.instruction = before;
    policy.restore(0, state);
    answer
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::RandomPolicy;
    use crate::analysis::chain::testing::chain;

    #[test]
    fn a_chain_is_followed_until_a_link_fails() {
        let chain = chain();
        let mut policy = RandomPolicy::new();
        let mut seen = 0;
        let play = chain.play(&mut policy, false, &AtomicBool::new(false), &mut |_| seen += 1).unwrap();
        assert_eq!(seen, play.link_values.len());
        assert_eq!(play.outcomes.len(), 2);
        let first = &play.outcomes[0];
        assert!(first.reached && first.done.is_some() && first.handover.is_none());
        assert_eq!(play.outcomes[1].reached, first.done == Some(true));
        let steps: u32 = play.outcomes.iter().map(|outcome| outcome.steps).sum();
        assert_eq!((play.link_values.len(), play.in_force.len()), (steps as usize, steps as usize));
        assert!(play.link_values.iter().all(|values| values.len() == 2) && !play.by_value);
    }

    #[test]
    fn nothing_is_reached_after_a_link_that_failed() {
        let mut chain = chain();
        let again = |n: usize| n % 2;
        chain.links = (0..6).map(|n| chain.links[again(n)].clone()).collect();
        if let Some((_, subtasks)) = &mut chain.graded {
            *subtasks = (0..6).map(|n| subtasks[again(n)].clone()).collect();
        }
        for whole in [false, true] {
            let play = chain.play(&mut RandomPolicy::new(), whole, &AtomicBool::new(false), &mut |_| ()).unwrap();
            let broken = play.outcomes.iter().position(|outcome| outcome.done == Some(false)).unwrap();
            let failed = &play.outcomes[broken];
            assert!(failed.failure.is_some() && failed.taken.len() == failed.steps as usize, "it is said why");
            let rest = &play.outcomes[broken + 1..];
            assert!(rest.iter().all(|outcome| !outcome.reached && outcome.done.is_none() && outcome.steps == 0));
            assert!(!rest.is_empty());
        }
    }
}
