use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::*;
use crate::agent::learned::tests::undecided;
use crate::agent::policy::each_alone;
use crate::agent::policy_source::{MakePolicy, PolicySource};
use crate::agent::{Decision, Decisions, Observation, Policy, RandomPolicy};
use crate::domain::{Action, ActionType, Class, Role, SkillKind, Subtask};
use crate::env::remote::RemoteSettings;
use crate::episode::branches::{SavedState, TakenStep, Tree};
use crate::episode::record::{Author, TraceStep};
use crate::episode::rollout::Rollout;
use crate::episode::scenes::Scenes;
use crate::eval::evaluation::tests::{options, tasks};
use crate::eval::evaluation::{Evaluation, evaluate};
use crate::eval::options::Options;
use crate::explore::session_export;
use crate::explore::session_export::SessionExport;
use crate::house::House;
use crate::house::grading::{Grader, Grading};
use crate::house::testing::kitchen;
use crate::run_dir::writer::RunWriter;

/// A random walk of eight steps in the kitchen; the fourth and fifth by hand, with another instruction from the sixth on.
fn walked() -> SessionExport {
    let (scene, world) = kitchen();
    let role = |name: &str| Role { class: Class::named(name).unwrap(), slice: false, bound: None, expert: None };
    let mut task = session_export::ungraded(crate::domain::task::SceneRef::Named(scene.name.clone()));
    task.roles = vec![role("Mug")];
    task.subtasks =
        vec![Subtask { skill: SkillKind::Pickup, object: 0, receptacle: None, closes: false, literal: None }];
    (task.id, task.start, task.instruction) = ("main".into(), Some(world.clone()), "Take the mug.".into());
    let grader = Grader::new(Grading::Class, &task.roles, &task.subtasks, None, (&scene, &world));
    let mut rollout = Rollout::in_house(House::new(scene.clone(), world), task.instruction.clone(), Some(grader), None);
    let mut policy = RandomPolicy::new();
    policy.reset(0, 9);
    let random = Author::of("random", 9);
    let mut tree = Tree::new(SavedState::of(&rollout, &random, policy.state(0)));
    for step in 0..8 {
        if step == 5 {
            rollout.instruction = "Dance.".into();
            rollout.env.grader = None;
        }
        let mut decision = rollout.decide(&mut policy).unwrap();
        let by_hand = (3..5).contains(&step);
        if by_hand {
            decision.action = Action::navigate(ActionType::LookUp);
        }
        let tick = rollout.carry_out(decision.clone()).unwrap();
        let taken = TakenStep {
            decision,
            step: TraceStep::of(&tick, &rollout),
            instruction: rollout.instruction.as_str().into(),
            wish: None,
            author: if by_hand { Author::hand() } else { random.clone() },
            values: None,
        };
        let moment = SavedState::of(&rollout, &random, policy.state(0));
        tree.grow(taken, || moment, String::new);
    }
    SessionExport { scene, tasks: vec![task], episodes: vec![tree.episode(0, "main")], places: Vec::new() }
}

fn random(author: &Author) -> anyhow::Result<Option<PolicySource>> {
    Ok((author.policy == "random").then(PolicySource::random))
}

fn verified(explored: &SessionExport) -> Verdict {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    session_export::write(explored, &path).unwrap();
    let run = RecordedRun::open(&path, None).unwrap();
    assert_eq!(run.episodes, explored.episodes);
    verify(&run, &mut random, 2, &RemoteSettings::default(), &mut |_| ()).unwrap()
}

#[test]
fn what_was_explored_is_a_run_that_comes_out_the_same() {
    let verdict = verified(&walked());
    assert_eq!((verdict.episodes, verdict.steps), (1, 8), "{verdict:?}");
    assert_eq!(verdict.choices, 3 + 3, "a person's two steps are not chosen again");
    assert!(verdict.differences.is_empty() && verdict.missing.is_empty(), "{verdict:?}");
}

#[test]
fn a_changed_record_is_found_at_its_first_step() {
    let check = |change: fn(&mut Episode), step: u32, what: &str| {
        let mut explored = walked();
        change(&mut explored.episodes[0]);
        let verdict = verified(&explored);
        let found: Vec<_> = verdict.differences.iter().map(|it| (it.mismatch.step, it.mismatch.what)).collect();
        assert_eq!(found, [(step, what)]);
    };
    check(|episode| episode.start_hash = "00".into(), 0, "start");
    check(
        |episode| episode.trace[3].outcome = crate::house::Outcome::Impossible(crate::house::outcome::Reason::Blocked),
        4,
        "outcome",
    );
    check(|episode| episode.trace[0].kind = ActionType::Slice, 1, "choice");
    check(|episode| episode.completed += 1, 0, "result");
}

