//! The floor of a room under construction: its outline, what is built on already, and the cells that stay free.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::piece_frame::PieceFrame;
use super::rooms::{Range, RoomPlan};
use crate::domain::place::{Cuboid, Rect};
use crate::domain::{Cell, Heading};

/// How far the centre of a cell is from walls and furniture at least, in millimetres.
const CLEARANCE: i32 = 220;
/// How far in front of a piece somebody stands to use it, in millimetres.
const USE: i32 = 520;
/// World height of the floor in millimetres: 900 below an agent at 901.
pub(crate) const FLOOR: i32 = 1;
const CEILING: i32 = 2600;

/// A straight piece of wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wall {
    /// Its frame; u runs along the wall.
    pub(crate) site: PieceFrame,
    /// How long it is.
    pub(crate) length: i32,
}

#[derive(Clone, Debug)]
pub(crate) struct RoomFloor {
    /// The walls, anticlockwise.
    pub(crate) walls: Vec<Wall>,
    bounds: Rect,
    notch: Option<Rect>,
    solids: Vec<Rect>,
    aprons: Vec<Rect>,
    cells: Vec<Cell>,
}

/// A number from a range, in steps of `step` from its start.
pub(crate) fn pick(rng: &mut ChaCha8Rng, range: Range, step: i32) -> i32 {
    range[0] + step * rng.random_range(0..=((range[1] - range[0]) / step).max(0))
}

/// Whether two rectangles share more than an edge.
pub(crate) fn overlap(a: &Rect, b: &Rect) -> bool {
    (0..2).all(|axis| a.min[axis] < b.max[axis] && b.min[axis] < a.max[axis])
}

impl RoomFloor {
    /// An empty room: a rectangle, or an L.
    pub(crate) fn new(plan: &RoomPlan, rng: &mut ChaCha8Rng) -> RoomFloor {
        let (mut width, mut depth) = (pick(rng, plan.width, Cell::SIDE), pick(rng, plan.depth, Cell::SIDE));
        if rng.random_bool(0.5) {
            std::mem::swap(&mut width, &mut depth);
        }
        let min = [pick(rng, [-4000, 4000], Cell::SIDE), pick(rng, [-4000, 4000], Cell::SIDE)];
        let bounds = Rect { min, max: [min[0] + width, min[1] + depth] };
        let notch = rng.random_bool(plan.notch).then(|| {
            let cut = [pick(rng, [750, width / 3], Cell::SIDE), pick(rng, [750, depth / 3], Cell::SIDE)];
            let mut notch = Rect { min: bounds.min, max: bounds.max };
            for (axis, cut) in cut.into_iter().enumerate() {
                if rng.random_bool(0.5) {
                    notch.min[axis] = bounds.max[axis] - cut;
                } else {
                    notch.max[axis] = bounds.min[axis] + cut;
                }
            }
            notch
        });
        let cells = open_cells(&bounds, notch.as_ref());
        RoomFloor { walls: walls(&bounds, notch.as_ref()), bounds, notch, solids: vec![], aprons: vec![], cells }
    }

    /// The cells where somebody can stand, sorted; all connected.
    pub(crate) fn cells(&self) -> &[Cell] {
        &self.cells
    }

    pub(crate) fn wall_bodies(&self) -> Vec<Cuboid> {
        let count = self.walls.len();
        let body = |(index, wall): (usize, &Wall)| {
            // Round the corners of the room; a corner that points into it needs nothing.
            let before = self.walls[(index + count - 1) % count].site.facing;
            let after = self.walls[(index + 1) % count].site.facing;
            let start = if before.left() == wall.site.facing { -100 } else { 0 };
            let end = if wall.site.facing.left() == after { 100 } else { 0 };
            wall.site.cuboid([start, wall.length + end], [0, CEILING], [-100, 0])
        };
        self.walls.iter().enumerate().map(body).collect()
    }

    /// The outline of the room without its notch.
    pub(crate) fn bounds(&self) -> Rect {
        self.bounds
    }

    /// Whether a rectangle is inside the room and clear of what stands there.
    pub(crate) fn is_free(&self, rect: &Rect) -> bool {
        let inside =
            (0..2).all(|axis| rect.min[axis] >= self.bounds.min[axis] && rect.max[axis] <= self.bounds.max[axis]);
        inside
            && !self.notch.iter().any(|notch| overlap(rect, notch))
            && !self.solids.iter().any(|solid| overlap(rect, solid))
    }

    /// Whether a rectangle covers a place that somebody stands on to use a piece.
    pub(crate) fn is_apron(&self, rect: &Rect) -> bool {
        self.aprons.iter().any(|apron| overlap(rect, apron))
    }

    /// Keeps a strip of floor free for people, if it is free and somebody can stand on it.
    pub(crate) fn reserve(&mut self, front: Rect) -> bool {
        let usable = !self.solids.iter().any(|solid| overlap(&front, solid)) && stands(&self.cells, &front);
        if usable {
            self.aprons.push(front);
        }
        usable
    }

