//! Agents: what decides the next action.

pub mod policy;
pub mod select;

pub use policy::{Decision, Mind, Policy, Situation};
