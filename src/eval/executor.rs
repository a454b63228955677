//! Plays episodes on several threads, each a table at which a team acts in several at once.
//!
//! An episode's seat follows from its place in the run alone, and a team decides in one seat whatever happens in the others:
//! so the record of an episode does not depend on the number of threads or on what is played beside it. A thread cannot be
//! ended from outside: a table that hangs within a step is left behind, what it was playing is recorded or played elsewhere,
//! and a new table takes its place.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};

use super::evaluation::Evaluation;
use super::in_flight::Watchdog;
use super::work_queue::WorkQueue;
use super::worker::Worker;
use crate::agent::Team;
use crate::episode::record::Episode;
use crate::run_dir::episode_spec::EpisodeSpec;

/// Makes a team; every table has one of its own.
pub type MakeTeam = dyn Fn() -> anyhow::Result<Box<dyn Team>> + Send + Sync;

/// How often the tables are looked at.
const GLANCE: Duration = Duration::from_millis(100);
/// How long a table that was asked to stop may take to finish its step before it is left behind.
const PATIENCE: Duration = Duration::from_secs(3);

/// What all tables share.
pub(crate) struct Executor {
    pub evaluation: Evaluation,
    pub make_team: Arc<MakeTeam>,
    /// Set from outside: what is under way is dropped.
    pub stop: Arc<AtomicBool>,
    /// Set when nobody takes the episodes any more.
    pub give_up: AtomicBool,
    pub queues: WorkQueue,
    teller: Mutex<Sender<Note>>,
}

/// What a table tells.
pub(crate) enum Note {
    /// An episode is over; its position among what is wanted.
    Over(usize, Episode),
    /// The table of that number is done.
    Done(usize),
}

impl Executor {
    /// Tells the thread that waits; false when nobody waits any more.
    pub fn tell(&self, note: Note) -> bool {
        self.teller.lock().unwrap_or_else(PoisonError::into_inner).send(note).is_ok()
    }
}

/// The tables of a play, and what is waited for.
struct WorkerPool {
    play: Arc<Executor>,
    seats: usize,
    receiver: Receiver<Note>,
    /// By their numbers; nothing where a table is done or was left behind.
    tables: Vec<Option<(Arc<Watchdog>, JoinHandle<()>)>>,
}

/// Plays what is wanted; `sink` takes each episode, in that order.
pub(crate) fn play(
    evaluation: &Evaluation,
    wanted: &[EpisodeSpec],
    make_team: &Arc<MakeTeam>,
    stop: &Arc<AtomicBool>,
    sink: &mut dyn FnMut(Episode) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let Some(jobs) = Some(evaluation.options.jobs.min(wanted.len())).filter(|&jobs| jobs > 0) else {
        return Ok(());
    };
    let first = make_team()?;
    let seats = first.seats().max(1);
    // No more tables than can be filled.
    let count = jobs.min(wanted.len().div_ceil(seats)).max(if seats == 1 { jobs } else { 1 });
    let others = (1..count).map(|_| make_team());
    let teams = std::iter::once(Ok(first)).chain(others).collect::<anyhow::Result<Vec<_>>>()?;
    let (sender, receiver) = mpsc::channel();
    let play = Arc::new(Executor {
        evaluation: evaluation.clone(),
        make_team: make_team.clone(),
        stop: stop.clone(),
        give_up: AtomicBool::new(false),
        queues: WorkQueue::new(wanted, seats),
        teller: Mutex::new(sender),
    });
    let mut tables = WorkerPool { play: play.clone(), seats, receiver, tables: Vec::new() };
    for team in teams {
        tables.open(Some(team))?;
    }
    let played = tables.wait(wanted.len(), sink);
    play.give_up.store(true, Ordering::Relaxed);
    // A run that was stopped waited for its tables already.
    if !stop.load(Ordering::Relaxed) {
        tables.close();
    }
    let whole = played?;
    ensure!(
        whole || stop.load(Ordering::Relaxed),
        "a thread ended before its episodes did; the same command continues"
    );
    Ok(())
}

impl WorkerPool {
    /// Opens a table; without a team it makes one.
    fn open(&mut self, team: Option<Box<dyn Team>>) -> anyhow::Result<()> {
        let (watch, number) = (Arc::new(Watchdog::new(self.seats)), self.tables.len());
        let (play, watched) = (self.play.clone(), watch.clone());
        let serve = move || {
            // Dropped last, after a panic too.
            let _done = Done { play: play.clone(), number };
            Worker::new(play, watched, team).serve();
        };
        let thread = std::thread::Builder::new().name(format!("table {number}")).spawn(serve);
        self.tables.push(Some((watch, thread.context("a thread could not be started")?)));
        Ok(())
    }

