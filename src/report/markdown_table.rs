//! Markdown tables that line up in plain text too, and the numbers in them.

use super::stats::Interval;

/// A share in percent.
pub(crate) fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// An interval of shares in percent.
pub(crate) fn between([low, high]: Interval) -> String {
    format!("{:.1} to {:.1} %", 100.0 * low, 100.0 * high)
}

/// A Markdown table of rows of one width.
pub(crate) fn table<const N: usize>(head: [&str; N], rows: impl IntoIterator<Item = [String; N]>) -> String {
    let rows: Vec<Vec<String>> = rows.into_iter().map(Vec::from).collect();
    aligned_table(&head.map(String::from), &rows)
}

/// A Markdown table whose columns line up in plain text too; all but the first are aligned right.
pub(crate) fn aligned_table(head: &[String], rows: &[Vec<String>]) -> String {
    let lines = || std::iter::once(head).chain(rows.iter().map(Vec::as_slice));
    let columns = 0..head.len();
    // A name may hold what would end a cell or a row.
    let plain = |text: &String| text.replace('|', "/").replace(['\n', '\r'], " ");
    let cell = |row: &[String], i: usize| row.get(i).map(plain).unwrap_or_default();
    let widths: Vec<usize> =
        columns.clone().map(|i| lines().map(|row| cell(row, i).chars().count()).max().unwrap_or(0)).collect();
    let line = |row: &[String]| {
        let padded = columns.clone().map(|i| match i {
            0 => format!("{:<1$}", cell(row, i), widths[i]),
            _ => format!("{:>1$}", cell(row, i), widths[i]),
        });
        format!("| {} |\n", padded.collect::<Vec<_>>().join(" | "))
    };
    let rules = widths.iter().enumerate().map(|(i, width)| match i {
        0 => "-".repeat(width + 2),
        _ => format!("{}:", "-".repeat(width + 1)),
    });
    let rule = format!("|{}|\n", rules.collect::<Vec<_>>().join("|"));
    std::iter::once(line(head)).chain([rule]).chain(rows.iter().map(|row| line(row))).collect()
}
