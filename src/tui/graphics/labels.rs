//! Numbers on the things that can be acted on, and a box around what the policy is about to act on.

use ratatui::style::{Color, Modifier, Style};

use super::Job;
use crate::report::export::lettering::{ADVANCE, glyph};

/// A numbered thing in the frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    /// Its edges in the frame: left, top, right, bottom, in pixels.
    pub bounds: [u16; 4],
    /// The numbers of the interactions with it, and its name where there is room: `1`, or `1,4 mug`.
    pub text: String,
    /// The policy is about to act on it.
    pub chosen: bool,
}

const PLAIN: (u8, u8, u8) = (255, 255, 255);
const CHOSEN: (u8, u8, u8) = (255, 214, 0);
const INK: (u8, u8, u8) = (0, 0, 0);

fn colour(label: &Label) -> (u8, u8, u8) {
    if label.chosen { CHOSEN } else { PLAIN }
}

/// Writes the labels over character cells, each in the middle of its thing.
pub fn over_cells(job: &Job, cells: &mut [(char, Style)]) {
    let (columns, rows) = (usize::from(job.cells.width), usize::from(job.cells.height));
    let (width, height) = (job.frame.width.max(1), job.frame.height.max(1));
    for label in &job.labels {
        let [left, top, right, bottom] = label.bounds.map(usize::from);
        let row = ((top + bottom) / 2 * rows / height).min(rows.saturating_sub(1));
        let text = format!(" {} ", label.text);
        let length = text.chars().count();
        let middle = (left + right) / 2 * columns / width;
        let start = middle.saturating_sub(length / 2).min(columns.saturating_sub(length));
        let (r, g, b) = colour(label);
        let style = Style::new().fg(Color::Black).bg(Color::Rgb(r, g, b)).add_modifier(Modifier::BOLD);
        for (column, symbol) in (start..columns).zip(text.chars()) {
            if let Some(cell) = cells.get_mut(row * columns + column) {
                *cell = (symbol, style);
            }
        }
    }
}

/// Draws the labels into a copy of the frame's pixels: an outline for each thing, and its numbers on a plate.
pub fn over_pixels(job: &Job) -> Vec<u8> {
    let mut canvas = Canvas { rgb: job.frame.rgb.clone(), width: job.frame.width, height: job.frame.height };
    for label in &job.labels {
        let [left, top, right, bottom] = label.bounds.map(i32::from);
        let ink = colour(label);
        let thick = if label.chosen { 2 } else { 1 };
        canvas.fill(left, top, right, top + thick - 1, ink);
        canvas.fill(left, bottom - thick + 1, right, bottom, ink);
        canvas.fill(left, top, left + thick - 1, bottom, ink);
        canvas.fill(right - thick + 1, top, right, bottom, ink);
    }
    for label in &job.labels {
        canvas.plate(label);
    }
    canvas.rgb
}

struct Canvas {
    rgb: Vec<u8>,
    width: usize,
    height: usize,
}

impl Canvas {
    fn fill(&mut self, left: i32, top: i32, right: i32, bottom: i32, (r, g, b): (u8, u8, u8)) {
        for y in top.max(0)..=bottom.min(self.height as i32 - 1) {
            for x in left.max(0)..=right.min(self.width as i32 - 1) {
                let at = 3 * (y as usize * self.width + x as usize);
                self.rgb[at..at + 3].copy_from_slice(&[r, g, b]);
            }
        }
    }

    fn plate(&mut self, label: &Label) {
        let scale = if label.text.len() <= 3 { 2 } else { 1 };
        let (advance, height) = (ADVANCE as i32 * scale, 7 * scale);
        let width = label.text.chars().count() as i32 * advance + scale;
        let [left, top, right, bottom] = label.bounds.map(i32::from);
        let x = ((left + right - width) / 2).clamp(0, (self.width as i32 - width).max(0));
        let y = ((top + bottom - height) / 2 - scale).clamp(0, (self.height as i32 - height - 2 * scale).max(0));
        self.fill(x, y, x + width - 1, y + height + 2 * scale - 1, colour(label));
        for (place, symbol) in (0..).zip(label.text.chars()) {
            for (row, bits) in (0..).zip(glyph(symbol)) {
                for column in (0..5).filter(|column| bits >> (4 - column) & 1 == 1) {
                    let (px, py) = (x + scale + place * advance + column * scale, y + scale + row * scale);
                    self.fill(px, py, px + scale - 1, py + scale - 1, INK);
                }
            }
        }
    }
}