    /// Takes episodes as they end, and hands them on in their order: what is written is the same for any number of tables.
    /// Whether all have come.
    fn wait(&mut self, wanted: usize, sink: &mut dyn FnMut(Episode) -> anyhow::Result<()>) -> anyhow::Result<bool> {
        let mut early = BTreeMap::new();
        let mut place = 0;
        let mut stopping: Option<Instant> = None;
        while self.tables.iter().any(Option::is_some) {
            match self.receiver.recv_timeout(GLANCE) {
                Ok(Note::Over(at, episode)) => drop(early.insert(at, episode)),
                Ok(Note::Done(number)) => self.join(number),
                Err(RecvTimeoutError::Timeout) => early.extend(self.leave_hanging()?),
                Err(RecvTimeoutError::Disconnected) => break,
            }
            while let Some(episode) = early.remove(&place) {
                sink(episode)?;
                place += 1;
            }
            if self.play.stop.load(Ordering::Relaxed) && stopping.get_or_insert_with(Instant::now).elapsed() >= PATIENCE
            {
                break;
            }
        }
        Ok(place == wanted)
    }

    /// Leaves tables behind that hang within a step, and opens others in their places. What a table played by itself is over.
    fn leave_hanging(&mut self) -> anyhow::Result<Vec<(usize, Episode)>> {
        let Some(limit) = self.play.evaluation.options.timeout else { return Ok(Vec::new()) };
        let mut over = Vec::new();
        for number in 0..self.tables.len() {
            let Some((watch, _)) = &self.tables[number] else { continue };
            let Some(mut left) = watch.leave_if_hanging(limit) else { continue };
            self.tables[number] = None;
            if let [only] = &mut left[..] {
                only.fail(&format!("timed out: a step went on after the {} s of the episode", limit.as_secs_f64()));
                match only.again(&self.play.evaluation) {
                    Some(again) => self.play.queues.play_alone(std::iter::once((only.at, again))),
                    None => over.push((only.at, only.clone().close(&self.play.evaluation))),
                }
            } else {
                self.play.queues.play_alone(left.iter().map(|in_flight| (in_flight.at, in_flight.spec)));
            }
            self.open(None)?;
        }
        Ok(over)
    }

    /// Takes leave of a table that is done.
    fn join(&mut self, number: usize) {
        if let Some((_, thread)) = self.tables.get_mut(number).and_then(Option::take) {
            // That it panicked shows in what is missing.
            let _ = thread.join();
        }
    }

    /// Waits for the tables to finish their steps; those that hang are left behind.
    fn close(&mut self) {
        let asked = Instant::now();
        while self.tables.iter().any(Option::is_some) && asked.elapsed() < PATIENCE {
            if let Ok(Note::Done(number)) = self.receiver.recv_timeout(GLANCE) {
                self.join(number);
            }
        }
    }
}

/// Says that a table is done.
struct Done {
    play: Arc<Executor>,
    number: usize,
}

