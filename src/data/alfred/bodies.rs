//! What furniture fills: boxes from its surfaces, from its pivot, and from what class of thing it is.

use super::fixtures::Found;
use super::furniture::{self, Build, Furniture};
use super::support::ahead_of;
use crate::domain::place::{Cuboid, Rect};
use crate::domain::scene::Surface;
use crate::domain::{Heading, Point};

/// How far a body reaches beyond the surface's own margin, in millimetres.
const RIM: i32 = 30;
/// Thickness of a shelf and of a sofa's back.
const BOARD: i32 = 30;
const BACK: i32 = 180;

/// The boxes of a fixture's body.
pub fn body(found: &Found, surfaces: &[Surface], facing: Heading, floor: i32) -> Vec<Cuboid> {
    let row = furniture::of(found.name.class);
    let own = own_box(found, row, facing, floor);
    let Some(lowest) = surfaces.first() else { return vec![own] };
    let highest = surfaces.iter().map(|surface| surface.height).fold(lowest.height, i32::max);
    let over = |rect: &Rect, bottom: i32, top: i32| upright(*rect, bottom.min(top - 10), top);
    match row.build {
        Build::Block => {
            let top = surfaces.last().unwrap_or(lowest);
            let areas = top.areas.iter();
            areas.map(|area| over(&area.grown(RIM), floor, highest)).collect()
        }
        Build::Seat => {
            let mut parts: Vec<Cuboid> =
                lowest.areas.iter().map(|area| over(&area.grown(RIM), floor, lowest.height)).collect();
            parts.extend(lowest.areas.iter().map(|area| {
                let back = behind(&area.grown(RIM), facing, BACK);
                upright(back, floor, lowest.height + 350)
            }));
            parts
        }
        Build::Board => lowest.areas.iter().map(|area| over(area, lowest.height - BOARD, lowest.height)).collect(),
        Build::Tub => {
            let outline = outline(surfaces).grown(RIM);
            let bottom = if matches!(row.bottom, furniture::Height::Floor(_)) { floor } else { lowest.height - 20 };
            let top = (bottom + row.body[1]).max(lowest.height + 100);
            vec![upright(outline, bottom, top)]
        }
        Build::Shell => {
            let inside = outline(surfaces).grown(RIM);
            let width = union(&inside, &own.footprint());
            let bottom = own.min.y.min(lowest.height - 20);
            vec![upright(width, bottom, own.max.y.max(highest + 250))]
        }
        Build::Thing => vec![own],
    }
}

/// The box that the class's own size gives.
fn own_box(found: &Found, row: &Furniture, facing: Heading, floor: i32) -> Cuboid {
    let [width, height, depth] = row.body;
    let footprint = ahead_of(found.pivot, facing, [width, depth], -row.behind);
    let bottom = row.bottom.above(found.pivot.y, floor);
    upright(footprint, bottom, bottom + height)
}

fn upright(rect: Rect, bottom: i32, top: i32) -> Cuboid {
    Cuboid { min: Point::new(rect.min[0], bottom, rect.min[1]), max: Point::new(rect.max[0], top, rect.max[1]) }
}

fn union(a: &Rect, b: &Rect) -> Rect {
    Rect {
        min: [a.min[0].min(b.min[0]), a.min[1].min(b.min[1])],
        max: [a.max[0].max(b.max[0]), a.max[1].max(b.max[1])],
    }
}

fn outline(surfaces: &[Surface]) -> Rect {
    let areas = surfaces.iter().flat_map(|surface| &surface.areas);
    areas.copied().reduce(|a, b| union(&a, &b)).unwrap_or(Rect { min: [0, 0], max: [0, 0] })
}

/// The strip of that depth behind a rectangle.
fn behind(rect: &Rect, facing: Heading, depth: i32) -> Rect {
    match facing {
        Heading::North => Rect { min: [rect.min[0], rect.min[1] - depth], max: [rect.max[0], rect.min[1]] },
        Heading::South => Rect { min: [rect.min[0], rect.max[1]], max: [rect.max[0], rect.max[1] + depth] },
        Heading::East => Rect { min: [rect.min[0] - depth, rect.min[1]], max: [rect.min[0], rect.max[1]] },
        Heading::West => Rect { min: [rect.max[0], rect.min[1]], max: [rect.max[0] + depth, rect.max[1]] },
    }
}
