//! Charts as vectors or pixels.

pub mod drawing;
pub mod line_chart;
pub mod progress_by_length;
pub mod training_curves;
