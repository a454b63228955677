//! The mouse, where it is wanted: what a click picks, and the wheel as time.

use crossterm::event::{MouseButton, MouseEvent, MouseEventKind};
use ratatui::layout::Position;

use super::on_action::perform;
use super::pages::turn_to;
use super::{Effect, send};
use crate::domain::{Cell, Instance};
use crate::explore::inspect::things;
use crate::explore::verb::{Page, Verb};
use crate::explore::worker::Command;
use crate::tui::app::App;
use crate::tui::keys::Mode;
use crate::tui::log::Tone;
use crate::tui::view::hit::{Hit, hit};

/// Does what the mouse asks for; nothing where it is not wanted, or while a line is typed.
pub(super) fn heed(app: &mut App, event: MouseEvent) -> Vec<Effect> {
    if !app.mouse || !matches!(app.mode, Mode::Watch | Mode::Manual) {
        return vec![];
    }
    app.newcomer = false;
    if app.now.is_none() {
        return vec![];
    }
    match event.kind {
        // The wheel never lets the policy step: at the end it stands still.
        MouseEventKind::ScrollUp => send(Command::Along { by: -1, steps: false }),
        MouseEventKind::ScrollDown => send(Command::Along { by: 1, steps: false }),
        MouseEventKind::Down(MouseButton::Left) => match hit(app, Position { x: event.column, y: event.row }) {
            Some(Hit::Candidate(number)) => perform(app, Verb::Interact(number)),
            Some(Hit::Step(step)) => send(Command::Seek(step)),
            Some(Hit::Thing(instance)) => inspect(app, instance),
            Some(Hit::Cell(cell)) => {
                tell(app, cell);
                vec![]
            }
            Some(Hit::Row(row)) => {
                app.selected = row;
                perform(app, Verb::Select(0))
            }
            None => vec![],
        },
        _ => vec![],
    }
}

/// Shows a thing on the page of the world.
fn inspect(app: &mut App, instance: Instance) -> Vec<Effect> {
    let effects = turn_to(app, Page::World);
    if let Some(now) = &app.now {
        app.selected = things(now).iter().position(|thing| thing.instance == instance).unwrap_or(0);
    }
    effects
}

/// What is known of a cell.
fn tell(app: &mut App, cell: Cell) {
    let Some(now) = &app.now else { return };
    let painted = app.landscape.as_ref().filter(|_| app.paints_values).and_then(|(values, _)| {
        let height = values.heights.iter().find(|height| height.cell == cell)?;
        let (heading, value) = height.facing(app.heading);
        Some(format!("{} {value:.2} facing {}", values.measure.letter(), heading.name()))
    });
    let stands = if now.world.agent.cell == cell { "the agent stands here" } else { "free floor" };
    let words = match (painted, now.scene.has_cell(cell)) {
        (Some(painted), _) => painted,
        (None, true) => stands.to_string(),
        (None, false) => "not to be walked on".to_string(),
    };
    app.note(Tone::Note, format!("cell {},{}: {words}", cell.x, cell.z));
}