impl Drop for Done {
    fn drop(&mut self) {
        // Where nobody listens any more, nobody waits.
        self.play.tell(Note::Done(self.number));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use super::*;
    use crate::agent::team::Decisions;
    use crate::agent::{Decision, Observation, Policy, Solo};
    use crate::domain::{Action, ActionType};
    use crate::eval::evaluation::tests::{Ran, Walker, options, run};
    use crate::eval::options::Options;

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

        fn decide(&mut self, situations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
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

    fn played(options: Options, make: impl Fn() -> anyhow::Result<Box<dyn Team>> + Send + Sync + 'static) -> Ran {
        let folder = tempfile::tempdir().unwrap();
        run(folder.path(), options, make, usize::MAX).unwrap()
    }

    #[test]
    fn the_result_does_not_depend_on_seats_and_threads() {
        let alone = played(options(), || walkers(1, "nobody", false));
        for (seats, jobs) in [(1, 3), (4, 1), (4, 2), (16, 3)] {
            let ran = played(Options { jobs, ..options() }, move || walkers(seats, "nobody", false));
            assert_eq!(ran.lines, alone.lines, "{seats} seats, {jobs} threads");
        }
    }

    #[test]
    fn what_breaks_a_whole_table_is_recorded_where_it_belongs_and_nowhere_else() {
        let sound = played(options(), move || walkers(4, "nobody", false));
        let (trouble, _) = sound.lines.split_once("\"instruction\":\"Take the ").unwrap().1.split_once('.').unwrap();
        let trouble: &'static str = trouble.to_owned().leak();
        for panics in [false, true] {
            let ran = played(Options { jobs: 2, ..options() }, move || walkers(4, trouble, panics));
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
            fn decide(&mut self, situation: &mut Observation<'_>) -> anyhow::Result<Decision> {
                let mut left = self.1.lock().unwrap();
                if *left > 0 {
                    *left -= 1;
                    anyhow::bail!("in a mood");
                }
                drop(left);
                self.0.decide(situation)
            }
        }
        let sound = played(options(), || walkers(1, "nobody", false));
        let counter: &'static Mutex<u32> = Box::leak(Box::new(Mutex::new(3)));
        let moody = move || -> anyhow::Result<Box<dyn Team>> {
            Ok(Box::new(Solo(Box::new(Moody(Walker::new(false, false), counter)))))
        };
        let folder = tempfile::tempdir().unwrap();
        let first = run(folder.path(), Options { retries: 1, ..options() }, moody, usize::MAX).unwrap();
        assert_eq!(first.summary.errors, 1, "two attempts of the first episode failed, then one of the second");
        assert!(first.lines.contains("in a mood") && first.lines.contains("\"attempts\":2"));
        let again = run(folder.path(), Options { retries: 2, ..options() }, moody, usize::MAX).unwrap();
        assert_eq!(again.summary.errors, 0);
        assert_eq!(again.lines.lines().count(), 13, "the failed record stays where it is");
        assert_eq!(again.summary.success, sound.summary.success);
        let untouched = run(folder.path(), Options { retries: 9, ..options() }, moody, usize::MAX).unwrap();
        assert_eq!(untouched.lines, again.lines);
    }

    #[test]
    fn an_episode_that_takes_too_long_is_an_error_and_is_counted() {
        let options = Options { timeout: Some(Duration::ZERO), ..options() };
        let ran = played(options, move || walkers(4, "nobody", false));
        assert_eq!((ran.summary.episodes, ran.summary.errors), (12, 12));
        assert!(ran.lines.contains("\"error\":\"timed out"));
    }

    #[test]
    fn a_team_that_cannot_be_made_again_is_an_error_of_its_episodes() {
        let made = AtomicUsize::new(0);
        let make = move || match made.fetch_add(1, Ordering::Relaxed) {
            0 => walkers(1, "Take", true),
            _ => anyhow::bail!("the checkpoint is gone"),
        };
        let ran = played(options(), make);
        assert_eq!((ran.summary.episodes, ran.summary.errors), (12, 12));
        assert!(ran.lines.contains("could not be made again: the checkpoint is gone"), "{}", ran.lines);
    }

    /// Turn on the spot; when one is told `trouble`, they never come to a decision about its fourth step.
    struct Sleepers {
        seats: usize,
        trouble: &'static str,
    }

    impl Team for Sleepers {
        fn name(&self) -> &str {
            "sleepers"
        }

        fn seats(&self) -> usize {
            self.seats
        }

        fn begin(&mut self, _seat: usize, _seed: u64) {}

        fn decide(&mut self, situations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
            while situations.iter().flatten().any(|here| here.instruction.contains(self.trouble) && here.step == 3) {
                std::thread::sleep(Duration::from_millis(100));
            }
            let turn = || Ok(Decision { action: Action::navigate(ActionType::RotateLeft), mind: None });
            Ok(situations.iter().map(|here| here.as_ref().map(|_| turn())).collect())
        }
    }

    fn sleepers(seats: usize, trouble: &'static str) -> anyhow::Result<Box<dyn Team>> {
        Ok(Box::new(Sleepers { seats, trouble }))
    }

    /// The name of the thing that the task of that number asks for.
    fn asked(number: usize) -> &'static str {
        let ran = played(Options { seeds: 1, ..options() }, || sleepers(1, "nobody"));
        let line = ran.lines.lines().nth(number).unwrap();
        line.split_once("Take the ").unwrap().1.split_once('.').unwrap().0.to_owned().leak()
    }

    #[test]
    fn a_step_that_never_ends_is_an_error_of_its_episode_alone() {
        let trouble = asked(0);
        let options = Options { seeds: 1, ..options() };
        let sound = played(options, || sleepers(4, "nobody"));
        let limited = Options { timeout: Some(Duration::from_millis(1500)), ..options };
        let ran = played(limited, move || sleepers(4, trouble));
        assert_eq!((ran.summary.episodes, ran.summary.errors), (3, 1));
        for (line, before) in ran.lines.lines().zip(sound.lines.lines()) {
            match before.contains(&format!("Take the {trouble}.")) {
                true => {
                    assert!(line.contains("\"error\":\"timed out: a step went on after the 1.5 s"), "{line}");
                    assert_eq!(line.matches("\"do\"").count(), 3, "what it did before is recorded");
                }
                false => assert_eq!(line, before),
            }
        }
    }

    #[test]
    fn a_run_that_is_stopped_does_not_wait_for_a_step_that_never_ends() {
        let trouble = asked(1);
        let (folder, began) = (tempfile::tempdir().unwrap(), Instant::now());
        // It is stopped when the first task is done, while the second one hangs.
        let options = Options { seeds: 1, jobs: 2, ..options() };
        let ran = run(folder.path(), options, move || sleepers(1, trouble), 1).unwrap();
        assert!(ran.summary.partial && (1..3).contains(&ran.summary.episodes));
        assert!(began.elapsed() < Duration::from_secs(20));
    }
}
