//! One thread of an evaluation: a policy that acts in several episodes at once, an episode a slot.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use anyhow::Context;

use super::executor::{Executor, Message};
use super::in_flight::{InFlight, Watchdog, guarded};
use super::plan::EvaluationPlan;
use crate::agent::{Decision, ExpertPolicy, Policy};
use crate::domain::Task;
use crate::env::remote::{RemoteEnvironment, Sessions};
use crate::env::{Environment, HouseEnvironment};
use crate::episode::record::{Episode, TraceStep};
use crate::episode::rollout::{AfterEach, Rollout, decide_all};
use crate::house::House;
use crate::language::count::counted;
use crate::run_dir::episode_spec::{EpisodeSpec, policy_seed};

/// An episode under way in whatever environment it plays.
type AnyRollout = Rollout<Box<dyn Environment>>;

/// A worker. What is recorded of its episodes stands in the watchdog.
pub(crate) struct Worker {
    executor: Arc<Executor>,
    watchdog: Arc<Watchdog>,
    policy: Option<Box<dyn Policy>>,
    rollouts: Vec<Option<AnyRollout>>,
    /// Environments in other processes, a session a slot.
    sessions: Sessions,
    /// The one episode under way is to be played with no other beside it.
    is_alone: bool,
}

/// Nobody waits for this worker any more, or it may play nothing.
struct Abandoned;

impl Worker {
    pub(crate) fn new(executor: Arc<Executor>, watchdog: Arc<Watchdog>, policy: Option<Box<dyn Policy>>) -> Worker {
        let slots = watchdog.lock().slots.len();
        let rollouts = (0..slots).map(|_| None).collect();
        let sessions = Sessions::new(executor.evaluation.remote.clone());
        Worker { executor, watchdog, policy, rollouts, sessions, is_alone: false }
    }

    /// Plays what is wanted until there is nothing left, or nobody waits for it any more.
    pub(crate) fn serve(&mut self) {
        while let Ok(true) = self.round() {}
    }

