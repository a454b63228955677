//! Annotation by people (the paper's Fig. 10), without a screen: spans of demonstrations are drawn, a person writes a sentence of
//! each or skips it, and what several people wrote is held against one another and becomes labels and tasks.

pub(crate) mod agreement;
pub(crate) mod export;
pub(crate) mod film;
pub(crate) mod plain;
pub(crate) mod session;
pub(crate) mod spans;
#[cfg(test)]
pub(crate) mod testing;
