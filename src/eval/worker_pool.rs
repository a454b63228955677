//! Plays episodes on several threads, each a worker whose policy acts in several at once.
//!
//! An episode's slot follows from its place in the run alone, and a policy decides in one slot whatever happens in the others:
//! so the record of an episode does not depend on the number of threads or on what is played beside it. A thread cannot be
//! ended from outside: a worker that hangs within a step is left behind, what it was playing is recorded or played elsewhere,
//! and a new worker takes its place.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, OnceLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};

use super::executor::{Executor, Message};
use super::in_flight::Watchdog;
use super::plan::EvaluationPlan;
use super::work_queue::WorkQueue;
use super::worker::Worker;
use crate::agent::Policy;
use crate::agent::policy_source::MakePolicy;
use crate::episode::record::Episode;
use crate::run_dir::episode_spec::EpisodeSpec;

/// How often the workers are looked at.
const GLANCE: Duration = Duration::from_millis(100);
/// How long a worker that was asked to stop may take to finish its step before it is left behind.
const PATIENCE: Duration = Duration::from_secs(3);

/// The workers of a run, and what is waited for.
struct WorkerPool {
    executor: Arc<Executor>,
    slots: usize,
    receiver: Receiver<Message>,
    /// By their numbers; nothing where a worker is done or was left behind.
    workers: Vec<Option<(Arc<Watchdog>, JoinHandle<()>)>>,
}

/// Plays what is wanted; `sink` takes each episode, in that order.
pub(crate) fn play(
    evaluation: &EvaluationPlan,
    wanted: &[EpisodeSpec],
    make_policy: &Arc<MakePolicy>,
    stop: &Arc<AtomicBool>,
    sink: &mut dyn FnMut(Episode) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let Some(jobs) = Some(evaluation.options.jobs.min(wanted.len())).filter(|&jobs| jobs > 0) else {
        return Ok(());
    };
    let first = make_policy()?;
    let slots = first.slots().max(1);
    // No more workers than can be filled.
    let count = jobs.min(wanted.len().div_ceil(slots)).max(if slots == 1 { jobs } else { 1 });
    let others = (1..count).map(|_| make_policy());
    let policies = std::iter::once(Ok(first)).chain(others).collect::<anyhow::Result<Vec<_>>>()?;
    let (sender, receiver) = mpsc::channel();
    let executor = Arc::new(Executor {
        evaluation: evaluation.clone(),
        make_policy: make_policy.clone(),
        stop: stop.clone(),
        give_up: AtomicBool::new(false),
        refusal: OnceLock::new(),
        queue: WorkQueue::new(wanted, slots),
        sender: Mutex::new(sender),
    });
    let mut workers = WorkerPool { executor: executor.clone(), slots, receiver, workers: Vec::new() };
    for policy in policies {
        workers.start(Some(policy))?;
    }
    let played = workers.wait(wanted.len(), sink);
    executor.give_up.store(true, Ordering::Relaxed);
    // A run that was stopped waited for its workers already.
    if !stop.load(Ordering::Relaxed) {
        workers.close();
    }
    if let Some(problem) = executor.refusal.get() {
        anyhow::bail!("{problem}");
    }
    let whole = played?;
    ensure!(
        whole || stop.load(Ordering::Relaxed),
        "a thread ended before its episodes did; the same command continues"
    );
    Ok(())
}

impl WorkerPool {
    /// Starts a worker; without a policy it makes one.
    fn start(&mut self, policy: Option<Box<dyn Policy>>) -> anyhow::Result<()> {
        let (watchdog, number) = (Arc::new(Watchdog::new(self.slots)), self.workers.len());
        let (executor, watched) = (self.executor.clone(), watchdog.clone());
        let serve = move || {
            // Dropped last, after a panic too.
            let _done = Done { executor: executor.clone(), number };
            Worker::new(executor, watched, policy).serve();
        };
        let thread = std::thread::Builder::new().name(format!("worker {number}")).spawn(serve);
        self.workers.push(Some((watchdog, thread.context("a thread could not be started")?)));
        Ok(())
    }

