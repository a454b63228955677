//! The episode under exploration, without any screen: house, task, policy, and the verbs that act on them. The worker
//! thread and the plain mode both drive it.

use std::sync::Arc;

use super::openings::{Opening, Openings};
use super::policies::{Policies, PolicyKind};
use crate::agent::{Decision, Policy};
use crate::domain::{Action, Cell, Scene, Task, World};
use crate::house::grading::{Grader, Grading, describe};
use crate::house::view::{Candidate, Frame, View};
use crate::house::{House, Outcome};
use crate::language::instruction;
use crate::run::rollout::{End, Rollout, Tick};

/// Everything that a screen shows of the present state.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Counts the episodes of this session, from 1.
    pub episode: u32,
    /// The floor plan.
    pub scene: Arc<Scene>,
    /// The seed of the house, or of the episode's chance.
    pub seed: u64,
    /// The state.
    pub world: World,
    /// What the agent sees.
    pub frame: Arc<Frame>,
    /// Which instances it sees.
    pub view: View,
    /// What could be done now, by action and distance.
    pub candidates: Vec<Candidate>,
    /// What the agent is told.
    pub instruction: String,
    /// How many steps were taken.
    pub step: u32,
    /// After how many it ends.
    pub horizon: Option<u32>,
    /// How many the expert takes for the task.
    pub expert_steps: Option<u32>,
    /// The task, where one applies.
    pub progress: Option<Progress>,
    /// Why the episode is over, if it is.
    pub end: Option<End>,
    /// Where the agent has been.
    pub path: Vec<Cell>,
    /// Which policy decides.
    pub policy: PolicyKind,
}

/// How far a task has come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Progress {
    /// What each subtask asks, in words.
    pub subtasks: Vec<String>,
    /// The step at which each completed subtask was.
    pub completed_at: Vec<u32>,
    /// What the current one waits for, in words.
    pub waits_for: String,
}

/// A step that was taken, for the log.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Which step, from 1.
    pub step: u32,
    /// What was done.
    pub action: String,
    /// What it came to.
    pub outcome: Outcome,
    /// A person chose it.
    pub by_hand: bool,
    /// The subtask that it completed.
    pub completed: Option<String>,
}

/// The episode under exploration.
pub struct Engine {
    openings: Openings,
    policies: Policies,
    kind: PolicyKind,
    policy: Option<Box<dyn Policy>>,
    rollout: Rollout,
    start: World,
    task: Option<Task>,
    limited: bool,
    seed: u64,
    episode: u32,
    path: Vec<Cell>,
    completed_at: Vec<u32>,
    decision: Option<Decision>,
    frame: Option<Arc<Frame>>,
}

impl Engine {
    /// Opens the first house. `instruction` replaces the task's own.
    ///
    /// # Errors
    /// When the house cannot be opened or the instruction is unfit.
    pub fn new(
        openings: Openings,
        policies: Policies,
        kind: PolicyKind,
        instruction: Option<&str>,
    ) -> anyhow::Result<Engine> {
        let opening = openings.open()?;
        let mut engine = Engine {
            policies,
            kind,
            policy: None,
            rollout: rollout_of(&opening),
            start: opening.world,
            seed: openings.seed(),
            openings,
            task: opening.task,
            limited: opening.limited,
            episode: 1,
            path: Vec::new(),
            completed_at: Vec::new(),
            decision: None,
            frame: None,
        };
        engine.path.push(engine.start.agent.cell);
        if let Some(text) = instruction {
            engine.instruct(text)?;
        }
        Ok(engine)
    }

    /// Loads the chosen policy; slow the first time for the agent.
    ///
    /// # Errors
    /// When it cannot be loaded; the one before stays.
    pub fn choose(&mut self, kind: PolicyKind) -> anyhow::Result<()> {
        let mut policy = self.policies.make(kind)?;
        policy.begin(self.seed);
        self.policy = Some(policy);
        self.kind = kind;
        self.decision = None;
        Ok(())
    }

