//! How the progress of commands that count items is drawn.

use indicatif::ProgressStyle;

/// What is done, a bar, and the time it took.
pub fn counted() -> ProgressStyle {
    let template = "{msg:15} {bar:40} {pos}/{len} {elapsed}";
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
