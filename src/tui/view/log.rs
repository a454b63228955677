//! What happened, the newest at the foot.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;

use super::panel::{panel, wrap};
use crate::tui::app::App;
use crate::tui::log::{LogEntry, Tone};
use crate::tui::theme::THEME;

/// The panel with the events.
pub(crate) struct LogPanel<'a>(pub(crate) &'a App);

impl Widget for LogPanel<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let inner = panel(buf, area, "Log", "");
        for (row, (_, line)) in inner.rows().zip(lines(self.0, inner)) {
            line.render(row, buf);
        }
    }
}

/// The lines that are shown, with the step of each.
fn lines(app: &App, inner: Rect) -> impl Iterator<Item = (Option<u32>, Line<'static>)> {
    let rows = usize::from(inner.height);
    let mut lines: Vec<(Option<u32>, Line)> = Vec::new();
    for entry in app.log.entries().rev() {
        if lines.len() >= rows {
            break;
        }
        lines.splice(0..0, entry_lines(entry, usize::from(inner.width)).into_iter().map(|line| (entry.step, line)));
    }
    let skip = lines.len().saturating_sub(rows);
    lines.into_iter().skip(skip)
}

/// The step of the entry in that row of the screen.
pub(super) fn step_at(app: &App, inner: Rect, row: u16) -> Option<u32> {
    lines(app, inner).nth(usize::from(row.checked_sub(inner.y)?))?.0
}

/// The style of a tone.
pub(super) fn tone(tone: Tone) -> Style {
    match tone {
        Tone::Done => THEME.quiet,
        Tone::Impossible | Tone::Bad => THEME.bad,
        Tone::Good => THEME.good,
        Tone::Note => THEME.note,
    }
}

fn entry_lines(entry: &LogEntry, width: usize) -> Vec<Line<'static>> {
    let step = entry.step.map_or(String::new(), |step| step.to_string());
    let tone = tone(entry.tone);
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
