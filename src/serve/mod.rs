//! House for programs in other languages: OpenEnv's protocol over WebSockets, and a faster one over a local socket.

pub(crate) mod episodes;
mod json;
mod local;
mod observation;
mod pages;
mod png;
mod refusal;
pub(crate) mod server;
mod session;
mod websocket;
