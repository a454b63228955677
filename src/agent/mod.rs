//! Agents: what decides the next action.

pub mod policy;

pub use policy::{Decision, Mind, Policy, Situation};
