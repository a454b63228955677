//! Environments in another process, that speak `OpenEnv`: found by name, started or reached, and acted in.

mod capabilities;
mod child;
mod connection;
mod environment;
pub(crate) mod session;
#[cfg(test)]
pub(crate) mod testing;

pub(crate) use child::end_all as end_children;
pub(crate) use environment::{RemoteEnvironment, RemoteSettings, Sessions};
pub(crate) use session::Patience;
