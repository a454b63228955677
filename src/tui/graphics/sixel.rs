//! Sixels with a fixed palette, a cube of colours and a ramp of greys: no colours are searched for, so a frame costs little, and the same colour looks the same from
//! step to step.

use std::fmt::Write;

use super::job::Job;
use super::labels::over_pixels;

/// Levels of red, green and blue in the cube.
const LEVELS: usize = 6;
/// Colours of the cube; greys follow them.
const CUBE: usize = LEVELS * LEVELS * LEVELS;
/// Greys: walls and metal are nearly grey, and a tint would show.
const GREYS: usize = 36;
/// Colours of the palette.
const COLOURS: usize = CUBE + GREYS;
/// Pixel rows of a band.
const BAND: usize = 6;

/// Draws the frame where the cursor is, scaled to the pixels of its cells.
pub(crate) fn draw(job: &Job) -> String {
    let (across, down) = (usize::from(job.cell_pixels.0.max(1)), usize::from(job.cell_pixels.1.max(1)));
    let (width, height) = (usize::from(job.cells.width) * across, usize::from(job.cells.height) * down);
    encode(&over_pixels(&job.labels, &job.frame), job.frame.width, job.frame.height, width, height)
}

/// Encodes pixels (three bytes each) of one size at another.
pub(crate) fn encode(rgb: &[u8], from_width: usize, from_height: usize, width: usize, height: usize) -> String {
    let mut sequence = String::with_capacity(width * height / 4 + 8192);
    // Aspect 1:1, and what is not drawn stays as it is.
    let _ = write!(sequence, "\x1bP0;1;0q\"1;1;{width};{height}");
    // Surfaces are flat: most pixels are like the one before.
    let mut last: (&[u8], u8) = (&[], 0);
    let mut index = |pixel| {
        if pixel != last.0 {
            last = (pixel, nearest(pixel));
        }
        last.1
    };
    let indices: Vec<u8> = rgb.chunks_exact(3).map(&mut index).collect();
    let columns: Vec<usize> = (0..width).map(|x| x * from_width / width.max(1)).collect();
    let mut defined = [false; COLOURS];
    let mut band: Vec<Vec<u8>> = vec![Vec::new(); COLOURS];
    let mut used: Vec<usize> = Vec::new();
    for top in (0..height).step_by(BAND) {
        for row in 0..BAND.min(height - top) {
            let line = &indices[(top + row) * from_height / height * from_width..][..from_width];
            for (x, &column) in columns.iter().enumerate() {
                let colour = usize::from(line[column]);
                if band[colour].is_empty() {
                    band[colour].resize(width, 0);
                    used.push(colour);
                }
                band[colour][x] |= 1 << row;
            }
        }
        for (place, colour) in used.drain(..).enumerate() {
            if place > 0 {
                sequence.push('$');
            }
            if !std::mem::replace(&mut defined[colour], true) {
                let [r, g, b] = percent(colour);
                let _ = write!(sequence, "#{colour};2;{r};{g};{b}");
            }
            // Some terminals do not select what they are told to define.
            let _ = write!(sequence, "#{colour}");
            runs(&band[colour], &mut sequence);
            band[colour].clear();
        }
        sequence.push('-');
    }
    sequence.push_str("\x1b\\");
    sequence
}

/// Writes a line of sixels, runs of the same one in short, without the empty end.
fn runs(line: &[u8], sequence: &mut String) {
    let end = line.iter().rposition(|&bits| bits != 0).map_or(0, |last| last + 1);
    let mut at = 0;
    while at < end {
        let bits = line[at];
        let length = line[at..end].iter().take_while(|&&other| other == bits).count();
        let symbol = char::from(b'?' + bits);
        if length > 3 {
            let _ = write!(sequence, "!{length}{symbol}");
        } else {
            sequence.extend(std::iter::repeat_n(symbol, length));
        }
        at += length;
    }
}

