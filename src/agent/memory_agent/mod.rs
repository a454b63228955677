//! An agent with a memory: it reads the instruction as subtasks, finds things with a detector, keeps them on a map of its own, and
//! chooses what to set out to. Beyond the paper; its module names follow what it does at a step: look, remember, choose.

pub(crate) mod config;
pub(crate) mod eyes;
pub(crate) mod features;
pub(crate) mod goal;
pub(crate) mod macro_action;
pub(crate) mod mind;
mod policy;
pub(crate) mod progress;
mod recollection;
mod weighed;

pub(crate) use policy::MemoryPolicy;
pub(crate) use recollection::Recollection;
