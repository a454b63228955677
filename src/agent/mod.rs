//! Agents: what decides the next action.

pub mod expert;
pub mod policy;
pub mod random;

pub use expert::ExpertPolicy;
pub use policy::{Decision, Mind, Policy, Situation};
pub use random::RandomPolicy;
