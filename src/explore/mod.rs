//! An explorer session without a screen, and the plain mode that speaks lines instead of drawing.

pub mod breakpoints;
pub mod chained;
pub mod choices;
pub mod episode_source;
pub mod inspect;
pub mod plain;
pub mod session;
pub mod session_export;
pub mod side_by_side;
pub mod timeline;
pub mod verb;
pub mod worker;
#[cfg(test)]
pub mod testing;
