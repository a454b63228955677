//! What an exported policy computed in one step, and what of it is possible.

use anyhow::{Context, ensure};

use super::spec::PolicySpec;

/// What is computed in one step.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Answer {
    /// A logit for each action of the description.
    pub(super) actions: Vec<f32>,
    /// A logit for each argument of the description.
    pub(super) arguments: Vec<f32>,
    /// The value of the state, where the policy tells one.
    pub(super) value: Option<f32>,
}

impl Answer {
    /// Takes the outputs of a description in its order.
    ///
    /// # Errors
    /// When a number is none; -inf is one for a logit.
    pub(super) fn read(outputs: Vec<Vec<f32>>, spec: &PolicySpec) -> anyhow::Result<Answer> {
        let mut outputs = spec.outputs().into_iter().zip(outputs);
        for ((name, _), values) in outputs.clone() {
            let is_masked = |value: f32| value == f32::NEG_INFINITY && name != "value";
            if let Some(strange) = values.iter().find(|value| !value.is_finite() && !is_masked(**value)) {
                anyhow::bail!("its output {name:?} has {strange}");
            }
        }
        let mut next = || outputs.next().map(|(_, values)| values);
        let actions = next().context("there is no output \"actions\"")?;
        let arguments = if spec.arguments.is_empty() { None } else { next() };
        let value = next().and_then(|values| values.first().copied());
        Ok(Answer { actions, arguments: arguments.unwrap_or_default(), value })
    }
}

/// How likely each of these logits is; masked ones are impossible.
///
/// # Errors
/// When all are masked.
pub(super) fn softmax(logits: &[f32]) -> anyhow::Result<Vec<f32>> {
    let highest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    ensure!(highest.is_finite(), "it masks everything that is possible");
    let weights: Vec<f32> = logits.iter().map(|logit| (logit - highest).exp()).collect();
    let sum: f32 = weights.iter().sum();
    Ok(weights.into_iter().map(|weight| weight / sum).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masked_logits_have_no_share_and_not_all_may_be_masked() {
        assert_eq!(softmax(&[0.0, f32::NEG_INFINITY, 0.0]).unwrap(), [0.5, 0.0, 0.5]);
        assert!(softmax(&[f32::NEG_INFINITY]).unwrap_err().to_string().contains("masks everything"));
        assert!(softmax(&[]).is_err());
    }
}
