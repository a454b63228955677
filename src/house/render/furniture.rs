//! Fixed furniture as bodies: looks, doors that stand open, and holes for what is built in.

use glam::{Mat3, Vec3};

use super::looks::{FilledBox, Look, Variant};
use super::solid::{RgbF32, Solid, SolidKind};
use crate::domain::place::Cuboid;
use crate::domain::scene::{Fixture, Scene, Surface};
use crate::domain::world::FixtureState;
use crate::domain::{Heading, Point};
use crate::house::{doors, placing};

/// Pieces lower than this are slabs: counter tops, boards.
const SLAB: i32 = 80;
/// How far a board in a cupboard reaches before the area that things stand on, in millimetres.
pub(crate) const BOARD_BEFORE_AREA: i32 = 120;
/// A hole thinner than this is not worth cutting, in millimetres.
const THIN: i32 = 2;

/// Whether things may be built into it: it gives way to drawers, cabinets and basins.
pub(crate) fn gives_way(fixture: &Fixture) -> bool {
    let solid = matches!(fixture.class.name(), "CounterTop" | "Dresser");
    solid && fixture.body.iter().any(|part| part.max.y - part.min.y >= SLAB)
}

/// Whether it may be built into another.
pub(crate) fn is_built_in(fixture: &Fixture) -> bool {
    fixture.class.info().openable || matches!(fixture.class.name(), "Sink" | "Bathtub")
}

/// The bodies of a fixture. `states` are those of all fixtures of the scene.
pub(crate) fn build(scene: &Scene, index: u16, states: &[FixtureState]) -> Vec<Solid> {
    let mut out = Vec::new();
    let Some(fixture) = scene.fixture(index) else { return out };
    let state = states.get(usize::from(index)).copied().unwrap_or_default();
    let variant = Variant { seed: seed_of(&fixture.id), open: state.open, on: state.on };
    let shift = if state.open { placing::drawer_shift(scene, index).metres() } else { Vec3::ZERO };
    let Some(look) = Look::of(fixture.class) else { return out };
    let surface = fixture.surfaces.first().map(|surface| Point::new(0, surface.height, 0).metres().y);
    let pieces = pieces(scene, index, states);
    let (uncut, whole) = (pieces == fixture.body, pieces.len() == 1);
    for (number, piece) in pieces.iter().enumerate() {
        let mut place = place(fixture.facing, piece, surface);
        place.centre += shift;
        let flat = piece.max.y - piece.min.y < SLAB;
        match (whole, Look::of_piece(fixture.class, number)) {
            _ if look.slab.is_some() => counter(look, &place, variant, flat, &mut out),
            (false, Some(part)) if uncut => part.fill(&place, variant, &mut out),
            _ if uncut && (whole || look.each) => look.fill(&place, variant, &mut out),
            _ => out.push(plain(&place, look.main(variant.seed), look.inner(variant.seed))),
        }
    }
    if pieces.is_empty() {
        for cuboid in boards(fixture) {
            out.push(plain(
                &place(fixture.facing, &cuboid, surface),
                look.main(variant.seed),
                look.inner(variant.seed),
            ));
        }
    }
    if state.open && fixture.class.info().openable {
        open_up(fixture, look, variant, &mut out);
    }
    out
}

/// A closed box.
fn plain(place: &FilledBox, colour: RgbF32, inner: RgbF32) -> Solid {
    let kind = SolidKind::Box { missing: 0 };
    Solid { kind, centre: place.centre, axes: place.axes, colour, inner, glows: false }
}

/// A piece of a counter: a slab, or a carcass that carries the slab's colour only where its top is.
fn counter(look: &Look, place: &FilledBox, variant: Variant, flat: bool, out: &mut Vec<Solid>) {
    let top = place.centre.y + place.axes.y_axis.length();
    match (flat, look.slab) {
        (true, Some(slab)) => out.push(plain(place, slab, slab)),
        _ if place.surface.is_some_and(|surface| (top - surface).abs() < 0.03) => look.fill(place, variant, out),
        _ => out.push(plain(place, look.main(variant.seed), look.inner(variant.seed))),
    }
}

