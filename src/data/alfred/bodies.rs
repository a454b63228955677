//! What furniture fills: boxes from its surfaces, its pivot, how it was seen, and what class of thing it is.

use super::fit::{Subject, within};
use super::fixtures::FoundFixture;
use super::furniture::{self, BodyKind, Furniture, MeasuredHeight};
use super::support::{MARGIN, ahead_of};
use crate::domain::place::{Cuboid, Rect};
use crate::domain::{Cell, Fixture, Heading, Point};

/// Thickness of a shelf.
const BOARD: i32 = 30;
/// First guesses of a seat's back and arms.
const BACK: i32 = 180;
const ARM: i32 = 100;
/// How high the arms rise above the seat, and how high a toilet's bowl is.
const ARM_RISE: i32 = 180;
const BOWL: i32 = 420;
/// Walls of tubs and cupboards around their contents.
pub(crate) const WALL: i32 = 30;
/// What it costs to turn something away from its users, in units of overlap.
const RETURN: f32 = 0.03;
/// A cupboard's contents need at least this height.
const HEADROOM: i32 = 60;

/// Gives a fixture its body, and cuts the surfaces that lie inside it to fit. The fixture comes with surfaces and facing;
/// seats and toilets, which are used from any side, are turned as they were seen.
pub(crate) fn furnish(fixture: &mut Fixture, found: &FoundFixture, agent_y: i32, cells: &[Cell]) {
    let turnable = matches!(furniture::of(fixture.class).build, BodyKind::Seat | BodyKind::Toilet);
    let voted = fixture.facing;
    let facings = Heading::ALL.into_iter().filter(|&facing| facing == voted || turnable);
    let fitted = facings.map(|facing| {
        let mut turned = Fixture { facing, ..fixture.clone() };
        let cost = furnish_as_turned(&mut turned, found, agent_y, cells);
        (cost + if facing == voted { 0.0 } else { RETURN }, turned)
    });
    if let Some((_, best)) = fitted.min_by(|a, b| a.0.total_cmp(&b.0)) {
        *fixture = best;
    }
}

/// Gives a fixture its body in the direction that it faces; how badly that agrees with its views.
fn furnish_as_turned(fixture: &mut Fixture, found: &FoundFixture, agent_y: i32, cells: &[Cell]) -> f32 {
    let floor = agent_y - 900;
    let row = furniture::of(fixture.class);
    let first = first_guess(fixture, row, floor);
    let areas = fixture.surfaces.first().map_or(0, |surface| surface.areas.len());
    if matches!(row.build, BodyKind::Block | BodyKind::Slab) && areas > 1 {
        // An outline of several parts: the contents tell more than any view.
        let surfaces = fixture.surfaces.iter().flat_map(|surface| &surface.areas);
        fixture.body = surfaces.map(|area| upright(*area, first.min.y, first.max.y)).collect();
        return 0.0;
    }
    let shape = fixture.clone();
    let parts = |outer: Cuboid| parts(outer, &shape, row, floor);
    let mut subject = Subject::new(fixture.clone(), row.build, &found.uses, agent_y, cells, &parts);
    let high = first.min.y > floor + 1200;
    if high {
        subject.cells = &[];
    }
    let on_floor = matches!(row.bottom, MeasuredHeight::Floor(_));
    let top_known = matches!(row.build, BodyKind::Block | BodyKind::Slab | BodyKind::Toilet);
    subject.free = [true, !on_floor, true, true, !top_known, true];
    subject.contents = contents(fixture, row);
    let (outer, cost) = subject.fit(first);
    fixture.body = parts(outer);
    if matches!(row.build, BodyKind::Tub | BodyKind::Shell | BodyKind::Board) {
        let inset = if row.build == BodyKind::Board { 0 } else { WALL };
        within(&mut fixture.surfaces, &outer, inset);
    }
    cost
}

/// The outer box before any view is looked at.
fn first_guess(fixture: &Fixture, row: &Furniture, floor: i32) -> Cuboid {
    let own = own_box(fixture.pivot, row, fixture.facing, floor);
    let (Some(lowest), Some(highest)) = (fixture.surfaces.first(), fixture.surfaces.last()) else { return own };
    let area = outline(fixture);
    match row.build {
        BodyKind::Thing => own,
        BodyKind::Block => upright(area, floor, highest.height.max(floor + 20)),
        BodyKind::Toilet => {
            let front = strip(&area, fixture.facing, 350);
            upright(union(&area, &front), floor, highest.height.max(floor + 20))
        }
        BodyKind::Seat => {
            let [left, right] = [fixture.facing.left(), fixture.facing.right()].map(|side| strip(&area, side, ARM));
            let back = strip(&area, fixture.facing.right().right(), BACK);
            let all = union(&union(&area, &back), &union(&left, &right));
            upright(all, floor, lowest.height.max(floor + 20) + row.body[1] / 2)
        }
        BodyKind::Slab => upright(area, lowest.height - row.body[1], lowest.height),
        BodyKind::Board => upright(area, lowest.height - BOARD, lowest.height),
        BodyKind::Tub => {
            let outline = area.grown(WALL - MARGIN / 2);
            let bottom = if matches!(row.bottom, MeasuredHeight::Floor(_)) { floor } else { lowest.height - 20 };
            upright(outline, bottom, (bottom + row.body[1]).max(lowest.height + HEADROOM))
        }
        BodyKind::Shell => {
            let inside = area.grown(WALL - MARGIN / 2);
            let bottom = own.min.y.min(lowest.height - 20);
            upright(union(&inside, &own.footprint()), bottom, own.max.y.max(highest.height + HEADROOM))
        }
    }
}

