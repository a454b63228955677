//! The frame as letters, one for each object class: what a screen without colour shows, and what a reader can read.

use ratatui::style::{Color, Style};

use super::job::Job;
use super::letters::tint;
use crate::house::view::decode;

/// Tangent of half the field of view of 60 degrees.
const HALF_VIEW: f32 = 0.577_350_3;

/// One character a cell, row by row; the last rows name the letters that occur.
pub(crate) fn draw(job: &Job) -> Vec<(char, Style)> {
    let (columns, rows) = (usize::from(job.cells.width), usize::from(job.cells.height));
    let frame = &job.frame;
    let mut cells = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        let lines = row * frame.height / rows..((row + 1) * frame.height / rows).max(row * frame.height / rows + 1);
        for column in 0..columns {
            let from = column * frame.width / columns;
            let until = ((column + 1) * frame.width / columns).max(from + 1);
            let mut counts: Vec<(u16, u32)> = Vec::new();
            for y in lines.clone() {
                for &id in &frame.ids[y * frame.width + from..y * frame.width + until] {
                    // Small things count more than what they stand on, or they would never show.
                    let weight = if id >= 0x8000 { 3 } else { 1 };
                    match counts.iter_mut().find(|(other, _)| *other == id) {
                        Some((_, count)) => *count += weight,
                        None => counts.push((id, weight)),
                    }
                }
            }
            let id = counts.iter().max_by_key(|(_, count)| *count).map_or(0, |(id, _)| *id);
            let middle = (lines.start + lines.end) / 2 * frame.width + (from + until) / 2;
            let below = (row as f32 + 0.5) / rows as f32 * 2.0 - 1.0;
            cells.push(cell(job, id, frame.depth.get(middle).copied().unwrap_or(f32::INFINITY) * below * HALF_VIEW));
        }
    }
    cells
}

/// The character of one instance code; structure is a dot where it is the floor, by its drop below the optical axis (metres).
fn cell(job: &Job, id: u16, drop: f32) -> (char, Style) {
    match decode(id).and_then(|_| job.classes.get(&id)) {
        Some(&class) => (job.letters.letter(class), Style::new().fg(tint(class))),
        None if drop > 0.9 => ('.', Style::new().fg(Color::DarkGray)),
        None => (' ', Style::new()),
    }
}
