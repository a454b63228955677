//! Lines that are typed over the screen: instructions and verbs.

use super::Effect;
use super::on_action::perform;
use crate::explore::verb;
use crate::tui::app::App;
use crate::tui::keys::Mode;
use crate::tui::log::Tone;

/// Opens a line or list over the screen; what keys meant before comes back when it closes.
pub(super) fn open_line(app: &mut App, mode: Mode) {
    if matches!(app.mode, Mode::Watch | Mode::Manual) {
        app.under = app.mode;
    }
    app.mode = mode;
}

/// A picture that floats over the cells has to be drawn anew when something covers or uncovers it.
pub(super) fn uncover(app: &App) -> Vec<Effect> {
    if app.graphics.protocol.floats() { vec![Effect::Repaint] } else { vec![] }
}

/// Does what was typed in the palette, or fills in the verb that is selected there.
pub(super) fn obey_line(app: &mut App) -> Vec<Effect> {
    let line = app.palette.text().trim().to_string();
    match verb::parse(&line) {
        Ok(verb) => {
            app.mode = app.under;
            let mut effects = uncover(app);
            effects.extend(perform(app, verb));
            effects
        }
        Err(complaint) => {
            match verb::matching(&line).get(app.selected) {
                Some(said) if !line.contains(' ') && said.name != line => {
                    app.palette.open(said.name);
                    if said.arguments.is_empty() {
                        return obey_line(app);
                    }
                    app.palette.open(&format!("{} ", said.name));
                }
                _ => app.note(Tone::Bad, complaint),
            }
            vec![]
        }
    }
}

/// Fills in what the typed text begins.
pub(super) fn complete(app: &mut App) {
    match app.mode {
        Mode::Palette => {
            if let Some(said) = verb::matching(app.palette.text()).get(app.selected) {
                app.palette.open(&format!("{} ", said.name));
            }
        }
        _ => {
            if let Some(whole) = app.completions().first() {
                app.editor.open(whole);
            }
        }
    }
}
