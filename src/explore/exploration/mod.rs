//! The episode under exploration, without any screen: house, task, policy, everything that was tried, and what can be done
//! with them. It tells nobody; [`super::session::Session`] drives it and tells what happens.

mod autosave;
mod open;
mod policy;
mod queries;
mod save;
mod snapshot;
mod state;
mod step;
mod time;
mod wishes;

pub(crate) use snapshot::{SessionSnapshot, TaskProgress};
pub(crate) use state::Unsaved;
pub(crate) use step::StepTaken;

use std::sync::Arc;

use super::episode_source::EpisodeSource;
use crate::agent::PolicyState;
use crate::agent::policy_place::PolicyPlace;
use crate::agent::registry::{Policies, PolicyKind};
use crate::domain::Task;
use crate::episode::branches::{SavedState, Tree};
use crate::episode::record::Author;
use crate::episode::rollout::Rollout;
use crate::episode::wish::{Expect, WishVerdict, Wishes};
use crate::house::grading::Grader;
use state::{ActingPolicy, Autosave, CurrentEpisode, Frames};

/// The episode under exploration.
pub struct Exploration {
    source: EpisodeSource,
    policies: Policies,
    checkpoints: Arc<Vec<String>>,
    episode: CurrentEpisode,
    acting: ActingPolicy,
    /// Where policies are that acted and are none of the program's own.
    places: Vec<PolicyPlace>,
    rollout: Rollout,
    tree: Tree,
    frames: Frames,
    /// What is made of typed wishes.
    expect: Expect,
    /// What was told on the way to the present state.
    wishes: Wishes,
    /// How many wishes were typed in this episode.
    told: u32,
    /// How much of what was tried and told is in a run folder.
    saved: Unsaved,
    autosave: Autosave,
    /// Grades the task on while something else was told: a deed counts under whatever words it was done.
    task_aside: Option<Grader>,
}

impl Exploration {
    /// Opens the first house. `instruction` replaces the task's own.
    ///
    /// # Errors
    /// When the house cannot be opened or the instruction is unfit.
    pub fn new(
        source: EpisodeSource,
        policies: Policies,
        kind: PolicyKind,
        instruction: Option<&str>,
    ) -> anyhow::Result<Exploration> {
        let start = source.open()?;
        let rollout = start.rollout();
        let author = Author::of(kind.name(), source.seed());
        let mut exploration = Exploration {
            checkpoints: Arc::new(policies.agents()),
            policies,
            tree: Tree::new(SavedState::of(&rollout, &author, PolicyState::Nothing)),
            acting: ActingPolicy { kind, policy: None, author, decision: None, redirected: false },
            places: Vec::new(),
            rollout,
            episode: CurrentEpisode {
                number: 1,
                seed: source.seed(),
                task: start.task,
                reference: start.reference,
                limited: start.limited,
                examples: Arc::default(),
            },
            source,
            frames: Frames::default(),
            expect: Expect::default(),
            wishes: Wishes::new(),
            told: 0,
            saved: Unsaved::default(),
            autosave: Autosave::default(),
            task_aside: None,
        };
        exploration.begin_wishes();
        if let Some(text) = instruction {
            exploration.instruct(text)?;
            exploration.make_start();
        }
        exploration.count_as_saved();
        Ok(exploration)
    }

    /// Reads typed wishes, or leaves them to a person's judgement.
    ///
    /// # Errors
    /// When the instruction is unfit.
    pub(crate) fn expecting(mut self, expect: Expect, instruction: Option<&str>) -> anyhow::Result<Exploration> {
        self.expect = expect;
        self.begin_wishes();
        if let Some(text) = instruction {
            self.instruct(text)?;
            self.make_start();
        }
        self.count_as_saved();
        Ok(self)
    }

    /// What is made of wishes that are typed from now on.
    pub(crate) fn reading_as(self, expect: Expect) -> Exploration {
        Exploration { expect, ..self }
    }

    /// The present state becomes the start, while nothing was tried.
    fn make_start(&mut self) {
        self.tree.begin_with(self.saved_state());
    }

