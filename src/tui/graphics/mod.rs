//! Pictures in a terminal: which way, and the frame encoded that way. Encoding happens on a thread of its own.

pub(crate) mod blocks;
pub mod classes;
pub(crate) mod coarse;
pub(crate) mod detect;
pub mod encoder;
pub(crate) mod inline;
mod job;
pub(crate) mod labels;
pub mod letters;
pub mod overlay;
mod picture;
mod placeholder;
mod protocol;
pub(crate) mod sixel;

pub use job::Job;
pub use picture::{Content, Picture};
pub use protocol::Protocol;
