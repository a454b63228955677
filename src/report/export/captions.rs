//! Text under pictures.

use embedded_graphics::mono_font::MonoFont;
use embedded_graphics::mono_font::iso_8859_1::FONT_6X10;

/// The font of captions.
pub(crate) const FONT: MonoFont<'_> = FONT_6X10;
/// The height of a line, in pixels.
pub(crate) const LINE: usize = 10;
/// The width of a letter, in pixels.
const ADVANCE: usize = 6;

/// Breaks text into lines of at most `width` pixels, at spaces where it can.
pub(crate) fn wrap(text: &str, width: usize) -> Vec<String> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_of_the_program_is_in_the_font() {
        let missing = FONT.glyph_mapping.index('\u{fffd}');
        for symbol in ('a'..='z').chain('A'..='Z').chain('0'..='9').chain(" .,:;!()[]/|-+'\"·×".chars()) {
            assert_ne!(FONT.glyph_mapping.index(symbol), missing, "{symbol:?}");
        }
        assert_eq!([FONT.character_size.width, FONT.character_size.height], [ADVANCE as u32, LINE as u32]);
    }

    #[test]
    fn lines_are_broken_at_spaces() {
        assert_eq!(wrap("put the mug down", 8 * ADVANCE), ["put the", "mug down"]);
        assert_eq!(wrap("", 60), [""]);
    }
}
