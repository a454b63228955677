//! The frame in block characters: each cell shows the two colours and the quarters that come nearest to its pixels. Colours are
//! the frame's own, never mixtures: then neighbours share them, and what is shared is not sent again.

use ratatui::style::{Color, Style};

use super::job::Job;

/// The eight ways to cut a cell's quarters in two, as bits (1 upper left, 2 upper right, 4 lower left, 8 lower right) that
/// are foreground, and the character with foreground and background exchanged. Whole halves come first: on a tie they win.
const CUTS: [(u8, char, char); 8] = [
    (3, '▀', '▄'),
    (5, '▌', '▐'),
    (15, '█', ' '),
    (1, '▘', '▟'),
    (2, '▝', '▙'),
    (4, '▖', '▜'),
    (8, '▗', '▛'),
    (9, '▚', '▞'),
];

type Rgb = [u8; 3];

/// Colours nearer to each other than this (the squares of their differences summed) make no edge within a cell.
const FLAT: u32 = 3 * 12 * 12;

/// One styled character a cell, row by row, with the labels over them.
pub(crate) fn draw(job: &Job) -> Vec<(char, Style)> {
    let (columns, rows) = (usize::from(job.cells.width), usize::from(job.cells.height));
    let quarters = shrink(job, 2 * columns, 2 * rows);
    let mut cells: Vec<(char, Style)> = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let at = |dx: usize, dy: usize| quarters[(2 * row + dy) * 2 * columns + 2 * column + dx];
            let before = cells.last().and_then(|(_, style)| style.bg);
            cells.push(nearest([at(0, 0), at(1, 0), at(0, 1), at(1, 1)], before));
        }
    }
    cells
}

/// The frame at another size, every pixel the most frequent colour of those it covers.
fn shrink(job: &Job, width: usize, height: usize) -> Vec<Rgb> {
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
    let mut counts: Vec<(Rgb, u32)> = Vec::new();
    for line in &lines {
        for column in &columns {
            counts.clear();
            for y in line.clone() {
                let row = &frame.rgb[3 * (y * frame.width + column.start)..3 * (y * frame.width + column.end)];
                for pixel in row.chunks_exact(3) {
                    let pixel = [pixel[0], pixel[1], pixel[2]].map(level);
                    match counts.iter_mut().find(|(known, _)| *known == pixel) {
                        Some((_, count)) => *count += 1,
                        None => counts.push((pixel, 1)),
                    }
                }
            }
            pixels.push(counts.iter().max_by_key(|(_, count)| *count).map_or([0; 3], |(pixel, _)| *pixel));
        }
    }
    pixels
}

/// Of 32 levels: what nobody can tell apart is one colour.
fn level(value: u8) -> u8 {
    (value & 0xf8) | (value >> 5)
}

fn distance(a: Rgb, b: Rgb) -> u32 {
    a.iter().zip(b).map(|(&a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
}

/// The character and colours that come nearest to four quarters. Where it can be, the background is that of the cell before.
fn nearest(quarters: [Rgb; 4], before: Option<Color>) -> (char, Style) {
    let mut best = (u32::MAX, (0, ' ', ' '), [0; 3], [0; 3]);
    for cut in CUTS {
        // Of each side the colour that is nearest to all of it.
        let side = |wanted: bool| {
            let members = || (0..4).filter(|i| (cut.0 >> i & 1 == 1) == wanted).map(|i| quarters[i]);
            let error = |colour: Rgb| members().map(|other| distance(colour, other)).sum::<u32>();
            members().map(|colour| (error(colour), colour)).min_by_key(|(error, _)| *error)
        };
        let (error, front) = side(true).unwrap_or((0, [0; 3]));
        let (rest, back) = side(false).unwrap_or((0, front));
        if error + rest < best.0 {
            best = (error + rest, cut, front, back);
        }
    }
    let colour = |[r, g, b]: Rgb| Color::Rgb(r, g, b);
    let (_, (_, symbol, exchanged), front, back) = best;
    let near = distance(front, back) < FLAT;
    let (front, back) = (colour(front), colour(back));
    if front == back || near {
        // A flat cell is a space, which every terminal and every copy of the screen keeps cheap.
        (' ', Style::new().bg(back))
    } else if before == Some(front) {
        (exchanged, Style::new().fg(back).bg(front))
    } else {
        (symbol, Style::new().fg(front).bg(back))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_shows_the_cut_that_its_pixels_have() {
        let (dark, light) = ([0; 3], [255; 3]);
        let cut = |quarters| nearest(quarters, None).0;
        assert_eq!(cut([light, light, dark, dark]), '▀');
        assert_eq!(cut([light, dark, light, dark]), '▌');
        assert_eq!(cut([dark, dark, dark, light]), '▗');
        assert_eq!(cut([light, dark, dark, light]), '▚');
        assert_eq!(nearest([light; 4], None), (' ', Style::new().bg(Color::Rgb(255, 255, 255))));
    }

    #[test]
    fn a_background_goes_on_from_cell_to_cell_and_colours_are_not_mixed() {
        let (dark, light, grey) = ([0; 3], [255; 3], [230; 3]);
        let (symbol, style) = nearest([light, light, dark, dark], Some(Color::Rgb(255, 255, 255)));
        assert_eq!((symbol, style.bg), ('▄', Some(Color::Rgb(255, 255, 255))));
        let (_, style) = nearest([light, grey, dark, dark], None);
        assert!([light, grey].map(|[r, g, b]| Some(Color::Rgb(r, g, b))).contains(&style.fg), "{style:?}");
    }
}
