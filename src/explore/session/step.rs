//! What the policy would do, and the steps that are taken.

use super::Session;
use crate::agent::registry::PolicyKind;
use crate::agent::{Decision, Values};
use crate::domain::Action;
use crate::episode::branches::{Growth, Taken};
use crate::episode::record::{Author, TraceStep};
use crate::episode::rollout::Tick;
use crate::house::Outcome;
use crate::house::grading::describe;

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
    /// The branch that it began, by name and why.
    pub forked: Option<String>,
}

impl Session {
    /// What the policy would do now. Decided once a state, and again when the instruction or the policy changes.
    ///
    /// # Errors
    /// When the policy cannot go on, or none is loaded.
    pub fn think(&mut self) -> anyhow::Result<&(Decision, Option<Values>)> {
        let thought = match self.decision.take() {
            Some(thought) => thought,
            None => {
                let policy = self.policy.as_deref_mut().ok_or_else(|| anyhow::anyhow!("no policy is loaded"))?;
                if self.kind == PolicyKind::Expert && self.rollout.env.grader.is_none() {
                    anyhow::bail!("the expert needs a task: it reads the subtasks, not the instruction");
                }
                let decision = self.rollout.decide(policy)?;
                let values = self.rollout.values(policy, &decision)?;
                (decision, values)
            }
        };
        Ok(self.decision.insert(thought))
    }

    /// Takes one step by the policy's choice.
    ///
    /// # Errors
    /// When the policy cannot go on; nothing was done then.
    pub fn step(&mut self) -> anyhow::Result<Event> {
        anyhow::ensure!(!self.tree.is_full(), "no more steps are remembered in this episode: N opens the next one");
        let decision = self.think()?.0.clone();
        self.carry_out(decision, self.author.clone())
    }

    /// Takes one step that a person chose. The policy sees that state too, so that it has seen every frame.
    pub fn act(&mut self, action: Action) -> anyhow::Result<Event> {
        let _ = self.think();
        self.carry_out(Decision::of(action), Author::hand())
    }

    pub(crate) fn carry_out(&mut self, decision: Decision, author: Author) -> anyhow::Result<Event> {
        let words = self.words(decision.action);
        let current = self.current_subtask();
        let (thought, values) = self.decision.take().unzip();
        let values = values.flatten();
        let tick = self.rollout.carry_out(decision.clone())?;
        let taken = Taken {
            decision: Decision {
                distribution: decision.distribution.or(thought.and_then(|thought| thought.distribution)),
                ..decision
            },
            step: TraceStep::of(&tick, &self.rollout),
            instruction: self.rollout.instruction.as_str().into(),
            author,
            values,
        };
        let Tick { step, outcome, completed_one, .. } = tick;
        self.frame = None;
        let by_hand = taken.author.is_hand();
        let why = self.why(&taken, &words);
        let moment = self.moment();
        let growth = self.tree.grow(taken, || moment, || why);
        if growth == Growth::Known {
            self.tree.moment().restore(&mut self.rollout, step);
        }
        let forked = match growth {
            Growth::Forked(branch) => self.tree.branches().get(branch).map(|b| format!("{}: {}", b.name, b.why)),
            Growth::Longer | Growth::Known => None,
        };
        Ok(Event { step, action: words, outcome, by_hand, completed: current.filter(|_| completed_one), forked })
    }

    /// What is new about a step that is not the one which is there already.
    fn why(&self, taken: &Taken, words: &str) -> String {
        let Some(next) = self.tree.next() else { return "went on".into() };
        if next.instruction != taken.instruction {
            format!("told: {}", taken.instruction)
        } else if next.decision.action != taken.decision.action {
            format!("{words} ({})", who(&taken.author))
        } else {
            format!("{} acts", who(&taken.author))
        }
    }

    fn current_subtask(&self) -> Option<String> {
        let grader = self.rollout.env.grader.as_ref()?;
        let subtask = grader.subtasks().get(grader.completed())?;
        Some(describe(grader.roles(), subtask))
    }

    /// An action with the name of its target.
    pub fn words(&self, action: Action) -> String {
        let house = &self.rollout.env.house;
        let class = action.target.and_then(|target| house.world().class_of(house.scene(), target));
        match class {
            Some(class) => format!("{} {}", action.kind, class.name()),
            None => action.kind.to_string(),
        }
    }
}

/// Who chose, in a few words.
fn who(author: &Author) -> String {
    match (author.is_hand(), author.sampling) {
        (true, _) => "you".into(),
        (false, true) => format!("{}, drawn with seed {}", author.policy, author.seed),
        (false, false) => author.policy.clone(),
    }
}
