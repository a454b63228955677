//! Episodes: the one loop that steps an environment, what is recorded of it, and what can be tried from a state.

pub(crate) mod branches;
pub(crate) mod diagnosis;
pub(crate) mod failure;
pub(crate) mod remote_frames;
pub(crate) mod frames;
pub(crate) mod instruction_variant;
pub(crate) mod record;
pub(crate) mod rollout;
pub mod scenes;
pub(crate) mod seed;
pub(crate) mod wish;
