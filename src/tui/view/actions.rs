//! The page of every action of the branch in hand: what was done, by whom, and under which words.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::widgets::Widget;

use super::panel::{panel, put, wrap};
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The page.
pub(crate) struct ActionsView<'a>(pub(crate) &'a App);

impl Widget for ActionsView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let Some(now) = &app.session.now else { return };
        let lines = &app.actions.lines;
        let inner = panel(buf, area, "Actions", &format!("{} on this branch, * is in hand", lines.len()));
        if lines.is_empty() {
            let nothing = "nothing was done yet: space lets the agent act, n takes one step";
            for (row, line) in (0..).zip(wrap(nothing, usize::from(inner.width), "")) {
                put(buf, inner, row, line, THEME.quiet);
            }
        }
        let first = (app.actions.selected + 1).saturating_sub(usize::from(inner.height));
        for (row, (at, line)) in (0..inner.height).zip(lines.iter().enumerate().skip(first)) {
            let selected = at == app.actions.selected;
            let style = match (selected, line.done, line.completed) {
                (true, ..) => THEME.chosen,
                (false, false, _) => THEME.bad,
                (false, true, true) => THEME.good,
                (false, true, false) => Style::new(),
            };
            let mark = if at + 1 == now.time.at as usize { '*' } else { ' ' };
            let before = at.checked_sub(1).and_then(|before| lines.get(before));
            let text = line.line(at + 1, before);
            put(buf, inner, row, format!("{}{mark}{text}", if selected { ">" } else { " " }), style);
        }
    }
}