#[test]
fn a_policy_that_is_not_at_hand_is_named_and_its_actions_are_replayed() {
    let explored = walked();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    session_export::write(&explored, &path).unwrap();
    let run = RecordedRun::open(&path, None).unwrap();
    let verdict = verify(&run, &mut |_| Ok(None), 1, &RemoteSettings::default(), &mut |_| ()).unwrap();
    assert_eq!((verdict.steps, verdict.choices, verdict.missing), (8, 0, vec!["random".to_string()]));
}

/// An evaluation of three tasks with four seeds each, in `folder/NAME`, by a policy of that source.
fn evaluated(name: &str, jobs: usize, source: &PolicySource) -> (tempfile::TempDir, RecordedRun) {
    let (folder, set) = tasks();
    let file = folder.path().join("tasks.json");
    let path = folder.path().join(name);
    let scenes = Scenes::of(&file, &set.value);
    let evaluation = Evaluation::prepare(&set, scenes, Options { jobs, ..options() }, name, None).unwrap();
    let mut run_folder = RunWriter::open(&path, evaluation.manifest()).unwrap();
    let stop = Arc::new(AtomicBool::new(false));
    evaluate(&evaluation, &source.make, &mut run_folder, &stop, &mut |_| ()).unwrap();
    let run = RecordedRun::open(&path, Some(&file)).unwrap();
    (folder, run)
}

fn verified_by(run: &RecordedRun, jobs: usize, source: &PolicySource) -> Verdict {
    verify(run, &mut |_| Ok(Some(source.clone())), jobs, &RemoteSettings::default(), &mut |_| ()).unwrap()
}

#[test]
fn an_evaluation_by_any_number_of_threads_verifies_bit_for_bit_near_ties_included() {
    let _chance = crate::nets::testing::chance();
    if undecided().is_none() {
        return;
    }
    crate::nets::device::set_threads(1);
    let make: Arc<MakePolicy> = Arc::new(|| Ok(Box::new(undecided().context("no sentence encoder")?)));
    let source = PolicySource::of("undecided", make);
    for jobs in [1, 2, 3] {
        let (_folder, run) = evaluated("undecided", jobs, &source);
        let verdict = verified_by(&run, 4 - jobs, &source);
        assert!(verdict.is_equal() && verdict.episodes == 12, "{jobs} jobs: {verdict:?}");
        assert_eq!(verdict.choices, verdict.steps);
    }
}

/// Decides by nothing but its slot: who decides in another one decides otherwise.
struct BySlot;

impl Policy for BySlot {
    fn name(&self) -> &str {
        "by-slot"
    }

    fn slots(&self) -> usize {
        3
    }

    fn reset(&mut self, _slot: usize, _seed: u64) {}

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        const KINDS: [ActionType; 3] = [ActionType::RotateLeft, ActionType::RotateRight, ActionType::LookUp];
        each_alone(observations, |slot, here| {
            anyhow::ensure!(!(here.step == 5 && here.instruction.to_lowercase().contains("apple")), "no appetite");
            Ok(Decision::of(Action::navigate(KINDS[slot])))
        })
    }
}

fn by_slot() -> PolicySource {
    PolicySource::of("by-slot", Arc::new(|| Ok(Box::new(BySlot))))
}

#[test]
fn each_episode_is_decided_in_the_slot_that_decided_it_what_an_error_cut_short_too() {
    let (_folder, run) = evaluated("by-slot", 2, &by_slot());
    let errors = run.episodes.iter().filter(|episode| episode.error.is_some()).count();
    assert!(errors > 0 && errors < 12, "{errors} of 12");
    for jobs in [1, 3] {
        let verdict = verified_by(&run, jobs, &by_slot());
        assert!(verdict.is_equal() && verdict.episodes == 12, "{verdict:?}");
        assert_eq!(verdict.choices, run.episodes.iter().map(|episode| episode.trace.len()).sum::<usize>());
    }
}

#[test]
fn a_changed_record_of_an_evaluation_is_found_at_its_first_step() {
    let check = |change: fn(&mut Episode), step: u32, what: &str| {
        let (_folder, mut run) = evaluated("by-slot", 1, &by_slot());
        let whole = run.episodes.iter().position(|episode| episode.error.is_none()).unwrap();
        change(&mut run.episodes[whole]);
        let verdict = verified_by(&run, 2, &by_slot());
        let found: Vec<_> = verdict.differences.iter().map(|it| (it.mismatch.step, it.mismatch.what)).collect();
        assert_eq!(found, [(step, what)]);
    };
    check(|episode| episode.start_hash = "00".into(), 0, "start");
    check(|episode| episode.instruction = "Dance.".into(), 0, "instruction");
    check(|episode| episode.trace[6].kind = ActionType::LookDown, 7, "choice");
    check(|episode| episode.trace[1].subtask = Some(0), 2, "subtask");
    check(|episode| episode.completed += 1, 0, "result");
    check(|episode| drop(episode.trace.pop()), 0, "result");
    check(
        |episode| {
            episode.trace.pop();
            episode.steps -= 1;
        },
        0,
        "result",
    );
    check(|episode| episode.trace.extend(episode.trace.last().cloned()), 31, "choice");
}
