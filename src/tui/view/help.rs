//! The keys of the screen under the help.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Padding, Widget};

use crate::tui::app::App;
use crate::tui::keys::{self, Mode};
use crate::tui::theme::THEME;

/// The overlay with the keys.
pub struct Help<'a>(pub &'a App);

impl Widget for Help<'_> {
    fn render(self, screen: Rect, buf: &mut Buffer) {
        let mode = if self.0.under == Mode::Help { Mode::Watch } else { self.0.under };
        let title = match mode {
            Mode::Manual => " Keys while you act ",
            _ => " Keys while a policy acts ",
        };
        let lines: Vec<Line> = keys::bindings(mode, self.0.page)
            .map(|binding| {
                Line::from(vec![
                    Span::styled(format!("{:<13}", binding.label), THEME.chosen),
                    Span::raw(binding.verb.doc()),
                ])
            })
            .collect();
        let (width, height) = (58.min(screen.width), (lines.len() as u16 + 2).min(screen.height));
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
