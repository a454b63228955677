//! The episode under exploration, without any screen: house, task, policy, everything that was tried, and the verbs that act
//! on them. The worker thread and the plain mode both drive it.

mod episodes;
mod policy;
mod queries;
mod save;
mod snapshot;
mod step;
mod time;

pub use snapshot::{Progress, Snapshot};
pub use step::Event;

use std::sync::Arc;

use super::episode_source::EpisodeSource;
use crate::agent::registry::{Policies, PolicyKind};
use crate::agent::{Decision, Policy, PolicyState, Values};
use crate::domain::Task;
use crate::domain::task::SceneRef;
use crate::episode::branches::{Moment, Tree};
use crate::episode::record::Author;
use crate::episode::rollout::{End, Rollout};
use crate::house::view::Frame;
use episodes::rollout_of;

/// The episode under exploration.
pub struct Session {
    openings: EpisodeSource,
    policies: Policies,
    checkpoints: Arc<Vec<String>>,
    kind: PolicyKind,
    policy: Option<Box<dyn Policy>>,
    author: Author,
    rollout: Rollout,
    task: Option<Task>,
    reference: SceneRef,
    limited: bool,
    seed: u64,
    episode: u32,
    tree: Tree,
    decision: Option<(Decision, Option<Values>)>,
    frame: Option<Arc<Frame>>,
    examples: Arc<Vec<String>>,
    /// The screen shows the frames before the present one.
    looks_back: bool,
}

impl Session {
    /// Opens the first house. `instruction` replaces the task's own.
    ///
    /// # Errors
    /// When the house cannot be opened or the instruction is unfit.
    pub fn new(
        openings: EpisodeSource,
        policies: Policies,
        kind: PolicyKind,
        instruction: Option<&str>,
    ) -> anyhow::Result<Session> {
        let opening = openings.open()?;
        let rollout = rollout_of(&opening);
        let author = Author { policy: kind.name().into(), checkpoint: None, seed: openings.seed(), sampling: false };
        let mut engine = Session {
            checkpoints: Arc::new(policies.agents()),
            policies,
            kind,
            policy: None,
            tree: Tree::new(Moment::of(&rollout, &author, PolicyState::Nothing)),
            author,
            rollout,
            seed: openings.seed(),
            openings,
            task: opening.task,
            reference: opening.reference,
            limited: opening.limited,
            episode: 1,
            decision: None,
            frame: None,
            examples: Arc::default(),
            looks_back: false,
        };
        engine.examples = Arc::new(engine.suggest());
        if let Some(text) = instruction {
            engine.instruct(text)?;
            engine.plant();
        }
        Ok(engine)
    }

    /// The present state becomes the start, while nothing was tried.
    fn plant(&mut self) {
        self.tree.begin_with(self.moment());
    }

    fn moment(&self) -> Moment {
        let carried = self.policy.as_ref().map_or(PolicyState::Nothing, |policy| policy.state(0));
        Moment::of(&self.rollout, &self.author, carried)
    }

    /// Whether the episode is over, and why.
    pub fn end(&self) -> Option<End> {
        self.rollout.end()
    }

    /// What the agent is told.
    pub fn instruction(&self) -> &str {
        &self.rollout.instruction
    }

    /// The task of this episode, whether it still applies or not.
    pub fn task(&self) -> Option<&Task> {
        self.task.as_ref()
    }

    /// The present state of the house.
    pub fn rollout(&self) -> &Rollout {
        &self.rollout
    }

    /// Everything that was tried.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Action, ActionType};
    use crate::explore::testing;

    #[test]
    fn another_instruction_ends_the_task_and_its_own_words_bring_it_back_at_a_reset() {
        let mut engine = testing::engine();
        let words = engine.instruction().to_string();
        assert_eq!(engine.instruct("open the fridge").unwrap(), "the task no longer applies");
        assert!(engine.progress().is_none());
        engine.reset();
        assert_eq!(engine.instruction(), "Open the fridge.", "a reset keeps what was typed");
        assert!(engine.progress().is_none());
        assert!(engine.instruct(&words.to_uppercase()).unwrap().contains("reset"));
        engine.reset();
        assert_eq!(engine.progress().unwrap().subtasks.len(), 2);
    }

    #[test]
    fn the_expert_without_a_task_says_so_and_solves_one() {
        let mut engine = testing::engine();
        engine.choose(PolicyKind::Expert).unwrap();
        for _ in 0..48 {
            engine.step().unwrap();
            if engine.end().is_some() {
                break;
            }
        }
        assert_eq!(engine.end(), Some(End::Success));
        assert_eq!(engine.progress().unwrap().completed_at.len(), 2);
        engine.reset();
        engine.instruct("dance").unwrap();
        assert!(engine.think().unwrap_err().to_string().contains("the expert needs a task"));
    }

