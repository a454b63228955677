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
/// Lines under the frame: two for the instruction, one for the step.
const LINES: usize = 3;
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
    let (width, height) = (side, side + LINES * LINE + 6);
    {
        let mut encoder = Encoder::new(&mut data, width as u16, height as u16, &[]).context("the film cannot begin")?;
        encoder.set_repeat(Repeat::Infinite)?;
        for (at, shot) in recording.shots.iter().enumerate() {
            let mut pixmap = Pixmap::new(width, height, PAPER);
            pixmap.frame(&camera.draw(shot), 0, 0, 1);
            caption(&mut pixmap, shot, side + 4);
            // The fastest quantiser: house frames have few colours.
            let mut frame = Frame::from_rgb_speed(width as u16, height as u16, &pixmap.rgb, 30);
            frame.delay = if at + 1 == recording.shots.len() { SHOWN.1 } else { SHOWN.0 };
            encoder.write_frame(&frame).context("the film cannot be encoded")?;
        }
    }
    Ok(data)
}

fn caption(pixmap: &mut Pixmap, shot: &Shot, top: usize) {
    let width = pixmap.width - 8;
    for (row, line) in wrap(&shot.told, width).iter().take(LINES - 1).enumerate() {
        pixmap.text(4, top + row * LINE, line, &FONT, INK);
    }
    let (text, colour) = match (&shot.done, shot.possible) {
        (Some(done), _) => (format!("{} {} · done: {done}", shot.step, shot.words()), DONE),
        (None, true) => (format!("{} {}", shot.step, shot.words()), INK),
        (None, false) => (format!("{} {}", shot.step, shot.words()), BAD),
    };
    pixmap.text(4, top + (LINES - 1) * LINE, &text, &FONT, colour);
}
