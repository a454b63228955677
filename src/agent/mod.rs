//! Agents: what decides the next action.

pub mod average;
pub mod balance;
pub mod batch;
pub mod checkpoint;
pub mod config;
pub mod expert;
pub mod goal;
pub mod learned;
pub mod memory;
pub mod policy;
pub mod random;
mod rounds;
pub mod seeker;
pub mod select;
pub mod team;
pub mod told;
pub mod values;

pub use batch::LearnedTeam;
pub use expert::ExpertPolicy;
pub use learned::LearnedPolicy;
pub use policy::{Carried, Decision, Mind, Policy, Reading, Situation};
pub use random::RandomPolicy;
pub use team::{Solo, Team};
pub use values::Values;
