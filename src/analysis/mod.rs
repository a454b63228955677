//! Questions about a policy: chains of instructions link by link, two instructions in one state, the value of every cell.

pub mod chain;
pub mod instruction_ab;
pub mod value_map;
