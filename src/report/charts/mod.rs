//! Charts as vectors or pixels.

pub(crate) mod drawing;
pub(crate) mod line_chart;
pub(crate) mod progress_by_length;
pub mod training_curves;
