//! Two frames side by side, as one picture: every protocol shows it as it shows a frame.

use crate::house::view::Frame;

/// The share of a frame's width that lies between the two, as a divisor.
const GAP: usize = 15;

/// Two frames of one size with a dark gap between them.
pub(crate) fn beside(left: &Frame, right: &Frame) -> Frame {
    let (height, gap) = (left.height.min(right.height), left.width / GAP);
    let width = left.width + gap + right.width;
    let mut both = Frame {
        width,
        height,
        rgb: Vec::with_capacity(3 * width * height),
        depth: Vec::with_capacity(width * height),
        ids: Vec::with_capacity(width * height),
    };
    for y in 0..height {
        let row = |frame: &Frame| y * frame.width..(y + 1) * frame.width;
        let (one, other) = (row(left), row(right));
        both.rgb.extend_from_slice(&left.rgb[3 * one.start..3 * one.end]);
        both.rgb.extend(std::iter::repeat_n(0, 3 * gap));
        both.rgb.extend_from_slice(&right.rgb[3 * other.start..3 * other.end]);
        both.depth.extend_from_slice(&left.depth[one.clone()]);
        both.depth.extend(std::iter::repeat_n(0.0, gap));
        both.depth.extend_from_slice(&right.depth[other.clone()]);
        both.ids.extend_from_slice(&left.ids[one]);
        both.ids.extend(std::iter::repeat_n(0, gap));
        both.ids.extend_from_slice(&right.ids[other]);
    }
    both
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
