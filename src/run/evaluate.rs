//! Evaluation: every task with every seed, on several threads, with the same result for any number of them.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

use anyhow::Context;

use super::episode::{self, Episode};
use super::folder::{Manifest, RunFolder};
use super::report::Summary;
use super::rollout::Rollout;
use super::scenes::Scenes;
use crate::agent::Policy;
use crate::data::json::Document;
use crate::domain::{Task, TaskSet};
use crate::house::House;
use crate::house::grading::{Grader, Grading};
use crate::language::instruction;

/// Makes a policy; every worker thread calls it for one of its own.
pub type MakePolicy<'a> = dyn Fn() -> anyhow::Result<Box<dyn Policy>> + Sync + 'a;

/// How to evaluate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How subtasks are graded.
    pub grading: Grading,
    /// Each task is played this often, with the seeds 0, 1, ...
    pub seeds: u64,
    /// Only that many tasks, from the first.
    pub limit: Option<usize>,
    /// Threads; the result does not depend on it.
    pub jobs: usize,
    /// The agent is told all steps instead of the task's instruction.
    pub step_by_step: bool,
}

/// An evaluation that can start: its tasks fit their scenes.
pub struct Evaluation {
    tasks: Vec<Task>,
    scenes: Scenes,
    options: Options,
    manifest: Manifest,
}

/// How far an evaluation is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Episodes that are over.
    pub done: usize,
    /// Of how many.
    pub of: usize,
    /// Of the done ones, successes.
    pub successes: usize,
    /// Of the done ones, those that ended with an error.
    pub errors: usize,
}

impl Progress {
    fn count(&mut self, episode: &Episode) {
        self.done += 1;
        self.successes += usize::from(episode.success);
        self.errors += usize::from(episode.error.is_some());
    }
}

impl Evaluation {
    /// Checks that every task can start, before anything is written.
    ///
    /// # Errors
    /// Names the task and field that is wrong; the caller names the file.
    pub fn prepare(
        set: &Document<TaskSet>,
        scenes: Scenes,
        options: Options,
        policy: &str,
        checkpoint_hash: Option<String>,
    ) -> anyhow::Result<Evaluation> {
        let mut tasks = set.value.tasks.clone();
        tasks.truncate(options.limit.unwrap_or(usize::MAX));
        if options.step_by_step
            && let Some(i) = tasks.iter().position(|task| task.sentences.is_empty())
        {
            anyhow::bail!("tasks[{i}].sentences: missing, so the task {:?} cannot be told step by step", tasks[i].id);
        }
        if options.grading == Grading::Strict {
            let unrecorded = |task: &Task| task.subtasks.iter().position(|subtask| subtask.literal.is_none());
            if let Some((i, j)) = tasks.iter().enumerate().find_map(|(i, task)| Some((i, unrecorded(task)?))) {
                anyhow::bail!(
                    "tasks[{i}].subtasks[{j}].literal: missing, so the task {:?} has no recording for the strict grader; use --grader class",
                    tasks[i].id
                );
            }
        }
        let scenes_hash = scenes.check(&tasks)?;
        let manifest = Manifest {
            format_version: Manifest::FORMAT,
            sprint: env!("CARGO_PKG_VERSION").into(),
            task_set: set.value.name.clone(),
            task_set_hash: set.digest.clone(),
            scenes_hash,
            policy: policy.to_owned(),
            checkpoint_hash,
            tasks: tasks.len(),
            seeds: options.seeds,
            grader: options.grading,
            step_by_step: options.step_by_step,
        };
        Ok(Evaluation { tasks, scenes, options, manifest })
    }

    /// What identifies this run.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Every task with every seed, as positions in the set.
    pub fn all(&self) -> Vec<(usize, u64)> {
        let seeds = self.options.seeds;
        (0..self.tasks.len()).flat_map(|task| (0..seeds).map(move |seed| (task, seed))).collect()
    }

