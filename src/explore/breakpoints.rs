//! Conditions at which a run stops: pure questions about two neighbouring states.

use std::fmt;

use crate::agent::{ActionDistribution, Values};
use crate::domain::Class;

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Condition {
    /// A subtask was completed.
    Subtask,
    /// An action was impossible.
    Failed,
    /// V fell by this much in one step.
    ValueDrop(f32),
    /// The best Q (without critics: probability) leads the second by less than this.
    Gap(f32),
    /// The entropy is above this, in nats.
    Entropy(f32),
    /// An object of this class came into view.
    Sees(Class),
    /// That step was reached.
    Step(u32),
}

/// What conditions ask of a state.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Facts {
    /// How many steps led to it.
    pub(crate) step: u32,
    /// Subtasks that are done.
    pub(crate) completed: u32,
    /// The last action was impossible.
    pub(crate) failed: bool,
    /// V, where there are critics.
    pub(crate) value: Option<f32>,
    /// By how much the best choice leads the second.
    pub(crate) gap: Option<f32>,
    /// The entropy of the choice, in nats.
    pub(crate) entropy: Option<f32>,
    /// The classes in view.
    pub(crate) seen: Vec<Class>,
}

impl Condition {
    /// Reads `subtask`, `failed`, `drop 0.1`, `gap 0.05`, `entropy 1.2`, `sees mug` or `step 12`.
    ///
    /// # Errors
    /// Says what conditions there are.
    pub(crate) fn parse(text: &str) -> Result<Condition, String> {
        let (word, rest) = text.trim().split_once(' ').map_or((text.trim(), ""), |(word, rest)| (word, rest.trim()));
        let number = || match rest.parse::<f32>() {
            Ok(number) if number.is_finite() && number >= 0.0 => Ok(number),
            Ok(number) if number.is_finite() => Err(format!("{word}: {rest} is below 0")),
            _ => Err(format!("{word}: {rest:?} is not a number")),
        };
        match word {
            "subtask" | "failed" if !rest.is_empty() => {
                Err(format!("{word} stands alone: {rest:?} is nothing that it takes"))
            }
            "subtask" => Ok(Condition::Subtask),
            "failed" => Ok(Condition::Failed),
            "drop" => Ok(Condition::ValueDrop(number()?)),
            "gap" => Ok(Condition::Gap(number()?)),
            "entropy" => Ok(Condition::Entropy(number()?)),
            "step" => rest.parse().map(Condition::Step).map_err(|_| format!("step: {rest:?} is not a number")),
            "sees" => {
                let plain = |name: &str| name.to_lowercase().replace([' ', '-', '_'], "");
                let named =
                    |class: &Class| [class.name(), class.spoken()].iter().any(|name| plain(name) == plain(rest));
                Class::all().find(named).map(Condition::Sees).ok_or(format!("sees: {rest:?} is no class of objects"))
            }
            _ => Err(format!(
                "{text:?} is no condition; there are: subtask, failed, drop X, gap X, entropy X, sees OBJECT, step N"
            )),
        }
    }

    /// Whether a run stops at `now`, one step after `before`; why, in words.
    pub(crate) fn hit(self, before: &Facts, now: &Facts) -> Option<String> {
        let meets = match self {
            Condition::Subtask => now.completed > before.completed,
            Condition::Failed => now.failed,
            Condition::ValueDrop(by) => matches!((before.value, now.value), (Some(a), Some(b)) if a - b > by),
            Condition::Gap(least) => now.gap.is_some_and(|gap| gap < least),
            Condition::Entropy(most) => now.entropy.is_some_and(|entropy| entropy > most),
            Condition::Sees(class) => now.seen.contains(&class) && !before.seen.contains(&class),
            Condition::Step(step) => now.step == step,
        };
        meets.then(|| match (self, now.entropy, now.gap, before.value, now.value) {
            (Condition::Entropy(_), Some(entropy), ..) => format!("{self}: it is {entropy:.2}"),
            (Condition::Gap(_), _, Some(gap), ..) => format!("{self}: it is {gap:.2}"),
            (Condition::ValueDrop(_), _, _, Some(a), Some(b)) => format!("{self}: from {a:.2} to {b:.2}"),
            _ => self.to_string(),
        })
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Condition::Subtask => f.write_str("a subtask is done"),
            Condition::Failed => f.write_str("an action failed"),
            Condition::ValueDrop(by) => write!(f, "V falls by more than {by}"),
            Condition::Gap(least) => write!(f, "the best leads by less than {least}"),
            Condition::Entropy(most) => write!(f, "entropy above {most}"),
            Condition::Sees(class) => write!(f, "the {} comes into view", class.spoken()),
            Condition::Step(step) => write!(f, "step {step}"),
        }
    }
}

/// By how much the best choice leads the second: in Q where there are critics, else in probability.
pub(crate) fn gap(distribution: Option<&ActionDistribution>, values: Option<&Values>) -> Option<f32> {
    let mut found: Vec<f32> = match (values, distribution) {
        (Some(values), _) => values.choices.iter().map(|choice| choice.q).collect(),
        (None, Some(distribution)) => distribution.actions.iter().flatten().copied().collect(),
        (None, None) => return None,
    };
    found.sort_by(|a, b| b.total_cmp(a));
    Some(found.first()? - found.get(1)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(condition: &str, before: &Facts, now: &Facts, expected: Option<&str>) {
        let condition = Condition::parse(condition).unwrap();
        assert_eq!(condition.hit(before, now).as_deref(), expected, "{condition:?}");
    }

    #[test]
    fn conditions_look_at_what_changed() {
        let mug = Class::named("Mug").unwrap();
        let before = Facts { step: 3, value: Some(0.8), ..Facts::default() };
        let now = Facts {
            step: 4,
            completed: 1,
            failed: true,
            value: Some(0.5),
            gap: Some(0.04),
            entropy: Some(1.3),
            seen: vec![mug],
        };
        check("subtask", &before, &now, Some("a subtask is done"));
        check("failed", &before, &now, Some("an action failed"));
        check("drop 0.2", &before, &now, Some("V falls by more than 0.2: from 0.80 to 0.50"));
        check("drop 0.4", &before, &now, None);
        check("gap 0.1", &before, &now, Some("the best leads by less than 0.1: it is 0.04"));
        check("entropy 1.2", &before, &now, Some("entropy above 1.2: it is 1.30"));
        check("sees mug", &before, &now, Some("the mug comes into view"));
        check("sees mug", &now, &now, None);
        check("step 4", &before, &now, Some("step 4"));
        check("subtask", &now, &now, None);
    }

    #[test]
    fn without_critics_v_never_falls() {
        let facts = Facts::default();
        check("drop 0", &facts, &facts, None);
    }

    #[test]
    fn mistakes_are_named() {
        for (text, part) in
            [("dance", "there are"), ("drop x", "not a number"), ("sees unicorn", "no class"), ("step", "not a number")]
        {
            let error = Condition::parse(text).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
