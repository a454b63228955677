//! Episodes that the agent's own word ends.

use super::*;
use crate::agent::policy::each_alone;
use crate::agent::policy_source::MakePolicy;
use crate::agent::{Decisions, Observation};
use crate::domain::{Action, ActionType};
use crate::episode::failure::Failure;
use crate::episode::record::Episode;
use crate::episode::rollout::EndedBy;
use crate::episode::scenes::Scenes;
use crate::episode::wish::WishVerdict;
use crate::eval::evaluation::Evaluation;
use crate::eval::evaluation::tests::{options, run, tasks};
use crate::eval::options::Options;

/// When an expert that may say so says that it is done.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Says {
    /// Once it is.
    WhenDone,
    /// At its first step.
    AtOnce,
    /// It always says that it is not.
    Never,
    /// Once it has put down again what it took.
    WhenUndone,
    /// It has no end of its own.
    Nothing,
}

struct Speaker {
    expert: ExpertPolicy,
    says: Says,
}

impl Speaker {
    fn decide(&mut self, here: &mut Observation<'_>, chosen: Option<Decision>) -> Decision {
        let (completed, of) = here.environment.grading().unwrap();
        let candidates = here.environment.legal_actions().unwrap();
        let put = candidates.iter().find(|candidate| candidate.kind == ActionType::Put);
        let is_done = completed == of;
        let is_empty_handed = here.environment.house().is_some_and(|access| access.house.world().held.is_none());
        let says = match self.says {
            Says::WhenDone => is_done,
            Says::AtOnce => true,
            Says::Never | Says::Nothing => false,
            Says::WhenUndone => is_done && is_empty_handed,
        };
        let turn = Decision::of(Action::navigate(ActionType::RotateLeft));
        let decision = match put.filter(|_| is_done && self.says == Says::WhenUndone) {
            Some(put) => Decision::of(put.action()),
            None => chosen.unwrap_or(turn),
        };
        let done = (self.says != Says::Nothing).then_some(if says { 0.9 } else { 0.1 });
        Decision { done, ..decision }
    }
}

impl Policy for Speaker {
    fn name(&self) -> &str {
        "speaker"
    }

    fn slots(&self) -> usize {
        1
    }

    fn reset(&mut self, slot: usize, seed: u64) {
        self.expert.reset(slot, seed);
    }

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        // The expert has nothing to do any more once all is done.
        let chosen = self.expert.act(observations)?.remove(0).and_then(Result::ok);
        each_alone(observations, |_, here| Ok(self.decide(here, chosen.clone())))
    }
}

fn played(says: Says) -> Vec<Episode> {
    let folder = tempfile::tempdir().unwrap();
    let make = move || Ok(Box::new(Speaker { expert: ExpertPolicy::new(), says }) as Box<dyn Policy>);
    let options = Options { end: EndedBy::Agent, seeds: 1, ..options() };
    let ran = run(folder.path(), options, make, usize::MAX).unwrap();
    assert_eq!(ran.summary.end, EndedBy::Agent);
    ran.lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn an_agents_own_end_counts_only_where_everything_holds_when_it_speaks() {
    let came_to = |says| {
        let episodes = played(says);
        let first = &episodes[0];
        let all = episodes.iter().all(|episode| episode.success == first.success && episode.failure == first.failure);
        assert!(all, "{episodes:?}");
        (first.success, first.agent_end, first.failure)
    };
    assert_eq!(came_to(Says::WhenDone), (true, Some(true), None));
    assert_eq!(came_to(Says::AtOnce), (false, Some(false), Some(Failure::StoppedEarly)));
    assert_eq!(came_to(Says::Never), (false, None, Some(Failure::NeverStopped)));
    assert_eq!(came_to(Says::WhenUndone), (false, Some(false), Some(Failure::Undone)));
}

#[test]
fn a_policy_without_an_end_of_its_own_is_refused_once_and_nothing_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let make = || Ok(Box::new(Speaker { expert: ExpertPolicy::new(), says: Says::Nothing }) as Box<dyn Policy>);
    let options = Options { end: EndedBy::Agent, ..options() };
    let error = run(folder.path(), options, make, usize::MAX).err().unwrap().to_string();
    assert!(error.contains("--end grader"), "{error}");
    let lines = std::fs::read_to_string(folder.path().join("episodes.jsonl")).unwrap_or_default();
    assert_eq!(lines, "");
}

#[test]
fn a_task_that_was_read_keeps_what_the_agent_said_of_its_end() {
    let wish = |says| {
        let (folder, mut set) = tasks();
        set.value.tasks.truncate(1);
        let task = &mut set.value.tasks[0];
        task.instruction = "pick up the mug".into();
        (task.roles, task.subtasks, task.sentences) = (Vec::new(), Vec::new(), Vec::new());
        let scenes = Scenes::of(&folder.path().join("tasks.json"), &set.value);
        let options = Options { end: EndedBy::Agent, seeds: 1, ..options() };
        let evaluation = Evaluation::prepare(&set, scenes, options, "speaker", None).unwrap();
        let make: Arc<MakePolicy> =
            Arc::new(move || Ok(Box::new(Speaker { expert: ExpertPolicy::new(), says }) as Box<dyn Policy>));
        let mut wishes = Vec::new();
        let mut sink = |episode: Episode| {
            wishes.extend(episode.wishes);
            Ok(())
        };
        evaluation.play(&evaluation.all(), &make, &Arc::default(), &mut sink).unwrap();
        wishes.remove(0)
    };
    let done = wish(Says::WhenDone);
    assert_eq!((done.verdict, done.agent_done), (Some(WishVerdict::Done), Some(done.steps)));
    let early = wish(Says::AtOnce);
    assert_eq!((early.verdict, early.agent_done, early.failure), (None, Some(0), Some(Failure::StoppedEarly)));
    assert!(early.verdict_in_words().starts_with("failed ("), "{}", early.verdict_in_words());
    let never = wish(Says::Never);
    assert_eq!((never.verdict, never.agent_done), (Some(WishVerdict::OutOfTime), None));
}