    fn saved_state(&self) -> SavedState {
        let carried = self.acting.policy.as_ref().map_or(PolicyState::Nothing, |policy| policy.state(0));
        let (wishes, task_aside) = (self.wishes.clone(), self.task_aside.clone());
        SavedState { wishes, task_aside, ..SavedState::of(&self.rollout, &self.acting.author, carried) }
    }

    /// Whether the wish in force is over, and how.
    pub fn end(&self) -> Option<WishVerdict> {
        self.wishes.last().and_then(|wish| wish.verdict)
    }

    /// What the agent is told.
    pub(crate) fn instruction(&self) -> &str {
        &self.rollout.instruction
    }

    /// The task of this episode, whether it still applies or not.
    pub fn task(&self) -> Option<&Task> {
        self.episode.task.as_ref()
    }

    /// House, grader and instruction in the present state.
    pub(crate) fn rollout(&self) -> &Rollout {
        &self.rollout
    }

    /// Everything that was tried.
    pub(crate) fn tree(&self) -> &Tree {
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
        let mut exploration = testing::exploration();
        let words = exploration.instruction().to_string();
        assert_eq!(exploration.instruct("open the fridge").unwrap(), "the task is graded on beside it");
        assert!(exploration.progress().is_none());
        exploration.reset();
        assert_eq!(exploration.instruction(), "Open the fridge.", "a reset keeps what was typed");
        assert!(exploration.progress().is_none());
        assert!(exploration.instruct(&words.to_uppercase()).unwrap().contains("reset"));
        exploration.reset();
        assert_eq!(exploration.progress().unwrap().subtasks.len(), 2);
    }

    #[test]
    fn the_task_is_graded_on_whatever_the_agent_is_told_and_in_every_state_anew() {
        let mut exploration = testing::exploration();
        exploration.choose(PolicyKind::Expert).unwrap();
        assert_eq!(exploration.task_beside(), None, "it is the wish in force");
        exploration.instruct("pick up the mug").unwrap();
        assert_eq!(exploration.task_beside(), Some((0, 2)));
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        let mut credited = None;
        while exploration.end().is_none() {
            credited = exploration.step().unwrap().completed;
        }
        assert_eq!(exploration.task_beside(), Some((1, 2)), "what was done under other words counts");
        assert_eq!(credited.as_deref(), Some("pick up the mug"));
        let done_at = exploration.tree().at();
        exploration.instruct("dance").unwrap();
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        assert_eq!(exploration.task_beside(), Some((1, 2)));
        exploration.seek(1);
        assert_eq!(exploration.task_beside(), Some((0, 2)));
        exploration.seek(done_at);
        assert_eq!(exploration.task_beside(), Some((1, 2)));
        exploration.reset();
        assert_eq!(exploration.instruction(), "Pick up the mug.");
        assert_eq!(exploration.task_beside(), Some((0, 2)));
    }

    #[test]
    fn the_expert_without_a_task_says_so_and_solves_one() {
        let mut exploration = testing::exploration();
        exploration.choose(PolicyKind::Expert).unwrap();
        for _ in 0..48 {
            exploration.step().unwrap();
            if exploration.end().is_some() {
                break;
            }
        }
        assert_eq!(exploration.end(), Some(WishVerdict::Done));
        assert_eq!(exploration.progress().unwrap().completed_at.len(), 2);
        exploration.reset();
        exploration.instruct("dance").unwrap();
        assert!(exploration.decide().unwrap_err().to_string().contains("the expert needs a task"));
    }

    #[test]
    fn unfit_instructions_change_nothing() {
        let mut exploration = testing::exploration();
        let words = exploration.instruction().to_string();
        for text in ["", "   ", "open\x1b[2J the door", &"word ".repeat(2_000)] {
            assert!(exploration.instruct(text).is_err(), "{text:.20}");
        }
        assert_eq!(exploration.instruction(), words);
        assert!(exploration.progress().is_some());
    }

