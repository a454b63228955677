//! One thread of an evaluation: a table at which a team acts in several episodes at once.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use anyhow::Context;

use super::executor::{Executor, Note};
use super::in_flight::{InFlight, Watchdog, guarded};
use crate::agent::{Decision, ExpertPolicy, Policy, Team};
use crate::episode::record::{Episode, Step};
use crate::episode::rollout::Rollout;
use crate::house::House;
use crate::house::grading::Grader;
use crate::run_dir::episode_spec::{EpisodeSpec, policy_seed};

/// A table. Episodes sit at it; what is recorded of them stands in the watch.
pub(crate) struct Worker {
    play: Arc<Executor>,
    watch: Arc<Watchdog>,
    team: Option<Box<dyn Team>>,
    rollouts: Vec<Option<Rollout>>,
    /// Who sits here is to be played with nobody beside it.
    is_alone: bool,
}

/// Nobody waits for this table any more.
struct Left;

impl Worker {
    pub fn new(play: Arc<Executor>, watch: Arc<Watchdog>, team: Option<Box<dyn Team>>) -> Worker {
        let seats = watch.lock().seats.len();
        Worker { play, watch, team, rollouts: (0..seats).map(|_| None).collect(), is_alone: false }
    }

    /// Plays what is wanted until there is nothing left, or nobody waits for it any more.
    pub fn serve(&mut self) {
        while let Ok(true) = self.round() {}
    }