/// The boards inside of something open, and its door.
fn open_up(fixture: &Fixture, look: &Look, variant: Variant, out: &mut Vec<Solid>) {
    let Some(door) = doors::open_door(fixture) else { return };
    let (main, inner) = (look.main(variant.seed), look.inner(variant.seed));
    out.push(Solid {
        kind: SolidKind::Box { missing: 0 },
        centre: door.centre,
        axes: door.axes,
        colour: main,
        inner,
        glows: false,
    });
    let Some(body) = fixture.body.first() else { return };
    for surface in &fixture.surfaces {
        if surface.height > body.min.y + 40 && surface.height < body.max.y {
            let (low, high) = (Point { y: surface.height - 12, ..body.min }, Point { y: surface.height, ..body.max });
            let (low, high) = set_back(fixture, surface, low, high);
            let mut shelf = place(fixture.facing, &Cuboid { min: low, max: high }, None);
            // Set back from the front, so that it is seen as inside.
            shelf.centre += shelf.axes.z_axis * 0.06;
            shelf.axes = Mat3::from_cols(shelf.axes.x_axis * 0.98, shelf.axes.y_axis, shelf.axes.z_axis * 0.92);
            out.push(plain(&shelf, inner, inner));
        }
    }
}

/// A board that ends a little before the area that things stand on, where that ends far behind the front.
fn set_back(fixture: &Fixture, surface: &Surface, mut low: Point, mut high: Point) -> (Point, Point) {
    let (dx, dz) = fixture.facing.step();
    let reach = |axis: usize, out: bool| {
        let edges = surface.areas.iter().map(move |area| if out { area.max[axis] } else { area.min[axis] });
        if out { edges.max() } else { edges.min() }
    };
    match (dx, dz) {
        (1, _) => high.x = reach(0, true).map_or(high.x, |x| high.x.min((x + BOARD_BEFORE_AREA).max(low.x))),
        (-1, _) => low.x = reach(0, false).map_or(low.x, |x| low.x.max((x - BOARD_BEFORE_AREA).min(high.x))),
        (_, 1) => high.z = reach(1, true).map_or(high.z, |z| high.z.min((z + BOARD_BEFORE_AREA).max(low.z))),
        _ => low.z = reach(1, false).map_or(low.z, |z| low.z.max((z - BOARD_BEFORE_AREA).min(high.z))),
    }
    (low, high)
}

/// The surfaces of a fixture without a body, as thin boards.
fn boards(fixture: &Fixture) -> impl Iterator<Item = Cuboid> {
    fixture.surfaces.iter().flat_map(|surface| {
        let y = surface.height;
        surface.areas.iter().map(move |area| {
            Cuboid::between(Point::new(area.min[0], y - 20, area.min[1]), Point::new(area.max[0], y, area.max[1]))
        })
    })
}

/// A box as seen from the front of its furniture.
fn place(facing: Heading, cuboid: &Cuboid, surface: Option<f32>) -> FilledBox {
    let (sides, half) = (doors::front(facing), doors::half_sides(facing, cuboid));
    let centre = (cuboid.min.metres() + cuboid.max.metres()) / 2.0;
    FilledBox { centre, axes: sides * Mat3::from_diagonal(half), surface }
}

