//! Agents: what decides the next action.

pub mod checkpoint;
pub mod learned;
pub mod policy;
pub mod seeker;
pub mod select;

pub use learned::LearnedPolicy;
pub mod expert;
pub mod policy;
pub mod random;

pub use expert::ExpertPolicy;
pub use policy::{Decision, Mind, Policy, Situation};
pub use random::RandomPolicy;
