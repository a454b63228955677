//! Instructions that fit what is typed so far: given before, or sensible in this house.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::Line;
use ratatui::widgets::{Block, Clear, Padding, Widget};

use super::panel::fit;
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The list, at the foot of an area.
pub(crate) struct SuggestionsOverlay<'a>(pub(crate) &'a App);

/// Instructions that are listed at a time.
const ROWS: u16 = 8;

/// Where they open, unless nothing fits; as large whatever is typed.
pub(super) fn place(app: &App, page: Rect) -> Option<Rect> {
    let height = (ROWS + 2).min(page.height);
    let area = Rect { y: page.bottom() - height, height, width: page.width.min(80), ..page };
    (!app.completions().is_empty()).then_some(area)
}

impl Widget for SuggestionsOverlay<'_> {
    fn render(self, page: Rect, buf: &mut Buffer) {
        let found = self.0.completions();
        let title =
            if self.0.input.editor.text().is_empty() { " Given before, or sensible here " } else { " Tab completes " };
        let Some(area) = place(self.0, page) else { return };
        Clear.render(area, buf);
        let block = Block::bordered().title(Line::styled(title, THEME.title)).padding(Padding::horizontal(1));
        let inner = block.inner(area);
        block.render(area, buf);
        for (at, (row, text)) in inner.rows().zip(&found).enumerate() {
            let style = if at == 0 { THEME.chosen } else { Style::new() };
            Line::styled(fit(text, usize::from(row.width)), style).render(row, buf);
        }
    }
}
