//! An encoded frame, and how it is put on the screen.

use std::num::NonZeroU16;

use ratatui::buffer::{Buffer, CellDiffOption};
use ratatui::layout::{Rect, Size};
use ratatui::style::{Color, Modifier, Style};
use ratatui::widgets::Widget;

use super::job::Job;
use super::protocol::Protocol;
use super::{blocks, classes, coarse, inline, letters, overlay, placeholder, sixel};
use crate::domain::Class;

/// An encoded frame.
#[derive(Clone)]
pub struct Picture {
    /// How it is encoded.
    pub(crate) protocol: Protocol,
    /// The character cells that it fills.
    pub(crate) cells: Size,
    /// What is put on the screen.
    pub(crate) content: Content,
    /// What the letters in it mean, the largest things first; nothing where it has none.
    pub(crate) legend: Vec<(char, Class)>,
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
        let frame = coarse::coarse(overlay::shown(job.overlay, &job.frame, &job.recent), job.coarseness);
        let job = &Job { frame, recent: Vec::new(), ..job.clone() };
        let in_blocks = |mut cells: Vec<(char, Style)>| {
            // Numbers in the picture have to stay legible.
            if job.coarseness > 0 && job.labels.is_empty() {
                coarse::coarse_cells(&mut cells, usize::from(job.cells.width), job.coarseness);
            }
            Content::Cells(cells)
        };
        let content = match job.protocol {
            Protocol::HalfBlocks => in_blocks(blocks::draw(job)),
            Protocol::Ascii => in_blocks(classes::draw(job)),
            Protocol::Kitty if job.in_tmux => Content::Placed(inline::kitty(job)),
            Protocol::Kitty => Content::Laid(inline::kitty(job), inline::rows_sent(job)),
            Protocol::Iterm2 => Content::Drawn(inline::iterm2(job)),
            Protocol::Sixel => Content::Drawn(sixel::draw(job)),
        };
        let legend = match job.protocol {
            Protocol::Ascii => letters::legend(&job.frame.ids, &job.classes, &job.letters),
            _ => Vec::new(),
        };
        Picture { protocol: job.protocol, cells: job.cells, content, legend }
    }

    /// Whether it lies over the cells, whatever is written there: what is opened over it has to be left out of its area, from
    /// some row down.
    pub(crate) fn lies_over(&self) -> bool {
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
