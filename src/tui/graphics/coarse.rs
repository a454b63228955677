//! Coarser frames for slow links: larger pixels and fewer colours compress better in every protocol.

use std::sync::Arc;

use ratatui::style::Style;

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

/// The cells of a picture in larger blocks: neighbours that are alike are not sent one by one, and change together. Blocks are
/// two columns to a row, as cells are narrow.
pub(crate) fn coarse_cells(cells: &mut [(char, Style)], columns: usize, coarseness: u8) {
    let (wide, high) = (1usize << coarseness.min(COARSEST), 1usize << coarseness.min(COARSEST).saturating_sub(1));
    let rows = cells.len() / columns.max(1);
    for row in 0..rows {
        for column in 0..columns {
            let middle = |at: usize, side: usize, most: usize| (at / side * side + side / 2).min(most - 1);
            let from = middle(row, high, rows) * columns + middle(column, wide, columns);
            // Only what comes before is overwritten; the middle of a block is read before its turn, or stays as it is.
            cells[row * columns + column] = plain(cells[from]);
        }
    }
}

/// A letter stays; a cut between two colours would be repeated as a pattern, so one of them fills the cell.
fn plain((symbol, style): (char, Style)) -> (char, Style) {
    match (symbol.is_ascii(), style.bg) {
        (false, Some(colour)) => (' ', Style::new().bg(colour)),
        _ => (symbol, style),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::style::Color;

    #[test]
    fn coarse_cells_are_blocks_of_their_middle() {
        let grey = |value| Style::new().bg(Color::Rgb(value, value, value)).fg(Color::Reset);
        let fine: Vec<(char, Style)> = (0..8 * 4).map(|at| ('▀', grey(at))).collect();
        for coarseness in 1..=3 {
            let mut cells = fine.clone();
            coarse_cells(&mut cells, 8, coarseness);
            let kinds = cells.iter().map(|(_, style)| style.bg).collect::<std::collections::HashSet<_>>().len();
            assert_eq!(kinds, [16, 4, 1][usize::from(coarseness) - 1], "{coarseness}");
        }
        let mut letters = vec![('a', Style::new()), ('b', Style::new())];
        coarse_cells(&mut letters, 2, 1);
        assert_eq!(letters, [('b', Style::new()); 2]);
    }

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
