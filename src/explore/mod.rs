//! The explorer without a screen: a [`session::Session`] takes commands and tells events; the plain mode writes them as lines,
//! and `tui` draws them.

pub(crate) mod annotation;
pub(crate) mod breakpoints;
pub(crate) mod chain_report;
pub(crate) mod choices;
pub(crate) mod remote;
pub mod episode_source;
pub mod exploration;
mod explored_run;
pub(crate) mod example_wishes;
pub(crate) mod inspect;
pub(crate) mod kept_session;
pub(crate) mod plain;
pub(crate) mod plain_input;
pub mod session;
pub(crate) mod session_export;
pub(crate) mod session_file;
pub(crate) mod side_by_side;
pub(crate) mod start_list;
pub(crate) mod steering;
pub(crate) mod terms;
pub(crate) mod timeline;
pub(crate) mod verb;
#[cfg(test)]
pub(crate) mod testing;
