//! Plays episodes on several threads, each with a team that acts in several at once.
//!
//! An episode's seat follows from its place in the run alone, and a team decides in one seat whatever happens in the others:
//! so the record of an episode does not depend on the number of threads or on what is played beside it.

use std::collections::{BTreeMap, VecDeque};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Sender};
use std::time::Instant;

use anyhow::Context;

use super::episode::{Episode, Key, Step};
use super::evaluate::{Evaluation, policy_seed};
use super::failure;
use super::rollout::Rollout;
use super::wording::{self, Wording};
use crate::agent::{Decision, ExpertPolicy, Policy, Situation, Team};
use crate::domain::Task;
use crate::house::House;
use crate::house::grading::Grader;

/// Makes a team; every thread calls it for one of its own.
pub type MakeTeam<'a> = dyn Fn() -> anyhow::Result<Box<dyn Team>> + Sync + 'a;

/// An episode that is to be played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Booking {
    /// Its place in the run, from 0.
    pub place: usize,
    /// The task's position in the set.
    pub task: usize,
    /// Which seed.
    pub seed: u64,
    /// Whose words.
    pub wording: Wording,
    /// From which subtask.
    pub from: u32,
    /// How often it was begun before.
    pub attempts: u32,
}

impl Booking {
    /// What tells it apart from the other episodes of the run.
    pub fn key(&self, tasks: &[Task]) -> Key {
        Key { task: tasks[self.task].id.clone(), seed: self.seed, wording: self.wording, from: self.from }
    }
}

/// Plays bookings of an evaluation.
pub(super) struct Player<'a> {
    pub evaluation: &'a Evaluation,
    pub make_team: &'a MakeTeam<'a>,
    /// Set from outside: what is under way is dropped.
    pub stop: &'a AtomicBool,
}

/// An episode under way.
struct Seated {
    /// Its position among what is wanted.
    at: usize,
    booking: Booking,
    began: Instant,
    episode: Episode,
    rollout: Option<Rollout>,
}

/// What is wanted, by seat.
struct Queues<'a> {
    by_seat: Vec<Vec<(usize, Booking)>>,
    next: Vec<AtomicUsize>,
    give_up: &'a AtomicBool,
}

impl Queues<'_> {
    fn next(&self, seat: usize) -> Option<(usize, Booking)> {
        let at = self.next[seat].fetch_add(1, Ordering::Relaxed);
        self.by_seat[seat].get(at).copied()
    }
}

/// One thread's table.
struct Table<'a> {
    player: &'a Player<'a>,
    team: Option<Box<dyn Team>>,
    seats: Vec<Option<Seated>>,
    /// Episodes that a failure of the whole team ended: each is played again with nobody beside it, which shows whose the
    /// failure was.
    alone: VecDeque<(usize, Booking)>,
}

