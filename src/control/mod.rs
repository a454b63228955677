//! Steering from another terminal: what runs listens on a socket of its user's own, and does what it is asked there.

pub(crate) mod client;
mod message;
mod run_control;
mod runtime_folder;
mod running_clock;
mod server;
mod tail;

pub(crate) use message::{Kind, Order, Progress, State, Status};
pub(crate) use run_control::RunControl;
pub(crate) use running_clock::RunningClock;
pub(crate) use server::{ControlServer, Controlled};
pub(crate) use tail::Tail;
