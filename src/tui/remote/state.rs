//! What the screen knows.

use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use ratatui::layout::{Rect, Size};

use super::layout;
use super::worker::{RemoteEvent, Told};
use crate::explore::remote::command::RemoteCommand;
use crate::explore::remote::view::{RemoteChoice, RemotePicture};
use crate::house::view::Frame;
use crate::language::count::counted;
use crate::tui::app::{Graphics, Traffic};
use crate::tui::editor::Editor;
use crate::tui::graphics::letters::Letters;
use crate::tui::graphics::overlay::Overlay;
use crate::tui::graphics::{Job, Picture, Protocol};
use crate::tui::theme::{Ability, Scheme};

/// What the keyboard is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum RemoteMode {
    /// Keys command.
    Watch,
    /// A choice is made among what can be done.
    Choosing,
    /// Something is typed; what becomes of it.
    Typing(Typed),
    /// The keys are listed.
    Help,
}

/// What becomes of what is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Typed {
    /// The agent is told it.
    Instruction,
    /// It is compared with what is told.
    Comparison,
    /// It is a condition to stop at.
    Condition,
    /// It is a command.
    Command,
}

/// Waiting is told once it is worth telling.
const PATIENT: Duration = Duration::from_millis(400);

/// The state of the screen.
pub(crate) struct RemoteApp {
    pub(super) size: Size,
    pub(super) graphics: Graphics,
    pub(super) ability: Ability,
    pub(super) scheme: Scheme,
    commands: Sender<RemoteCommand>,
    pub(super) shown: Option<Box<RemotePicture>>,
    /// The picture, encoded for the terminal; nothing where there is none.
    pub(super) picture: Option<Picture>,
    /// What is to be seen has changed since it was encoded.
    is_picture_stale: bool,
    /// What pictures cost.
    pub(super) traffic: Traffic,
    pub(super) is_running: bool,
    pub(super) said: Option<(bool, String)>,
    /// Why what was typed or pressed last is not done; it stays whatever comes of what was asked before.
    pub(super) refused: Option<String>,
    pub(super) compared: Option<Vec<(String, Vec<RemoteChoice>)>>,
    pub(super) mode: RemoteMode,
    pub(super) editor: Editor,
    /// What would lose steps, and was asked for once.
    pub(super) asked: Option<RemoteCommand>,
    /// Which choice is marked.
    pub(super) marked: usize,
    /// Since when the environment is waited for, and for how many commands.
    pub(super) waiting: Option<(Instant, usize)>,
    runs: bool,
}

impl RemoteApp {
    pub(super) fn new(
        size: Size,
        graphics: Graphics,
        ability: Ability,
        scheme: Scheme,
        commands: Sender<RemoteCommand>,
    ) -> RemoteApp {
        RemoteApp {
            size,
            graphics,
            ability,
            scheme,
            commands,
            shown: None,
            picture: None,
            is_picture_stale: false,
            traffic: Traffic::default(),
            is_running: false,
            said: None,
            refused: None,
            compared: None,
            mode: RemoteMode::Watch,
            editor: Editor::default(),
            asked: None,
            marked: 0,
            waiting: Some((Instant::now(), 1)),
            runs: false,
        }
    }

    /// The policy acts as soon as the environment is there.
    pub(super) fn run_when_open(&mut self) {
        self.runs = true;
    }

    /// Whether the environment is waited for.
    pub(super) fn is_waiting(&self) -> bool {
        self.waiting.is_some()
    }

    /// Whether it is waited for so long that this is worth telling.
    pub(super) fn waits_long(&self) -> bool {
        self.waiting.is_some_and(|(since, _)| since.elapsed() > PATIENT)
    }

    /// Asks for something.
    pub(super) fn ask(&mut self, command: RemoteCommand) {
        // A worker that is gone has said why.
        let _ = self.commands.send(command);
        let (since, many) = self.waiting.unwrap_or_else(|| (Instant::now(), 0));
        self.waiting = Some((since, many + 1));
        (self.compared, self.refused) = (None, None);
    }

