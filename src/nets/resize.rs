//! Scales a drawn frame down to what the visual encoder reads, by averaging areas so that small things stay visible.
//! Ours, because trained encoders depend on every byte: fast_image_resize 5 has no area average (its box filter takes whole
//! pixels: a tenth of the bytes differ, by up to 65), and its bilinear filter rounds some bytes otherwise.

/// Averages a square image of `from` x `from` pixels, three bytes a pixel, down to `to` x `to`. Planes: all red, then all green,
/// then all blue, each row-major. Returns nothing but zeros when the image is shorter than its size says.
pub(crate) fn resize_area(rgb: &[u8], from: usize, to: usize) -> Vec<u8> {
    weighted(rgb, from, to, &areas(from, to))
}

/// As [`resize_area`], with weights that fall off linearly from each target pixel's centre: what image libraries call bilinear.
pub(crate) fn resize_bilinear(rgb: &[u8], from: usize, to: usize) -> Vec<u8> {
    weighted(rgb, from, to, &triangles(from, to))
}

/// The source pixels of a line that a target pixel is made of.
struct PixelSpan {
    first: usize,
    /// From the first one on; they add up to 1.
    weights: Vec<f32>,
}

fn weighted(rgb: &[u8], from: usize, to: usize, spans: &[PixelSpan]) -> Vec<u8> {
    let mut planes = vec![0u8; to * to * 3];
    if rgb.len() < from * from * 3 {
        return planes;
    }
    let mut line = vec![0f32; from * 3];
    for (y, span) in spans.iter().enumerate() {
        // Down the columns first: whole rows are added up, which the compiler turns into vector code.
        line.fill(0.0);
        for (row, &weight) in rgb.chunks_exact(from * 3).skip(span.first).zip(&span.weights) {
            for (sum, &byte) in line.iter_mut().zip(row) {
                *sum += weight * f32::from(byte);
            }
        }
        for (x, span) in spans.iter().enumerate() {
            let mut sum = [0f32; 3];
            for (pixel, &weight) in line[span.first * 3..].chunks_exact(3).zip(&span.weights) {
                sum[0] += weight * pixel[0];
                sum[1] += weight * pixel[1];
                sum[2] += weight * pixel[2];
            }
            for (channel, sum) in sum.into_iter().enumerate() {
                planes[(channel * to + y) * to + x] = (sum + 0.5) as u8;
            }
        }
    }
    planes
}

/// For each target pixel of a line, the source pixels under it with the shares of it that they cover.
fn areas(from: usize, to: usize) -> Vec<PixelSpan> {
    let scale = from as f32 / to as f32;
    let span = |target: usize| {
        let (start, end) = (target as f32 * scale, (target + 1) as f32 * scale);
        let last = (end.ceil() as usize).min(from);
        let share = |source: usize| (end.min((source + 1) as f32) - start.max(source as f32)).max(0.0) / scale;
        let first = start.floor() as usize;
        PixelSpan { first, weights: (first..last).map(share).collect() }
    };
    (0..to).map(span).collect()
}

/// The same with weights that fall off linearly over the width of a target pixel on either side.
fn triangles(from: usize, to: usize) -> Vec<PixelSpan> {
    let scale = from as f32 / to as f32;
    let reach = scale.max(1.0);
    let span = |target: usize| {
        let centre = (target as f32 + 0.5) * scale;
        let first = (centre - reach + 0.5).max(0.0) as usize;
        let last = ((centre + reach + 0.5) as usize).min(from);
        let weight = |source: usize| (1.0 - ((source as f32 + 0.5 - centre) / reach).abs()).max(0.0);
        let total: f32 = (first..last).map(weight).sum();
        PixelSpan { first, weights: (first..last).map(|source| weight(source) / total).collect() }
    };
    (0..to).map(span).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_colour_stays_and_a_checkerboard_turns_grey() {
        let even: Vec<u8> = [10, 200, 90].repeat(300 * 300);
        let small = resize_area(&even, 300, 112);
        assert_eq!(small.len(), 3 * 112 * 112);
        assert!(small[..112 * 112].iter().all(|&v| v == 10));
        assert!(small[2 * 112 * 112..].iter().all(|&v| v == 90));
        let board: Vec<u8> = (0..4).flat_map(|y| (0..4).flat_map(move |x| [((x + y) % 2) as u8 * 200; 3])).collect();
        assert!(resize_area(&board, 4, 2).iter().all(|&v| v == 100));
    }

    #[test]
    fn the_shares_of_a_pixel_add_up_to_one() {
        for span in areas(300, 112).into_iter().chain(triangles(300, 224)) {
            assert!((span.weights.iter().sum::<f32>() - 1.0).abs() < 1e-4);
        }
    }

    const PILLOW: [((usize, usize, usize), u8); 27] = [
        ((1, 114, 169), 76),
        ((2, 7, 32), 196),
        ((2, 212, 55), 197),
        ((0, 194, 94), 167),
        ((0, 185, 57), 210),
        ((1, 144, 123), 137),
        ((0, 6, 193), 49),
        ((2, 187, 120), 222),
        ((2, 73, 101), 78),
        ((2, 27, 67), 18),
        ((0, 101, 218), 27),
        ((0, 85, 90), 174),
        ((2, 45, 112), 111),
        ((0, 4, 168), 192),
        ((0, 62, 111), 99),
        ((1, 26, 219), 66),
        ((2, 215, 20), 90),
        ((2, 65, 121), 84),
        ((2, 62, 162), 220),
        ((0, 72, 217), 80),
        ((1, 115, 65), 178),
        ((0, 95, 139), 182),
        ((1, 173, 81), 206),
        ((1, 173, 205), 192),
        ((0, 0, 0), 3),
        ((1, 223, 223), 163),
        ((2, 0, 223), 130),
    ];

    #[test]
    fn bilinear_agrees_with_pillow() {
        let rgb: Vec<u8> =
            (0..300 * 300).flat_map(|i| [0, 1, 2].map(|c| ((i % 300) * 3 + (i / 300) * (5 + c) % 251) as u8)).collect();
        let small = resize_bilinear(&rgb, 300, 224);
        // Computed with Pillow 13.0's Image.resize((224, 224), Image.BILINEAR); it rounds twice, so it may differ by 1.
        for ((channel, y, x), expected) in PILLOW {
            let found = small[(channel * 224 + y) * 224 + x];
            assert!(found.abs_diff(expected) <= 1, "{channel} {y} {x}: {found}, not {expected}");
        }
    }
}