    /// Plays the episodes of these tasks and seeds on several threads; `sink` takes each, in their order.
    ///
    /// `stop` ends it early: episodes under way are finished, no others begun.
    ///
    /// # Errors
    /// When a policy cannot be made, or `sink` fails.
    pub fn play(
        &self,
        wanted: &[(usize, u64)],
        make_policy: &MakePolicy<'_>,
        stop: &AtomicBool,
        sink: &mut dyn FnMut(Episode) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let jobs = self.options.jobs.min(wanted.len());
        let policies = (0..jobs).map(|_| make_policy()).collect::<anyhow::Result<Vec<_>>>()?;
        let next = AtomicUsize::new(0);
        // Set when the sink fails; `stop` belongs to the caller.
        let give_up = AtomicBool::new(false);
        let (sender, receiver) = mpsc::channel::<(usize, Episode)>();
        std::thread::scope(|scope| {
            for policy in policies {
                let (sender, next, give_up) = (sender.clone(), &next, &give_up);
                scope.spawn(move || {
                    let mut policy = Some(policy);
                    while !stop.load(Ordering::Relaxed) && !give_up.load(Ordering::Relaxed) {
                        let place = next.fetch_add(1, Ordering::Relaxed);
                        let Some(&(task, seed)) = wanted.get(place) else { break };
                        let episode = self.episode(task, seed, &mut policy, make_policy);
                        if sender.send((place, episode)).is_err() {
                            break;
                        }
                    }
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

    /// One episode. Errors and panics of the policy or the environment end it and are recorded.
    fn episode(
        &self,
        index: usize,
        seed: u64,
        policy: &mut Option<Box<dyn Policy>>,
        make_policy: &MakePolicy<'_>,
    ) -> Episode {
        let task = &self.tasks[index];
        let mut episode = Episode {
            task: task.id.clone(),
            seed,
            start_hash: String::new(),
            instruction: told(task, self.options.step_by_step),
            completed: 0,
            of: task.subtasks.len() as u32,
            success: false,
            steps: 0,
            error: None,
            trace: Vec::new(),
        };
        let ending = catch_unwind(AssertUnwindSafe(|| -> anyhow::Result<()> {
            let setting = self.scenes.setting(task)?;
            episode.start_hash = setting.world.digest();
            let grader = Grader::new(self.options.grading, &task.roles, &task.subtasks, task.goal.as_ref());
            let house = House::new(setting.scene, setting.world);
            let mut rollout = Rollout::new(house, episode.instruction.clone(), Some(grader), Some(task.horizon));
            if policy.is_none() {
                *policy = Some(make_policy().context("the policy could not be made again")?);
            }
            let Some(policy) = policy.as_mut() else { anyhow::bail!("there is no policy") };
            policy.begin(policy_seed(index, seed));
            episode::play(&mut rollout, policy.as_mut(), &mut episode.trace)
        }));
        episode.error = match ending {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(format!("{error:#}")),
            Err(panic) => {
                // Whatever state the panic left it in is not carried into the next episode.
                *policy = None;
                Some(format!("panicked: {}", panic_message(panic.as_ref())))
            }
        };
        episode.steps = episode.trace.len() as u32;
        episode.completed = episode.trace.iter().filter(|step| step.subtask.is_some()).count() as u32;
        episode.success = episode.completed == episode.of;
        episode
    }
}

/// Runs an evaluation into its folder: the episodes that are not there yet, in the order of tasks and seeds.
///
/// `stop` ends it early: episodes under way are finished, no others begun, and the summary says that it is partial.
///
/// # Errors
/// When a policy cannot be made or the folder cannot be written to. What goes wrong in an episode is recorded there instead.
pub fn evaluate(
    evaluation: &Evaluation,
    make_policy: &MakePolicy<'_>,
    folder: &mut RunFolder,
    stop: &AtomicBool,
    progress: &mut dyn FnMut(Progress),
) -> anyhow::Result<Summary> {
    let mut episodes = std::mem::take(&mut folder.earlier);
    let done: BTreeSet<(&str, u64)> = episodes.iter().map(|episode| (episode.task.as_str(), episode.seed)).collect();
    let all = evaluation.all();
    let total = all.len();
    let missing = |&(task, seed): &(usize, u64)| !done.contains(&(evaluation.tasks[task].id.as_str(), seed));
    let wanted: Vec<(usize, u64)> = all.into_iter().filter(missing).collect();
    let mut state = Progress { of: total, ..Progress::default() };
    episodes.iter().for_each(|episode| state.count(episode));
    progress(state);
    evaluation.play(&wanted, make_policy, stop, &mut |mut episode| {
        folder.append(&episode)?;
        state.count(&episode);
        progress(state);
        // It is on disk; a night's run need not be in memory too.
        episode.trace = Vec::new();
        episodes.push(episode);
        Ok(())
    })?;
    let summary = Summary::of(&evaluation.manifest, &evaluation.tasks, &episodes, episodes.len() < total);
    folder.write_summary(&summary)?;
    Ok(summary)
}

/// What the agent is told: the task's instruction, or all its steps, each normalised, in one line.
pub fn told(task: &Task, step_by_step: bool) -> String {
    if step_by_step {
        task.sentences.iter().map(|sentence| instruction::normalise(sentence)).collect::<Vec<_>>().join(" ")
    } else {
        instruction::normalise(&task.instruction)
    }
}

/// What drives a policy's chance in an episode: the task's position and the seed, and nothing else.
pub fn policy_seed(task: usize, seed: u64) -> u64 {
    // SplitMix64's finaliser over both, so that neighbours have nothing in common.
    let mut z = (task as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ seed.wrapping_mul(0xd1b5_4a32_d192_ed03);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn panic_message(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("without a message")
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::agent::{Decision, Situation};
    use crate::data::{json, taskset};
    use crate::domain::task::SceneRef;
    use crate::domain::{Action, ActionType, Class, Role, SkillKind, Subtask};
    use crate::house::testing::kitchen;

    /// Walks by chance, sometimes touching what it can; fails in the ways that it is told to.
    struct Walker {
        rng: ChaCha8Rng,
        steps: u32,
        fails: bool,
        panics: bool,
    }

    impl Policy for Walker {
        fn name(&self) -> &str {
            "walker"
        }

        fn begin(&mut self, seed: u64) {
            self.rng = ChaCha8Rng::seed_from_u64(seed);
            self.steps = 0;
        }

        fn decide(&mut self, situation: &mut Situation<'_>) -> anyhow::Result<Decision> {
            self.steps += 1;
            assert!(!(self.panics && self.steps == 4), "out of legs");
            anyhow::ensure!(!(self.fails && self.steps == 6), "no way to the mug");
            let candidates = situation.house.candidates();
            let action = if !candidates.is_empty() && self.rng.random_bool(0.5) {
                candidates[self.rng.random_range(0..candidates.len())].action()
            } else {
                Action::navigate(ActionType::ALL[self.rng.random_range(0..5)])
            };
            Ok(Decision { action, mind: None })
        }
    }

    fn walker(fails: bool, panics: bool) -> anyhow::Result<Box<dyn Policy>> {
        Ok(Box::new(Walker { rng: ChaCha8Rng::seed_from_u64(0), steps: 0, fails, panics }))
    }

    /// Three tasks in the test kitchen, and the folder that they live in.
    fn tasks() -> (tempfile::TempDir, Document<TaskSet>) {
        let folder = tempfile::tempdir().unwrap();
        let (scene, world) = kitchen();
        json::write(&folder.path().join(format!("{}.json", scene.name)), &*scene).unwrap();
        let task = |name: &str| Task {
            id: format!("take-{name}"),
            scene: SceneRef::Named(scene.name.clone()),
            start: Some(world.clone()),
            instruction: format!("take the {name}"),
            sentences: vec![format!("  take   the {name}")],
            roles: vec![Role { class: Class::named(name).unwrap(), slice: false, bound: None, expert: None }],
            subtasks: vec![Subtask {
                skill: SkillKind::Pickup,
                object: 0,
                receptacle: None,
                closes: false,
                literal: None,
            }],
            expert_steps: 15,
            horizon: 30,
            goal: None,
            source: None,
            reworded: false,
        };
        let names: BTreeSet<&str> = world.objects.iter().map(|object| object.class.name()).collect();
        let tasks = names.into_iter().take(3).map(task).collect();
        let set = TaskSet { format_version: 1, name: "kitchen".into(), scenes: Some(".".into()), tasks };
        taskset::write(&folder.path().join("tasks.json"), &set).unwrap();
        let document = taskset::read(&folder.path().join("tasks.json")).unwrap();
        (folder, document)
    }

    const OPTIONS: Options = Options { grading: Grading::Class, seeds: 4, limit: None, jobs: 1, step_by_step: false };

    struct Ran {
        summary: Summary,
        lines: String,
    }

    fn run(into: &std::path::Path, options: Options, make: &MakePolicy<'_>, stop_after: usize) -> anyhow::Result<Ran> {
        let (folder, set) = tasks();
        let scenes = Scenes::of(&folder.path().join("tasks.json"), &set.value);
        let evaluation = Evaluation::prepare(&set, scenes, options, "walker", None)?;
        let mut folder = RunFolder::open(into, evaluation.manifest())?;
        let stop = AtomicBool::new(false);
        let mut progress = |progress: Progress| {
            if progress.done >= stop_after {
                stop.store(true, Ordering::Relaxed);
            }
        };
        let summary = evaluate(&evaluation, make, &mut folder, &stop, &mut progress)?;
        Ok(Ran { summary, lines: std::fs::read_to_string(into.join("episodes.jsonl"))? })
    }

    #[test]
    fn the_result_does_not_depend_on_the_number_of_threads() {
        let folder = tempfile::tempdir().unwrap();
        let with = |jobs: usize| {
            let into = folder.path().join(jobs.to_string());
            run(&into, Options { jobs, ..OPTIONS }, &|| walker(false, false), usize::MAX).unwrap()
        };
        let (one, four) = (with(1), with(4));
        assert_eq!(one.lines.lines().count(), 12);
        assert_eq!(one.lines, four.lines);
        assert_eq!(one.summary, four.summary);
        assert_ne!(one.lines.lines().next(), one.lines.lines().nth(1), "seeds differ");
    }

    #[test]
    fn errors_and_panics_end_their_episode_and_stay_in_the_count() {
        let folder = tempfile::tempdir().unwrap();
        let failing = run(&folder.path().join("a"), OPTIONS, &|| walker(true, false), usize::MAX).unwrap();
        assert_eq!((failing.summary.episodes, failing.summary.partial), (12, false));
        assert!(failing.summary.errors > 0);
        assert!(failing.lines.contains("\"error\":\"no way to the mug\""), "{}", failing.lines);
        let panicking = run(&folder.path().join("b"), OPTIONS, &|| walker(false, true), usize::MAX).unwrap();
        assert_eq!(panicking.summary.episodes, 12);
        assert!(panicking.lines.contains("\"error\":\"panicked: out of legs\""), "{}", panicking.lines);
    }

    #[test]
    fn a_stopped_run_is_valid_and_partial_and_continues_to_the_same_result() {
        let folder = tempfile::tempdir().unwrap();
        let (whole, stopped) = (folder.path().join("whole"), folder.path().join("stopped"));
        let make = || walker(false, false);
        let whole = run(&whole, OPTIONS, &make, usize::MAX).unwrap();
        let partial = run(&stopped, Options { jobs: 2, ..OPTIONS }, &make, 3).unwrap();
        assert!(partial.summary.partial && (3..12).contains(&partial.summary.episodes));
        let resumed = run(&stopped, OPTIONS, &make, usize::MAX).unwrap();
        assert_eq!(resumed.lines, whole.lines);
        assert_eq!(resumed.summary, whole.summary);
        let again = run(&stopped, OPTIONS, &make, usize::MAX).unwrap();
        assert_eq!(again.lines, whole.lines, "a complete run is left as it is");
    }

    #[test]
    fn a_folder_of_other_settings_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        run(folder.path(), OPTIONS, &|| walker(false, false), usize::MAX).unwrap();
        let other = Options { seeds: 5, ..OPTIONS };
        let error = run(folder.path(), other, &|| walker(false, false), usize::MAX).err().unwrap();
        assert!(error.to_string().contains("seeds: 4, not 5"), "{error}");
    }

    #[test]
    fn the_agent_is_told_the_normalised_instruction_or_all_steps() {
        let (_folder, set) = tasks();
        let mut task = set.value.tasks[0].clone();
        task.instruction = "  put it   AWAY".into();
        task.sentences = vec!["take   it".into(), "drop it!".into()];
        assert_eq!(told(&task, false), "Put it away.");
        assert_eq!(told(&task, true), "Take it. Drop it!");
    }

    #[test]
    fn every_episode_has_a_seed_of_its_own() {
        let seeds: BTreeSet<u64> = (0..50).flat_map(|task| (0..50).map(move |seed| policy_seed(task, seed))).collect();
        assert_eq!(seeds.len(), 2_500);
    }
}
