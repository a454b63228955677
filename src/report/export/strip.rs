//! Single frames, and the frames at which something was completed in one row.

use anyhow::Context;

use super::captions::{FONT, LINE, wrap};
use crate::episode::frames::{FrameSequence, Shot};
use crate::report::pixmap::{Pixmap, RgbColour};

const PAPER: RgbColour = [255, 255, 255];
const INK: RgbColour = [20, 20, 24];
const DONE: RgbColour = [20, 120, 60];
/// Space around frames, in pixels.
const MARGIN: usize = 8;
/// Frames of a strip where no subtask was done.
const FEWEST: usize = 5;
/// The side of a frame in a strip, in pixels.
const SIDE: usize = 150;

/// The frame at a step, as the agent saw it.
///
/// # Errors
/// When there is no such step.
pub(crate) fn frame(recording: &FrameSequence, at: u32) -> anyhow::Result<Pixmap> {
    let shot = recording.shots.get(at as usize).with_context(|| format!("there is no step {at}"))?;
    let frame = recording.camera().draw(shot);
    Ok(Pixmap { width: frame.width, height: frame.height, rgb: frame.rgb })
}

/// The first frame, those at which a subtask was done, and the last one, each over its words.
pub(crate) fn draw(recording: &FrameSequence) -> Pixmap {
    let shots = chosen(recording);
    let words: Vec<Vec<String>> = shots.iter().map(|shot| wrap(&caption(shot), SIDE)).collect();
    let lines = words.iter().map(Vec::len).max().unwrap_or(1);
    let width = MARGIN + shots.len() * (SIDE + MARGIN);
    let title = wrap(&told(recording), width - 2 * MARGIN);
    let top = MARGIN + title.len() * LINE;
    let mut pixmap = Pixmap::new(width, top + SIDE + MARGIN + lines * LINE + MARGIN / 2, PAPER);
    for (row, line) in title.iter().enumerate() {
        pixmap.text(MARGIN, MARGIN / 2 + row * LINE, line, &FONT, INK);
    }
    let mut camera = recording.camera();
    for (place, (shot, words)) in shots.iter().zip(words).enumerate() {
        let left = MARGIN + place * (SIDE + MARGIN);
        let frame = camera.draw(shot);
        pixmap.frame(&frame, left, top, (frame.width / SIDE).max(1));
        let colour = if shot.done.is_some() { DONE } else { INK };
        for (row, line) in words.iter().enumerate() {
            pixmap.text(left, top + SIDE + MARGIN / 2 + row * LINE, line, &FONT, colour);
        }
    }
    pixmap
}

/// What the agent was told, with the step from which it was told something else.
fn told(recording: &FrameSequence) -> String {
    let mut last = recording.told();
    let mut text = last.clone();
    for shot in recording.shots.iter().skip(1).filter(|shot| shot.did.is_some()) {
        if shot.told != last {
            last.clone_from(&shot.told);
            text += &format!(" From step {}: {last}", shot.step);
        }
    }
    text
}

fn caption(shot: &Shot) -> String {
    match (&shot.done, shot.step) {
        (Some(done), step) => format!("{step}: {done}"),
        (None, 0) => "start".into(),
        (None, step) => format!("{step}: {}", shot.did.as_deref().unwrap_or("")),
    }
}

fn chosen(recording: &FrameSequence) -> Vec<&Shot> {
    let last = recording.shots.len().saturating_sub(1);
    let telling = |(at, shot): &(usize, &Shot)| *at == 0 || *at == last || shot.done.is_some();
    let found: Vec<&Shot> = recording.shots.iter().enumerate().filter(telling).map(|(_, shot)| shot).collect();
    if found.len() > 2 || last < FEWEST {
        return found;
    }
    (0..FEWEST).filter_map(|part| recording.shots.get(part * last / (FEWEST - 1))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::episode::frames::tests::recording;

    #[test]
    fn a_strip_says_what_was_told_later_too() {
        let mut recording = recording();
        assert_eq!(told(&recording), "Put the mug in the sink.");
        for shot in &mut recording.shots[2..] {
            shot.told = "Take the fork.".into();
        }
        assert_eq!(told(&recording), "Put the mug in the sink. From step 2: Take the fork.");
    }
}
