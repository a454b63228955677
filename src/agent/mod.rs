//! Agents: what decides the next action.

pub mod checkpoint;
pub mod expert;
pub mod goal;
pub mod learned;
pub mod policy;
pub mod random;
pub mod seeker;
pub mod select;

pub use expert::ExpertPolicy;
pub use learned::LearnedPolicy;
pub use policy::{Decision, Mind, Policy, Situation, Values};
pub use random::RandomPolicy;
