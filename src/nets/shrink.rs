//! Scales a drawn frame down to what the visual encoder reads, by averaging areas so that small things stay visible.

/// Averages a square image of `from` x `from` pixels, three bytes a pixel, down to `to` x `to`. Planes: all red, then all green,
/// then all blue, each row-major. Returns nothing but zeros when the image is shorter than its size says.
pub fn shrink(rgb: &[u8], from: usize, to: usize) -> Vec<u8> {
    let spans = spans(from, to);
    let mut rows = vec![0f32; to * from * 3];
    if rgb.len() < from * from * 3 {
        return vec![0; to * to * 3];
    }
    // Down the columns first: whole rows are added up, which the compiler turns into vector code.
    for (target, span) in rows.chunks_exact_mut(from * 3).zip(&spans) {
        for &(source, weight) in span {
            let row = &rgb[source * from * 3..(source + 1) * from * 3];
            for (sum, &byte) in target.iter_mut().zip(row) {
                *sum += weight * f32::from(byte);
            }
        }
    }
    let mut planes = vec![0u8; to * to * 3];
    for (y, row) in rows.chunks_exact(from * 3).enumerate() {
        for (x, span) in spans.iter().enumerate() {
            let mut sum = [0f32; 3];
            for &(source, weight) in span {
                for (sum, value) in sum.iter_mut().zip(&row[source * 3..source * 3 + 3]) {
                    *sum += weight * value;
                }
            }
            for (channel, sum) in sum.into_iter().enumerate() {
                planes[(channel * to + y) * to + x] = (sum + 0.5) as u8;
            }
        }
    }
    planes
}

/// For each target pixel of a line, the source pixels under it with their shares, which add up to 1.
fn spans(from: usize, to: usize) -> Vec<Vec<(usize, f32)>> {
    let scale = from as f32 / to as f32;
    let span = |target: usize| {
        let (start, end) = (target as f32 * scale, (target + 1) as f32 * scale);
        let last = (end.ceil() as usize).min(from);
        let share = |source: usize| (end.min((source + 1) as f32) - start.max(source as f32)).max(0.0) / scale;
        (start.floor() as usize..last).map(|source| (source, share(source))).collect()
    };
    (0..to).map(span).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_colour_stays_and_a_checkerboard_turns_grey() {
        let even: Vec<u8> = [10, 200, 90].repeat(300 * 300);
        let small = shrink(&even, 300, 112);
        assert_eq!(small.len(), 3 * 112 * 112);
        assert!(small[..112 * 112].iter().all(|&v| v == 10));
        assert!(small[2 * 112 * 112..].iter().all(|&v| v == 90));
        let board: Vec<u8> = (0..4).flat_map(|y| (0..4).flat_map(move |x| [((x + y) % 2) as u8 * 200; 3])).collect();
        assert!(shrink(&board, 4, 2).iter().all(|&v| v == 100));
    }

    #[test]
    fn the_shares_of_a_pixel_add_up_to_one() {
        for span in spans(300, 112) {
            assert!((span.iter().map(|(_, share)| share).sum::<f32>() - 1.0).abs() < 1e-4);
        }
    }
}
