//! Pictures in a terminal: which way, and the frame encoded that way. Encoding happens on a thread of its own.

pub mod blocks;
pub mod classes;
pub mod coarse;
pub mod detect;
pub mod encoder;
pub mod inline;
pub mod labels;
pub mod overlay;
mod placeholder;
pub mod sixel;

use std::num::NonZeroU16;
use std::sync::Arc;

use ratatui::buffer::{Buffer, CellDiffOption};
use ratatui::layout::{Rect, Size};
use ratatui::style::{Color, Modifier, Style};
use ratatui::widgets::Widget;

use crate::house::view::Frame;
use classes::Letters;
use labels::Label;
use overlay::Overlay;

/// How a picture can be shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// The kitty graphics protocol; the terminal scales.
    Kitty,
    /// iTerm2's inline images; the terminal scales.
    Iterm2,
    /// Sixel graphics.
    Sixel,
    /// Coloured block characters.
    HalfBlocks,
    /// A letter for each object class.
    Ascii,
}

impl Protocol {
    /// Every protocol, in the order in which the key goes round.
    pub const ALL: [Protocol; 5] =
        [Protocol::HalfBlocks, Protocol::Ascii, Protocol::Kitty, Protocol::Iterm2, Protocol::Sixel];

    /// The name that `--graphics` takes.
    pub fn name(self) -> &'static str {
        match self {
            Protocol::Kitty => "kitty",
            Protocol::Iterm2 => "iterm2",
            Protocol::Sixel => "sixel",
            Protocol::HalfBlocks => "halfblocks",
            Protocol::Ascii => "ascii",
        }
    }

    /// The next one, around.
    pub fn next(self) -> Protocol {
        let at = Protocol::ALL.iter().position(|&protocol| protocol == self).unwrap_or(0);
        Protocol::ALL[(at + 1) % Protocol::ALL.len()]
    }

    /// Whether the picture is drawn by an escape sequence that the screen's own cells do not know of, so that covering and
    /// uncovering it needs a full repaint.
    pub fn floats(self) -> bool {
        matches!(self, Protocol::Kitty | Protocol::Iterm2 | Protocol::Sixel)
    }
}

/// A frame to be encoded.
#[derive(Clone)]
pub struct Job {
    /// The frame.
    pub frame: Arc<Frame>,
    /// What is shown of it.
    pub overlay: Overlay,
    /// How coarse it may be, from 0.
    pub coarseness: u8,
    /// Sequences have to pass through tmux.
    pub in_tmux: bool,
    /// The frames before it, newest first, where the overlay shows them.
    pub recent: Vec<Arc<Frame>>,
    /// The letters of the scene's classes.
    pub letters: Arc<Letters>,
    /// For each instance code in the frame, its class letter's key; see [`classes::draw`].
    pub classes: Arc<classes::Names>,
    /// What is numbered in it.
    pub labels: Vec<Label>,
    /// How.
    pub protocol: Protocol,
    /// The character cells that it fills.
    pub cells: Size,
    /// The pixels of a character cell, width and height.
    pub cell_pixels: (u16, u16),
}

/// An encoded frame.
#[derive(Clone)]
pub struct Picture {
    /// How it is encoded.
    pub protocol: Protocol,
    /// The character cells that it fills.
    pub cells: Size,
    /// Its content.
    pub content: Content,
}

/// What an encoded frame consists of.
#[derive(Clone)]
pub enum Content {
    /// Characters with colours, row by row.
    Cells(Vec<(char, Style)>),
    /// A sequence that transmits the picture; placeholders then show it.
    Placed(String),
    /// A sequence that transmits the picture, to be laid over blank cells, and its height in pixels.
    Laid(String, usize),
    /// A sequence that draws the picture where the cursor is.
    Drawn(String),
}

impl Picture {
    /// Encodes a frame.
    pub fn encode(job: &Job) -> Picture {
        let frame = coarse::coarse(overlay::shown(job), job.coarseness);
        let job = &Job { frame, recent: Vec::new(), ..job.clone() };
        let content = match job.protocol {
            Protocol::HalfBlocks => Content::Cells(blocks::draw(job)),
            Protocol::Ascii => Content::Cells(classes::draw(job)),
            Protocol::Kitty if job.in_tmux => Content::Placed(inline::kitty(job)),
            Protocol::Kitty => Content::Laid(inline::kitty(job), job.frame.height),
            Protocol::Iterm2 => Content::Drawn(inline::iterm2(job)),
            Protocol::Sixel => Content::Drawn(sixel::draw(job)),
        };
        Picture { protocol: job.protocol, cells: job.cells, content }
    }

    /// Whether it lies over the cells, whatever is written there: what is opened over it has to be left out of its area, from
    /// some row down.
    pub fn lies_over(&self) -> bool {
        matches!(self.content, Content::Laid(..))
    }
}

/// Escape sequences are wider as text than on the screen.
const ONE: CellDiffOption = CellDiffOption::ForcedWidth(NonZeroU16::MIN);

impl Widget for &Picture {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let cut = !self.lies_over() && area.height < self.cells.height;
        if area.width < self.cells.width || cut || area.is_empty() {
            return;
        }
        let all = usize::from(self.cells.height).max(1);
        let area = Rect { width: self.cells.width, height: self.cells.height.min(area.height), ..area };
        match &self.content {
            Content::Cells(cells) => {
                for (position, (symbol, style)) in area.positions().zip(cells) {
                    buf[position].set_char(*symbol).set_style(*style);
                }
            }
            Content::Placed(transmit) => {
                for (row, line) in area.rows().enumerate() {
                    for (column, position) in line.positions().enumerate() {
                        let placeholder = placeholder::placeholder(row, column);
                        let first = (row, column) == (0, 0);
                        let symbol = if first { format!("{transmit}{placeholder}") } else { placeholder };
                        buf[position].set_symbol(&symbol).set_diff_option(ONE);
                        buf[position].fg = Color::Indexed(inline::KITTY_ID);
                        buf[position].bg = Color::Reset;
                        buf[position].modifier = Modifier::empty();
                    }
                }
            }
            Content::Laid(transmit, pixels) => {
                for position in area.positions() {
                    buf[position].reset();
                }
                let lay = inline::lay(area.width, area.height, pixels * usize::from(area.height) / all);
                buf[area.as_position()].set_symbol(&format!("{transmit}{lay} ")).set_diff_option(ONE);
            }
            Content::Drawn(sequence) => {
                for position in area.positions().skip(1) {
                    buf[position].set_diff_option(CellDiffOption::Skip);
                }
                buf[area.as_position()].set_symbol(sequence).set_diff_option(ONE);
            }
        }
    }
}