    /// Takes episodes as they end, and hands them on in their order: what is written is the same for any number of workers.
    /// Whether all have come.
    fn wait(&mut self, wanted: usize, sink: &mut dyn FnMut(Episode) -> anyhow::Result<()>) -> anyhow::Result<bool> {
        let mut early = BTreeMap::new();
        let mut place = 0;
        let mut stopping: Option<Instant> = None;
        while self.workers.iter().any(Option::is_some) {
            match self.receiver.recv_timeout(GLANCE) {
                Ok(Message::Over(at, episode)) => drop(early.insert(at, episode)),
                Ok(Message::Done(number)) => self.join(number),
                Err(RecvTimeoutError::Timeout) => early.extend(self.abandon_hanging()?),
                Err(RecvTimeoutError::Disconnected) => break,
            }
            while let Some(episode) = early.remove(&place) {
                sink(episode)?;
                place += 1;
            }
            if self.executor.stop.load(Ordering::Relaxed)
                && stopping.get_or_insert_with(Instant::now).elapsed() >= PATIENCE
            {
                break;
            }
        }
        Ok(place == wanted)
    }

    /// Leaves workers behind that hang within a step, and starts others in their places. What a worker played by itself is over.
    fn abandon_hanging(&mut self) -> anyhow::Result<Vec<(usize, Episode)>> {
        let Some(limit) = self.executor.evaluation.options.timeout else { return Ok(Vec::new()) };
        let now = self.executor.evaluation.clock.now();
        let mut over = Vec::new();
        for number in 0..self.workers.len() {
            let Some((watchdog, _)) = &self.workers[number] else { continue };
            let Some(mut left) = watchdog.abandon_if_hanging(now, limit) else { continue };
            self.workers[number] = None;
            if let [only] = &mut left[..] {
                only.fail(&format!("timed out: a step went on after the {} s of the episode", limit.as_secs_f64()));
                match only.again(&self.executor.evaluation) {
                    Some(again) => self.executor.queue.play_alone(std::iter::once((only.at, again))),
                    None => over.push((only.at, only.clone().close(&self.executor.evaluation))),
                }
            } else {
                self.executor.queue.play_alone(left.iter().map(|in_flight| (in_flight.at, in_flight.spec)));
            }
            self.start(None)?;
        }
        Ok(over)
    }

    /// Joins the thread of a worker that is done.
    fn join(&mut self, number: usize) {
        if let Some((_, thread)) = self.workers.get_mut(number).and_then(Option::take) {
            // That it panicked shows in what is missing.
            let _ = thread.join();
        }
    }

    /// Waits for the workers to finish their steps; those that hang are left behind.
    fn close(&mut self) {
        let asked = Instant::now();
        while self.workers.iter().any(Option::is_some) && asked.elapsed() < PATIENCE {
            if let Ok(Message::Done(number)) = self.receiver.recv_timeout(GLANCE) {
                self.join(number);
            }
        }
    }
}

/// Says that a worker is done.
struct Done {
    executor: Arc<Executor>,
    number: usize,
}

impl Drop for Done {
    fn drop(&mut self) {
        // Where nobody listens any more, nobody waits.
        self.executor.send(Message::Done(self.number));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use super::*;
    use crate::agent::policy::each_alone;
    use crate::agent::{Decision, Decisions, Observation};
    use crate::domain::{Action, ActionType};
    use crate::eval::evaluation::tests::{Ran, Walker, options, run};
    use crate::eval::options::Options;

    /// Walkers in several slots. All fail together, or panic, when one of them is told `trouble`.
    struct Walkers {
        slots: Vec<Walker>,
        trouble: &'static str,
        panics: bool,
    }

    impl Policy for Walkers {
        fn name(&self) -> &str {
            "walkers"
        }

        fn slots(&self) -> usize {
            self.slots.len()
        }

        fn reset(&mut self, slot: usize, seed: u64) {
            self.slots[slot].reset(0, seed);
        }

        fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
            let troubled =
                observations.iter().flatten().any(|here| here.instruction.contains(self.trouble) && here.step == 3);
            assert!(!(troubled && self.panics), "the policy broke");
            anyhow::ensure!(!troubled, "the policy broke");
            each_alone(observations, |slot, here| self.slots[slot].decide(here))
        }
    }

