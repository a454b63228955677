//! What the eyes make of one frame: which classes show where, what stands open, how far it is.

use std::collections::BTreeSet;

use crate::domain::{Class, Scene, World};
use crate::house::view::{Frame, decode, pixels_by_place, places_of};

pub(crate) use crate::nets::detector::GRID;

/// One frame on a raster of [`GRID`] x [`GRID`] cells, row by row, top left first.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Percept {
    /// A class, the number of the cell where it shows, and how probably it does; no less than [`Percept::LEAST`].
    pub(crate) detections: Vec<(Class, u16, f32)>,
    /// For each cell, how probably what shows there stands open or is switched on.
    pub(crate) open: Vec<f32>,
    /// For each cell, the median of its pixels' distance along the optical axis in metres; infinite where nothing is.
    pub(crate) depth: Vec<f32>,
}

impl Percept {
    /// Less probable detections are left out.
    pub(crate) const LEAST: f32 = 0.2;

    /// The side of a cell in pixels of a 300 x 300 frame.
    pub(crate) const CELL: f32 = 300.0 / GRID as f32;

    /// What eyes without fault would make of a frame that was drawn of `world`.
    pub(crate) fn of_truth(scene: &Scene, world: &World, frame: &Frame) -> Percept {
        /// Even the simulator's word leaves a doubt, as every other evidence does.
        const SURE: f32 = 0.9;
        let mut percept = Percept { detections: vec![], open: vec![0.0; GRID * GRID], depth: median_depths(frame) };
        let mut seen = BTreeSet::new();
        for (code, pixels) in pixels_by_place(frame, GRID) {
            let Some(instance) = decode(code) else { continue };
            let class = world.class_of(scene, instance).unwrap_or_default();
            for place in places_of(&pixels) {
                if class.in_vocabulary() {
                    seen.insert((place as u16, class));
                }
                if world.is_open(instance) || world.is_on(instance) {
                    percept.open[place] = 1.0;
                }
            }
        }
        percept.detections = seen.into_iter().map(|(place, class)| (class, place, SURE)).collect();
        percept
    }

    /// Column and row of a cell's middle in pixels of a 300 x 300 frame.
    pub(crate) fn middle(cell: u16) -> (f32, f32) {
        let (row, column) = (usize::from(cell) / GRID, usize::from(cell) % GRID);
        ((column as f32 + 0.5) * Percept::CELL, (row as f32 + 0.5) * Percept::CELL)
    }

    /// The number of the cell that holds a pixel of a 300 x 300 frame; `None` outside the frame.
    pub(crate) fn cell_at(column: f32, row: f32) -> Option<usize> {
        let whole = |pixel: f32| {
            let cell = (pixel / Percept::CELL).floor();
            (0.0..GRID as f32).contains(&cell).then_some(cell as usize)
        };
        Some(whole(row)? * GRID + whole(column)?)
    }
}

/// Whether something is in the hand: where that is drawn, something is nearer than the house comes. The lowest rows do not
/// count: a counter may come as near there.
pub(crate) fn fills_hand(frame: &Frame) -> bool {
    /// As few pixels of a 300 x 300 frame are something.
    const FEWEST: usize = 12;
    /// Rows below this one of a 300 x 300 frame do not count.
    const LOWEST: f32 = 268.0;
    let scale = 300.0 / frame.width.max(1) as f32;
    let shows = |&(at, &depth): &(usize, &f32)| {
        let (row, column) = ((at / frame.width) as f32 + 0.5, (at % frame.width) as f32 + 0.5);
        row * scale < LOWEST && super::eye::is_in_hand(column * scale, row * scale, depth)
    };
    frame.depth.iter().enumerate().filter(shows).count() >= FEWEST
}

/// The median depth of each cell of a frame.
pub(crate) fn median_depths(frame: &Frame) -> Vec<f32> {
    let span = |index: usize, size: usize| (index * size / GRID, ((index + 1) * size / GRID).min(size));
    let mut pixels = Vec::new();
    let mut median = |cell: usize| {
        let ((top, bottom), (left, right)) = (span(cell / GRID, frame.height), span(cell % GRID, frame.width));
        pixels.clear();
        for row in top..bottom {
            pixels.extend_from_slice(&frame.depth[row * frame.width + left..row * frame.width + right]);
        }
        let middle = pixels.len() / 2;
        match pixels.is_empty() {
            true => f32::INFINITY,
            false => *pixels.select_nth_unstable_by(middle, f32::total_cmp).1,
        }
    };
    (0..GRID * GRID).map(&mut median).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_holds_the_pixel_in_its_middle() {
        for cell in [0u16, 39, 40, 777, 1599] {
            let (column, row) = Percept::middle(cell);
            assert_eq!(Percept::cell_at(column, row), Some(usize::from(cell)));
        }
        assert_eq!(Percept::cell_at(300.0, 10.0), None);
        assert_eq!(Percept::cell_at(10.0, -0.1), None);
    }

    #[test]
    fn whatever_is_in_the_hand_fills_it() {
        use crate::domain::Room;
        use crate::domain::world::Parent;
        use crate::house::{generate, render::Renderer};
        let mut renderer = Renderer::new(300);
        let mut missed = Vec::new();
        for (seed, room) in (0..).zip(Room::ALL) {
            let (scene, world) = generate::house(room, seed);
            for index in 0..world.objects.len() {
                let mut world = world.clone();
                (world.held, world.objects[index].parent) = (Some(index as u16), Parent::Hand);
                if !fills_hand(renderer.draw(&scene, &world)) {
                    missed.push(world.objects[index].class.name());
                }
            }
        }
        assert!(missed.is_empty(), "{missed:?}");
    }

    #[test]
    fn an_empty_hand_seldom_looks_full_wherever_one_stands() {
        use crate::domain::Room;
        use crate::house::{generate, render::Renderer};
        let mut renderer = Renderer::new(300);
        let (mut wrong, mut looks) = (0, 0);
        for (seed, room) in (0..).zip(Room::ALL) {
            let (scene, mut world) = generate::house(room, seed);
            for &cell in scene.cells.iter().step_by(3) {
                world.agent.cell = cell;
                wrong += usize::from(fills_hand(renderer.draw(&scene, &world)));
                looks += 1;
            }
        }
        assert!(wrong * 4 <= looks, "{wrong} of {looks} empty hands look full");
    }

    #[test]
    fn one_odd_pixel_does_not_move_a_cells_depth() {
        let mut frame = Frame { width: 300, height: 300, rgb: vec![], depth: vec![2.0; 90_000], ids: vec![] };
        for column in 150..300 {
            for row in 0..300 {
                frame.depth[row * 300 + column] = f32::INFINITY;
            }
        }
        frame.depth[301] = 0.1;
        let depths = median_depths(&frame);
        assert_eq!((depths[0], depths[19], depths[20], depths[1599]), (2.0, 2.0, f32::INFINITY, f32::INFINITY));
    }
}
