//! The terminal, and the picture in it.

use std::sync::Arc;

use ratatui::layout::Size;

use crate::tui::graphics::Picture;
use crate::tui::graphics::Protocol;
use crate::tui::graphics::letters::{Letters, Names};
use crate::tui::theme::Ability;

/// How pictures are shown, and why.
#[derive(Clone, Debug)]
pub struct Graphics {
    /// By which protocol.
    pub protocol: Protocol,
    /// Why by that one.
    pub reason: String,
    /// The pixels of a character cell, width and height.
    pub cell_pixels: (u16, u16),
    /// Sequences have to pass through tmux.
    pub in_tmux: bool,
}

/// What is known of the terminal.
pub struct TerminalState {
    /// Its size in character cells.
    pub(crate) size: Size,
    /// What it can show.
    pub(crate) ability: Ability,
    /// How it shows pictures.
    pub(crate) graphics: Graphics,
    /// Its mouse is heard.
    pub(crate) mouse: bool,
}

/// The frame as it is shown.
#[derive(Default)]
pub struct FrameState {
    /// The frame, encoded.
    pub(crate) picture: Option<Picture>,
    /// The letters of the scene's classes.
    pub(crate) letters: Arc<Letters>,
    /// The classes of the instances in the frame.
    pub(crate) names: Arc<Names>,
}

/// What pictures cost on the wire, in bytes.
#[derive(Default)]
pub struct Traffic {
    /// The most that a step may cost.
    pub(crate) limit: Option<u64>,
    /// How coarse pictures are to keep to that.
    pub(crate) coarseness: u8,
    /// What the newest step cost.
    pub(crate) of_step: Option<u64>,
    /// What a second cost, over the last while.
    pub(crate) of_second: Option<u64>,
}
