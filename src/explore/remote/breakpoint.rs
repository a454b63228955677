//! Conditions at which a run in an environment with actions of its own stops.

use std::fmt;

use super::tree::State;

/// When to stop.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum RemoteCondition {
    /// A part of what is asked was done.
    Subtask,
    /// A step earned something.
    Reward,
    /// The environment refused an action.
    Refused,
    /// An action of that name was taken.
    Action(String),
    /// A thing of that name is in view.
    Sees(String),
    /// That step was reached.
    Step(u32),
}

impl RemoteCondition {
    /// Reads `subtask`, `reward`, `refused`, `action open`, `sees door` or `step 12`.
    ///
    /// # Errors
    /// Says what conditions there are.
    pub(crate) fn parse(text: &str) -> Result<RemoteCondition, String> {
        let (word, rest) = text.trim().split_once(' ').map_or((text.trim(), ""), |(word, rest)| (word, rest.trim()));
        match (word, rest) {
            ("subtask", "") => Ok(RemoteCondition::Subtask),
            ("reward", "") => Ok(RemoteCondition::Reward),
            ("refused", "") => Ok(RemoteCondition::Refused),
            ("action", name) if !name.is_empty() => Ok(RemoteCondition::Action(name.into())),
            ("sees", name) if !name.is_empty() => Ok(RemoteCondition::Sees(name.into())),
            ("step", number) if number.parse::<u32>().is_ok() => Ok(RemoteCondition::Step(number.parse().unwrap_or(0))),
            _ => Err(format!("{text:?} is none of subtask, reward, refused, action NAME, sees NAME, step N")),
        }
    }

    /// Whether a run stops in that state.
    pub(crate) fn holds(&self, state: &State) -> bool {
        let Some(taken) = &state.taken else { return false };
        let record = &taken.record;
        match self {
            RemoteCondition::Subtask => record.subtask.is_some(),
            RemoteCondition::Reward => state.observation.reward.is_some_and(|reward| reward != 0.0),
            RemoteCondition::Refused => !record.outcome.is_done(),
            RemoteCondition::Action(name) => record.own.as_ref().is_some_and(|own| own.action == *name),
            RemoteCondition::Sees(name) => {
                let name = name.to_lowercase();
                state.observation.things.iter().any(|thing| thing.name.to_lowercase().contains(&name))
            }
            RemoteCondition::Step(step) => state.step == *step,
        }
    }
}

impl fmt::Display for RemoteCondition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RemoteCondition::Subtask => f.write_str("subtask"),
            RemoteCondition::Reward => f.write_str("reward"),
            RemoteCondition::Refused => f.write_str("refused"),
            RemoteCondition::Action(name) => write!(f, "action {name}"),
            RemoteCondition::Sees(name) => write!(f, "sees {name}"),
            RemoteCondition::Step(step) => write!(f, "step {step}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_condition_reads_as_it_is_written_and_others_are_refused() {
        for text in ["subtask", "reward", "refused", "action open", "sees red ball", "step 12"] {
            assert_eq!(RemoteCondition::parse(text).unwrap().to_string(), text);
        }
        for text in ["", "step", "step x", "action", "drop 0.1"] {
            assert!(RemoteCondition::parse(text).unwrap_err().contains("action NAME"), "{text}");
        }
    }
}
