//! Numbers on the things that can be acted on, and a box around what the policy is about to act on.

use embedded_graphics::mono_font::iso_8859_1::{FONT_6X10, FONT_9X15_BOLD};
use embedded_graphics::prelude::{Point, Primitive, Size};
use embedded_graphics::primitives::{PrimitiveStyle, PrimitiveStyleBuilder, Rectangle, StrokeAlignment};
use ratatui::layout::Size as Cells;
use ratatui::style::{Color, Modifier, Style};

use crate::house::view::Frame;
use crate::report::pixmap::{Pixmap, RgbColour, rgb888};

/// A numbered thing in the frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ThingLabel {
    /// Its edges in the frame: left, top, right, bottom, in pixels.
    pub(crate) bounds: [u16; 4],
    /// The numbers of the interactions with it, and its name where there is room: `1`, or `1,4 mug`.
    pub(crate) text: String,
    /// The policy is about to act on it.
    pub(crate) chosen: bool,
}

const PLAIN: RgbColour = [255, 255, 255];
const CHOSEN: RgbColour = [255, 214, 0];
const INK: RgbColour = [0, 0, 0];

fn colour(label: &ThingLabel) -> RgbColour {
    if label.chosen { CHOSEN } else { PLAIN }
}

/// Writes the labels over character cells, each in the middle of its thing.
pub(crate) fn over_cells(labels: &[ThingLabel], frame: &Frame, size: Cells, cells: &mut [(char, Style)]) {
    let (columns, rows) = (usize::from(size.width), usize::from(size.height));
    let (width, height) = (frame.width.max(1), frame.height.max(1));
    for label in labels {
        let [left, top, right, bottom] = label.bounds.map(usize::from);
        let row = ((top + bottom) / 2 * rows / height).min(rows.saturating_sub(1));
        let text = format!(" {} ", label.text);
        let length = text.chars().count();
        let middle = (left + right) / 2 * columns / width;
        let start = middle.saturating_sub(length / 2).min(columns.saturating_sub(length));
        let [r, g, b] = colour(label);
        let style = Style::new().fg(Color::Rgb(0, 0, 0)).bg(Color::Rgb(r, g, b)).add_modifier(Modifier::BOLD);
        for (column, symbol) in (start..columns).zip(text.chars()) {
            if let Some(cell) = cells.get_mut(row * columns + column) {
                *cell = (symbol, style);
            }
        }
    }
}

/// Draws the labels into a copy of the frame's pixels: an outline for each thing, and its numbers on a plate.
pub(crate) fn over_pixels(labels: &[ThingLabel], frame: &Frame) -> Vec<u8> {
    let mut pixmap = Pixmap { rgb: frame.rgb.clone(), width: frame.width, height: frame.height };
    for label in labels {
        let [left, top, right, bottom] = label.bounds.map(i32::from);
        let outline = Rectangle::with_corners(Point::new(left, top), Point::new(right, bottom));
        let style = PrimitiveStyleBuilder::new()
            .stroke_color(rgb888(colour(label)))
            .stroke_width(if label.chosen { 2 } else { 1 })
            .stroke_alignment(StrokeAlignment::Inside)
            .build();
        pixmap.draw(&outline.into_styled(style));
    }
    for label in labels {
        plate(&mut pixmap, label);
    }
    pixmap.rgb
}

/// Writes a label's text on a plate in the middle of its thing.
fn plate(pixmap: &mut Pixmap, label: &ThingLabel) {
    let (font, margin) = if label.text.len() <= 3 { (&FONT_9X15_BOLD, 2) } else { (&FONT_6X10, 1) };
    let letter = font.character_size;
    let width = label.text.chars().count() as i32 * letter.width as i32 + 2 * margin;
    let height = letter.height as i32;
    let [left, top, right, bottom] = label.bounds.map(i32::from);
    let x = ((left + right - width) / 2).clamp(0, (pixmap.width as i32 - width).max(0));
    let y = ((top + bottom - height) / 2).clamp(0, (pixmap.height as i32 - height).max(0));
    let plate = Rectangle::new(Point::new(x, y), Size::new(width as u32, height as u32));
    pixmap.draw(&plate.into_styled(PrimitiveStyle::with_fill(rgb888(colour(label)))));
    pixmap.text((x + margin) as usize, y as usize, &label.text, font, INK);
}