/// The palette's colour nearest to a pixel: of the cube or a grey.
fn nearest(pixel: &[u8]) -> u8 {
    let steps = LEVELS - 1;
    let level = |value: u8| (usize::from(value) * steps + 127) / 255;
    let [r, g, b] = [0, 1, 2].map(|i| level(pixel[i]));
    let sum: usize = pixel[..3].iter().map(|&value| usize::from(value)).sum();
    let grey = (sum * (GREYS - 1) + 382) / 765;
    let error = |shown: [usize; 3]| -> usize {
        pixel.iter().zip(shown).map(|(&value, shown)| usize::from(value).abs_diff(shown).pow(2)).sum()
    };
    let cube = error([r, g, b].map(|level| level * 255 / steps));
    let colour = if error([grey * 255 / (GREYS - 1); 3]) < cube { CUBE + grey } else { (r * LEVELS + g) * LEVELS + b };
    colour as u8
}

/// A colour of the palette in per cent of red, green and blue.
fn percent(colour: usize) -> [usize; 3] {
    if let Some(grey) = colour.checked_sub(CUBE) {
        return [grey * 100 / (GREYS - 1); 3];
    }
    [colour / LEVELS / LEVELS, colour / LEVELS % LEVELS, colour % LEVELS].map(|level| level * 100 / (LEVELS - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads sixels back: the colour of every pixel in per cent.
    fn decode(sequence: &str, width: usize, height: usize) -> Vec<Option<[usize; 3]>> {
        let body = sequence.split_once("q\"").unwrap().1.trim_end_matches("\x1b\\");
        let body = &body[body.find('#').unwrap()..];
        let (mut pixels, mut palette) = (vec![None; width * height], vec![[0; 3]; COLOURS]);
        let (mut x, mut top, mut colour, mut repeat) = (0, 0, 0, 1);
        let mut rest = body;
        while let Some(c) = rest.chars().next() {
            rest = &rest[1..];
            let mut number = || {
                let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
                let value: usize = rest[..end].parse().unwrap();
                rest = &rest[end..];
                value
            };
            match c {
                '#' => {
                    colour = number();
                    if rest.starts_with(";2;") {
                        rest = &rest[3..];
                        let mut parts = [0; 3];
                        for (i, part) in parts.iter_mut().enumerate() {
                            let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap();
                            *part = rest[..end].parse().unwrap();
                            rest = &rest[end + usize::from(i < 2)..];
                        }
                        palette[colour] = parts;
                    }
                }
                '!' => repeat = number(),
                '$' => x = 0,
                '-' => (x, top) = (0, top + BAND),
                symbol => {
                    for _ in 0..std::mem::replace(&mut repeat, 1) {
                        for row in (0..BAND).filter(|row| (symbol as u8 - b'?') >> row & 1 == 1) {
                            pixels[(top + row) * width + x] = Some(palette[colour]);
                        }
                        x += 1;
                    }
                }
            }
        }
        pixels
    }

    #[test]
    fn every_pixel_comes_back_in_its_colour_at_another_size() {
        let rgb = [255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255];
        let sequence = encode(&rgb, 2, 2, 10, 14);
        let pixels = decode(&sequence, 10, 14);
        let at = |x: usize, y: usize| pixels[y * 10 + x];
        assert_eq!(at(0, 0), Some([100, 0, 0]));
        assert_eq!(at(9, 6), Some([0, 100, 0]));
        assert_eq!(at(4, 7), Some([0, 0, 100]));
        assert_eq!(at(9, 13), Some([100, 100, 100]));
        assert!(pixels.iter().all(Option::is_some));
        assert!(
            !sequence.split('#').skip(1).any(|part| part.contains(";2;") && part.contains(['~', '!'])),
            "defined, then selected"
        );
        assert_eq!(percent(usize::from(nearest(&[170, 178, 186]))), [68, 68, 68], "a grey stays a grey");
        assert_eq!(percent(usize::from(nearest(&[150, 110, 70]))), [60, 40, 20]);
    }
}
