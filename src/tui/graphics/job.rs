//! What is to be encoded, and how.

use std::sync::Arc;

use ratatui::layout::Size;

use super::labels::ThingLabel;
use super::letters::{Letters, Names};
use super::overlay::Overlay;
use super::protocol::Protocol;
use crate::house::view::Frame;

/// A frame to be encoded.
#[derive(Clone)]
pub struct Job {
    /// The frame that the agent sees, or a pair of them.
    pub frame: Arc<Frame>,
    /// What is shown of it.
    pub overlay: Overlay,
    /// How coarse it may be, from 0.
    pub coarseness: u8,
    /// The most bytes that it may take where it is one escape sequence: then it is as fine as that allows.
    pub budget: Option<u64>,
    /// It is shown in block characters whatever the protocol: its sequences are too large for the link.
    pub in_blocks: bool,
    /// Sequences have to pass through tmux.
    pub in_tmux: bool,
    /// The frames before it, newest first, where the overlay shows them.
    pub recent: Vec<Arc<Frame>>,
    /// The letters of the scene's classes.
    pub letters: Arc<Letters>,
    /// The class of each instance code in the frame.
    pub classes: Arc<Names>,
    /// What is numbered in it.
    pub labels: Vec<ThingLabel>,
    /// How the terminal shows pictures.
    pub protocol: Protocol,
    /// The character cells that it fills.
    pub cells: Size,
    /// The pixels of a character cell, width and height.
    pub cell_pixels: (u16, u16),
}
