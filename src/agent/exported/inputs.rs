//! Frames and instructions as an exported policy takes them.

use std::collections::VecDeque;

use anyhow::ensure;

use super::spec::FramesSpec;
use crate::house::view::Frame;
use crate::nets::resize::resize_area;

/// The planes of a frame: all red, all green, all blue, at the size that the policy takes.
///
/// # Errors
/// When the frame cannot be brought to that size.
pub(super) fn planes(frame: &Frame, spec: &FramesSpec) -> anyhow::Result<Vec<u8>> {
    let pixels = frame.width * frame.height;
    if (frame.width, frame.height) == (spec.width, spec.height) {
        let plane = |channel: usize| frame.rgb.iter().skip(channel).step_by(3).take(pixels).copied();
        return Ok((0..3).flat_map(plane).collect());
    }
    ensure!(
        frame.width == frame.height && spec.width == spec.height && spec.width <= frame.width,
        "the frames are {} x {}, and the policy takes {} x {}: only square ones are averaged down",
        frame.width,
        frame.height,
        spec.width,
        spec.height
    );
    Ok(resize_area(&frame.rgb, frame.width, spec.width))
}

/// The last frames as one input, the oldest first; before the first there was the first.
pub(super) fn stack(seen: &VecDeque<Vec<u8>>, spec: &FramesSpec) -> Vec<f32> {
    let missing = spec.history - seen.len().min(spec.history);
    let plane = spec.height * spec.width;
    let mut input = Vec::with_capacity(3 * spec.history * plane);
    for at in 0..spec.history {
        for (channel, bytes) in seen[at.saturating_sub(missing)].chunks_exact(plane).enumerate() {
            let (mean, std) = (spec.mean[channel], spec.std[channel]);
            input.extend(bytes.iter().map(|&byte| (f32::from(byte) / 255.0 - mean) / std));
        }
    }
    input
}

/// The tokens of an instruction.
pub(super) fn tokens(instruction: &str, vocabulary: &[String], length: usize) -> Vec<i32> {
    let lower = instruction.to_lowercase();
    let words = lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    let number = |word: &str| vocabulary.iter().position(|known| known == word).map_or(1, |at| at as i32 + 2);
    let mut tokens: Vec<i32> = words.map(number).take(length).collect();
    tokens.resize(length, 0);
    tokens
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instruction_is_cut_into_known_and_unknown_words_and_padded() {
        let vocabulary = ["go", "red", "ball"].map(String::from);
        assert_eq!(tokens("Go to the RED ball!", &vocabulary, 7), [2, 1, 1, 3, 4, 0, 0]);
        assert_eq!(tokens("go, red ball", &vocabulary, 2), [2, 3]);
    }

    #[test]
    fn before_the_first_frame_there_was_the_first_and_bytes_are_normalised() {
        let spec = FramesSpec { height: 1, width: 1, history: 3, mean: [0.5, 0.0, 0.0], std: [0.5, 1.0, 1.0] };
        let seen = VecDeque::from([vec![255, 0, 51], vec![0, 255, 0]]);
        assert_eq!(stack(&seen, &spec), [1.0, 0.0, 0.2, 1.0, 0.0, 0.2, -1.0, 1.0, 0.0]);
    }

    #[test]
    fn a_frame_of_the_right_size_is_taken_as_it_is_and_one_that_does_not_fit_is_refused() {
        let frame = |width, height| Frame {
            width,
            height,
            rgb: (0..3 * width * height).map(|byte| byte as u8).collect(),
            depth: Vec::new(),
            ids: Vec::new(),
        };
        let spec = |height, width| FramesSpec { height, width, history: 1, mean: [0.0; 3], std: [1.0; 3] };
        assert_eq!(planes(&frame(2, 1), &spec(1, 2)).unwrap(), [0, 3, 1, 4, 2, 5]);
        assert_eq!(planes(&frame(4, 4), &spec(2, 2)).unwrap().len(), 12);
        assert!(planes(&frame(2, 1), &spec(2, 2)).unwrap_err().to_string().contains("the policy takes 2 x 2"));
    }
}