    /// Which policy decides.
    pub fn policy(&self) -> PolicyKind {
        self.kind
    }

    /// Whether a policy is loaded.
    pub fn has_policy(&self) -> bool {
        self.policy.is_some()
    }

    /// What the policy would do now. Decided once a state, and again when the instruction or the policy changes.
    ///
    /// # Errors
    /// When the policy cannot go on, or none is loaded.
    pub fn think(&mut self) -> anyhow::Result<&Decision> {
        let decision = match self.decision.take() {
            Some(decision) => decision,
            None => {
                let policy = self.policy.as_deref_mut().ok_or_else(|| anyhow::anyhow!("no policy is loaded"))?;
                if self.kind == PolicyKind::Expert && self.rollout.grader.is_none() {
                    anyhow::bail!("the expert needs a task: it reads the subtasks, not the instruction");
                }
                self.rollout.decide(policy)?
            }
        };
        Ok(self.decision.insert(decision))
    }

    /// Takes one step by the policy's choice.
    ///
    /// # Errors
    /// When the policy cannot go on; nothing was done then.
    pub fn step(&mut self) -> anyhow::Result<Event> {
        let decision = self.think()?.clone();
        Ok(self.carry_out(decision, false))
    }

    /// Takes one step that a person chose.
    pub fn act(&mut self, action: Action) -> Event {
        self.carry_out(Decision { action, mind: None }, true)
    }

    fn carry_out(&mut self, decision: Decision, by_hand: bool) -> Event {
        let words = self.words(decision.action);
        let current = self.current_subtask();
        let Tick { step, outcome, completed_one, .. } = self.rollout.carry_out(decision);
        self.decision = None;
        if outcome.is_done() {
            self.frame = None;
        }
        let cell = self.rollout.house.world().agent.cell;
        if self.path.last() != Some(&cell) {
            self.path.push(cell);
        }
        if completed_one {
            self.completed_at.push(step);
        }
        Event { step, action: words, outcome, by_hand, completed: current.filter(|_| completed_one) }
    }

    fn current_subtask(&self) -> Option<String> {
        let grader = self.rollout.grader.as_ref()?;
        let subtask = grader.subtasks().get(grader.completed())?;
        Some(describe(grader.roles(), subtask))
    }

    /// An action with the name of its target.
    pub fn words(&self, action: Action) -> String {
        let house = &self.rollout.house;
        let class = action.target.and_then(|target| house.world().class_of(house.scene(), target));
        match class {
            Some(class) => format!("{} {}", action.kind, class.name()),
            None => action.kind.to_string(),
        }
    }

    /// Whether the episode is over, and why.
    pub fn end(&self) -> Option<End> {
        self.rollout.end()
    }

