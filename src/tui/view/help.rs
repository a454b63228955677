//! The keys of the screen under the help.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Padding, Widget};

use super::panel::fit;
use crate::tui::app::App;
use crate::tui::keys::{self, Mode};
use crate::tui::theme::THEME;

/// The overlay with the keys.
pub(crate) struct HelpOverlay<'a>(pub(crate) &'a App);

/// Columns that the names of keys take.
const LABEL: usize = 9;
/// Columns that a key takes with what it does.
const WIDEST: u16 = 40;

impl Widget for HelpOverlay<'_> {
    fn render(self, screen: Rect, buf: &mut Buffer) {
        let mode = if self.0.input.under == Mode::Help { Mode::Watch } else { self.0.input.under };
        let title = match mode {
            Mode::Manual => " Keys while you act ",
            _ => " Keys while a policy acts ",
        };
        // A key that the one before it speaks for has no line of its own.
        let bindings: Vec<_> = keys::bindings(mode, self.0.page).filter(|binding| !binding.label.is_empty()).collect();
        // As many columns as it takes.
        let most = usize::from(screen.height.saturating_sub(2)).max(1);
        let columns = bindings.len().div_ceil(most).max(1);
        let rows = bindings.len().div_ceil(columns);
        let width = (WIDEST * columns as u16 + 4).min(screen.width);
        let room = usize::from(width.saturating_sub(4)) / columns;
        let lines = (0..rows).map(|row| {
            let shown = bindings.iter().skip(row).step_by(rows.max(1)).take(columns);
            Line::from_iter(shown.flat_map(|binding| {
                let doc = fit(binding.help, room.saturating_sub(LABEL + 1));
                let words = format!("{doc:<width$}", width = room.saturating_sub(LABEL));
                [Span::styled(format!("{:<LABEL$}", binding.label), THEME.chosen), Span::raw(words)]
            }))
        });
        let height = (rows as u16 + 2).min(screen.height);
        let area = Rect {
            x: screen.x + (screen.width - width) / 2,
            y: screen.y + (screen.height - height) / 2,
            width,
            height,
        };
        Clear.render(area, buf);
        let block = Block::bordered().title(Line::styled(title, THEME.title)).padding(Padding::horizontal(1));
        let inner = block.inner(area);
        block.render(area, buf);
        for (row, line) in inner.rows().zip(lines) {
            line.render(row, buf);
        }
    }
}
