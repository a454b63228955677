//! The frame in block characters: each cell shows the two colours and the quarters that come nearest to its pixels.

use ratatui::style::{Color, Style};

use super::Job;

/// The eight ways to cut a cell's quarters in two, as bits (1 upper left, 2 upper right, 4 lower left, 8 lower right) that
/// are foreground. Whole halves come first: on a tie they win.
const CUTS: [(u8, char); 8] = [(3, '▀'), (5, '▌'), (15, '█'), (1, '▘'), (2, '▝'), (4, '▖'), (8, '▗'), (9, '▚')];

/// One styled character a cell, row by row, with the labels over them.
pub fn draw(job: &Job) -> Vec<(char, Style)> {
    let (columns, rows) = (usize::from(job.cells.width), usize::from(job.cells.height));
    let quarters = shrink(job, 2 * columns, 2 * rows);
    let mut cells = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let at = |dx: usize, dy: usize| quarters[(2 * row + dy) * 2 * columns + 2 * column + dx];
            cells.push(nearest([at(0, 0), at(1, 0), at(0, 1), at(1, 1)]));
        }
    }
    super::labels::over_cells(job, &mut cells);
    cells
}

/// The frame at another size, every pixel the mean of those it covers.
fn shrink(job: &Job, width: usize, height: usize) -> Vec<[f32; 3]> {
    let frame = &job.frame;
    let edges = |count: usize, size: usize| -> Vec<std::ops::Range<usize>> {
        (0..count)
            .map(|i| {
                let from = i * size / count.max(1);
                from..((i + 1) * size / count.max(1)).clamp(from + 1, size.max(from + 1))
            })
            .collect()
    };
    let (columns, lines) = (edges(width, frame.width), edges(height, frame.height));
    let mut pixels = Vec::with_capacity(width * height);
    for line in &lines {
        for column in &columns {
            let mut sum = [0.0; 3];
            for y in line.clone() {
                let row = &frame.rgb[3 * (y * frame.width + column.start)..3 * (y * frame.width + column.end)];
                for pixel in row.chunks_exact(3) {
                    for (total, &value) in sum.iter_mut().zip(pixel) {
                        *total += f32::from(value);
                    }
                }
            }
            pixels.push(sum.map(|total| total / (line.len() * column.len()) as f32));
        }
    }
    pixels
}

/// The character and colours that come nearest to four quarters.
fn nearest(quarters: [[f32; 3]; 4]) -> (char, Style) {
    let mut best = (f32::INFINITY, ' ', [0.0; 3], [0.0; 3]);
    for (bits, symbol) in CUTS {
        let mean = |wanted: bool| {
            let members = (0..4).filter(|i| (bits >> i & 1 == 1) == wanted);
            let (mut sum, mut count) = ([0.0; 3], 0.0f32);
            for i in members {
                count += 1.0;
                for (total, value) in sum.iter_mut().zip(quarters[i]) {
                    *total += value;
                }
            }
            sum.map(|total| total / count.max(1.0))
        };
        let (front, back) = (mean(true), mean(false));
        let error: f32 = (0..4)
            .map(|i| {
                let shown = if bits >> i & 1 == 1 { front } else { back };
                quarters[i].iter().zip(shown).map(|(a, b)| (a - b) * (a - b)).sum::<f32>()
            })
            .sum();
        if error < best.0 - 1.0 {
            best = (error, symbol, front, if bits == 15 { front } else { back });
        }
    }
    let colour = |c: [f32; 3]| Color::Rgb(c[0].round() as u8, c[1].round() as u8, c[2].round() as u8);
    let (_, symbol, front, back) = best;
    // A flat cell is a space, which every terminal and every copy of the screen keeps cheap.
    if front == back {
        (' ', Style::new().bg(colour(back)))
    } else {
        (symbol, Style::new().fg(colour(front)).bg(colour(back)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_shows_the_cut_that_its_pixels_have() {
        let (dark, light) = ([0.0; 3], [255.0; 3]);
        assert_eq!(nearest([light, light, dark, dark]).0, '▀');
        assert_eq!(nearest([light, dark, light, dark]).0, '▌');
        assert_eq!(nearest([dark, dark, dark, light]).0, '▗');
        assert_eq!(nearest([light, dark, dark, light]).0, '▚');
        assert_eq!(nearest([light; 4]), (' ', Style::new().bg(Color::Rgb(255, 255, 255))));
    }
}