    fn walkers(slots: usize, trouble: &'static str, panics: bool) -> anyhow::Result<Box<dyn Policy>> {
        let slots = (0..slots).map(|_| Walker::new(false, false)).collect();
        Ok(Box::new(Walkers { slots, trouble, panics }))
    }

    fn played(options: Options, make: impl Fn() -> anyhow::Result<Box<dyn Policy>> + Send + Sync + 'static) -> Ran {
        let folder = tempfile::tempdir().unwrap();
        run(folder.path(), options, make, usize::MAX).unwrap()
    }

    #[test]
    fn the_result_does_not_depend_on_slots_and_threads() {
        let alone = played(options(), || walkers(1, "nobody", false));
        for (slots, jobs) in [(1, 3), (4, 1), (4, 2), (16, 3)] {
            let ran = played(Options { jobs, ..options() }, move || walkers(slots, "nobody", false));
            assert_eq!(ran.lines, alone.lines, "{slots} slots, {jobs} threads");
        }
    }

    #[test]
    fn what_breaks_a_whole_policy_is_recorded_where_it_belongs_and_nowhere_else() {
        let sound = played(options(), move || walkers(4, "nobody", false));
        let (trouble, _) = sound.lines.split_once("\"instruction\":\"Take the ").unwrap().1.split_once('.').unwrap();
        let trouble: &'static str = trouble.to_owned().leak();
        for panics in [false, true] {
            let ran = played(Options { jobs: 2, ..options() }, move || walkers(4, trouble, panics));
            for (line, before) in ran.lines.lines().zip(sound.lines.lines()) {
                match before.contains(&format!("Take the {trouble}.")) && before.matches("\"action\"").count() > 3 {
                    true => assert!(line.contains("the policy broke"), "{line}"),
                    false => assert_eq!(line, before),
                }
            }
            assert!(ran.summary.errors > 0 && ran.summary.errors < 12);
            assert_eq!(ran.summary.errored_episodes.len(), ran.summary.errors);
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
            fn slots(&self) -> usize {
                1
            }
            fn reset(&mut self, slot: usize, seed: u64) {
                self.0.reset(slot, seed);
            }
            fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
                each_alone(observations, |_, here| {
                    let mut left = self.1.lock().unwrap();
                    if *left > 0 {
                        *left -= 1;
                        anyhow::bail!("in a mood");
                    }
                    drop(left);
                    self.0.decide(here)
                })
            }
        }
        let sound = played(options(), || walkers(1, "nobody", false));
        let counter: &'static Mutex<u32> = Box::leak(Box::new(Mutex::new(3)));
        let moody =
            move || -> anyhow::Result<Box<dyn Policy>> { Ok(Box::new(Moody(Walker::new(false, false), counter))) };
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
    fn a_policy_that_cannot_be_made_again_is_an_error_of_its_episodes() {
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
        slots: usize,
        trouble: &'static str,
    }

    impl Policy for Sleepers {
        fn name(&self) -> &str {
            "sleepers"
        }

        fn slots(&self) -> usize {
            self.slots
        }

        fn reset(&mut self, _slot: usize, _seed: u64) {}

        fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
            while observations.iter().flatten().any(|here| here.instruction.contains(self.trouble) && here.step == 3) {
                std::thread::sleep(Duration::from_millis(100));
            }
            each_alone(observations, |_, _| Ok(Decision::of(Action::navigate(ActionType::RotateLeft))))
        }
    }

    fn sleepers(slots: usize, trouble: &'static str) -> anyhow::Result<Box<dyn Policy>> {
        Ok(Box::new(Sleepers { slots, trouble }))
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
                    assert_eq!(line.matches("\"action\"").count(), 3, "what it did before is recorded");
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
