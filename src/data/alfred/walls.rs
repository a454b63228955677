//! Walls and what carries counters: not in the data. Made so that a room looks closed.

use crate::domain::place::{Cuboid, Rect};
use crate::domain::{Cell, Fixture, Point};

/// From the outermost cell or furniture to the wall, in millimetres.
const GAP: i32 = 20;
/// How much of a cell lies beyond its middle, in millimetres.
const STAND: i32 = 250;
const THICKNESS: i32 = 60;
const HEIGHT: i32 = 2600;

/// Four walls around cells and furniture, from the floor up; taller where furniture is.
pub(crate) fn around(cells: &[Cell], fixtures: &[Fixture], floor: i32) -> Vec<Cuboid> {
    let stands = cells.iter().map(|cell| {
        let middle = cell.centre(0);
        Rect { min: [middle.x, middle.z], max: [middle.x, middle.z] }.grown(STAND)
    });
    let bodies = fixtures.iter().flat_map(|fixture| &fixture.body);
    let all = stands.chain(bodies.clone().map(Cuboid::footprint));
    let Some(outline) = all.reduce(|a, b| Rect {
        min: [a.min[0].min(b.min[0]), a.min[1].min(b.min[1])],
        max: [a.max[0].max(b.max[0]), a.max[1].max(b.max[1])],
    }) else {
        return Vec::new();
    };
    let top = bodies.map(|body| body.max.y + 100).fold(floor + HEIGHT, i32::max);
    let inner = outline.grown(GAP);
    let outer = inner.grown(THICKNESS);
    let wall = |min: [i32; 2], max: [i32; 2]| Cuboid {
        min: Point::new(min[0], floor, min[1]),
        max: Point::new(max[0], top, max[1]),
    };
    vec![
        wall(outer.min, [outer.max[0], inner.min[1]]),
        wall([outer.min[0], inner.max[1]], outer.max),
        wall([outer.min[0], inner.min[1]], [inner.min[0], inner.max[1]]),
        wall([inner.max[0], inner.min[1]], [outer.max[0], inner.max[1]]),
    ]
}

/// How far what carries a counter stands back from its edge, in millimetres.
const SET_BACK: i32 = 25;
/// What is built in is free to its front for this far.
const FRONT: i32 = 400;
/// Pieces thinner than this are left out.
const SLIVER: i32 = 15;

/// What carries the counters: boxes from the floor to each slab, with room left for everything that stands or is built in
/// below.
pub(crate) fn under_counters(fixtures: &[Fixture], floor: i32) -> Vec<Cuboid> {
    let mut all = Vec::new();
    for (number, counter) in fixtures.iter().enumerate().filter(|(_, fixture)| fixture.class.name() == "CounterTop") {
        let below = |slab: &Cuboid| {
            let ground = slab.footprint().grown(-SET_BACK);
            let min = Point::new(ground.min[0], floor, ground.min[1]);
            Cuboid { min, max: Point::new(ground.max[0], slab.min.y, ground.max[1]) }
        };
        let mut pieces: Vec<Cuboid> = counter.body.iter().map(below).filter(thick).collect();
        for (_, other) in fixtures.iter().enumerate().filter(|(other, _)| *other != number) {
            let (dx, dz) = other.facing.step();
            for part in &other.body {
                let mut hole = *part;
                let (x, z) = (i32::from(dx) * FRONT, i32::from(dz) * FRONT);
                hole.min = Point::new(hole.min.x + x.min(0), hole.min.y, hole.min.z + z.min(0));
                hole.max = Point::new(hole.max.x + x.max(0), hole.max.y, hole.max.z + z.max(0));
                pieces = pieces.into_iter().flat_map(|piece| without(piece, &hole)).collect();
            }
        }
        all.extend(pieces);
    }
    all
}

fn thick(piece: &Cuboid) -> bool {
    piece.sides().iter().all(|side| *side >= SLIVER)
}

/// What is left of a box when another is cut out, but for slivers.
fn without(piece: Cuboid, hole: &Cuboid) -> Vec<Cuboid> {
    let mut left = piece.without(hole);
    if left != [piece] {
        left.retain(thick);
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_lies_within_the_walls() {
        let cells = [Cell::new(0, 0), Cell::new(4, 0), Cell::new(4, 6)];
        let walls = around(&cells, &[], 0);
        assert_eq!(walls.len(), 4);
        for cell in cells {
            let at = cell.centre(0);
            assert!(walls.iter().all(|wall| !wall.footprint().grown(150).contains(at.x, at.z)));
        }
    }
}
