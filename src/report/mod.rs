//! What recorded episodes say: summaries, statistics, comparisons, pages, charts, films.

pub mod charts;
pub mod compare;
pub mod estimates;
pub mod export;
pub mod groups;
pub mod html;
pub mod markdown_table;
pub mod pixmap;
pub mod stats;
pub mod summary;
pub mod summary_files;
pub mod summary_markdown;
pub mod threshold;