/// The boxes of a body, without the holes for what is built into it.
fn pieces(scene: &Scene, index: u16, states: &[FixtureState]) -> Vec<Cuboid> {
    let Some(fixture) = scene.fixture(index) else { return Vec::new() };
    let mut pieces = fixture.body.clone();
    if !gives_way(fixture) {
        return pieces;
    }
    for (number, other) in scene.fixtures.iter().enumerate().filter(|(_, other)| is_built_in(other)) {
        let open = states.get(number).is_some_and(|state| state.open) && !other.class.info().slides;
        for hole in &other.body {
            let (dx, dz) = other.facing.step();
            let out = Point::new(i32::from(dx) * 200, 0, i32::from(dz) * 200);
            let front = Cuboid {
                min: Point::new(hole.min.x + out.x.min(0), hole.min.y, hole.min.z + out.z.min(0)),
                max: Point::new(hole.max.x + out.x.max(0), hole.max.y, hole.max.z + out.z.max(0)),
            };
            // A closed front that stands out needs no hole.
            let hidden = |piece: &Cuboid| match other.facing {
                _ if !other.class.info().openable => true,
                Heading::North => hole.max.z < piece.max.z + 4,
                Heading::East => hole.max.x < piece.max.x + 4,
                Heading::South => hole.min.z > piece.min.z - 4,
                Heading::West => hole.min.x > piece.min.x - 4,
            };
            pieces = pieces
                .into_iter()
                .flat_map(|piece| {
                    // A basin is open above, whatever its rim was measured to be.
                    let basin = Cuboid { max: Point { y: hole.max.y.max(piece.max.y), ..hole.max }, ..*hole };
                    let cut = if other.class.info().openable { front } else { basin };
                    if (open || hidden(&piece)) && meet(&piece, &cut) { without(piece, &cut) } else { vec![piece] }
                })
                .collect();
        }
    }
    pieces
}

/// Whether two boxes share more than a sliver.
pub(crate) fn meet(a: &Cuboid, b: &Cuboid) -> bool {
    let (a, b): ([[i32; 3]; 2], [[i32; 3]; 2]) = ([a.min.into(), a.max.into()], [b.min.into(), b.max.into()]);
    (0..3).all(|axis| a[1][axis].min(b[1][axis]) - a[0][axis].max(b[0][axis]) > THIN)
}

/// What is left of a box when another is cut out: at most six boxes.
fn without(cuboid: Cuboid, hole: &Cuboid) -> Vec<Cuboid> {
    let (mut min, mut max): ([i32; 3], [i32; 3]) = (cuboid.min.into(), cuboid.max.into());
    let (low, high): ([i32; 3], [i32; 3]) = (hole.min.into(), hole.max.into());
    let mut left = Vec::new();
    // Above and below first, so that tops stay whole.
    for axis in [1, 0, 2] {
        if low[axis] - min[axis] > THIN {
            let mut end = max;
            end[axis] = low[axis];
            left.push(Cuboid { min: min.into(), max: end.into() });
            min[axis] = low[axis];
        }
        if max[axis] - high[axis] > THIN {
            let mut start = min;
            start[axis] = high[axis];
            left.push(Cuboid { min: start.into(), max: max.into() });
            max[axis] = high[axis];
        }
    }
    left
}

/// A number that stays with a name (FNV-1a, finished so that all bits depend on all of it).
pub(crate) fn seed_of(name: &str) -> u32 {
    let hash = name.bytes().fold(0x811c_9dc5_u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
    mix(hash)
}

/// Spreads a number's bits.
pub(crate) fn mix(mut hash: u32) -> u32 {
    hash = (hash ^ hash >> 16).wrapping_mul(0x7feb_352d);
    hash = (hash ^ hash >> 15).wrapping_mul(0x846c_a68b);
    hash ^ hash >> 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_leaves_the_rest_of_the_box() {
        let cube = Cuboid::between(Point::new(0, 0, 0), Point::new(100, 100, 100));
        let volume = |cuboid: &Cuboid| {
            let (min, max): ([i32; 3], [i32; 3]) = (cuboid.min.into(), cuboid.max.into());
            (0..3).map(|axis| max[axis] - min[axis]).product::<i32>()
        };
        let hole = Cuboid::between(Point::new(20, 50, -10), Point::new(60, 90, 30));
        let left = without(cube, &hole);
        assert_eq!(left.iter().map(volume).sum::<i32>(), 1_000_000 - 40 * 40 * 30);
        assert!(left.iter().all(|part| !meet(part, &hole)));
    }
}
