//! The explorer without a screen: a [`session::Session`] takes commands and tells events; the plain mode writes them as lines,
//! and `tui` draws them.

pub mod breakpoints;
pub mod chain_report;
pub mod choices;
pub mod episode_source;
pub mod exploration;
pub mod inspect;
pub mod plain;
pub mod session;
pub mod session_export;
pub mod side_by_side;
pub mod timeline;
pub mod verb;
#[cfg(test)]
pub mod testing;
