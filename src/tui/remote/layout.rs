//! Where what is on the page, and pictures for terminals that have characters alone.

use ratatui::layout::{Rect, Size};
use ratatui::style::Style;

use crate::house::view::Frame;
use crate::tui::graphics::{Content, Picture, Protocol};

/// From dark to light.
const SHADES: &[u8] = b" .:-=+*#%@";

/// Where what is shown.
pub(super) struct Areas {
    pub(super) head: Rect,
    pub(super) told: Rect,
    pub(super) left: Rect,
    pub(super) right: Rect,
    pub(super) timeline: Rect,
    pub(super) last: Rect,
    pub(super) keys: Rect,
}

/// Divides the screen.
pub(super) fn areas(area: Rect) -> Areas {
    let row =
        |y: u16| Rect { x: area.x, y: area.y + y.min(area.height.saturating_sub(1)), width: area.width, height: 1 };
    let body = area.height.saturating_sub(6);
    // A square of pixels is as high as half as many columns.
    let wide = (2 * body.saturating_sub(1)).min(area.width * 3 / 5);
    let left = Rect { x: area.x, y: area.y + 2, width: wide, height: body };
    let right = Rect { x: area.x + wide + 2, width: area.width.saturating_sub(wide + 2), ..left };
    let below = 2 + body;
    Areas { head: row(0), told: row(1), left, right, timeline: row(below), last: row(below + 1), keys: row(below + 3) }
}

/// Where the picture is drawn.
pub(super) fn picture_area(area: Rect) -> Rect {
    let left = areas(area).left;
    Rect { y: left.y + 1, height: left.height.saturating_sub(1), ..left }
}

/// A picture in characters alone, from dark to light.
pub(super) fn shaded(frame: &Frame, cells: Size) -> Picture {
    let (columns, rows) = (usize::from(cells.width), usize::from(cells.height));
    let mut content = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let (x, y) = (column * frame.width / columns, row * frame.height / rows);
            let at = 3 * (y * frame.width + x);
            let light: usize = frame.rgb[at..at + 3].iter().map(|&level| usize::from(level)).sum();
            let shade = SHADES[light * (SHADES.len() - 1) / (3 * 255)];
            content.push((char::from(shade), Style::new()));
        }
    }
    Picture {
        protocol: Protocol::Ascii,
        cells,
        content: Content::Cells(content),
        is_bounded: false,
        legend: Vec::new(),
    }
}