impl Player<'_> {
    /// Plays what is wanted; `sink` takes each episode, in that order.
    pub fn play(&self, wanted: &[Booking], sink: &mut dyn FnMut(Episode) -> anyhow::Result<()>) -> anyhow::Result<()> {
        let Some(jobs) = Some(self.evaluation.options.jobs.min(wanted.len())).filter(|&jobs| jobs > 0) else {
            return Ok(());
        };
        let first = (self.make_team)()?;
        let seats = first.seats().max(1);
        // No more tables than can be filled.
        let tables = jobs.min(wanted.len().div_ceil(seats)).max(if seats == 1 { jobs } else { 1 });
        let others = (1..tables).map(|_| (self.make_team)());
        let teams = std::iter::once(Ok(first)).chain(others).collect::<anyhow::Result<Vec<_>>>()?;
        let give_up = AtomicBool::new(false);
        let mut by_seat = vec![Vec::new(); seats];
        for (at, booking) in wanted.iter().enumerate() {
            by_seat[booking.place % seats].push((at, *booking));
        }
        let queues = Queues { by_seat, next: (0..seats).map(|_| AtomicUsize::new(0)).collect(), give_up: &give_up };
        let (sender, receiver) = mpsc::channel::<(usize, Episode)>();
        std::thread::scope(|scope| {
            for team in teams {
                let (sender, queues) = (sender.clone(), &queues);
                let seats = (0..seats).map(|_| None).collect();
                scope.spawn(move || {
                    let mut table = Table { player: self, team: Some(team), seats, alone: VecDeque::new() };
                    table.serve(queues, &sender);
                });
            }
            drop(sender);
            // Episodes come as they end and leave in their order: what is written is the same for any number of threads.
            let mut waiting = BTreeMap::new();
            let mut place = 0;
            for (at, episode) in receiver {
                waiting.insert(at, episode);
                while let Some(episode) = waiting.remove(&place) {
                    sink(episode).inspect_err(|_| give_up.store(true, Ordering::Relaxed))?;
                    place += 1;
                }
            }
            Ok(())
        })
    }

    /// Sets an episode to its start; an error is recorded in it.
    fn seat(&self, at: usize, booking: Booking) -> Seated {
        let evaluation = self.evaluation;
        let task = &evaluation.tasks[booking.task];
        let chance = policy_seed(booking.task, booking.seed);
        let said =
            wording::say(&evaluation.tasks, booking.task, booking.wording, evaluation.options.step_by_step, chance);
        let episode = Episode {
            task: task.id.clone(),
            seed: booking.seed,
            wording: booking.wording,
            from: booking.from,
            instruction: said,
            of: (task.subtasks.len() as u32).saturating_sub(booking.from),
            attempts: booking.attempts + 1,
            ..Episode::default()
        };
        let mut seated = Seated { at, booking, began: Instant::now(), episode, rollout: None };
        seated.episode.error = guarded(|| self.begin(task, &mut seated)).err();
        seated
    }

    fn begin(&self, task: &Task, seated: &mut Seated) -> anyhow::Result<()> {
        let setting = self.evaluation.scenes.setting(task)?;
        seated.episode.start_hash = setting.world.digest();
        let grader = Grader::new(self.evaluation.options.grading, &task.roles, &task.subtasks, task.goal.as_ref());
        let house = House::new(setting.scene, setting.world);
        let mut rollout = Rollout::new(house, seated.episode.instruction.clone(), Some(grader), Some(task.horizon));
        if seated.booking.from > 0 {
            lead(&mut rollout, seated.booking.from, &mut seated.episode)?;
            rollout.horizon = Some(seated.episode.prefix + task.horizon);
        }
        seated.rollout = Some(rollout);
        Ok(())
    }

    /// Fills in what an episode came to.
    fn close(&self, mut seated: Seated) -> Episode {
        let episode = &mut seated.episode;
        let own = &episode.trace[(episode.prefix as usize).min(episode.trace.len())..];
        episode.steps = own.len() as u32;
        episode.completed = own.iter().filter(|step| step.subtask.is_some()).count() as u32;
        episode.success = episode.error.is_none() && episode.completed == episode.of;
        if !episode.success && episode.error.is_none() {
            let task = &self.evaluation.tasks[seated.booking.task];
            let setting = self.evaluation.scenes.setting(task);
            let trace = &episode.trace;
            let class = guarded(|| Ok(failure::classify(task, self.evaluation.options.grading, &setting?, trace)));
            episode.failure = class.ok();
        }
        seated.episode
    }
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

