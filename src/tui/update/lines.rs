//! Lines that are typed over the screen: instructions and verbs.

use super::effect::Effect;
use crate::explore::verb;
use crate::explore::verb::Verb;
use crate::tui::app::App;
use crate::tui::keys::Mode;

/// A picture that floats over the cells has to be drawn anew when something covers or uncovers it.
pub(super) fn uncover(app: &App) -> Vec<Effect> {
    if app.terminal.graphics.protocol.floats() { vec![Effect::Repaint] } else { vec![] }
}

/// The verb that was typed in the palette; without a whole one, the one that is selected there is filled in first.
pub(super) fn read_palette(app: &mut App) -> Option<Verb> {
    let line = app.input.palette.text().trim().to_string();
    let complaint = match verb::parse(&line) {
        Ok(verb) => return Some(verb),
        Err(complaint) => complaint,
    };
    match verb::matching(&line).get(app.input.selected_verb) {
        Some(entry) if !line.contains(' ') && entry.name != line => {
            app.input.palette.open(entry.name);
            if entry.arguments.is_empty() {
                return read_palette(app);
            }
            app.input.palette.open(&format!("{} ", entry.name));
        }
        // The list of verbs hides the log: it is said under the line itself.
        _ => app.input.complaint = Some(complaint),
    }
    None
}

/// Fills in what the typed text begins.
pub(super) fn complete(app: &mut App) {
    match app.input.mode {
        Mode::Palette => {
            if let Some(entry) = verb::matching(app.input.palette.text()).get(app.input.selected_verb) {
                app.input.palette.open(&format!("{} ", entry.name));
            }
        }
        _ => {
            if let Some(whole) = app.completions().first() {
                app.input.editor.open(whole);
            }
        }
    }
}