    /// Tells the agent something else, from the next step on; says what that means for the task.
    ///
    /// # Errors
    /// When the text is empty, too long, or holds control characters.
    pub fn instruct(&mut self, text: &str) -> anyhow::Result<&'static str> {
        let text = instruction::parse(text)?;
        self.rollout.instruction = text;
        self.decision = None;
        let asked = self.task.as_ref().is_some_and(|task| {
            instruction::normalise(&task.instruction) == instruction::normalise(&self.rollout.instruction)
        });
        Ok(match (self.rollout.grader.is_some(), asked) {
            (true, true) => "the task's own words",
            (true, false) => {
                self.rollout.grader = None;
                self.rollout.horizon = None;
                "the task no longer applies"
            }
            (false, true) => "the task's words again: reset to be graded",
            (false, false) => "applies from the next step",
        })
    }

    /// What the agent is told.
    pub fn instruction(&self) -> &str {
        &self.rollout.instruction
    }

    /// Puts the house back to its start, with the present instruction.
    pub fn reset(&mut self) {
        let instruction = std::mem::take(&mut self.rollout.instruction);
        let opening = Opening {
            scene: self.rollout.house.scene().clone(),
            world: self.start.clone(),
            task: self.task.take(),
            limited: self.limited,
        };
        self.enter(opening);
        if let Ok(words) = instruction::parse(&instruction) {
            // The text was checked when it came in.
            let _ = self.instruct(&words);
        }
    }

    /// Opens the next house, or the next task of the set.
    ///
    /// # Errors
    /// When it cannot be opened; the present one stays.
    pub fn next_episode(&mut self) -> anyhow::Result<()> {
        self.openings.advance();
        self.enter_opened()
    }

    /// Opens the house of another seed.
    ///
    /// # Errors
    /// When it cannot be opened; the present one stays.
    pub fn seed(&mut self, seed: u64) -> anyhow::Result<()> {
        self.openings.seek(seed);
        self.enter_opened()
    }

    fn enter_opened(&mut self) -> anyhow::Result<()> {
        let opening = self.openings.open()?;
        self.seed = self.openings.seed();
        self.start = opening.world.clone();
        self.enter(opening);
        Ok(())
    }

    fn enter(&mut self, opening: Opening) {
        self.rollout = rollout_of(&opening);
        self.task = opening.task;
        self.limited = opening.limited;
        self.episode += 1;
        self.path = vec![opening.world.agent.cell];
        self.completed_at.clear();
        self.decision = None;
        self.frame = None;
        if let Some(policy) = &mut self.policy {
            policy.begin(self.seed);
        }
    }

    /// How far the task has come, where one applies.
    pub fn progress(&self) -> Option<Progress> {
        let (grader, house) = (self.rollout.grader.as_ref()?, &self.rollout.house);
        Some(Progress {
            subtasks: grader.subtasks().iter().map(|subtask| describe(grader.roles(), subtask)).collect(),
            completed_at: self.completed_at.clone(),
            waits_for: grader.waits_for(house.scene(), house.world()),
        })
    }

    /// The present state for a screen; draws the frame when it changed.
    pub fn snapshot(&mut self) -> Snapshot {
        let candidates = self.rollout.house.candidates();
        let frame = match &self.frame {
            Some(frame) => frame.clone(),
            None => self.frame.insert(Arc::new(self.rollout.house.frame().clone())).clone(),
        };
        let view = self.rollout.house.view().clone();
        let progress = self.progress();
        let house = &self.rollout.house;
        Snapshot {
            episode: self.episode,
            scene: house.scene().clone(),
            seed: self.seed,
            world: house.world().clone(),
            frame,
            view,
            candidates,
            instruction: self.rollout.instruction.clone(),
            step: self.rollout.steps(),
            horizon: self.rollout.horizon,
            expert_steps: self.task.as_ref().filter(|_| self.rollout.grader.is_some()).map(|task| task.expert_steps),
            progress,
            end: self.rollout.end(),
            path: self.path.clone(),
            policy: self.kind,
        }
    }
}

fn rollout_of(opening: &Opening) -> Rollout {
    let house = House::new(opening.scene.clone(), opening.world.clone());
    match &opening.task {
        Some(task) => {
            let grader = Grader::new(Grading::Class, &task.roles, &task.subtasks, task.goal.as_ref());
            Rollout::new(house, task.instruction.clone(), Some(grader), opening.limited.then_some(task.horizon))
        }
        None => Rollout::new(house, "look around".into(), None, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::ActionType;
    use crate::tui::testing;

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
        let first = engine.think().unwrap().action;
        assert_eq!(engine.think().unwrap().action, first);
        let words = engine.words(first);
        assert_eq!(engine.step().unwrap().action, words);
    }

    #[test]
    fn a_reset_brings_back_the_world_and_the_path_begins_anew() {
        let mut engine = testing::engine();
        let start = engine.snapshot();
        engine.act(Action::navigate(ActionType::MoveAhead));
        engine.act(Action::navigate(ActionType::RotateLeft));
        assert_eq!(engine.snapshot().step, 2);
        engine.reset();
        let again = engine.snapshot();
        assert_eq!((again.world, again.step, again.path.len()), (start.world, 0, 1));
        assert_eq!(again.episode, 2);
    }
}
