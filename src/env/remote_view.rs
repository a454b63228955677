//! What an environment with actions of its own shows and lets an agent do.

use std::sync::Arc;

use super::action_space::{ActionSpace, ArgumentList};
use super::observation::{Legal, RemoteObservation};
use crate::domain::Action;

/// What an environment with actions of its own shows now, and what can be done in it.
pub(crate) struct RemoteView<'a> {
    /// Everything that can ever be done.
    pub(crate) space: &'a Arc<ActionSpace>,
    /// The present state.
    pub(crate) observation: &'a RemoteObservation,
}

/// An action that is possible now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Possible {
    /// Its place in the action space.
    pub(crate) action: u16,
    /// Without an argument, `None`; else what can be done, an argument each.
    pub(crate) with: Option<Vec<Action>>,
}

impl Possible {
    /// Everything that can be done with it.
    pub(crate) fn actions(&self) -> Vec<Action> {
        self.with.clone().unwrap_or_else(|| vec![Action::own(self.action, None)])
    }
}

impl RemoteView<'_> {
    /// What is asked, in one line; empty where the environment does not say.
    pub(crate) fn mission(&self) -> String {
        let mission = self.observation.mission.as_deref().unwrap_or_default();
        mission.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Everything that is possible now; all that is known where the environment does not say.
    pub(crate) fn possible(&self) -> Vec<Possible> {
        let mut found = Vec::new();
        for (place, action) in self.space.actions().iter().enumerate() {
            let legal = self.observation.legal.as_ref().and_then(|legal| legal.get(place));
            let listed = self.space.list(place).map(ArgumentList::values);
            let values = match (legal, listed) {
                (Some(Legal::Whole(false)), _) => continue,
                (_, None) => {
                    found.push(Possible { action: place as u16, with: None });
                    continue;
                }
                (Some(Legal::With(values)), Some(_)) => values.clone(),
                (_, Some(values)) => values,
            };
            let with: Vec<Action> =
                values.iter().filter_map(|value| self.space.find(&action.name, Some(value)).ok()).collect();
            if !with.is_empty() {
                found.push(Possible { action: place as u16, with: Some(with) });
            }
        }
        found
    }
}
