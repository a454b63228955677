//! Going on, back and forth.

use super::{Effect, send};
use crate::explore::verb::Verb;
use crate::explore::worker::{Command, Going};
use crate::tui::app::App;
use crate::tui::keys::Mode;
use crate::tui::log::Tone;

pub(super) fn go_on(app: &mut App, by_policy: bool) -> Vec<Effect> {
    if app.going.is_some() && !by_policy {
        return send(Command::Go(None));
    }
    if app.mode == Mode::Manual {
        app.mode = Mode::Watch;
    }
    let in_the_past = app.now.as_ref().is_some_and(|now| (now.time.at as usize) < now.time.beats.len());
    send(Command::Go(Some(if in_the_past && !by_policy { Going::Replay } else { Going::Policy })))
}

/// Along the branch in hand. At its end a step forward is the policy's.
pub(super) fn travel(app: &mut App, verb: &Verb) -> Vec<Effect> {
    let Some(time) = app.now.as_ref().map(|now| now.time.clone()) else { return vec![] };
    let last = time.beats.len() as u32;
    let step = match verb {
        // Relative: more keys may come than states are shown.
        Verb::Back(steps) => return send(Command::Along { by: -(*steps as i32), steps: true }),
        Verb::Forward(steps) => return send(Command::Along { by: *steps as i32, steps: true }),
        Verb::Seek(step) => *step,
        Verb::NextEvent => time.event(true),
        Verb::LastEvent => time.event(false),
        Verb::Subtask(number) => match time.subtask(*number) {
            Some(step) => step,
            None => {
                app.note(Tone::Note, format!("subtask {number} is not done on this branch"));
                return vec![];
            }
        },
        _ => last,
    };
    send(Command::Seek(step))
}