    #[test]
    fn a_state_is_decided_once_and_the_decision_is_what_happens() {
        let mut exploration = testing::exploration();
        exploration.choose(PolicyKind::Random).unwrap();
        let first = exploration.decide().unwrap().0.action;
        assert_eq!(exploration.decide().unwrap().0.action, first);
        let words = exploration.words(first);
        assert_eq!(exploration.step().unwrap().action, words);
    }

    #[test]
    fn a_reset_brings_back_the_world_and_the_path_begins_anew() {
        let mut exploration = testing::exploration();
        let start = exploration.snapshot();
        exploration.act(Action::navigate(ActionType::MoveAhead)).unwrap();
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        assert_eq!(exploration.snapshot().step, 2);
        exploration.reset();
        let again = exploration.snapshot();
        assert_eq!((again.world, again.step, again.path.len()), (start.world, 0, 1));
        assert_eq!((again.episode, again.time.steps.len()), (1, 2), "what was tried stays");
    }

    /// Everything that decides what comes next, as text.
    fn state(exploration: &mut Exploration) -> String {
        let frame = exploration.snapshot().frame;
        let decided = exploration.decide().map(|(decision, _)| format!("{decision:?}")).unwrap_or_default();
        let moment = exploration.saved_state();
        let (world, told) = (moment.world.digest(), &moment.instruction);
        let sum: u64 = frame.rgb.iter().zip(1u64..).map(|(&value, at)| u64::from(value) * at).sum();
        format!(
            "{world} {told} {:?} {:?} {decided} {sum} {:?}",
            moment.grader,
            moment.horizon,
            exploration.acting.policy.as_ref().unwrap().state(0)
        )
    }

    #[test]
    fn going_back_and_forth_restores_everything_bit_for_bit() {
        for kind in [PolicyKind::Random, PolicyKind::Expert] {
            let mut exploration = testing::exploration();
            exploration.choose(kind).unwrap();
            let mut states = vec![state(&mut exploration)];
            while states.len() < 10 && exploration.end().is_none() {
                exploration.step().unwrap();
                states.push(state(&mut exploration));
            }
            let last = states.len() - 1;
            for step in [last - 1, last / 3, last, 0, last / 2, 1, last - 1] {
                exploration.seek(step as u32);
                assert_eq!(state(&mut exploration), states[step], "{kind:?}, step {step}");
            }
            exploration.seek(1);
            for wanted in &states[2..] {
                exploration.step().unwrap();
                assert_eq!(&state(&mut exploration), wanted, "the policy goes the same way again");
            }
            assert_eq!(exploration.tree().branches().len(), 1, "and no branch began");
        }
    }

    #[test]
    fn another_action_instruction_seed_or_policy_forks() {
        let mut exploration = testing::exploration();
        exploration.choose(PolicyKind::Random).unwrap();
        for _ in 0..4 {
            exploration.step().unwrap();
        }
        exploration.seek(1);
        let event = exploration.act(Action::navigate(ActionType::LookDown)).unwrap();
        assert!(event.forked.unwrap().starts_with("b1: "));
        exploration.switch(0).unwrap();
        exploration.seek(2);
        exploration.instruct("dance").unwrap();
        assert!(exploration.step().unwrap().forked.unwrap().contains("instruction: Dance."));
        exploration.switch(0).unwrap();
        exploration.seek(1);
        assert!(exploration.rollout.env.grader.is_some(), "the task is back where it applied");
        exploration.reseed(77, false);
        assert!(exploration.step().unwrap().forked.unwrap().starts_with("b3: "));
        exploration.switch(0).unwrap();
        exploration.seek(0);
        exploration.choose(PolicyKind::Expert).unwrap();
        assert!(exploration.step().unwrap().forked.is_some());
        assert_eq!(exploration.tree().branches().len(), 5);
        let divergence = exploration.divergence(0);
        assert_eq!(divergence.shared, 0);
    }

    #[test]
    fn a_typed_chain_is_graded_only_where_it_is_about_the_task() {
        let exploration = testing::exploration();
        let graded = |text: &str| exploration.chain(text).unwrap().graded.is_some();
        assert!(graded("") && graded("take the mug; put it in the sink"));
        assert!(!graded("take the plate; open the fridge") && !graded("take the mug"));
    }
}
