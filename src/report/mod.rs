//! What recorded episodes say: summaries, statistics, comparisons, pages, charts, films.

pub mod charts;
pub mod compare;
pub(crate) mod estimates;
pub(crate) mod export;
pub(crate) mod groups;
pub(crate) mod html;
pub(crate) mod label_comparison;
pub(crate) mod markdown_table;
pub(crate) mod pixmap;
pub(crate) mod shell_word;
pub(crate) mod stats;
pub(crate) mod summary;
pub(crate) mod summary_files;
pub(crate) mod summary_markdown;
pub(crate) mod threshold;
