//! Pages and their lists.

use super::effect::{Effect, send};
use crate::explore::session::SessionCommand;
use crate::explore::verb::ExplorerPage;
use crate::tui::app::App;
use crate::tui::keys::Mode;

/// Shows a page. Everything is drawn anew: pictures lie over the cells that change.
pub(crate) fn turn_to(app: &mut App, page: ExplorerPage) -> Vec<Effect> {
    if app.page == page {
        return vec![];
    }
    app.page = page;
    app.select(0);
    if matches!(app.input.mode, Mode::Manual) && !matches!(page, ExplorerPage::Main | ExplorerPage::Frame) {
        app.input.mode = Mode::Watch;
    }
    app.frame.picture = None;
    vec![Effect::Encode, Effect::Repaint]
}

pub(super) fn show(app: &mut App, page: ExplorerPage) -> Vec<Effect> {
    let page = if app.page == page { ExplorerPage::Main } else { page };
    let mut effects = turn_to(app, page);
    if app.page == ExplorerPage::Actions {
        let at = app.session.now.as_ref().map_or(0, |now| now.time.at as usize);
        app.actions.selected = at.saturating_sub(1);
        app.actions.lines.clear();
        effects.push(Effect::Send(SessionCommand::Actions));
    }
    if app.page == ExplorerPage::Branches {
        let branch = app.session.now.as_ref().map_or(0, |now| now.time.branch);
        app.branches.selected = branch;
        app.branches.divergence = None;
        // The branch that this one left is what one wants to see it beside.
        let other = app.session.now.as_ref().and_then(|now| now.time.branches.get(branch)?.left);
        effects.extend(other.map(|(other, _)| Effect::Send(SessionCommand::Diverge((other + 1).to_string()))));
    }
    effects
}

pub(super) fn select(app: &mut App, by: i8) -> Vec<Effect> {
    let rows = app.rows();
    app.select(app.selected().saturating_add_signed(isize::from(by)).min(rows.saturating_sub(1)));
    match app.page {
        ExplorerPage::Branches => send(SessionCommand::Diverge((app.branches.selected + 1).to_string())),
        _ => vec![],
    }
}