    #[test]
    fn unfit_instructions_change_nothing() {
        let mut engine = testing::engine();
        let words = engine.instruction().to_string();
        for text in ["", "   ", "open\x1b[2J the door", &"word ".repeat(2_000)] {
            assert!(engine.instruct(text).is_err(), "{text:.20}");
        }
        assert_eq!(engine.instruction(), words);
        assert!(engine.progress().is_some());
    }

    #[test]
    fn a_state_is_decided_once_and_the_decision_is_what_happens() {
        let mut engine = testing::engine();
        engine.choose(PolicyKind::Random).unwrap();
        let first = engine.think().unwrap().0.action;
        assert_eq!(engine.think().unwrap().0.action, first);
        let words = engine.words(first);
        assert_eq!(engine.step().unwrap().action, words);
    }

    #[test]
    fn a_reset_brings_back_the_world_and_the_path_begins_anew() {
        let mut engine = testing::engine();
        let start = engine.snapshot();
        engine.act(Action::navigate(ActionType::MoveAhead)).unwrap();
        engine.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        assert_eq!(engine.snapshot().step, 2);
        engine.reset();
        let again = engine.snapshot();
        assert_eq!((again.world, again.step, again.path.len()), (start.world, 0, 1));
        assert_eq!((again.episode, again.time.beats.len()), (1, 2), "what was tried stays");
    }

    /// Everything that decides what comes next, as text.
    fn state(engine: &mut Session) -> String {
        let frame = engine.snapshot().frame;
        let thought = engine.think().map(|(decision, _)| format!("{decision:?}")).unwrap_or_default();
        let moment = engine.moment();
        let (world, told) = (moment.world.digest(), &moment.instruction);
        let sum: u64 = frame.rgb.iter().zip(1u64..).map(|(&value, at)| u64::from(value) * at).sum();
        format!(
            "{world} {told} {:?} {:?} {thought} {sum} {:?}",
            moment.grader,
            moment.horizon,
            engine.policy.as_ref().unwrap().state(0)
        )
    }

    #[test]
    fn going_back_and_forth_restores_everything_bit_for_bit() {
        for kind in [PolicyKind::Random, PolicyKind::Expert] {
            let mut engine = testing::engine();
            engine.choose(kind).unwrap();
            let mut states = vec![state(&mut engine)];
            while states.len() < 10 && engine.end().is_none() {
                engine.step().unwrap();
                states.push(state(&mut engine));
            }
            let last = states.len() - 1;
            for step in [last - 1, last / 3, last, 0, last / 2, 1, last - 1] {
                engine.seek(step as u32);
                assert_eq!(state(&mut engine), states[step], "{kind:?}, step {step}");
            }
            engine.seek(1);
            for wanted in &states[2..] {
                engine.step().unwrap();
                assert_eq!(&state(&mut engine), wanted, "the policy goes the same way again");
            }
            assert_eq!(engine.tree().branches().len(), 1, "and no branch began");
        }
    }

    #[test]
    fn another_action_instruction_seed_or_policy_forks() {
        let mut engine = testing::engine();
        engine.choose(PolicyKind::Random).unwrap();
        for _ in 0..4 {
            engine.step().unwrap();
        }
        engine.seek(1);
        let event = engine.act(Action::navigate(ActionType::LookDown)).unwrap();
        assert!(event.forked.unwrap().starts_with("b1: "));
        engine.switch(0).unwrap();
        engine.seek(2);
        engine.instruct("dance").unwrap();
        assert!(engine.step().unwrap().forked.unwrap().contains("told: Dance."));
        engine.switch(0).unwrap();
        engine.seek(1);
        assert!(engine.rollout.env.grader.is_some(), "the task is back where it applied");
        engine.reseed(77, false);
        assert!(engine.step().unwrap().forked.unwrap().starts_with("b3: "));
        engine.switch(0).unwrap();
        engine.seek(0);
        engine.choose(PolicyKind::Expert).unwrap();
        assert!(engine.step().unwrap().forked.is_some());
        assert_eq!(engine.tree().branches().len(), 5);
        let divergence = engine.divergence(0);
        assert_eq!(divergence.shared, 0);
    }

    #[test]
    fn a_typed_chain_is_graded_only_where_it_is_about_the_task() {
        let engine = testing::engine();
        let graded = |text: &str| engine.chain(text).unwrap().graded.is_some();
        assert!(graded("") && graded("take the mug; put it in the sink"));
        assert!(!graded("take the plate; open the fridge") && !graded("take the mug"));
    }
}
