//! Wishes that can be fulfilled in this house, to pick one.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::Line;
use ratatui::widgets::{Block, Clear, Padding, Widget};

use super::panel::fit;
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The list, at the foot of an area.
pub(crate) struct WishListOverlay<'a>(pub(crate) &'a App);

/// Where it opens.
pub(super) fn place(app: &App, page: Rect) -> Rect {
    let height = (app.input.wishes.len() as u16 + 2).min(page.height);
    Rect { y: page.bottom() - height, height, width: page.width.min(80), ..page }
}

impl Widget for WishListOverlay<'_> {
    fn render(self, page: Rect, buf: &mut Buffer) {
        let input = &self.0.input;
        let area = place(self.0, page);
        Clear.render(area, buf);
        let title = Line::styled(" Wishes for this house ", THEME.title);
        let block = Block::bordered().title(title).padding(Padding::horizontal(1));
        let inner = block.inner(area);
        block.render(area, buf);
        for (at, (row, text)) in inner.rows().zip(&input.wishes).enumerate() {
            let (mark, style) = if at == input.selected_wish { (">", THEME.chosen) } else { (" ", Style::new()) };
            Line::styled(fit(&format!("{mark} {text}"), usize::from(row.width)), style).render(row, buf);
        }
    }
}
