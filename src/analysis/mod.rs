//! Questions about a policy: chains of instructions link by link, two instructions in one state, the value of every cell; and how
//! fast everything is.

pub mod bench;
pub(crate) mod chain;
pub(crate) mod instruction_ab;
pub(crate) mod value_map;