impl Table<'_> {
    /// Plays what the queues hold until they are empty.
    fn serve(&mut self, queues: &Queues<'_>, sender: &Sender<(usize, Episode)>) {
        loop {
            if self.player.stop.load(Ordering::Relaxed) || queues.give_up.load(Ordering::Relaxed) {
                return;
            }
            self.fill(queues);
            let over = self.over();
            if over.is_empty() {
                if self.seats.iter().all(Option::is_none) {
                    return;
                }
                self.step();
            }
            for seat in over {
                let Some(seated) = self.seats[seat].take() else { continue };
                let retries = self.player.evaluation.options.retries;
                if seated.episode.error.is_some() && seated.episode.attempts <= retries {
                    let again = Booking { attempts: seated.episode.attempts, ..seated.booking };
                    self.sit(seat, seated.at, again);
                } else if sender.send((seated.at, self.player.close(seated))).is_err() {
                    return;
                }
            }
        }
    }

    /// Seats whose episode is over.
    fn over(&self) -> Vec<usize> {
        let is_over = |seated: &Seated| {
            seated.episode.error.is_some() || seated.rollout.as_ref().is_none_or(|rollout| rollout.end().is_some())
        };
        (0..self.seats.len()).filter(|&seat| self.seats[seat].as_ref().is_some_and(is_over)).collect()
    }

    fn fill(&mut self, queues: &Queues<'_>) {
        if let Some((at, booking)) = self.alone.front().copied() {
            if self.seats.iter().all(Option::is_none) {
                self.alone.pop_front();
                self.sit(booking.place % self.seats.len(), at, booking);
            }
            return;
        }
        for seat in 0..self.seats.len() {
            if self.seats[seat].is_none()
                && let Some((at, booking)) = queues.next(seat)
            {
                self.sit(seat, at, booking);
            }
        }
    }

    fn sit(&mut self, seat: usize, at: usize, booking: Booking) {
        let mut seated = self.player.seat(at, booking);
        let ready = guarded(|| {
            self.team()?.begin(seat, policy_seed(booking.task, booking.seed));
            Ok(())
        });
        seated.episode.error = seated.episode.error.or(ready.err());
        self.seats[seat] = Some(seated);
    }

    /// The team; made again where a panic left the last one in an unknown state.
    fn team(&mut self) -> anyhow::Result<&mut dyn Team> {
        let team = match self.team.take() {
            Some(team) => team,
            None => (self.player.make_team)().context("the policy could not be made again")?,
        };
        Ok(&mut **self.team.insert(team))
    }

    /// One decision and one step in every seat.
    fn step(&mut self) {
        let mut team = match self.team() {
            Ok(_) => self.team.take(),
            Err(error) => return self.fail_all(&format!("{error:#}")),
        };
        let seats = &mut self.seats;
        let decided = guarded(|| {
            let mut situations: Vec<_> = seats.iter_mut().map(Seated::situation).collect();
            team.as_mut().context("there is no policy")?.decide(&mut situations)
        });
        match decided {
            Ok(decisions) => {
                self.team = team;
                for (seat, decision) in decisions.into_iter().enumerate() {
                    if let (Some(seated), Some(decision)) = (self.seats[seat].as_mut(), decision) {
                        seated.take(decision, self.player.evaluation);
                    }
                }
            }
            // Whatever state a failure left the team in is not carried on.
            Err(problem) if self.seats.iter().flatten().count() == 1 => self.fail_all(&problem),
            Err(_) => {
                let begun = self.seats.iter_mut().filter_map(Option::take);
                self.alone.extend(begun.map(|seated| (seated.at, seated.booking)));
            }
        }
    }

    fn fail_all(&mut self, problem: &str) {
        for seated in self.seats.iter_mut().flatten() {
            seated.episode.error = Some(problem.to_owned());
        }
    }
}

impl Seated {
    fn situation(seat: &mut Option<Seated>) -> Option<Situation<'_>> {
        Some(seat.as_mut()?.rollout.as_mut()?.situation())
    }

    fn take(&mut self, decision: anyhow::Result<Decision>, evaluation: &Evaluation) {
        let Some(rollout) = self.rollout.as_mut() else { return };
        let trace = &mut self.episode.trace;
        let taken = guarded(|| {
            let tick = rollout.carry_out(decision?);
            trace.push(Step::of(&tick, rollout));
            Ok(())
        });
        self.episode.error = taken.err();
        let limit = evaluation.options.timeout.filter(|&limit| self.began.elapsed() >= limit);
        if let (Some(limit), None, None) = (limit, &self.episode.error, rollout.end()) {
            self.episode.error = Some(format!("timed out: it took longer than {} s", limit.as_secs_f64()));
        }
    }
}

