//! Instructions: how they are read, and the grammar in which the program itself asks for things.

pub mod grammar;
pub mod instruction;
pub mod nouns;
pub mod passage;
pub mod phrases;
pub mod rules;
pub mod story;
pub mod summary;
pub mod vocabulary;

mod outcome;
mod place_slots;
