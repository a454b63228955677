//! Boxes give up what lines of sight cross.

use glam::Vec3;

use super::sightlines::Line;
use crate::domain::place::{Cuboid, Rect};
use crate::domain::{Fixture, Point};
use crate::house::render::furniture::BOARD_BEFORE_AREA;

/// Around lines, in millimetres.
pub(super) const SPARE: i32 = 12;
/// Pieces thinner than this are left out, in millimetres.
const SLIVER: i32 = 40;
/// No box gives up more than this share of a side.
const MOST: f32 = 0.6;
/// How much a support sinks at a time, and how far from the height of its contents it is one, in millimetres.
const LOWER: i32 = 20;
const DEEPEST: i32 = 80;
/// How thick the walls of tubs are drawn, in millimetres.
pub(super) const RIM: i32 = 25;

/// Lowers what things lie on by a little: it is drawn with cushions and edges that no box tells of.
pub(super) fn sink(fixture: &mut Fixture) {
    let Some(support) = fixture.surfaces.first().map(|surface| surface.height) else { return };
    for part in &mut fixture.body {
        if (part.max.y - support).abs() < DEEPEST && part.max.y - LOWER - part.min.y > LOWER / 2 {
            part.max.y -= LOWER;
        }
    }
}

/// The box around all that lines cross of a box.
pub(super) fn crossed(cuboid: &Cuboid, lines: &[Line]) -> Option<Cuboid> {
    let ends = lines.iter().filter_map(|line| line.through(cuboid)).flatten();
    let (low, high) = ends.fold(None, |range: Option<(Vec3, Vec3)>, end| {
        let (low, high) = range.unwrap_or((end, end));
        Some((low.min(end), high.max(end)))
    })?;
    let mm = |metres: f32| (metres * 1000.0).round() as i32;
    let point = |at: Vec3, by: i32| Point::new(mm(at.x) + by, mm(at.y) + by, mm(at.z) + by);
    Some(Cuboid { min: point(low, -SPARE), max: point(high, SPARE) })
}

/// Cuts what lines cross out of a slab or an outline of several parts, through all of its height.
pub(super) fn notch(fixture: &mut Fixture, lines: &[Line]) {
    let mut holes = Vec::new();
    let mut left = Vec::new();
    for part in &fixture.body {
        match crossed(part, lines) {
            Some(hole) => {
                let upright =
                    Cuboid { min: Point { y: part.min.y, ..hole.min }, max: Point { y: part.max.y, ..hole.max } };
                holes.push(upright.footprint());
                left.extend(without(*part, &upright));
            }
            None => left.push(*part),
        }
    }
    if left.is_empty() {
        return;
    }
    fixture.body = left;
    for surface in &mut fixture.surfaces {
        for hole in &holes {
            let areas: Vec<Rect> = surface.areas.iter().flat_map(|area| outside(area, hole)).collect();
            if !areas.is_empty() {
                surface.areas = areas;
            }
        }
    }
}

/// What is left of a rectangle when another is cut out.
fn outside(area: &Rect, hole: &Rect) -> Vec<Rect> {
    let cuboid = |rect: &Rect| Cuboid {
        min: Point::new(rect.min[0], 0, rect.min[1]),
        max: Point::new(rect.max[0], SLIVER, rect.max[1]),
    };
    without(cuboid(area), &cuboid(hole)).iter().map(Cuboid::footprint).collect()
}

/// A box that ends where lines begin to cross it, on the side that costs it least.
pub(super) fn trimmed(part: &Cuboid, lines: &[Line]) -> Cuboid {
    let Some(hole) = crossed(part, lines) else { return *part };
    let (min, max): ([i32; 3], [i32; 3]) = (part.min.into(), part.max.into());
    let (low, high): ([i32; 3], [i32; 3]) = (hole.min.into(), hole.max.into());
    let mut best: Option<(f32, Cuboid)> = None;
    for axis in 0..3 {
        let side = (max[axis] - min[axis]) as f32;
        let (mut lower, mut upper) = (max, min);
        lower[axis] = low[axis];
        upper[axis] = high[axis];
        let kept = [
            (max[axis] - low[axis], Cuboid { min: part.min, max: lower.into() }),
            (high[axis] - min[axis], Cuboid { min: upper.into(), max: part.max }),
        ];
        for (loss, kept) in kept {
            let loss = loss as f32 / side;
            if loss <= MOST && best.is_none_or(|(least, _)| loss < least) {
                best = Some((loss, kept));
            }
        }
    }
    best.map_or(*part, |(_, kept)| kept)
}

/// Lets one look into an open cupboard: boards above what is seen end farther back, and its front or top moves until the lines
/// come in through the front.
pub(super) fn let_look_in(fixture: &mut Fixture, lines: &[Line]) {
    let Some(body) = fixture.body.first_mut() else { return };
    let (dx, dz) = fixture.facing.step();
    let (axis, sign) = if dx == 0 { (2, i32::from(dz)) } else { (0, i32::from(dx)) };
    let mm = |metres: f32| (metres * 1000.0).round() as i32;
    // Boards first: those that lines cross within.
    for surface in &mut fixture.surfaces {
        for line in lines {
            let Some(at) = line.crossing(1, surface.height as f32 / 1000.0) else { continue };
            let front = mm(at[axis]) - sign * (BOARD_BEFORE_AREA + SPARE);
            for area in &mut surface.areas {
                let flat = axis / 2;
                match sign {
                    1 => area.max[flat] = area.max[flat].min(front.max(area.min[flat])),
                    _ => area.min[flat] = area.min[flat].max(front.min(area.max[flat])),
                }
            }
        }
    }
    let (min, max): ([i32; 3], [i32; 3]) = (body.min.into(), body.max.into());
    let front = if sign == 1 { max[axis] } else { min[axis] };
    let (mut top, mut back) = (max[1], front);
    for line in lines {
        let Some(at) = line.crossing(axis, front as f32 / 1000.0) else { continue };
        top = top.max(mm(at.y) + RIM);
        // Farther back the line has come down below the top.
        if let Some(under) = line.crossing(1, (max[1] - RIM) as f32 / 1000.0) {
            let under = mm(under[axis]);
            back = if sign == 1 { back.min(under - SPARE) } else { back.max(under + SPARE) };
        }
    }
    let share = |by: i32, axis: usize| by as f32 / (max[axis] - min[axis]).max(1) as f32;
    let set_back = share((front - back).abs(), axis);
    let raised = share(top - max[1], 1);
    if set_back < raised && set_back <= MOST {
        if sign == 1 { body.max = with(body.max, axis, back) } else { body.min = with(body.min, axis, back) }
    } else if raised <= MOST {
        body.max.y = top;
    }
}

fn with(point: Point, axis: usize, value: i32) -> Point {
    let mut at: [i32; 3] = point.into();
    at[axis] = value;
    at.into()
}

/// What is left of a box when another is cut out, but for slivers.
pub(super) fn without(piece: Cuboid, hole: &Cuboid) -> Vec<Cuboid> {
    let mut left = piece.without(hole);
    if left != [piece] {
        left.retain(|piece| {
            let [wide, high, deep] = piece.sides();
            wide >= SLIVER && deep >= SLIVER && high > 0
        });
    }
    left
}