/// Runs something; what went wrong, a panic included, in words.
fn guarded<T>(run: impl FnOnce() -> anyhow::Result<T>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(format!("{error:#}")),
        Err(panic) => {
            let text = panic.downcast_ref::<&str>().copied();
            let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
            Err(format!("panicked: {}", text.unwrap_or("without a message")))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::time::Duration;

    use super::*;
    use crate::agent::team::Decisions;
    use crate::run::evaluate::Options;
    use crate::run::evaluate::tests::{Ran, Walker, options, run};

    /// Walkers at one table. The whole table panics, or fails, when somebody at it is told `trouble`.
    struct Walkers {
        seats: Vec<Walker>,
        trouble: &'static str,
        panics: bool,
    }

    impl Team for Walkers {
        fn name(&self) -> &str {
            "walkers"
        }

        fn seats(&self) -> usize {
            self.seats.len()
        }

        fn begin(&mut self, seat: usize, seed: u64) {
            self.seats[seat].begin(seed);
        }

        fn decide(&mut self, situations: &mut [Option<Situation<'_>>]) -> anyhow::Result<Decisions> {
            let troubled =
                situations.iter().flatten().any(|here| here.instruction.contains(self.trouble) && here.step == 3);
            assert!(!(troubled && self.panics), "the table broke");
            anyhow::ensure!(!troubled, "the table broke");
            let pairs = situations.iter_mut().zip(&mut self.seats);
            Ok(pairs.map(|(here, walker)| here.as_mut().map(|here| walker.decide(here))).collect())
        }
    }

    fn walkers(seats: usize, trouble: &'static str, panics: bool) -> anyhow::Result<Box<dyn Team>> {
        let seats = (0..seats).map(|_| Walker::new(false, false)).collect();
        Ok(Box::new(Walkers { seats, trouble, panics }))
    }

    fn played(options: Options, make: &MakeTeam<'_>) -> Ran {
        let folder = tempfile::tempdir().unwrap();
        run(folder.path(), options, make, usize::MAX).unwrap()
    }

    #[test]
    fn the_result_does_not_depend_on_seats_and_threads() {
        let alone = played(options(), &|| walkers(1, "nobody", false));
        for (seats, jobs) in [(1, 3), (4, 1), (4, 2), (16, 3)] {
            let ran = played(Options { jobs, ..options() }, &|| walkers(seats, "nobody", false));
            assert_eq!(ran.lines, alone.lines, "{seats} seats, {jobs} threads");
        }
    }

    #[test]
    fn what_breaks_a_whole_table_is_recorded_where_it_belongs_and_nowhere_else() {
        let sound = played(options(), &|| walkers(4, "nobody", false));
        let (trouble, _) = sound.lines.split_once("\"instruction\":\"Take the ").unwrap().1.split_once('.').unwrap();
        let trouble: &'static str = trouble.to_owned().leak();
        for panics in [false, true] {
            let ran = played(Options { jobs: 2, ..options() }, &|| walkers(4, trouble, panics));
            for (line, before) in ran.lines.lines().zip(sound.lines.lines()) {
                match before.contains(&format!("Take the {trouble}.")) && before.matches("\"do\"").count() > 3 {
                    true => assert!(line.contains("the table broke"), "{line}"),
                    false => assert_eq!(line, before),
                }
            }
            assert!(ran.summary.errors > 0 && ran.summary.errors < 12);
            assert_eq!(ran.summary.errored.len(), ran.summary.errors);
        }
    }

    #[test]
    fn an_error_is_tried_again_as_often_as_asked_and_what_came_of_it_is_recorded() {
        /// Fails the first few times, whoever it is.
        struct Moody(Walker, &'static Mutex<u32>);
        impl Policy for Moody {
            fn name(&self) -> &str {
                "moody"
            }
            fn begin(&mut self, seed: u64) {
                self.0.begin(seed);
            }
            fn decide(&mut self, situation: &mut Situation<'_>) -> anyhow::Result<Decision> {
                let mut left = self.1.lock().unwrap();
                if *left > 0 {
                    *left -= 1;
                    anyhow::bail!("in a mood");
                }
                drop(left);
                self.0.decide(situation)
            }
        }
        let sound = played(options(), &|| walkers(1, "nobody", false));
        let counter: &'static Mutex<u32> = Box::leak(Box::new(Mutex::new(3)));
        let moody = || -> anyhow::Result<Box<dyn Team>> {
            Ok(Box::new(crate::agent::Solo(Box::new(Moody(Walker::new(false, false), counter)))))
        };
        let folder = tempfile::tempdir().unwrap();
        let first = run(folder.path(), Options { retries: 1, ..options() }, &moody, usize::MAX).unwrap();
        assert_eq!(first.summary.errors, 1, "two attempts of the first episode failed, then one of the second");
        assert!(first.lines.contains("in a mood") && first.lines.contains("\"attempts\":2"));
        let again = run(folder.path(), Options { retries: 2, ..options() }, &moody, usize::MAX).unwrap();
        assert_eq!(again.summary.errors, 0);
        assert_eq!(again.lines.lines().count(), 13, "the failed record stays where it is");
        assert_eq!(again.summary.success, sound.summary.success);
        let untouched = run(folder.path(), Options { retries: 9, ..options() }, &moody, usize::MAX).unwrap();
        assert_eq!(untouched.lines, again.lines);
    }

    #[test]
    fn an_episode_that_takes_too_long_is_an_error_and_is_counted() {
        let options = Options { timeout: Some(Duration::ZERO), ..options() };
        let ran = played(options, &|| walkers(4, "nobody", false));
        assert_eq!((ran.summary.episodes, ran.summary.errors), (12, 12));
        assert!(ran.lines.contains("\"error\":\"timed out"));
    }

    #[test]
    fn a_team_that_cannot_be_made_again_is_an_error_of_its_episodes() {
        let made = AtomicUsize::new(0);
        let make = || match made.fetch_add(1, Ordering::Relaxed) {
            0 => walkers(1, "Take", true),
            _ => anyhow::bail!("the checkpoint is gone"),
        };
        let ran = played(options(), &make);
        assert_eq!((ran.summary.episodes, ran.summary.errors), (12, 12));
        assert!(ran.lines.contains("could not be made again: the checkpoint is gone"), "{}", ran.lines);
    }
}
