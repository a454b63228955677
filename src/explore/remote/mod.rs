//! Exploring an environment in another process: its actions are its own, and its states are gone back to by what it can do
//! itself, or by taking the same actions again from the same seed.

pub(crate) mod breakpoint;
pub(crate) mod command;
pub(crate) mod exploration;
mod open;
pub(crate) mod plain;
mod save;
mod time;
pub(crate) mod tree;
pub(crate) mod view;

pub(crate) use exploration::{OpenRemote, RemoteExploration};
