//! Text in pictures: letters of five by seven pixels, drawn by hand.

use super::canvas::Canvas;

/// The width of a letter with the gap after it, in pixels.
pub const ADVANCE: usize = 6;
/// The height of a line with the gap below it, in pixels.
pub const LINE: usize = 10;

/// Writes a line of text, its upper left corner at (x, y). What does not fit is cut.
pub fn write(canvas: &mut Canvas, x: usize, y: usize, text: &str, colour: [u8; 3]) {
    for (place, symbol) in text.chars().enumerate() {
        let left = x + place * ADVANCE;
        for (row, bits) in glyph(symbol).into_iter().enumerate() {
            for column in (0..5).filter(|column| bits >> (4 - column) & 1 == 1) {
                canvas.set(left + column, y + row, colour);
            }
        }
    }
}

/// Breaks text into lines of at most `width` pixels, at spaces where it can.
pub fn broken(text: &str, width: usize) -> Vec<String> {
    let most = (width / ADVANCE).max(1);
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let used = lines.last().map_or(0, |line| line.chars().count());
        if used > 0 && used + 1 + word.chars().count() > most {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push(' ');
            }
            line.extend(word.chars().take(most));
        }
    }
    lines
}

/// The rows of a letter, each five bits with the left pixel highest; a box for letters that are not there.
pub fn glyph(symbol: char) -> [u8; 7] {
    let found = GLYPHS.binary_search_by_key(&symbol, |(known, _)| *known);
    found.map_or([31, 17, 17, 17, 17, 17, 31], |at| GLYPHS[at].1)
}

