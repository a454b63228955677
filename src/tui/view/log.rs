//! What happened, the newest at the foot.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;

use super::{panel, wrap};
use crate::tui::app::{App, Entry, Tone};
use crate::tui::theme::THEME;

/// The panel with the events.
pub struct Log<'a>(pub &'a App);

impl Widget for Log<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let inner = panel(buf, area, "Log", "");
        let rows = usize::from(inner.height);
        let mut lines: Vec<Line> = Vec::new();
        for entry in self.0.log.iter().rev() {
            if lines.len() >= rows {
                break;
            }
            lines.splice(0..0, entry_lines(entry, usize::from(inner.width)));
        }
        let skip = lines.len().saturating_sub(rows);
        for (row, line) in inner.rows().zip(lines.into_iter().skip(skip)) {
            line.render(row, buf);
        }
    }
}

fn entry_lines(entry: &Entry, width: usize) -> Vec<Line<'static>> {
    let step = entry.step.map_or(String::new(), |step| step.to_string());
    let tone = match entry.tone {
        Tone::Done => THEME.quiet,
        Tone::Impossible | Tone::Bad => THEME.bad,
        Tone::Good => THEME.good,
        Tone::Note => THEME.note,
    };
    let text =
        if entry.outcome.is_empty() { entry.text.clone() } else { format!("{} · {}", entry.text, entry.outcome) };
    let room = width.saturating_sub(5);
    let mut lines = Vec::new();
    for (at, line) in wrap(&text, room, "  ").into_iter().enumerate() {
        let number = if at == 0 { format!("{step:>4} ") } else { " ".repeat(5) };
        let spans = match (entry.tone, line.split_once(" · ")) {
            (Tone::Done | Tone::Impossible, Some((action, outcome))) => {
                vec![Span::raw(action.to_string()), Span::styled(format!(" · {outcome}"), tone)]
            }
            (Tone::Done, None) => vec![Span::styled(line, if at == 0 { Style::new() } else { tone })],
            _ => vec![Span::styled(line, tone)],
        };
        lines.push(Line::from([vec![Span::styled(number, THEME.quiet)], spans].concat()));
    }
    lines
}
