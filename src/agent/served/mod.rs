//! Policies that act from another process: a policy server that speaks vla-eval's protocol or openpi's over a WebSocket.

mod address;
mod answer;
mod array;
mod connection;
mod deadline_stream;
mod dialogue;
mod image;
mod observation;
mod remote;
mod policy;
mod reply;
mod server_gone;
mod state;

pub(crate) use address::PolicyAddress;
pub(crate) use policy::ServedPolicy;
pub(crate) use server_gone::ServerGone;
pub(crate) use state::ServedState;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
