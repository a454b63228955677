//! The encoded frame in a panel.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::Widget;

use super::panel::put;
use super::{palette, suggestions, wish_list};
use crate::tui::app::App;
use crate::tui::keys::Mode;
use crate::tui::theme::THEME;

/// Draws the encoded frame, or says that it is under way. What is opened over the page stays uncovered by it.
pub(super) fn picture(app: &App, area: Rect, buf: &mut Buffer) {
    // The help stands anywhere over it.
    if app.input.mode == Mode::Help && app.terminal.graphics.protocol.floats() {
        return;
    }
    match &app.frame.picture {
        Some(picture) if picture.lies_over() => {
            let page = app.layout().map_or(area, |layout| layout.page);
            let top = match app.input.mode {
                Mode::Palette => palette::place(page).y,
                Mode::Typing => suggestions::place(app, page).map_or(area.bottom(), |area| area.y),
                Mode::WishList => wish_list::place(app, page).y,
                Mode::Watch | Mode::Manual | Mode::Help => area.bottom(),
            };
            picture.render(Rect { height: area.height.min(top.saturating_sub(area.y)), ..area }, buf);
        }
        Some(picture) => picture.render(area, buf),
        None => put(buf, area, area.height / 2, "  drawing ...", THEME.quiet),
    }
}
