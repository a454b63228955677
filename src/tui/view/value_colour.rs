//! The colour scale of values, on the map and in the strips of a chain.

use ratatui::style::Color;

/// A colour from low to high for a share of 0 to 1, readable with the digits over it.
pub(super) fn value_colour(share: f32) -> Color {
    const STOPS: [[f32; 3]; 5] =
        [[26.0, 24.0, 60.0], [86.0, 32.0, 120.0], [180.0, 54.0, 96.0], [240.0, 130.0, 50.0], [252.0, 230.0, 120.0]];
    let at = share.clamp(0.0, 1.0) * 4.0;
    let (from, part) = ((at as usize).min(3), at - (at as usize).min(3) as f32);
    let mix = |i: usize| (STOPS[from][i] + (STOPS[from + 1][i] - STOPS[from][i]) * part) as u8;
    Color::Rgb(mix(0), mix(1), mix(2))
}