    /// Whether there is more to play.
    fn round(&mut self) -> Result<bool, Abandoned> {
        self.executor.evaluation.clock.wait(&self.executor.stop);
        if self.executor.stop.load(Ordering::Relaxed) || self.executor.give_up.load(Ordering::Relaxed) {
            return Ok(false);
        }
        self.fill()?;
        let over = self.over()?;
        if over.is_empty() {
            if self.is_idle()? {
                return Ok(false);
            }
            self.step()?;
        }
        for slot in over {
            let Some(in_flight) = self.record(|slots| slots[slot].clone())? else { continue };
            if let Some(again) = in_flight.again(&self.executor.evaluation) {
                self.begin(slot, in_flight.at, again)?;
                continue;
            }
            // Why it fell short is found while it is still watched, so that a hang there is noticed too.
            let at = in_flight.at;
            let episode = in_flight.close(&self.executor.evaluation);
            self.rollouts[slot] = None;
            if self.record(|slots| slots[slot].take())?.is_some() && !self.executor.send(Message::Over(at, episode)) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Reads or writes what is recorded, unless nobody waits for it any more.
    fn record<T>(&self, change: impl FnOnce(&mut Vec<Option<InFlight>>) -> T) -> Result<T, Abandoned> {
        let mut state = self.watchdog.lock();
        // What a refusal cut short is played again another time.
        let is_void = state.is_abandoned || self.executor.refusal.get().is_some();
        if is_void { Err(Abandoned) } else { Ok(change(&mut state.slots)) }
    }

    fn is_idle(&self) -> Result<bool, Abandoned> {
        self.record(|slots| slots.iter().all(Option::is_none))
    }

    /// Slots whose episode is over.
    fn over(&self) -> Result<Vec<usize>, Abandoned> {
        let ended = |slot: usize| self.rollouts[slot].as_ref().is_none_or(|rollout| rollout.end().is_some());
        self.record(|slots| {
            let is_over = |slot: &usize| {
                slots[*slot].as_ref().is_some_and(|in_flight| {
                    let episode = &in_flight.episode;
                    episode.error.is_some() || episode.agent_end.is_some() || ended(*slot)
                })
            };
            (0..slots.len()).filter(is_over).collect()
        })
    }

    fn fill(&mut self) -> Result<(), Abandoned> {
        let slots = self.rollouts.len();
        let is_idle = self.is_idle()?;
        self.is_alone &= !is_idle;
        if self.is_alone || (self.executor.queue.someone_waits_alone() && !is_idle) {
            return Ok(());
        }
        if let Some((at, spec)) = self.executor.queue.next_alone() {
            self.is_alone = true;
            return self.begin(spec.slot(slots), at, spec);
        }
        for slot in 0..slots {
            if self.record(|slots| slots[slot].is_none())?
                && let Some((at, spec)) = self.executor.queue.next(slot)
            {
                self.begin(slot, at, spec)?;
            }
        }
        Ok(())
    }

    /// Sets an episode to its start; an error is recorded in it.
    fn begin(&mut self, slot: usize, at: usize, spec: EpisodeSpec) -> Result<(), Abandoned> {
        let executor = self.executor.clone();
        let in_flight = InFlight::new(&executor.evaluation, at, spec);
        let mut episode = in_flight.episode.clone();
        self.record(|slots| slots[slot] = Some(in_flight))?;
        self.rollouts[slot] = None;
        let ready = guarded(|| {
            self.rollouts[slot] = Some(start(&executor, &mut self.sessions, slot, spec, &mut episode)?);
            self.policy()?.reset(slot, policy_seed(spec.task, spec.seed));
            Ok(())
        });
        episode.error = ready.err();
        self.record(|slots| {
            if let Some(in_flight) = &mut slots[slot] {
                in_flight.episode = episode;
            }
        })
    }

    /// The policy; made again where a panic left the last one in an unknown state.
    fn policy(&mut self) -> anyhow::Result<&mut dyn Policy> {
        let policy = match self.policy.take() {
            Some(policy) => policy,
            None => {
                let made = (self.executor.make_policy)().inspect_err(|error| self.executor.refuse_if_gone(error));
                made.context("the policy could not be made again")?
            }
        };
        Ok(&mut **self.policy.insert(policy))
    }

    /// One decision and one step in every slot.
    fn step(&mut self) -> Result<(), Abandoned> {
        let mut policy = match self.policy() {
            Ok(_) => self.policy.take(),
            Err(error) => return self.fail_all(&format!("{error:#}")),
        };
        let (rollouts, executor) = (&mut self.rollouts, &self.executor);
        let decided = guarded(|| {
            let decided = decide_all(policy.as_deref_mut().context("there is no policy")?, rollouts);
            decided.inspect_err(|error| executor.refuse_if_gone(error))
        });
        match decided {
            Ok(decisions) => {
                self.policy = policy;
                for (slot, decision) in decisions.into_iter().enumerate() {
                    if let Some(decision) = decision {
                        self.carry_out(slot, decision)?;
                    }
                }
                Ok(())
            }
            // Whatever state a failure left the policy in is not carried on.
            Err(problem) if self.rollouts.iter().flatten().count() == 1 => self.fail_all(&problem),
            Err(_) => {
                let begun: Vec<InFlight> = self.record(|slots| slots.iter_mut().filter_map(Option::take).collect())?;
                self.rollouts.iter_mut().for_each(|rollout| *rollout = None);
                self.executor.queue.play_alone(begun.iter().map(|in_flight| (in_flight.at, in_flight.spec)));
                Ok(())
            }
        }
    }

    /// Carries out what was decided in a slot.
    fn carry_out(&mut self, slot: usize, decision: anyhow::Result<Decision>) -> Result<(), Abandoned> {
        let Some(rollout) = self.rollouts[slot].as_mut() else { return Ok(()) };
        if !rollout.ended_by.is_grader()
            && let Ok(decision) = &decision
        {
            match decision.says_done() {
                Some(true) => {
                    let held = guarded(|| Ok(holds(rollout)));
                    return self.record(|slots| {
                        let Some(in_flight) = &mut slots[slot] else { return };
                        match held {
                            Ok(held) => in_flight.episode.agent_end = Some(held),
                            Err(problem) => in_flight.fail(&problem),
                        }
                    });
                }
                Some(false) => {}
                None => {
                    // No episode of it can end so: that is said once, and none is recorded.
                    let problem =
                        "the policy has no end of its own, so its word cannot end an episode: use --end grader";
                    self.executor.refuse(problem.into());
                    return Err(Abandoned);
                }
            }
        }
        let taken = guarded(|| {
            let tick = rollout.carry_out(decision?)?;
            Ok(TraceStep::of(&tick, rollout))
        });
        let (limit, goes_on) = (self.executor.evaluation.options.timeout, rollout.end().is_none());
        let now = self.executor.evaluation.clock.now();
        self.record(|slots| {
            let Some(in_flight) = &mut slots[slot] else { return };
            match taken {
                Ok(step) => in_flight.episode.trace.push(step),
                Err(problem) => in_flight.fail(&problem),
            }
            if let Some(limit) = limit.filter(|&limit| goes_on && now.saturating_sub(in_flight.began) >= limit) {
                in_flight.fail(&format!("timed out: it took longer than {} s", limit.as_secs_f64()));
            }
        })
    }

    fn fail_all(&mut self, problem: &str) -> Result<(), Abandoned> {
        self.record(|slots| slots.iter_mut().flatten().for_each(|in_flight| in_flight.fail(problem)))
    }
}

/// The environment of a task, where it begins.
///
/// # Errors
/// When another process does not serve it.
pub(super) fn environment_of(
    evaluation: &EvaluationPlan,
    sessions: &mut Sessions,
    slot: usize,
    task: &Task,
) -> anyhow::Result<Box<dyn Environment>> {
    if let Some((name, seed)) = task.remote_episode() {
        return Ok(Box::new(RemoteEnvironment::begin(sessions.get(slot, name)?, seed)?));
    }
    let setting = evaluation.scenes.setting(task)?;
    let house = House::new(setting.scene, setting.world);
    Ok(Box::new(HouseEnvironment::of_task(task, house, evaluation.options.grading)))
}

/// Sets an episode to its start.
fn start(
    executor: &Executor,
    sessions: &mut Sessions,
    slot: usize,
    spec: EpisodeSpec,
    episode: &mut Episode,
) -> anyhow::Result<AnyRollout> {
    let evaluation = &executor.evaluation;
    let task = &evaluation.tasks[spec.task];
    let env = environment_of(evaluation, sessions, slot, task)?;
    episode.start_hash = env.fingerprint().unwrap_or_default();
    if task.env.is_some() {
        episode.of = env.grading().map_or(0, |(_, of)| of as u32);
        if let (true, Some(view)) = (task.instruction.is_empty(), env.own()) {
            episode.instruction = view.mission();
        }
    }
    let mut rollout = Rollout::new(env, episode.instruction.clone(), Some(task.horizon));
    rollout.ended_by = evaluation.options.end;
    if spec.start_subtask > 0 {
        lead(&mut rollout, spec.start_subtask, episode)?;
        rollout.horizon = Some(episode.prefix_steps + task.horizon);
    }
    Ok(rollout)
}

/// Whether everything that is asked holds in the present state.
fn holds(rollout: &mut AnyRollout) -> bool {
    let graded = rollout.env.grading().is_some_and(|(completed, of)| completed == of);
    let house = rollout.env.house();
    let held = house.and_then(|access| Some(access.grader?.still_holds(access.house.world())));
    // What an environment does not show, its grader's word stands for.
    held.unwrap_or(graded)
}

/// Lets the expert act until `from` subtasks are done.
fn lead(rollout: &mut AnyRollout, from: u32, episode: &mut Episode) -> anyhow::Result<()> {
    let mut expert = ExpertPolicy::new();
    expert.reset(0, 0);
    let reached = |rollout: &AnyRollout| rollout.env.grading().is_none_or(|(completed, _)| completed >= from as usize);
    let mut record = AfterEach(|rollout: &mut AnyRollout, tick: &_| {
        episode.trace.push(TraceStep::of(tick, rollout));
        episode.prefix_steps += 1;
        Ok(if reached(rollout) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    });
    rollout.run(&mut expert, &mut record).with_context(|| format!("the expert could not lead to subtask {from}"))?;
    anyhow::ensure!(
        reached(rollout),
        "the expert did not come to subtask {from} within the task's {}",
        counted(rollout.steps(), "step")
    );
    Ok(())
}

#[cfg(test)]
mod tests;
