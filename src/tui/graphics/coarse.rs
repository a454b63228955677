//! Coarser frames for slow links: larger pixels and fewer colours compress better in every protocol.

use std::sync::Arc;

use crate::house::view::Frame;

/// The coarsest that pictures get.
pub(crate) const COARSEST: u8 = 3;

/// The frame with pixels of 1, 2, 4 or 8, and with fewer colours from the first step on.
pub(crate) fn coarse(frame: Arc<Frame>, coarseness: u8) -> Arc<Frame> {
    if coarseness == 0 {
        return frame;
    }
    let (side, mask) = (1usize << coarseness.min(COARSEST), 0xffu8 << (2 + coarseness.min(COARSEST)));
    let mut rgb = Vec::with_capacity(frame.rgb.len());
    for y in 0..frame.height {
        for x in 0..frame.width {
            let middle = |at: usize, most: usize| (at / side * side + side / 2).min(most - 1);
            let from = 3 * (middle(y, frame.height) * frame.width + middle(x, frame.width));
            rgb.extend(frame.rgb[from..from + 3].iter().map(|value| value & mask));
        }
    }
    Arc::new(Frame { rgb, ..(*frame).clone() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_frames_have_fewer_different_pixels() {
        let rgb = (0..3 * 64 * 64).map(|i| (i * 7 % 251) as u8).collect();
        let frame = Arc::new(Frame { width: 64, height: 64, rgb, depth: vec![1.0; 4096], ids: vec![0; 4096] });
        let kinds =
            |frame: &Frame| frame.rgb.chunks(3).map(<[u8]>::to_vec).collect::<std::collections::BTreeSet<_>>().len();
        assert!(Arc::ptr_eq(&coarse(frame.clone(), 0), &frame));
        let many: Vec<usize> = (0..=3).map(|coarseness| kinds(&coarse(frame.clone(), coarseness))).collect();
        assert!(many.is_sorted_by(|a, b| a > b), "{many:?}");
    }
}
