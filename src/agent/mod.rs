//! Agents: what decides the next action.

pub mod average;
pub mod checkpoint;
pub mod conditioning;
pub mod config;
pub mod decision;
pub mod experts;
pub mod frame_history;
pub mod learned;
pub mod logit_adjustment;
pub mod loop_guard;
pub mod policy;
pub mod policy_source;
pub mod random;
pub mod registry;
pub mod select;
pub mod value_estimates;

pub use decision::{ActionDistribution, Decision};
pub use experts::expert::ExpertPolicy;
pub use learned::LearnedPolicy;
pub use policy::{Decisions, Observation, Policy, PolicyState, Reading};
pub use random::RandomPolicy;
pub use value_estimates::Values;
