//! An encoded frame, and how it is put on the screen.

use std::num::NonZeroU16;

use ratatui::buffer::{Buffer, CellDiffOption};
use ratatui::layout::{Rect, Size};
use ratatui::style::{Color, Modifier, Style};
use ratatui::widgets::Widget;

use super::job::Job;
use super::protocol::Protocol;
use super::{blocks, classes, coarse, inline, labels, letters, overlay, placeholder, sixel};
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
    /// It was encoded to keep to a budget.
    pub(crate) is_bounded: bool,
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
        let frame = overlay::shown(job.overlay, &job.frame, &job.recent);
        let job = &Job { frame, recent: Vec::new(), ..job.clone() };
        let content = match job.protocol {
            Protocol::Kitty | Protocol::Iterm2 | Protocol::Sixel if !job.in_blocks => in_budget(job),
            _ => None,
        };
        let content = content.unwrap_or_else(|| in_cells(job));
        let legend = match job.protocol {
            Protocol::Ascii => letters::legend(&job.frame.ids, &job.classes, &job.letters),
            _ => Vec::new(),
        };
        Picture { protocol: job.protocol, cells: job.cells, content, is_bounded: job.budget.is_some(), legend }
    }

    /// The bytes of the sequence that it is; those of cells depend on what is shown already.
    pub(crate) fn sequence_bytes(&self) -> u64 {
        self.content.sequence_bytes()
    }

    /// Whether it lies over the cells, whatever is written there: what is opened over it has to be left out of its area, from
    /// some row down.
    pub(crate) fn lies_over(&self) -> bool {
        matches!(self.content, Content::Laid(..))
    }
}

impl Content {
    fn sequence_bytes(&self) -> u64 {
        match self {
            Content::Cells(_) => 0,
            Content::Placed(sequence) | Content::Laid(sequence, _) | Content::Drawn(sequence) => sequence.len() as u64,
        }
    }
}

/// The frame in character cells; numbers are put over it however coarse it is, so that they stay legible.
fn in_cells(job: &Job) -> Content {
    let frame = coarse::coarse(job.frame.clone(), job.coarseness);
    let job = &Job { frame, ..job.clone() };
    let mut cells = match job.protocol {
        Protocol::Ascii => classes::draw(job),
        _ => blocks::draw(job),
    };
    if job.coarseness > 0 {
        coarse::coarse_cells(&mut cells, usize::from(job.cells.width), job.coarseness);
    }
    labels::over_cells(&job.labels, &job.frame, job.cells, &mut cells);
    Content::Cells(cells)
}

/// The frame as the finest sequence that keeps to the budget: coarser first, then without numbers. The terminal scales small
/// pictures up, so the coarsest always does; but sixels have to fill their place, and where even the coarsest are too large,
/// there is nothing.
fn in_budget(job: &Job) -> Option<Content> {
    let Some(most) = job.budget else { return Some(sequence(job, job.coarseness)) };
    let unnumbered = Job { labels: Vec::new(), ..job.clone() };
    let numbered = (!job.labels.is_empty()).then_some(job);
    let mut coarsest = None;
    for job in numbered.into_iter().chain([&unnumbered]) {
        for coarseness in 0..=coarse::COARSEST {
            let content = sequence(job, coarseness);
            if content.sequence_bytes() <= most {
                return Some(content);
            }
            coarsest = Some(content);
        }
    }
    coarsest.filter(|_| job.protocol != Protocol::Sixel)
}

fn sequence(job: &Job, coarseness: u8) -> Content {
    let job = &Job { frame: coarse::coarse(job.frame.clone(), coarseness), coarseness, ..job.clone() };
    match job.protocol {
        Protocol::Kitty if job.in_tmux => Content::Placed(inline::kitty(job)),
        Protocol::Kitty => Content::Laid(inline::kitty(job), inline::rows_sent(job)),
        Protocol::Iterm2 => Content::Drawn(inline::iterm2(job)),
        Protocol::Sixel | Protocol::HalfBlocks | Protocol::Ascii => Content::Drawn(sixel::draw(job)),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::testing;
    use crate::tui::theme::Ability;

    fn job(protocol: Protocol, budget: Option<u64>) -> Job {
        Job { budget, ..testing::app(80, 24, protocol, Ability::FULL).job().unwrap() }
    }

    #[test]
    fn a_sequence_keeps_to_its_budget_and_sixels_that_cannot_give_way_to_blocks() {
        for protocol in [Protocol::Kitty, Protocol::Iterm2, Protocol::Sixel] {
            let whole = Picture::encode(&job(protocol, None)).sequence_bytes();
            for budget in [u64::MAX, whole / 2, 2500, 1250, 300] {
                let picture = Picture::encode(&job(protocol, Some(budget)));
                let bytes = picture.sequence_bytes();
                if budget >= 1250 {
                    assert!(bytes <= budget, "{protocol:?}: {bytes} of {budget}");
                }
                assert!(bytes > 0 || protocol == Protocol::Sixel, "the terminal scales others up");
            }
        }
        let squeezed = Picture::encode(&job(Protocol::Sixel, Some(300)));
        let Content::Cells(cells) = &squeezed.content else { panic!("300 bytes hold no sixels") };
        assert_eq!(cells.len(), usize::from(squeezed.cells.width) * usize::from(squeezed.cells.height));
    }

    #[test]
    fn numbers_stay_legible_in_coarse_cells() {
        let mut job = job(Protocol::HalfBlocks, None);
        job.coarseness = coarse::COARSEST;
        assert!(!job.labels.is_empty());
        let Content::Cells(cells) = Picture::encode(&job).content else { panic!("cells") };
        let text: String = cells.iter().map(|(symbol, _)| *symbol).collect();
        assert!(job.labels.iter().any(|label| text.contains(&label.text)), "{text}");
    }
}
