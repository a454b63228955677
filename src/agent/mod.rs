//! Agents: what decides the next action.

pub mod batch;
pub mod checkpoint;
pub mod expert;
pub mod learned;
pub mod memory;
pub mod policy;
pub mod random;
pub mod seeker;
pub mod select;
pub mod team;

pub use batch::LearnedTeam;
pub use expert::ExpertPolicy;
pub use learned::LearnedPolicy;
pub use policy::{Decision, Mind, Policy, Situation};
pub use random::RandomPolicy;
pub use team::{Solo, Team};