    /// Builds on the floor if there is room: `footprint` is free and in front of no other piece, every piece can still be
    /// stood before, and the cells stay connected. `front` is where people stand: the strip before these edges.
    pub(crate) fn build(&mut self, footprint: &Rect, fronts: &[Rect]) -> bool {
        if !self.is_free(footprint) || self.is_apron(footprint) {
            return false;
        }
        if fronts.iter().any(|front| self.solids.iter().any(|solid| overlap(front, solid))) {
            return false;
        }
        let cells = largest(self.cells.clone(), footprint);
        if cells.len() * 2 < self.cells.len() || !self.aprons.iter().chain(fronts).all(|front| stands(&cells, front)) {
            return false;
        }
        self.cells = cells;
        self.solids.push(*footprint);
        self.aprons.extend_from_slice(fronts);
        true
    }
}

/// The cells of an empty room, sorted.
fn open_cells(bounds: &Rect, notch: Option<&Rect>) -> Vec<Cell> {
    let low = |v: i32| ((v + CLEARANCE) as f32 / Cell::SIDE as f32).ceil() as i16;
    let high = |v: i32| ((v - CLEARANCE) as f32 / Cell::SIDE as f32).floor() as i16;
    let [xs, zs] = [0, 1].map(|axis| low(bounds.min[axis])..=high(bounds.max[axis]));
    let all = xs.flat_map(|x| zs.clone().map(move |z| Cell::new(x, z)));
    all.filter(|cell| notch.is_none_or(|notch| is_clear(*cell, notch))).collect()
}

/// Whether a cell is clear of something that stands there.
fn is_clear(cell: Cell, solid: &Rect) -> bool {
    let centre = cell.centre(0);
    !solid.grown(CLEARANCE - 1).contains(centre.x, centre.z)
}

/// The largest connected set of the cells that are clear of a new piece, sorted.
fn largest(mut open: Vec<Cell>, piece: &Rect) -> Vec<Cell> {
    open.retain(|&cell| is_clear(cell, piece));
    let mut largest = Vec::new();
    while let Some(&start) = open.first().filter(|_| open.len() > largest.len()) {
        let component = flood(&open, start);
        if component.len() == open.len() && largest.is_empty() {
            return open;
        }
        open.retain(|cell| component.binary_search(cell).is_err());
        if component.len() > largest.len() {
            largest = component;
        }
    }
    largest
}

/// Whether somebody can stand in a strip of floor, or at its very edge.
fn stands(cells: &[Cell], front: &Rect) -> bool {
    let front = front.grown(80);
    cells.iter().map(|cell| cell.centre(0)).any(|centre| front.contains(centre.x, centre.z))
}

/// The strip of floor before a piece of that width and depth.
pub(crate) fn before(site: &PieceFrame, width: i32, depth: i32) -> Rect {
    site.rect([0, width], [depth, depth + USE])
}

/// The cells of a sorted list that can be walked to from `start`, sorted.
pub(crate) fn flood(cells: &[Cell], start: Cell) -> Vec<Cell> {
    let mut seen = vec![false; cells.len()];
    let mut found = Vec::new();
    let mut queue = vec![start];
    while let Some(cell) = queue.pop() {
        let Ok(index) = cells.binary_search(&cell) else { continue };
        if std::mem::replace(&mut seen[index], true) {
            continue;
        }
        found.push(cell);
        queue.extend(Heading::ALL.map(|heading| cell.ahead(heading)));
    }
    found.sort_unstable();
    found
}

/// The walls around a rectangle with a corner cut out, anticlockwise.
fn walls(bounds: &Rect, notch: Option<&Rect>) -> Vec<Wall> {
    let ([x0, z0], [x1, z1]) = (bounds.min, bounds.max);
    let corners = [[x0, z0], [x1, z0], [x1, z1], [x0, z1]];
    let mut outline: Vec<[i32; 2]> = Vec::new();
    for (index, corner) in corners.into_iter().enumerate() {
        match notch {
            Some(notch) if notch.contains(corner[0], corner[1]) => {
                let inner = [
                    if corner[0] == x0 { notch.max[0] } else { notch.min[0] },
                    if corner[1] == z0 { notch.max[1] } else { notch.min[1] },
                ];
                // Anticlockwise, the south and north walls run along x: the cut starts on x after an even corner's z wall.
                if index % 2 == 0 {
                    outline.extend([[corner[0], inner[1]], inner, [inner[0], corner[1]]]);
                } else {
                    outline.extend([[inner[0], corner[1]], inner, [corner[0], inner[1]]]);
                }
            }
            _ => outline.push(corner),
        }
    }
    let next = outline.iter().cycle().skip(1);
    outline
        .iter()
        .zip(next)
        .map(|(from, to)| {
            let (dx, dz) = (to[0] - from[0], to[1] - from[1]);
            let along = match (dx.signum(), dz.signum()) {
                (1, _) => Heading::East,
                (-1, _) => Heading::West,
                (_, 1) => Heading::North,
                _ => Heading::South,
            };
            Wall { site: PieceFrame { origin: *from, facing: along.left(), floor: FLOOR }, length: dx.abs() + dz.abs() }
        })
        .collect()
}
