//! Where everything is on the screen of annotation.

use ratatui::layout::Rect;

use super::panel::wrap;
use crate::tui::graphics::Protocol;
use crate::tui::layout::pictured;

/// The smallest screen on which it can be done.
const SMALLEST: (u16, u16) = (40, 12);
/// Rows for what letters mean, where pictures are letters.
const LEGEND: u16 = 3;

/// What there is to see of a span.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sight {
    /// Nothing: the steps have all the room.
    None,
    /// One frame beside the steps.
    Film,
    /// So many frames in a row above the steps.
    Strip(u32),
}

/// Where everything is.
pub(crate) struct AnnotateLayout {
    pub(crate) picture: Rect,
    pub(super) legend: Rect,
    /// Where the frames of the strip are named.
    pub(super) captions: Rect,
    pub(super) steps: Rect,
    pub(super) sentence: Rect,
    pub(super) message: Rect,
    pub(super) keys: Rect,
}

impl AnnotateLayout {
    /// The parts of a screen; nothing where it is too small.
    pub(crate) fn of(
        screen: Rect,
        sight: Sight,
        sentences: &[String],
        protocol: Protocol,
        cell_pixels: (u16, u16),
    ) -> Option<AnnotateLayout> {
        if screen.width < SMALLEST.0 || screen.height < SMALLEST.1 {
            return None;
        }
        let row = |y: u16| Rect { y: screen.y + y, height: 1, ..screen };
        let body = Rect { y: screen.y + 1, height: screen.height - 4, ..screen };
        let letters = if protocol == Protocol::Ascii { LEGEND } else { 0 };
        let (picture, captions, steps) = match sight {
            Sight::Strip(many) => {
                let lines = 2 + lines_of(sentences, usize::from(body.width)).len() as u16;
                let rows = body.height.saturating_sub(lines + letters + 1).max(body.height / 3);
                let picture = pictured(Rect { height: rows, ..body }, many, cell_pixels);
                let captions = Rect { y: picture.bottom(), height: 1, ..picture };
                let top = captions.bottom() + letters;
                (picture, captions, Rect { y: top, height: body.bottom().saturating_sub(top), ..body })
            }
            Sight::Film => {
                let left = Rect { width: body.width / 2, height: body.height - letters, ..body };
                let picture = Rect { x: left.x, ..pictured(left, 1, cell_pixels) };
                let steps = Rect { x: picture.right() + 2, width: body.width - picture.width - 2, ..body };
                (picture, Rect { height: 0, ..picture }, steps)
            }
            Sight::None => (Rect { width: 0, height: 0, ..body }, Rect { height: 0, ..body }, body),
        };
        let legend = Rect { y: captions.bottom().max(picture.bottom()), height: letters, ..picture };
        let foot = screen.height - 3;
        let (sentence, message, keys) = (row(foot), row(foot + 1), row(foot + 2));
        Some(AnnotateLayout { picture, legend, captions, steps, sentence, message, keys })
    }
}

/// Numbered steps in lines of a width, each with the position of its step.
pub(super) fn lines_of(sentences: &[String], width: usize) -> Vec<(usize, String)> {
    let lines = sentences.iter().enumerate().flat_map(|(step, sentence)| {
        let text = format!("{} {}", step + 1, sentence.trim());
        wrap(&text, width.saturating_sub(2), "  ").into_iter().map(move |line| (step, line))
    });
    lines.collect()
}
