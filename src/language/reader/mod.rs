//! Reads a wish: typed text as an ordered list of subtasks, with how sure that is and what was not understood.

pub(crate) mod answered_by_model;
mod clause;
pub mod clauses;
pub mod features;
pub mod lexicon;
pub mod model;
pub mod shape;
pub mod spelling;
pub mod tokens;

mod answers;
mod corrections;
mod forbidden;
mod pronouns;
mod reading;
mod switching;
mod details;
mod units;
mod unread;

pub use reading::{Alternative, CERTAIN, ReadSubtask, WishReading};
pub use units::{Context, Reader, lying};

/// The features of a text as one unit, for training.
pub fn features_of(text: &str, before: features::Before, spelling: &spelling::Spelling) -> Vec<u32> {
    let wanted = forbidden::without_the_forbidden(corrections::corrected(tokens::tokens(text, spelling).tokens));
    features::features(&clauses::clauses(&wanted), before)
}

#[cfg(test)]
#[path = "../../../tests/reader.rs"]
mod tests;
