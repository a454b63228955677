//! Agents: what decides the next action.

pub mod checkpoint;
pub mod expert;
pub mod learned;
pub mod memory;
pub mod policy;
pub mod random;
pub mod seeker;
pub mod select;
pub mod values;

pub use expert::ExpertPolicy;
pub use learned::LearnedPolicy;
pub use policy::{Carried, Decision, Mind, Policy, Reading, Situation};
pub use random::RandomPolicy;
pub use values::Values;
