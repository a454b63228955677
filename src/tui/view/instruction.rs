//! The instruction, or the line in which it is typed.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::panel::fit;
use crate::tui::app::App;
use crate::tui::keys::Mode;
use crate::tui::theme::THEME;

/// The line with the instruction.
pub(crate) struct InstructionRow<'a>(pub(crate) &'a App);

impl Widget for InstructionRow<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        if app.input.mode == Mode::Palette {
            buf.set_string(area.x, area.y, ": ", THEME.title);
            app.input.palette.area().render(Rect { x: area.x + 2, width: area.width - 2, ..area }, buf);
            return;
        }
        let now = app.session.now.as_ref().map_or("", |now| now.instruction.as_str());
        let prompt = "Instruction > ";
        buf.set_string(area.x, area.y, prompt, THEME.title);
        let rest = Rect { x: area.x + prompt.width() as u16, width: area.width - prompt.width() as u16, ..area };
        if app.input.mode == Mode::Typing {
            let hint = match app.completions().first().filter(|_| !app.input.editor.text().is_empty()) {
                Some(whole) => format!("  tab: {}", fit(whole, usize::from(area.width) / 3)),
                None => format!("  now: {}", fit(now, usize::from(area.width) / 3)),
            };
            // What is typed needs the room first.
            let is_tight = app.input.editor.text().width() + hint.width() + 1 > usize::from(rest.width);
            let hint = if is_tight { String::new() } else { hint };
            let typed = rest.width.saturating_sub(hint.width() as u16);
            app.input.editor.area().render(Rect { width: typed, ..rest }, buf);
            buf.set_string(rest.x + typed, rest.y, hint, THEME.quiet);
            return;
        }
        let mut spans = vec![Span::styled(fit(now, usize::from(rest.width)), THEME.instruction)];
        let left = usize::from(rest.width).saturating_sub(now.width());
        match &app.session.replaced {
            Some(old) if left > 12 => {
                spans.push(Span::styled(format!("  (was: {})", fit(old, left - 10)), THEME.quiet));
            }
            _ => {}
        }
        Line::from(spans).render(rest, buf);
    }
}
