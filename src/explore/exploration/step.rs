//! What the policy would do, and the steps that are taken.

use super::{Exploration, TaskProgress};
use crate::agent::registry::PolicyKind;
use crate::agent::{ActionDistribution, Decision, Values};
use crate::domain::Action;
use crate::episode::branches::{Growth, TakenStep};
use crate::episode::record::{Author, TraceStep};
use crate::episode::rollout::Tick;
use crate::episode::wish::WishVerdict;
use crate::house::Outcome;
use crate::house::grading::describe;

/// A step that was taken, in words.
#[derive(Clone, Debug, PartialEq)]
pub struct StepTaken {
    /// Which step, from 1.
    pub(crate) step: u32,
    /// What was done.
    pub(crate) action: String,
    /// What it came to.
    pub(crate) outcome: Outcome,
    /// A person chose it.
    pub(crate) by_hand: bool,
    /// The subtask that it completed.
    pub(crate) completed: Option<String>,
    /// The branch that it began, by name and why.
    pub(crate) forked: Option<String>,
    /// What the policy weighed, where it chose.
    pub(crate) distribution: Option<ActionDistribution>,
    /// How far the task is after it, where one applies.
    pub(crate) progress: Option<TaskProgress>,
    /// What the wish came to, if it is over after it.
    pub(crate) end: Option<WishVerdict>,
}

impl Exploration {
    /// What the policy would do now. Decided once a state, and again when the instruction or the policy changes.
    ///
    /// # Errors
    /// When the policy cannot go on, or none is loaded.
    pub(crate) fn decide(&mut self) -> anyhow::Result<&(Decision, Option<Values>)> {
        let decided = match self.acting.decision.take() {
            Some(decided) => decided,
            None => {
                let policy = self.acting.policy.as_deref_mut().ok_or_else(|| anyhow::anyhow!("no policy is loaded"))?;
                if self.acting.kind == PolicyKind::Expert && self.rollout.env.grader.is_none() {
                    anyhow::bail!("the expert needs a task: it reads the subtasks, not the instruction");
                }
                let decision = self.rollout.decide(policy)?;
                let values = self.rollout.values(policy, &decision)?;
                self.hear(&decision);
                (decision, values)
            }
        };
        Ok(self.acting.decision.insert(decided))
    }

    /// Takes one step by the policy's choice.
    ///
    /// # Errors
    /// When the policy cannot go on; nothing was done then.
    pub fn step(&mut self) -> anyhow::Result<StepTaken> {
        anyhow::ensure!(!self.tree.is_full(), "no more steps are remembered in this episode: N opens the next one");
        let decision = self.decide()?.0.clone();
        self.carry_out(decision, self.acting.author.clone())
    }

    /// Takes one step that a person chose. The policy sees that state too, so that it has seen every frame.
    pub(crate) fn act(&mut self, action: Action) -> anyhow::Result<StepTaken> {
        let _ = self.decide();
        self.carry_out(Decision::of(action), Author::hand())
    }

    pub(crate) fn carry_out(&mut self, decision: Decision, author: Author) -> anyhow::Result<StepTaken> {
        let words = self.words(decision.action);
        let current = self.current_subtask();
        let (weighed, values) = self.acting.decision.take().unzip();
        let values = values.flatten();
        let tick = self.rollout.carry_out(decision.clone())?;
        let (distribution, done) = weighed.map_or((None, None), |weighed| (weighed.distribution, weighed.done));
        let taken = TakenStep {
            decision: Decision {
                distribution: decision.distribution.or(distribution),
                done: decision.done.or(done),
                ..decision
            },
            step: TraceStep::of(&tick, &self.rollout),
            instruction: self.rollout.instruction.as_str().into(),
            wish: self.wishes.last().cloned(),
            author,
            values,
        };
        let Tick { step, outcome, completed_one, .. } = tick;
        self.frames.present = None;
        self.acting.redirected = false;
        let by_hand = taken.author.is_hand();
        let distribution = taken.decision.distribution.clone().filter(|_| !by_hand);
        let why = self.why(&taken, &words);
        let beside = self.grade_beside(taken.decision.action, outcome);
        self.count_step(taken.decision.action);
        let moment = self.saved_state();
        let growth = self.tree.grow(taken, || moment, || why);
        if growth == Growth::Known {
            self.tree.saved_state().restore(&mut self.rollout, step);
            self.wishes.clone_from(&self.tree.saved_state().wishes);
            self.task_aside.clone_from(&self.tree.saved_state().task_aside);
        }
        let forked = match growth {
            Growth::Forked(branch) => self.tree.branches().get(branch).map(|b| format!("{}: {}", b.name, b.why)),
            Growth::Longer | Growth::Known => None,
        };
        Ok(StepTaken {
            step,
            action: words,
            outcome,
            by_hand,
            completed: current.filter(|_| completed_one).or(beside),
            forked,
            distribution,
            progress: self.progress(),
            end: self.end(),
        })
    }

    /// What is new about a step that is not the one which is there already.
    fn why(&self, taken: &TakenStep, words: &str) -> String {
        let Some(next) = self.tree.next() else { return "went on".into() };
        let another = match (&next.wish, &taken.wish) {
            (Some(next), Some(taken)) => !next.is_same(taken),
            _ => next.instruction != taken.instruction,
        };
        if another {
            format!("instruction: {}", taken.instruction)
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
    pub(crate) fn words(&self, action: Action) -> String {
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
