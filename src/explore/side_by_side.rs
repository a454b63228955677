//! Frames side by side, as one picture: every protocol shows it as it shows a frame.

use crate::house::view::Frame;

/// The share of a frame's width that lies between the two, as a divisor.
const GAP: usize = 15;

/// Two frames of one size with a dark gap between them.
pub(crate) fn beside(left: &Frame, right: &Frame) -> Frame {
    in_a_row(&[left, right])
}

/// Frames of one size in a row, with dark gaps between them.
pub(crate) fn in_a_row(frames: &[&Frame]) -> Frame {
    let height = frames.iter().map(|frame| frame.height).min().unwrap_or(0);
    let gap = frames.first().map_or(0, |first| first.width / GAP);
    let width = frames.iter().map(|frame| frame.width).sum::<usize>() + gap * frames.len().saturating_sub(1);
    let mut all = Frame {
        width,
        height,
        rgb: Vec::with_capacity(3 * width * height),
        depth: Vec::with_capacity(width * height),
        ids: Vec::with_capacity(width * height),
    };
    for y in 0..height {
        for (place, frame) in frames.iter().enumerate() {
            if place > 0 {
                all.rgb.extend(std::iter::repeat_n(0, 3 * gap));
                all.depth.extend(std::iter::repeat_n(0.0, gap));
                all.ids.extend(std::iter::repeat_n(0, gap));
            }
            let row = y * frame.width..(y + 1) * frame.width;
            all.rgb.extend_from_slice(&frame.rgb[3 * row.start..3 * row.end]);
            all.depth.extend_from_slice(&frame.depth[row.clone()]);
            all.ids.extend_from_slice(&frame.ids[row]);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_frames_are_whole_with_a_gap_between() {
        let flat = |value: u8, id: u16| Frame {
            width: 30,
            height: 20,
            rgb: vec![value; 1800],
            depth: vec![1.0; 600],
            ids: vec![id; 600],
        };
        let both = beside(&flat(10, 1), &flat(20, 2));
        assert_eq!((both.width, both.height, both.rgb.len()), (62, 20, 3 * 62 * 20));
        let at = |x: usize, y: usize| (both.rgb[3 * (y * 62 + x)], both.ids[y * 62 + x]);
        assert_eq!([at(29, 0), at(30, 19), at(32, 19), at(61, 19)], [(10, 1), (0, 0), (20, 2), (20, 2)]);
    }
}