/// The letters in the order of their code points.
#[rustfmt::skip]
const GLYPHS: [(char, [u8; 7]); 91] = [
    (' ', [0, 0, 0, 0, 0, 0, 0]),
    ('!', [4, 4, 4, 4, 4, 0, 4]),
    ('"', [10, 10, 0, 0, 0, 0, 0]),
    ('#', [10, 10, 31, 10, 31, 10, 10]),
    ('$', [4, 15, 20, 14, 5, 30, 4]),
    ('%', [25, 25, 2, 4, 8, 19, 19]),
    ('&', [12, 18, 12, 13, 18, 18, 13]),
    ('\'', [4, 4, 0, 0, 0, 0, 0]),
    ('(', [2, 4, 8, 8, 8, 4, 2]),
    (')', [8, 4, 2, 2, 2, 4, 8]),
    ('*', [0, 21, 14, 31, 14, 21, 0]),
    ('+', [0, 4, 4, 31, 4, 4, 0]),
    (',', [0, 0, 0, 0, 4, 4, 8]),
    ('-', [0, 0, 0, 31, 0, 0, 0]),
    ('.', [0, 0, 0, 0, 0, 4, 4]),
    ('/', [1, 1, 2, 4, 8, 16, 16]),
    ('0', [14, 17, 19, 21, 25, 17, 14]),
    ('1', [4, 12, 4, 4, 4, 4, 14]),
    ('2', [14, 17, 1, 2, 4, 8, 31]),
    ('3', [30, 1, 1, 14, 1, 1, 30]),
    ('4', [2, 6, 10, 18, 31, 2, 2]),
    ('5', [31, 16, 30, 1, 1, 17, 14]),
    ('6', [14, 16, 16, 30, 17, 17, 14]),
    ('7', [31, 1, 2, 4, 8, 8, 8]),
    ('8', [14, 17, 17, 14, 17, 17, 14]),
    ('9', [14, 17, 17, 15, 1, 1, 14]),
    (':', [0, 4, 4, 0, 4, 4, 0]),
    (';', [0, 4, 4, 0, 4, 4, 8]),
    ('<', [2, 4, 8, 16, 8, 4, 2]),
    ('=', [0, 0, 31, 0, 31, 0, 0]),
    ('>', [8, 4, 2, 1, 2, 4, 8]),
    ('?', [14, 17, 1, 2, 4, 0, 4]),
    ('@', [14, 17, 23, 21, 23, 16, 14]),
    ('A', [14, 17, 17, 31, 17, 17, 17]),
    ('B', [30, 17, 17, 30, 17, 17, 30]),
    ('C', [14, 17, 16, 16, 16, 17, 14]),
    ('D', [30, 17, 17, 17, 17, 17, 30]),
    ('E', [31, 16, 16, 30, 16, 16, 31]),
    ('F', [31, 16, 16, 30, 16, 16, 16]),
    ('G', [14, 17, 16, 23, 17, 17, 14]),
    ('H', [17, 17, 17, 31, 17, 17, 17]),
    ('I', [14, 4, 4, 4, 4, 4, 14]),
    ('J', [7, 2, 2, 2, 2, 18, 12]),
    ('K', [17, 18, 20, 24, 20, 18, 17]),
    ('L', [16, 16, 16, 16, 16, 16, 31]),
    ('M', [17, 27, 21, 21, 17, 17, 17]),
    ('N', [17, 25, 21, 19, 17, 17, 17]),
    ('O', [14, 17, 17, 17, 17, 17, 14]),
    ('P', [30, 17, 17, 30, 16, 16, 16]),
    ('Q', [14, 17, 17, 17, 21, 18, 13]),
    ('R', [30, 17, 17, 30, 20, 18, 17]),
    ('S', [15, 16, 16, 14, 1, 1, 30]),
    ('T', [31, 4, 4, 4, 4, 4, 4]),
    ('U', [17, 17, 17, 17, 17, 17, 14]),
    ('V', [17, 17, 17, 17, 17, 10, 4]),
    ('W', [17, 17, 17, 21, 21, 27, 17]),
    ('X', [17, 17, 10, 4, 10, 17, 17]),
    ('Y', [17, 17, 10, 4, 4, 4, 4]),
    ('Z', [31, 1, 2, 4, 8, 16, 31]),
    ('[', [14, 8, 8, 8, 8, 8, 14]),
    (']', [14, 2, 2, 2, 2, 2, 14]),
    ('_', [0, 0, 0, 0, 0, 0, 31]),
    ('a', [0, 0, 14, 1, 15, 17, 15]),
    ('b', [16, 16, 30, 17, 17, 17, 30]),
    ('c', [0, 0, 14, 16, 16, 17, 14]),
    ('d', [1, 1, 15, 17, 17, 17, 15]),
    ('e', [0, 0, 14, 17, 31, 16, 14]),
    ('f', [6, 9, 8, 28, 8, 8, 8]),
    ('g', [0, 0, 15, 17, 15, 1, 14]),
    ('h', [16, 16, 30, 17, 17, 17, 17]),
    ('i', [4, 0, 12, 4, 4, 4, 14]),
    ('j', [2, 0, 6, 2, 2, 18, 12]),
    ('k', [16, 16, 18, 20, 24, 20, 18]),
    ('l', [12, 4, 4, 4, 4, 4, 14]),
    ('m', [0, 0, 26, 21, 21, 17, 17]),
    ('n', [0, 0, 30, 17, 17, 17, 17]),
    ('o', [0, 0, 14, 17, 17, 17, 14]),
    ('p', [0, 0, 30, 17, 30, 16, 16]),
    ('q', [0, 0, 15, 17, 15, 1, 1]),
    ('r', [0, 0, 22, 25, 16, 16, 16]),
    ('s', [0, 0, 15, 16, 14, 1, 30]),
    ('t', [8, 8, 30, 8, 8, 9, 6]),
    ('u', [0, 0, 17, 17, 17, 19, 13]),
    ('v', [0, 0, 17, 17, 17, 10, 4]),
    ('w', [0, 0, 17, 17, 21, 21, 10]),
    ('x', [0, 0, 17, 10, 4, 10, 17]),
    ('y', [0, 0, 17, 17, 15, 1, 14]),
    ('z', [0, 0, 31, 2, 4, 8, 31]),
    ('|', [4, 4, 4, 4, 4, 4, 4]),
    ('·', [0, 0, 0, 4, 0, 0, 0]),
    ('×', [0, 17, 10, 4, 10, 17, 0]),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_of_the_program_is_there_and_looks_like_no_other() {
        assert!(GLYPHS.is_sorted_by_key(|(symbol, _)| *symbol));
        for symbol in ('a'..='z').chain('A'..='Z').chain('0'..='9').chain(" .,:;!?()[]/|-+'\"·×".chars()) {
            assert!(GLYPHS.iter().any(|(known, _)| *known == symbol), "{symbol:?}");
        }
        for (at, (symbol, rows)) in GLYPHS.iter().enumerate() {
            let twin = GLYPHS[at + 1..].iter().find(|(_, other)| other == rows);
            assert!(twin.is_none(), "{symbol:?} and {twin:?}");
        }
    }

    #[test]
    fn lines_are_broken_at_spaces() {
        assert_eq!(broken("put the mug down", 8 * ADVANCE), ["put the", "mug down"]);
        assert_eq!(broken("", 60), [""]);
    }
}
