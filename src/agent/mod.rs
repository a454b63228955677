//! Agents: what decides the next action.

pub(crate) mod average;
pub mod checkpoint;
pub(crate) mod conditioning;
pub mod config;
pub(crate) mod decision;
pub(crate) mod decision_rule;
pub(crate) mod experts;
pub(crate) mod epsilon_greedy;
pub(crate) mod exported;
pub(crate) mod frame_history;
pub(crate) mod learned;
pub(crate) mod logit_adjustment;
pub(crate) mod loop_guard;
pub(crate) mod memory;
pub(crate) mod memory_agent;
pub(crate) mod policy;
pub(crate) mod policy_place;
pub mod policy_source;
pub(crate) mod random;
pub mod registry;
pub(crate) mod select;
pub(crate) mod sentence_encoders;
pub(crate) mod served;
pub(crate) mod value_estimates;

pub(crate) use decision::{ActionDistribution, Decision};
pub use decision_rule::{DecisionOverride, DecisionRule};
pub(crate) use experts::expert::ExpertPolicy;
pub(crate) use policy::{Decisions, Observation, Policy, PolicyState, Reading};
pub use random::RandomPolicy;
pub(crate) use value_estimates::Values;
