//! A GIF of a recording: every step a frame, with what was done under it.

use anyhow::Context;
use gif::{Encoder, Frame, Repeat};

use super::captions::{FONT, LINE, wrap};
use crate::episode::frames::{FrameSequence, Shot};
use crate::report::pixmap::{Pixmap, RgbColour};

const PAPER: RgbColour = [20, 20, 24];
const INK: RgbColour = [230, 230, 230];
const DONE: RgbColour = [90, 220, 130];
const BAD: RgbColour = [255, 120, 110];
/// Lines under the frame for the instruction, at least; one more is for the step.
const FEWEST: usize = 2;
/// Space beside a line, in pixels.
const INDENT: usize = 4;
/// Hundredths of a second that a step is shown, and the last one.
const SHOWN: (u16, u16) = (25, 200);

/// The film as the bytes of a GIF file.
///
/// # Errors
/// Never in practice: it is written to memory.
pub(crate) fn draw(recording: &FrameSequence) -> anyhow::Result<Vec<u8>> {
    let mut camera = recording.camera();
    let mut data = Vec::new();
    let side = crate::house::House::FRAME;
    // All that is told has room: the longest instruction says how much.
    let lines = recording.shots.iter().map(|shot| told(shot, side).len()).max().unwrap_or(0).max(FEWEST);
    let (width, height) = (side, side + (lines + 1) * LINE + 6);
    {
        let mut encoder = Encoder::new(&mut data, width as u16, height as u16, &[]).context("the film cannot begin")?;
        encoder.set_repeat(Repeat::Infinite)?;
        for (at, shot) in recording.shots.iter().enumerate() {
            let mut pixmap = Pixmap::new(width, height, PAPER);
            pixmap.frame(&camera.draw(shot), 0, 0, 1);
            caption(&mut pixmap, shot, side + 4, lines);
            // The fastest quantiser: house frames have few colours.
            let mut frame = Frame::from_rgb_speed(width as u16, height as u16, &pixmap.rgb, 30);
            frame.delay = if at + 1 == recording.shots.len() { SHOWN.1 } else { SHOWN.0 };
            encoder.write_frame(&frame).context("the film cannot be encoded")?;
        }
    }
    Ok(data)
}

/// What the agent was told, in lines under a frame of that width.
fn told(shot: &Shot, width: usize) -> Vec<String> {
    wrap(&shot.told, width - 2 * INDENT)
}

fn caption(pixmap: &mut Pixmap, shot: &Shot, top: usize, lines: usize) {
    for (row, line) in told(shot, pixmap.width).iter().enumerate() {
        pixmap.text(INDENT, top + row * LINE, line, &FONT, INK);
    }
    let (text, colour) = match (&shot.done, shot.possible) {
        (Some(done), _) => (format!("{} {} · done: {done}", shot.step, shot.words()), DONE),
        (None, true) => (format!("{} {}", shot.step, shot.words()), INK),
        (None, false) => (format!("{} {}", shot.step, shot.words()), BAD),
    };
    pixmap.text(INDENT, top + lines * LINE, &text, &FONT, colour);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::episode::frames::tests::recording;

    #[test]
    fn a_film_has_room_for_all_lines_of_an_instruction() {
        let height = |told: &str| {
            let mut recording = recording();
            recording.shots[1].told = told.into();
            let film = draw(&recording).unwrap();
            u16::from_le_bytes([film[8], film[9]])
        };
        let short = height("Put the mug in the sink.");
        assert_eq!(height(&"Put the mug in the sink, please. ".repeat(6)) - short, 3 * LINE as u16);
    }
}
