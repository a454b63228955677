//! Pages and their lists.

use super::{Effect, send};
use crate::explore::verb::Page;
use crate::explore::worker::Command;
use crate::tui::app::App;
use crate::tui::keys::Mode;

/// Shows a page. Everything is drawn anew: pictures lie over the cells that change.
pub fn turn_to(app: &mut App, page: Page) -> Vec<Effect> {
    if app.page == page {
        return vec![];
    }
    app.page = page;
    app.selected = 0;
    if matches!(app.mode, Mode::Manual) && page != Page::Main {
        app.mode = Mode::Watch;
    }
    app.picture = None;
    vec![Effect::Encode, Effect::Repaint]
}

pub(super) fn show(app: &mut App, page: Page) -> Vec<Effect> {
    let page = if app.page == page { Page::Main } else { page };
    let mut effects = turn_to(app, page);
    if app.page == Page::Branches {
        let branch = app.now.as_ref().map_or(0, |now| now.time.branch);
        app.selected = branch;
        app.divergence = None;
        // The branch that this one left is what one wants to see it beside.
        let other = app.now.as_ref().and_then(|now| now.time.branches.get(branch)?.left);
        effects.extend(other.map(|(other, _)| Effect::Send(Command::Diverge((other + 1).to_string()))));
    }
    effects
}

pub(super) fn select(app: &mut App, by: i8) -> Vec<Effect> {
    let rows = app.rows();
    app.selected = app.selected.saturating_add_signed(isize::from(by)).min(rows.saturating_sub(1));
    match app.page {
        Page::Branches => send(Command::Diverge((app.selected + 1).to_string())),
        _ => vec![],
    }
}
