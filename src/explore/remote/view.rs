//! What a screen shows of an exploration in an environment with actions of its own.

use std::sync::Arc;

use super::exploration::{RemoteExploration, RemoteStepTaken};
use crate::agent::Decision;
use crate::domain::Action;
use crate::env::observation::RemoteObservation;

/// One thing that can be done.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RemoteChoice {
    /// The action.
    pub(crate) action: Action,
    /// In words.
    pub(crate) words: String,
    /// How likely the policy does it; nothing where it does not say.
    pub(crate) probability: Option<f32>,
    /// It is what the policy would do.
    pub(crate) is_chosen: bool,
}

/// Everything that is shown.
#[derive(Clone, Debug)]
pub(crate) struct RemotePicture {
    pub(crate) name: String,
    pub(crate) seed: u64,
    pub(crate) instruction: String,
    /// The instruction is not what the environment asks.
    pub(crate) is_told: bool,
    pub(crate) observation: Arc<RemoteObservation>,
    pub(crate) step: u32,
    pub(crate) length: u32,
    /// Name, place from 1, and number of the branches.
    pub(crate) branch: (String, usize, usize),
    pub(crate) choices: Vec<RemoteChoice>,
    /// Why nothing was decided here.
    pub(crate) undecided: Option<String>,
    pub(crate) taken: Option<RemoteStepTaken>,
    pub(crate) earned: f64,
    pub(crate) end: Option<&'static str>,
    pub(crate) exactness: String,
    pub(crate) policy: String,
    pub(crate) conditions: Vec<String>,
    /// Steps that no run folder holds.
    pub(crate) unsaved: usize,
    /// What is worth seeing of each step of the branch in hand.
    pub(crate) marks: Vec<StepMark>,
}

/// What is worth seeing of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StepMark {
    /// Nothing.
    Plain,
    /// The environment refused it.
    Refused,
    /// It earned something.
    Earned,
    /// A part of what is asked was done by it.
    Done,
}

impl RemoteExploration {
    /// Everything that is shown now. What the policy would do is asked, which may take its time.
    pub(crate) fn picture(&mut self) -> RemotePicture {
        let decided = match self.end() {
            None => self.decide().cloned().map(Some).map_err(|error| format!("{error:#}")),
            Some(_) => Ok(None),
        };
        let choices = self.choices(decided.as_ref().ok().and_then(Option::as_ref));
        let tree = self.tree();
        let (at, many) = (tree.branch(), tree.branches().len());
        let mark = |state: usize| {
            let state = tree.state(state);
            let record = &state.taken.as_ref()?.record;
            Some(match () {
                () if record.subtask.is_some() => StepMark::Done,
                () if !record.outcome.is_done() => StepMark::Refused,
                () if state.observation.reward.is_some_and(|reward| reward != 0.0) => StepMark::Earned,
                () => StepMark::Plain,
            })
        };
        RemotePicture {
            marks: tree.story().into_iter().filter_map(mark).collect(),
            unsaved: self.unsaved(),
            name: self.name().to_string(),
            seed: self.seed(),
            instruction: self.instruction().to_owned(),
            is_told: self.instruction() != self.mission(),
            observation: tree.present().observation.clone(),
            step: tree.present().step,
            length: tree.length(),
            branch: (tree.branches()[at].name.clone(), at + 1, many),
            undecided: decided.err(),
            choices,
            taken: self.told_of_present(),
            earned: tree.present().earned,
            end: self.end(),
            exactness: self.exactness(),
            policy: self.policy().to_owned(),
            conditions: self.conditions.iter().map(ToString::to_string).collect(),
        }
    }

    /// Everything that can be done here, the likeliest first.
    pub(crate) fn choices(&self, decided: Option<&Decision>) -> Vec<RemoteChoice> {
        let shares = decided.and_then(|decision| decision.own.as_ref());
        let share = |action: Action| shares?.iter().find(|(other, _)| *other == action).map(|(_, share)| *share);
        let choice = |action: Action| RemoteChoice {
            action,
            words: self.words(action),
            probability: share(action),
            is_chosen: decided.is_some_and(|decision| decision.action == action),
        };
        let mut choices: Vec<RemoteChoice> = self.possible().into_iter().map(choice).collect();
        let chosen = decided.map(|decision| decision.action);
        // What a policy chooses may not be listed where any text can be said.
        if let Some(chosen) = chosen.filter(|chosen| !choices.iter().any(|choice| choice.action == *chosen)) {
            choices.push(choice(chosen));
        }
        choices.sort_by(|a, b| b.probability.unwrap_or(0.0).total_cmp(&a.probability.unwrap_or(0.0)));
        choices
    }

    /// What the policy would do here told one thing and another: each with its choices.
    ///
    /// # Errors
    /// When the environment or the policy fails.
    pub(crate) fn compared(&mut self, other: &str) -> anyhow::Result<[(String, Vec<RemoteChoice>); 2]> {
        let told = self.instruction().to_owned();
        let other = crate::language::instruction::parse(other)?;
        let first = self.decision_when_told(&told)?;
        let second = self.decision_when_told(&other)?;
        Ok([(told, self.choices(Some(&first))), (other, self.choices(Some(&second)))])
    }
}
