//! The mouse, where it is wanted: what a click picks, and the wheel as time.

use crossterm::event::{MouseButton, MouseEvent, MouseEventKind};
use ratatui::layout::Position;

use super::effect::{Effect, send};
use super::on_action::on_action;
use super::pages::turn_to;
use crate::domain::{Cell, Instance};
use crate::explore::inspect::things;
use crate::explore::session::SessionCommand;
use crate::explore::verb::{ExplorerPage, Verb};
use crate::tui::app::App;
use crate::tui::keys::Mode;
use crate::tui::log::Tone;
use crate::tui::view::hit::target_at;
use crate::tui::view::target::Target;

/// Does what the mouse asks for; nothing where it is not wanted, or while a line is typed.
pub(super) fn on_pointer(app: &mut App, event: MouseEvent) -> Vec<Effect> {
    if !app.terminal.mouse || !matches!(app.input.mode, Mode::Watch | Mode::Manual) {
        return vec![];
    }
    app.input.newcomer = false;
    if app.session.now.is_none() {
        return vec![];
    }
    match event.kind {
        // The wheel never lets the policy step: at the end it stands still.
        MouseEventKind::ScrollUp => send(SessionCommand::Along { by: -1, steps: false }),
        MouseEventKind::ScrollDown => send(SessionCommand::Along { by: 1, steps: false }),
        MouseEventKind::Down(MouseButton::Left) => match target_at(app, Position { x: event.column, y: event.row }) {
            Some(Target::Candidate(number)) => on_action(app, Verb::Interact(number)),
            Some(Target::Step(step)) => send(SessionCommand::Seek(step)),
            Some(Target::Thing(instance)) => inspect(app, instance),
            Some(Target::Cell(cell)) => {
                describe_cell(app, cell);
                vec![]
            }
            Some(Target::Row(row)) => {
                app.select(row);
                on_action(app, Verb::Select(0))
            }
            None => vec![],
        },
        _ => vec![],
    }
}

/// Shows a thing on the page of the world.
fn inspect(app: &mut App, instance: Instance) -> Vec<Effect> {
    let effects = turn_to(app, ExplorerPage::World);
    if let Some(now) = &app.session.now {
        app.world.selected = things(now).iter().position(|thing| thing.instance == instance).unwrap_or(0);
    }
    effects
}

/// What is known of a cell.
fn describe_cell(app: &mut App, cell: Cell) {
    let Some(now) = &app.session.now else { return };
    let painted = app.value_map.painted().and_then(|(values, _)| {
        let found = values.cells.iter().find(|found| found.cell == cell)?;
        let (heading, value) = found.facing(app.value_map.heading);
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
