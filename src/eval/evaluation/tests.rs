use std::collections::BTreeSet;
use std::sync::atomic::Ordering;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::agent::policy::each_alone;
use crate::agent::{Decision, Decisions, Observation, Policy};
use crate::data::{json, taskset};
use crate::domain::task::SceneRef;
use crate::domain::{Action, ActionType, Class, Role, SkillKind, Subtask};
use crate::house::testing::kitchen;

/// Walks by chance, sometimes touching what it can; fails in the ways that it is told to.
pub(crate) struct Walker {
    rng: ChaCha8Rng,
    steps: u32,
    fails: bool,
    panics: bool,
}

impl Walker {
    pub(crate) fn new(fails: bool, panics: bool) -> Walker {
        Walker { rng: ChaCha8Rng::seed_from_u64(0), steps: 0, fails, panics }
    }
}

impl Policy for Walker {
    fn name(&self) -> &str {
        "walker"
    }

    fn slots(&self) -> usize {
        1
    }

    fn reset(&mut self, _slot: usize, seed: u64) {
        self.rng = ChaCha8Rng::seed_from_u64(seed);
        self.steps = 0;
    }

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        each_alone(observations, |_, here| self.decide(here))
    }
}

impl Walker {
    pub(crate) fn decide(&mut self, here: &mut Observation<'_>) -> anyhow::Result<Decision> {
        self.steps += 1;
        assert!(!(self.panics && self.steps == 4), "out of legs");
        anyhow::ensure!(!(self.fails && self.steps == 6), "no way to the mug");
        let candidates = here.environment.legal_actions()?;
        let action = if !candidates.is_empty() && self.rng.random_bool(0.5) {
            candidates[self.rng.random_range(0..candidates.len())].action()
        } else {
            Action::navigate(ActionType::ALL[self.rng.random_range(0..5)])
        };
        Ok(Decision::of(action))
    }
}

pub(crate) fn walker(fails: bool, panics: bool) -> anyhow::Result<Box<dyn Policy>> {
    Ok(Box::new(Walker::new(fails, panics)))
}

/// Three tasks in the test kitchen, and the folder that they live in.
pub(crate) fn tasks() -> (tempfile::TempDir, Document<TaskSet>) {
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
        subtasks: vec![Subtask { skill: SkillKind::Pickup, object: 0, receptacle: None, closes: false, literal: None }],
        expert_steps: 15,
        horizon: 30,
        goal: None,
        source: None,
        env: None,
        seed: None,
        reworded: false,
    };
    let names: BTreeSet<&str> = world.objects.iter().map(|object| object.class.name()).collect();
    let tasks = names.into_iter().take(3).map(task).collect();
    let set = TaskSet { format_version: 1, name: "kitchen".into(), scenes: Some(".".into()), tasks };
    taskset::write(&folder.path().join("tasks.json"), &set).unwrap();
    let document = taskset::read(&folder.path().join("tasks.json")).unwrap();
    (folder, document)
}

pub(crate) fn options() -> Options {
    Options { seeds: 4, ..Options::plain(Grading::Class) }
}

pub(crate) struct Ran {
    pub(crate) summary: RunSummary,
    pub(crate) lines: String,
}

pub(crate) fn run(
    into: &std::path::Path,
    options: Options,
    make: impl Fn() -> anyhow::Result<Box<dyn Policy>> + Send + Sync + 'static,
    stop_after: usize,
) -> anyhow::Result<Ran> {
    let (folder, set) = tasks();
    let scenes = Scenes::of(&folder.path().join("tasks.json"), &set.value);
    let evaluation = Evaluation::prepare(&set, scenes, options, "walker", None)?;
    let mut folder = RunWriter::open(into, evaluation.manifest())?;
    let stop = Arc::new(AtomicBool::new(false));
    let stopping = stop.clone();
    let mut progress = move |progress: EvaluationProgress| {
        if progress.done >= stop_after {
            stopping.store(true, Ordering::Relaxed);
        }
    };
    let summary = evaluate(&evaluation, &(Arc::new(make) as Arc<MakePolicy>), &mut folder, &stop, &mut progress)?;
    Ok(Ran { summary, lines: std::fs::read_to_string(into.join("episodes.jsonl"))? })
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let with = |jobs: usize| {
        let into = folder.path().join(jobs.to_string());
        run(&into, Options { jobs, ..options() }, || walker(false, false), usize::MAX).unwrap()
    };
    let (one, four) = (with(1), with(4));
    assert_eq!(one.lines.lines().count(), 12);
    assert_eq!(one.lines, four.lines);
    assert_eq!(one.summary, four.summary);
    assert_ne!(one.lines.lines().next(), one.lines.lines().nth(1), "seeds differ");
}

#[test]
fn strict_grading_of_tasks_without_recordings_is_refused_in_words() {
    let (folder, set) = tasks();
    let scenes = Scenes::of(&folder.path().join("tasks.json"), &set.value);
    let strict = Options::plain(Grading::Strict);
    let error = Evaluation::prepare(&set, scenes, strict, "walker", None).err().unwrap().to_string();
    for part in ["strict grading needs", "recorded demonstrations", "none of the 3", "--grader class"] {
        assert!(error.contains(part), "{part} in {error}");
    }
}
#[test]
fn errors_and_panics_end_their_episode_and_stay_in_the_count() {
    let folder = tempfile::tempdir().unwrap();
    let failing = run(&folder.path().join("a"), options(), || walker(true, false), usize::MAX).unwrap();
    assert_eq!((failing.summary.episodes, failing.summary.partial), (12, false));
    assert!(failing.summary.errors > 0);
    assert!(failing.lines.contains("\"error\":\"no way to the mug\""), "{}", failing.lines);
    let panicking = run(&folder.path().join("b"), options(), || walker(false, true), usize::MAX).unwrap();
    assert_eq!(panicking.summary.episodes, 12);
    assert!(panicking.lines.contains("\"error\":\"panicked: out of legs\""), "{}", panicking.lines);
}

#[test]
fn a_stopped_run_is_valid_and_partial_and_continues_to_the_same_result() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, stopped) = (folder.path().join("whole"), folder.path().join("stopped"));
    let make = || walker(false, false);
    let whole = run(&whole, options(), make, usize::MAX).unwrap();
    let partial = run(&stopped, Options { jobs: 2, ..options() }, make, 3).unwrap();
    assert!(partial.summary.partial && (3..12).contains(&partial.summary.episodes));
    let resumed = run(&stopped, options(), make, usize::MAX).unwrap();
    assert_eq!(resumed.lines, whole.lines);
    assert_eq!(resumed.summary, whole.summary);
    let again = run(&stopped, options(), make, usize::MAX).unwrap();
    assert_eq!(again.lines, whole.lines, "a complete run is left as it is");
}

#[test]
fn a_folder_of_other_settings_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), options(), || walker(false, false), usize::MAX).unwrap();
    let other = Options { seeds: 5, ..options() };
    let error = run(folder.path(), other, || walker(false, false), usize::MAX).err().unwrap();
    assert!(error.to_string().contains("seeds: 4, not 5"), "{error}");
}
