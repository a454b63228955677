//! Instructions: how they are read, and the grammar in which the program itself asks for things.

pub(crate) mod count;
pub(crate) mod grammar;
pub(crate) mod instruction;
pub(crate) mod maker;
pub(crate) mod nouns;
pub(crate) mod passage;
pub(crate) mod phrases;
pub(crate) mod prompt;
pub mod reader;
pub(crate) mod rules;
pub(crate) mod task_wording;
pub(crate) mod summary;
pub(crate) mod vocabulary;

mod outcome;
mod place_slots;
