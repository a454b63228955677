//! What all panels are made of: a title over a rule, text that fits, bars.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::{UnicodeWidthChar, UnicodeWidthStr};

use crate::tui::theme::THEME;

/// Draws a panel's title over a rule, with something quiet at its right; returns the rest of the panel.
pub(crate) fn panel(buf: &mut Buffer, area: Rect, title: &str, right: &str) -> Rect {
    let width = usize::from(area.width);
    let right = fit_parts(right, width.saturating_sub(title.width() + 4));
    let rule = width.saturating_sub(title.width() + 1 + if right.is_empty() { 0 } else { right.width() + 1 });
    let mut spans =
        vec![Span::styled(title.to_string(), THEME.title), Span::raw(" "), Span::styled("─".repeat(rule), THEME.quiet)];
    if !right.is_empty() {
        spans.extend([Span::raw(" "), Span::raw(right)]);
    }
    Line::from(spans).render(Rect { height: 1.min(area.height), ..area }, buf);
    Rect { y: area.y + 1, height: area.height.saturating_sub(1), ..area }
}

/// Text cut to `width` columns, the cut marked.
pub(crate) fn fit(text: &str, width: usize) -> String {
    if text.width() <= width {
        return text.to_string();
    }
    let mut short = String::new();
    for c in text.chars() {
        if short.width() + c.width().unwrap_or(0) + 1 > width {
            break;
        }
        short.push(c);
    }
    if width > 0 {
        short.push('…');
    }
    short
}

/// The end of a text in `width` columns, the cut marked: of a path, its name.
pub(super) fn fit_end(text: &str, width: usize) -> String {
    if text.width() <= width {
        return text.to_string();
    }
    let mut from = text.len();
    for (at, _) in text.char_indices().rev() {
        if text[at..].width() + 1 > width {
            break;
        }
        from = at;
    }
    if width > 0 { format!("…{}", &text[from..]) } else { String::new() }
}

/// A cut text of fewer columns says nothing.
const STUMP: usize = 6;

/// Parts of a text (`a · b, c`) as far as they fit whole, from the first; a first one that does not fit is cut.
pub(super) fn fit_parts(text: &str, width: usize) -> String {
    let ends = [" · ", ", "].iter().flat_map(|between| text.match_indices(between)).map(|(at, _)| at);
    let whole = std::iter::once(text.len()).chain(ends).filter(|&end| text[..end].width() <= width).max();
    match whole {
        Some(end) => text[..end].to_owned(),
        None if width < STUMP => String::new(),
        None => fit(text, width),
    }
}

/// Lines of at most `width` columns, broken at spaces; later lines start with `indent`.
pub(crate) fn wrap(text: &str, width: usize, indent: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let fresh = lines.len() > 1;
        let line = lines.last_mut().map_or("", |line| line.as_str());
        let start = if fresh { indent.width() } else { 0 };
        if line.width() > start && line.width() + 1 + word.width() > width {
            lines.push(format!("{indent}{word}"));
        } else if let Some(line) = lines.last_mut() {
            if line.width() > start {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines.iter().map(|line| fit(line, width)).collect()
}

/// A bar of `share` (0 to 1) of `width` columns, in eighths of a column.
pub(crate) fn bar(share: f32, width: usize) -> String {
    const EIGHTHS: [char; 8] = [' ', '▏', '▎', '▍', '▌', '▋', '▊', '▉'];
    let eighths = (share.clamp(0.0, 1.0) * 8.0 * width as f32).round() as usize;
    let mut bar = "█".repeat(eighths / 8);
    if !eighths.is_multiple_of(8) {
        bar.push(EIGHTHS[eighths % 8]);
    }
    format!("{bar:<width$}")
}

/// A probability in three columns: `.07`, `1.0`.
pub(crate) fn share(p: f32) -> String {
    if p >= 0.995 { "1.0".into() } else { format!("{p:.2}").trim_start_matches('0').to_string() }
}

/// A number without the sign of a zero: what rounds to 0.00 is not below it.
pub(crate) fn unsigned_zero(x: f32) -> f32 {
    if x.abs() < 0.005 { 0.0 } else { x }
}

/// A line of text at a row of an area.
pub(crate) fn put(buf: &mut Buffer, area: Rect, row: u16, text: impl Into<String>, style: Style) {
    if row < area.height {
        let line = Rect { y: area.y + row, height: 1, ..area };
        Line::styled(fit(&text.into(), usize::from(area.width)), style).render(line, buf);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_path_the_end_is_seen() {
        assert_eq!(fit_end("in /a/long/way/checkpoints", 13), "…/checkpoints");
        assert_eq!((fit_end("runs", 4), fit_end("runs", 0)), ("runs".into(), String::new()));
        assert_eq!(fit_end("ü漢字", 4), "…字", "wide letters are whole");
    }

    #[test]
    fn parts_that_do_not_fit_whole_are_left_out() {
        let parts = |width| fit_parts("west, 30 down · far", width);
        assert_eq!(
            [parts(30), parts(18), parts(12), parts(4)],
            ["west, 30 down · far", "west, 30 down", "west", "west"]
        );
        assert_eq!((fit_parts("southwards", 8), fit_parts("southwards", 5)), ("southwa…".into(), String::new()));
    }
}
