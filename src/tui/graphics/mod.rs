//! Pictures in a terminal: which way, and the frame encoded that way. Encoding happens on a thread of its own.

pub mod blocks;
pub mod classes;
pub mod coarse;
pub mod detect;
pub mod encoder;
pub mod inline;
mod job;
pub mod labels;
pub mod letters;
pub mod overlay;
mod picture;
mod placeholder;
mod protocol;
pub mod sixel;

pub use job::Job;
pub use picture::{Content, Picture};
pub use protocol::Protocol;
