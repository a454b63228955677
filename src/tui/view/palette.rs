//! The list of verbs over the screen, while one is typed.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Padding, Widget};

use super::panel::{fit, wrap};
use crate::explore::verb::matching;
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The list, at the foot of an area.
pub(crate) struct PaletteOverlay<'a>(pub(crate) &'a App);

/// Verbs that are listed at a time.
const ROWS: u16 = 12;

/// Where it opens: under the list there is room for the whole of what the selected verb does.
pub(super) fn place(page: Rect) -> Rect {
    let height = (ROWS + 4).min(page.height);
    Rect { y: page.bottom() - height, height, width: page.width.min(110), ..page }
}

impl Widget for PaletteOverlay<'_> {
    fn render(self, page: Rect, buf: &mut Buffer) {
        let found = matching(self.0.input.palette.text());
        let area = place(page);
        let rows = usize::from(area.height) - 4;
        Clear.render(area, buf);
        let block = Block::bordered().title(Line::styled(" Verbs ", THEME.title)).padding(Padding::horizontal(1));
        let inner = block.inner(area);
        block.render(area, buf);
        let first = (self.0.input.selected_verb + 1).saturating_sub(rows);
        if found.is_empty() {
            Line::styled("no verb fits", THEME.quiet).render(inner, buf);
        }
        for (row, (at, entry)) in inner.rows().take(rows).zip(found.iter().enumerate().skip(first)) {
            let style = if at == self.0.input.selected_verb { THEME.chosen } else { Style::new() };
            let verb = format!("{} {}", entry.name, entry.arguments);
            let doc = fit(entry.help, usize::from(row.width).saturating_sub(25));
            let spans = vec![Span::styled(format!("{verb:<24} "), style), Span::styled(doc, THEME.quiet)];
            Line::from(spans).render(row, buf);
        }
        if let Some(entry) = found.get(self.0.input.selected_verb) {
            let foot = Rect { y: inner.bottom() - 2, height: 2, ..inner };
            for (row, line) in foot.rows().zip(wrap(entry.help, usize::from(inner.width), "")) {
                Line::styled(line, THEME.note).render(row, buf);
            }
        }
    }
}