    /// Whether something that would lose steps was asked for again: the first time it is said what would be lost.
    pub(super) fn is_sure(&mut self, command: &RemoteCommand) -> bool {
        let unsaved = self.shown.as_ref().map_or(0, |shown| shown.unsaved);
        // While the environment is waited for nothing can be saved, and the screen says that one key leaves.
        let is_stuck = *command == RemoteCommand::Quit && self.waits_long();
        if unsaved == 0 || is_stuck || self.asked.as_ref() == Some(command) {
            return true;
        }
        self.asked = Some(command.clone());
        let what = if *command == RemoteCommand::Quit { "leaves" } else { "forgets them" };
        let steps = counted(unsaved, "step");
        self.refused = Some(format!("Not saved: {steps}. S saves, the same again {what}"));
        false
    }

    /// Takes in what the worker tells.
    pub(super) fn on_event(&mut self, event: RemoteEvent) -> anyhow::Result<()> {
        self.waiting = match self.waiting {
            Some((_, many)) if many > 1 => Some((Instant::now(), many - 1)),
            _ => None,
        };
        match event.0 {
            Told::Failed(problem) => anyhow::bail!(problem),
            Told::Compared(both) => self.compared = Some(both),
            Told::Shown(shown, is_running, said) => {
                // What was said stays until there is something else to say, or something was done.
                let moved = self.shown.as_ref().is_none_or(|before| before.step != shown.step);
                if said.is_some() || moved {
                    self.said = said;
                }
                self.is_running = is_running;
                self.marked = self.marked.min(shown.choices.len().saturating_sub(1));
                self.shown = Some(shown);
                self.is_picture_stale = true;
                if std::mem::take(&mut self.runs) {
                    self.ask(RemoteCommand::Run);
                }
            }
        }
        Ok(())
    }

    pub(super) fn resize(&mut self, size: Size) {
        (self.size, self.picture, self.is_picture_stale) = (size, None, true);
        self.editor.refit();
    }

    /// Encodes the picture for the place that it has, where that is to be done; whether there is a new one.
    pub(super) fn encode(&mut self) -> bool {
        if std::mem::take(&mut self.is_picture_stale) {
            self.picture = self.encoded();
            return self.picture.is_some();
        }
        false
    }

    fn encoded(&mut self) -> Option<Picture> {
        let seen = self.shown.as_ref()?.observation.picture.as_ref()?;
        let area = layout::picture_area(Rect::new(0, 0, self.size.width, self.size.height));
        let cells = fitting(area, (seen.width, seen.height), self.graphics.cell_pixels);
        if cells.width == 0 || cells.height == 0 {
            return None;
        }
        let (width, height, rgb) = (seen.width, seen.height, seen.rgb.clone());
        let frame = Arc::new(Frame { width, height, rgb, depth: Vec::new(), ids: Vec::new() });
        // Letters stand for House's classes; elsewhere they are shades.
        if self.graphics.protocol == Protocol::Ascii {
            return Some(layout::shaded(&frame, cells));
        }
        let picture = Picture::encode(&Job {
            frame,
            overlay: Overlay::Colour,
            coarseness: self.traffic.coarseness,
            budget: self.traffic.budget(),
            in_blocks: self.traffic.are_sequences_too_large(),
            in_tmux: self.graphics.in_tmux,
            recent: Vec::new(),
            letters: Arc::new(Letters::default()),
            classes: Arc::default(),
            labels: Vec::new(),
            protocol: self.graphics.protocol,
            cells,
            cell_pixels: self.graphics.cell_pixels,
        });
        self.traffic.take_in(&picture);
        Some(picture)
    }
}

/// The most cells of an area that keep a picture's shape.
fn fitting(area: Rect, (width, height): (usize, usize), (across, down): (u16, u16)) -> Size {
    let (across, down) = (f64::from(across.max(1)), f64::from(down.max(1)));
    let shape = width as f64 / height.max(1) as f64;
    let (most_wide, most_high) = (f64::from(area.width) * across, f64::from(area.height) * down);
    let high = most_high.min(most_wide / shape);
    let cells = |pixels: f64, cell: f64, most: u16| ((pixels / cell).round() as u16).clamp(u16::from(most > 0), most);
    Size { width: cells(high * shape, across, area.width), height: cells(high, down, area.height) }
}