    /// Whether there is more to play.
    fn round(&mut self) -> Result<bool, Left> {
        if self.play.stop.load(Ordering::Relaxed) || self.play.give_up.load(Ordering::Relaxed) {
            return Ok(false);
        }
        self.fill()?;
        let over = self.over()?;
        if over.is_empty() {
            if self.empty()? {
                return Ok(false);
            }
            self.step()?;
        }
        for seat in over {
            let Some(in_flight) = self.record(|seats| seats[seat].clone())? else { continue };
            if let Some(again) = in_flight.again(&self.play.evaluation) {
                self.sit(seat, in_flight.at, again)?;
                continue;
            }
            // Why it fell short is found while it still sits, so that somebody waits for that too.
            let at = in_flight.at;
            let evaluation = &self.play.evaluation;
            let episode = in_flight.close(evaluation);
            self.rollouts[seat] = None;
            if self.record(|seats| seats[seat].take())?.is_some() && !self.play.tell(Note::Over(at, episode)) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Reads or writes what is recorded, unless nobody waits for it any more.
    fn record<T>(&self, change: impl FnOnce(&mut Vec<Option<InFlight>>) -> T) -> Result<T, Left> {
        let mut state = self.watch.lock();
        if state.is_left { Err(Left) } else { Ok(change(&mut state.seats)) }
    }

    fn empty(&self) -> Result<bool, Left> {
        self.record(|seats| seats.iter().all(Option::is_none))
    }

    /// Seats whose episode is over.
    fn over(&self) -> Result<Vec<usize>, Left> {
        let ended = |seat: usize| self.rollouts[seat].as_ref().is_none_or(|rollout| rollout.end().is_some());
        self.record(|seats| {
            let is_over = |seat: &usize| {
                seats[*seat].as_ref().is_some_and(|in_flight| in_flight.episode.error.is_some() || ended(*seat))
            };
            (0..seats.len()).filter(is_over).collect()
        })
    }

    fn fill(&mut self) -> Result<(), Left> {
        let seats = self.rollouts.len();
        let is_empty = self.empty()?;
        self.is_alone &= !is_empty;
        if self.is_alone || (self.play.queues.someone_waits_alone() && !is_empty) {
            return Ok(());
        }
        if let Some((at, spec)) = self.play.queues.next_alone() {
            self.is_alone = true;
            return self.sit(spec.place % seats, at, spec);
        }
        for seat in 0..seats {
            if self.record(|seats| seats[seat].is_none())?
                && let Some((at, spec)) = self.play.queues.next(seat)
            {
                self.sit(seat, at, spec)?;
            }
        }
        Ok(())
    }

    /// Sets an episode to its start; an error is recorded in it.
    fn sit(&mut self, seat: usize, at: usize, spec: EpisodeSpec) -> Result<(), Left> {
        let play = self.play.clone();
        let in_flight = InFlight::new(&play.evaluation, at, spec);
        let mut episode = in_flight.episode.clone();
        self.record(|seats| seats[seat] = Some(in_flight))?;
        self.rollouts[seat] = None;
        let ready = guarded(|| {
            self.rollouts[seat] = Some(begin(&play, spec, &mut episode)?);
            self.team()?.begin(seat, policy_seed(spec.task, spec.seed));
            Ok(())
        });
        episode.error = ready.err();
        self.record(|seats| {
            if let Some(in_flight) = &mut seats[seat] {
                in_flight.episode = episode;
            }
        })
    }

    /// The team; made again where a panic left the last one in an unknown state.
    fn team(&mut self) -> anyhow::Result<&mut dyn Team> {
        let team = match self.team.take() {
            Some(team) => team,
            None => (self.play.make_team)().context("the policy could not be made again")?,
        };
        Ok(&mut **self.team.insert(team))
    }

    /// One decision and one step in every seat.
    fn step(&mut self) -> Result<(), Left> {
        let mut team = match self.team() {
            Ok(_) => self.team.take(),
            Err(error) => return self.fail_all(&format!("{error:#}")),
        };
        let rollouts = &mut self.rollouts;
        let decided = guarded(|| {
            let mut situations: Vec<_> =
                rollouts.iter_mut().map(|rollout| rollout.as_mut().map(Rollout::situation)).collect();
            team.as_mut().context("there is no policy")?.decide(&mut situations)
        });
        match decided {
            Ok(decisions) => {
                self.team = team;
                for (seat, decision) in decisions.into_iter().enumerate() {
                    if let Some(decision) = decision {
                        self.take(seat, decision)?;
                    }
                }
                Ok(())
            }
            // Whatever state a failure left the team in is not carried on.
            Err(problem) if self.rollouts.iter().flatten().count() == 1 => self.fail_all(&problem),
            Err(_) => {
                let begun: Vec<InFlight> = self.record(|seats| seats.iter_mut().filter_map(Option::take).collect())?;
                self.rollouts.iter_mut().for_each(|rollout| *rollout = None);
                self.play.queues.play_alone(begun.iter().map(|in_flight| (in_flight.at, in_flight.spec)));
                Ok(())
            }
        }
    }

    /// Carries out what was decided in a seat.
    fn take(&mut self, seat: usize, decision: anyhow::Result<Decision>) -> Result<(), Left> {
        let Some(rollout) = self.rollouts[seat].as_mut() else { return Ok(()) };
        let taken = guarded(|| {
            let tick = rollout.carry_out(decision?);
            Ok(Step::of(&tick, rollout))
        });
        let (limit, goes_on) = (self.play.evaluation.options.timeout, rollout.end().is_none());
        self.record(|seats| {
            let Some(in_flight) = &mut seats[seat] else { return };
            match taken {
                Ok(step) => in_flight.episode.trace.push(step),
                Err(problem) => in_flight.fail(&problem),
            }
            if let Some(limit) = limit.filter(|&limit| goes_on && in_flight.began.elapsed() >= limit) {
                in_flight.fail(&format!("timed out: it took longer than {} s", limit.as_secs_f64()));
            }
        })
    }

    fn fail_all(&mut self, problem: &str) -> Result<(), Left> {
        self.record(|seats| seats.iter_mut().flatten().for_each(|in_flight| in_flight.fail(problem)))
    }
}

/// Sets an episode to its start.
fn begin(play: &Executor, spec: EpisodeSpec, episode: &mut Episode) -> anyhow::Result<Rollout> {
    let task = &play.evaluation.tasks[spec.task];
    let setting = play.evaluation.scenes.setting(task)?;
    episode.start_hash = setting.world.digest();
    let grader = Grader::new(play.evaluation.options.grading, &task.roles, &task.subtasks, task.goal.as_ref());
    let house = House::new(setting.scene, setting.world);
    let mut rollout = Rollout::new(house, episode.instruction.clone(), Some(grader), Some(task.horizon));
    if spec.from > 0 {
        lead(&mut rollout, spec.from, episode)?;
        rollout.horizon = Some(episode.prefix + task.horizon);
    }
    Ok(rollout)
}

/// Lets the expert act until `from` subtasks are done.
fn lead(rollout: &mut Rollout, from: u32, episode: &mut Episode) -> anyhow::Result<()> {
    let mut expert = ExpertPolicy::new();
    expert.begin(0);
    while rollout.grader.as_ref().is_some_and(|grader| grader.completed() < from as usize) {
        anyhow::ensure!(
            rollout.end().is_none(),
            "the expert did not come to subtask {from} within the task's {} steps",
            rollout.steps()
        );
        let tick = rollout.step(&mut expert).with_context(|| format!("the expert could not lead to subtask {from}"))?;
        episode.trace.push(Step::of(&tick, rollout));
        episode.prefix += 1;
    }
    Ok(())
}
