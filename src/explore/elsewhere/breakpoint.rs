//! Conditions at which a run in an environment with actions of its own stops.

use std::fmt;

use super::tree::State;

/// When to stop.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum OwnCondition {
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

impl OwnCondition {
    /// Reads `subtask`, `reward`, `refused`, `action open`, `sees door` or `step 12`.
    ///
    /// # Errors
    /// Says what conditions there are.
    pub(crate) fn parse(text: &str) -> Result<OwnCondition, String> {
        let (word, rest) = text.trim().split_once(' ').map_or((text.trim(), ""), |(word, rest)| (word, rest.trim()));
        match (word, rest) {
            ("subtask", "") => Ok(OwnCondition::Subtask),
            ("reward", "") => Ok(OwnCondition::Reward),
            ("refused", "") => Ok(OwnCondition::Refused),
            ("action", name) if !name.is_empty() => Ok(OwnCondition::Action(name.into())),
            ("sees", name) if !name.is_empty() => Ok(OwnCondition::Sees(name.into())),
            ("step", number) if number.parse::<u32>().is_ok() => Ok(OwnCondition::Step(number.parse().unwrap_or(0))),
            _ => Err(format!("{text:?} is none of subtask, reward, refused, action NAME, sees NAME, step N")),
        }
    }

    /// Whether a run stops in that state.
    pub(crate) fn holds(&self, state: &State) -> bool {
        let Some(taken) = &state.taken else { return false };
        let record = &taken.record;
        match self {
            OwnCondition::Subtask => record.subtask.is_some(),
            OwnCondition::Reward => state.observation.reward.is_some_and(|reward| reward != 0.0),
            OwnCondition::Refused => !record.outcome.is_done(),
            OwnCondition::Action(name) => record.own.as_ref().is_some_and(|own| own.action == *name),
            OwnCondition::Sees(name) => {
                let name = name.to_lowercase();
                state.observation.things.iter().any(|thing| thing.name.to_lowercase().contains(&name))
            }
            OwnCondition::Step(step) => state.step == *step,
        }
    }
}

impl fmt::Display for OwnCondition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OwnCondition::Subtask => f.write_str("subtask"),
            OwnCondition::Reward => f.write_str("reward"),
            OwnCondition::Refused => f.write_str("refused"),
            OwnCondition::Action(name) => write!(f, "action {name}"),
            OwnCondition::Sees(name) => write!(f, "sees {name}"),
            OwnCondition::Step(step) => write!(f, "step {step}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_condition_reads_as_it_is_written_and_others_are_refused() {
        for text in ["subtask", "reward", "refused", "action open", "sees red ball", "step 12"] {
            assert_eq!(OwnCondition::parse(text).unwrap().to_string(), text);
        }
        for text in ["", "step", "step x", "action", "drop 0.1"] {
            assert!(OwnCondition::parse(text).unwrap_err().contains("action NAME"), "{text}");
        }
    }
}
