//! By which rule an agent turns its logits into an action, and whether a loop guard keeps it from repeating itself.

use serde::{Deserialize, Serialize};

/// How logits become an action. Impossible actions are masked by either rule.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DecisionRule {
    /// The likeliest pair of action and class: an interaction's probability counts times that of the classes it could name now.
    /// Logits are adjusted (`logit_adjustment`), and the critic's advantages count (`advantage_scale`).
    #[default]
    Mass,
    /// The paper's: the likeliest possible action by the policy's own logits, then the likeliest class that it could name.
    Paper,
}

impl DecisionRule {
    /// Whether it is the one of agents that name none.
    pub(crate) fn is_mass(&self) -> bool {
        *self == DecisionRule::Mass
    }
}

/// What is asked of an agent's decisions in place of what its checkpoint says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DecisionOverride {
    /// The rule; the checkpoint's own without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) decision: Option<DecisionRule>,
    /// Whether the loop guard is on; as the checkpoint says without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) loop_guard: Option<bool>,
}

impl DecisionOverride {
    /// Whether nothing is asked.
    pub(crate) fn is_none(&self) -> bool {
        *self == DecisionOverride::default()
    }
}

/// Serde's default of a loop guard: older checkpoints have one and do not say so.
pub(crate) fn on() -> bool {
    true
}

/// Whether it is on, for serde.
pub(crate) fn is_on(on: &bool) -> bool {
    *on
}
