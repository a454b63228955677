//! Episodes: the one loop that steps an environment, what is recorded of it, and what can be tried from a state.

pub mod branches;
pub mod diagnosis;
pub mod failure;
pub mod frames;
pub mod instruction_variant;
pub mod record;
pub mod rollout;
pub mod scenes;
pub mod seed;