/// What the outer box has to contain: where things stood, without the margin.
pub(crate) fn contents(fixture: &Fixture, row: &Furniture) -> Option<Cuboid> {
    let (lowest, highest) = (fixture.surfaces.first()?, fixture.surfaces.last()?);
    let area = outline(fixture);
    match row.build {
        BodyKind::Thing | BodyKind::Board => None,
        BodyKind::Block | BodyKind::Slab | BodyKind::Seat | BodyKind::Toilet => {
            let points = area.grown(-MARGIN);
            let points = if points.min[0] <= points.max[0] && points.min[1] <= points.max[1] { points } else { area };
            Some(upright(points, lowest.height, lowest.height))
        }
        BodyKind::Tub | BodyKind::Shell => {
            // Neighbours may have been taken for contents: only the inner part has to be inside.
            let inset = |axis: usize| (area.max[axis] - area.min[axis]) / 4;
            let min = [area.min[0] + inset(0), area.min[1] + inset(1)];
            let max = [area.max[0] - inset(0), area.max[1] - inset(1)];
            Some(upright(Rect { min, max }, lowest.height, highest.height + HEADROOM))
        }
    }
}

/// The boxes that an outer box stands for.
fn parts(outer: Cuboid, fixture: &Fixture, row: &Furniture, floor: i32) -> Vec<Cuboid> {
    let Some(lowest) = fixture.surfaces.first() else { return vec![outer] };
    let (all, area) = (outer.footprint(), outline(fixture));
    match row.build {
        BodyKind::Seat => {
            let seat = shrunk_behind(&all, &area, fixture.facing);
            let top = lowest.height.max(floor + 10);
            let mut parts = vec![upright(seat, floor, top)];
            let back = remainder(&all, &seat, fixture.facing.right().right());
            parts.extend(back.map(|back| upright(back, floor, outer.max.y.max(top))));
            let arm_top = (top + ARM_RISE).min(outer.max.y.max(top));
            for side in [fixture.facing.left(), fixture.facing.right()] {
                parts.extend(remainder(&all, &seat, side).map(|arm| upright(arm, floor, arm_top)));
            }
            parts
        }
        BodyKind::Toilet => {
            let tank = area.grown(WALL - MARGIN / 2);
            let bowl = remainder(&union(&all, &tank), &tank, fixture.facing);
            let bowl = bowl.map(|bowl| upright(bowl, floor, floor + BOWL));
            bowl.into_iter().chain([upright(tank, floor, lowest.height.max(floor + 10))]).collect()
        }
        _ => vec![outer],
    }
}

/// The seat of an outer rectangle: what is left when back and arms are taken off where nothing lay.
fn shrunk_behind(all: &Rect, area: &Rect, facing: Heading) -> Rect {
    let mut seat = Rect {
        min: [area.min[0].clamp(all.min[0], all.max[0]), area.min[1].clamp(all.min[1], all.max[1])],
        max: [area.max[0].clamp(all.min[0], all.max[0]), area.max[1].clamp(all.min[1], all.max[1])],
    };
    // Nothing stands before the seat.
    match facing {
        Heading::North => seat.max[1] = all.max[1],
        Heading::South => seat.min[1] = all.min[1],
        Heading::East => seat.max[0] = all.max[0],
        Heading::West => seat.min[0] = all.min[0],
    }
    seat
}

/// What of `all` lies beyond `part` on one side, as deep as it goes.
fn remainder(all: &Rect, part: &Rect, side: Heading) -> Option<Rect> {
    let mut rest = *all;
    match side {
        Heading::North => rest.min[1] = part.max[1],
        Heading::South => rest.max[1] = part.min[1],
        Heading::East => rest.min[0] = part.max[0],
        Heading::West => rest.max[0] = part.min[0],
    }
    (0..2).all(|axis| rest.max[axis] - rest.min[axis] > 20).then_some(rest)
}

/// The strip of that depth beyond one side of a rectangle.
fn strip(rect: &Rect, side: Heading, depth: i32) -> Rect {
    let mut strip = *rect;
    match side {
        Heading::North => (strip.min[1], strip.max[1]) = (rect.max[1], rect.max[1] + depth),
        Heading::South => (strip.min[1], strip.max[1]) = (rect.min[1] - depth, rect.min[1]),
        Heading::East => (strip.min[0], strip.max[0]) = (rect.max[0], rect.max[0] + depth),
        Heading::West => (strip.min[0], strip.max[0]) = (rect.min[0] - depth, rect.min[0]),
    }
    strip
}

/// The box that the class's own size gives.
fn own_box(pivot: Point, row: &Furniture, facing: Heading, floor: i32) -> Cuboid {
    let [width, height, depth] = row.body;
    let footprint = ahead_of(pivot, facing, [width, depth], -row.behind);
    let bottom = row.bottom.above(pivot.y, floor);
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

/// The rectangle around all surfaces.
fn outline(fixture: &Fixture) -> Rect {
    let areas = fixture.surfaces.iter().flat_map(|surface| &surface.areas);
    areas.copied().reduce(|a, b| union(&a, &b)).unwrap_or(Rect { min: [0, 0], max: [0, 0] })
}
