//! Agents: what decides the next action.

pub mod logit_adjustment;
pub mod experts;
pub mod frame_history;
pub mod loop_guard;
pub mod conditioning;
pub mod value_estimates;
pub mod registry;
pub mod average;
pub mod batch;
pub mod checkpoint;
pub mod config;
pub mod goal;
pub mod learned;
pub mod policy;
pub mod random;
pub mod select;
pub mod team;

pub use batch::LearnedTeam;
pub use experts::expert::ExpertPolicy;
pub use learned::LearnedPolicy;
pub use policy::{ActionDistribution, Decision, Observation, Policy, PolicyState, Reading};
pub use random::RandomPolicy;
pub use team::{Solo, Team};
pub use value_estimates::Values;
