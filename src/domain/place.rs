//! Where things are: integer millimetres and quarter turns, so that equal worlds are bit-equal on every machine.

use serde::{Deserialize, Serialize};

/// A point in the scene's frame, in millimetres; y is up, x and z span the floor.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(from = "[i32; 3]", into = "[i32; 3]")]
pub struct Point {
    /// East, in millimetres.
    pub(crate) x: i32,
    /// Up, in millimetres.
    pub(crate) y: i32,
    /// North, in millimetres.
    pub(crate) z: i32,
}

impl From<[i32; 3]> for Point {
    fn from([x, y, z]: [i32; 3]) -> Point {
        Point { x, y, z }
    }
}

impl From<Point> for [i32; 3] {
    fn from(p: Point) -> [i32; 3] {
        [p.x, p.y, p.z]
    }
}

impl Point {
    /// The point with these coordinates in millimetres.
    pub(crate) const fn new(x: i32, y: i32, z: i32) -> Point {
        Point { x, y, z }
    }

    /// From metres, rounded to the millimetre.
    pub(crate) fn from_metres(x: f64, y: f64, z: f64) -> Point {
        let mm = |v: f64| (v * 1000.0).round() as i32;
        Point::new(mm(x), mm(y), mm(z))
    }

    /// In metres.
    pub(crate) fn metres(self) -> glam::Vec3 {
        glam::Vec3::new(self.x as f32, self.y as f32, self.z as f32) / 1000.0
    }

    /// Distance over the floor, in millimetres.
    pub(crate) fn floor_distance(self, other: Point) -> f32 {
        let (dx, dz) = ((self.x - other.x) as f32, (self.z - other.z) as f32);
        (dx * dx + dz * dz).sqrt()
    }

    /// Distance in space, in millimetres.
    pub(crate) fn distance(self, other: Point) -> f32 {
        let dy = (self.y - other.y) as f32;
        let floor = self.floor_distance(other);
        (floor * floor + dy * dy).sqrt()
    }
}

/// A cell of the 0.25 m grid on which the agent stands; its centre is at 250 mm times its coordinates.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(from = "[i16; 2]", into = "[i16; 2]")]
pub struct Cell {
    /// East.
    pub(crate) x: i16,
    /// North.
    pub(crate) z: i16,
}

impl From<[i16; 2]> for Cell {
    fn from([x, z]: [i16; 2]) -> Cell {
        Cell { x, z }
    }
}

impl From<Cell> for [i16; 2] {
    fn from(cell: Cell) -> [i16; 2] {
        [cell.x, cell.z]
    }
}

impl Cell {
    /// The side of a cell in millimetres.
    pub(crate) const SIDE: i32 = 250;

    /// The cell with these grid coordinates.
    pub(crate) const fn new(x: i16, z: i16) -> Cell {
        Cell { x, z }
    }

    /// The cell nearest to a point.
    pub(crate) fn nearest(point: Point) -> Cell {
        let round = |v: i32| (v as f32 / Cell::SIDE as f32).round() as i16;
        Cell::new(round(point.x), round(point.z))
    }

    /// Its centre at height `y` (millimetres).
    pub(crate) fn centre(self, y: i32) -> Point {
        Point::new(i32::from(self.x) * Cell::SIDE, y, i32::from(self.z) * Cell::SIDE)
    }

    /// How many cells lie between the two, along x or z, whichever is more: 1 for neighbours, also across a corner.
    pub(crate) fn apart(self, other: Cell) -> u16 {
        self.x.abs_diff(other.x).max(self.z.abs_diff(other.z))
    }

    /// The neighbouring cell that lies ahead.
    pub(crate) fn ahead(self, heading: Heading) -> Cell {
        let (dx, dz) = heading.step();
        Cell::new(self.x.saturating_add(dx), self.z.saturating_add(dz))
    }
}

/// One of the four directions the agent may face.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Heading {
    /// +z.
    #[default]
    North,
    /// +x.
    East,
    /// -z.
    South,
    /// -x.
    West,
}

impl Heading {
    /// Clockwise from north.
    pub(crate) const ALL: [Heading; 4] = [Heading::North, Heading::East, Heading::South, Heading::West];

    /// In a word.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Heading::North => "north",
            Heading::East => "east",
            Heading::South => "south",
            Heading::West => "west",
        }
    }

    /// From quarter turns clockwise, any integer.
    pub fn from_quarters(quarters: i32) -> Heading {
        Heading::ALL[quarters.rem_euclid(4) as usize]
    }

    /// Quarter turns clockwise from north.
    pub(crate) fn quarters(self) -> i32 {
        self as i32
    }

    /// The change of (x, z) by one cell ahead.
    pub(crate) fn step(self) -> (i16, i16) {
        match self {
            Heading::North => (0, 1),
            Heading::East => (1, 0),
            Heading::South => (0, -1),
            Heading::West => (-1, 0),
        }
    }

    /// A quarter turn clockwise.
    pub(crate) fn right(self) -> Heading {
        Heading::from_quarters(self.quarters() + 1)
    }

    /// A quarter turn anticlockwise.
    pub(crate) fn left(self) -> Heading {
        Heading::from_quarters(self.quarters() - 1)
    }
}

/// Where the agent stands and looks.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// The cell under the agent.
    pub cell: Cell,
    /// The direction it faces.
    pub heading: Heading,
    /// How far the camera looks down, in degrees; -30 to 60 in steps of 15.
    pub horizon: i16,
}

impl Pose {
    /// The lowest horizon: looking up.
    pub const UP: i16 = -30;
    /// The highest horizon: looking down.
    pub(crate) const DOWN: i16 = 60;
    /// One look, in degrees.
    pub const LOOK: i16 = 15;

    /// The pose as one calls it who stood at `origin` and took that for cell (0, 0), facing north; horizons stay.
    pub(crate) fn relative_to(self, origin: Pose) -> Pose {
        let (dx, dz) = (self.cell.x - origin.cell.x, self.cell.z - origin.cell.z);
        let cell = match origin.heading {
            Heading::North => Cell::new(dx, dz),
            Heading::East => Cell::new(-dz, dx),
            Heading::South => Cell::new(-dx, -dz),
            Heading::West => Cell::new(dz, -dx),
        };
        Pose { cell, heading: Heading::from_quarters(self.heading.quarters() - origin.heading.quarters()), ..self }
    }
}

/// An axis-aligned box in the scene's frame, in millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub(crate) struct Cuboid {
    /// The corner with the smallest coordinates.
    pub(crate) min: Point,
    /// The corner with the largest coordinates.
    pub(crate) max: Point,
}

impl Cuboid {
    /// The box between two corners, given in any order.
    pub(crate) fn between(a: Point, b: Point) -> Cuboid {
        Cuboid {
            min: Point::new(a.x.min(b.x), a.y.min(b.y), a.z.min(b.z)),
            max: Point::new(a.x.max(b.x), a.y.max(b.y), a.z.max(b.z)),
        }
    }

    /// Its middle.
    pub(crate) fn centre(&self) -> Point {
        Point::new((self.min.x + self.max.x) / 2, (self.min.y + self.max.y) / 2, (self.min.z + self.max.z) / 2)
    }

    /// Its sides along x, y and z.
    pub(crate) fn sides(&self) -> [i32; 3] {
        [self.max.x - self.min.x, self.max.y - self.min.y, self.max.z - self.min.z]
    }

    /// What is left of it when another box is cut out: at most six boxes, some of which may be thin.
    pub(crate) fn without(self, hole: &Cuboid) -> Vec<Cuboid> {
        let (mut min, mut max): ([i32; 3], [i32; 3]) = (self.min.into(), self.max.into());
        let (low, high): ([i32; 3], [i32; 3]) = (hole.min.into(), hole.max.into());
        if (0..3).any(|axis| high[axis] <= min[axis] || max[axis] <= low[axis]) {
            return vec![self];
        }
        let mut left = Vec::new();
        // Pieces above and below are as small as can be: what stands is cut into slices first.
        for axis in [0, 2, 1] {
            if low[axis] > min[axis] {
                let mut end = max;
                end[axis] = low[axis];
                left.push(Cuboid { min: min.into(), max: end.into() });
                min[axis] = low[axis];
            }
            if high[axis] < max[axis] {
                let mut start = min;
                start[axis] = high[axis];
                left.push(Cuboid { min: start.into(), max: max.into() });
                max[axis] = high[axis];
            }
        }
        left
    }

    /// Its outline on the floor.
    pub(crate) fn footprint(&self) -> Rect {
        Rect { min: [self.min.x, self.min.z], max: [self.max.x, self.max.z] }
    }
}

/// An axis-aligned rectangle on the floor plan, (x, z) in millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Rect {
    /// The corner with the smallest coordinates.
    pub(crate) min: [i32; 2],
    /// The corner with the largest coordinates.
    pub(crate) max: [i32; 2],
}

impl Rect {
    /// The point of the rectangle that is nearest to `from`, at `from`'s height.
    pub(crate) fn nearest(&self, from: Point) -> Point {
        Point::new(from.x.clamp(self.min[0], self.max[0]), from.y, from.z.clamp(self.min[1], self.max[1]))
    }

    /// Whether (x, z) lies in it, edges included.
    pub(crate) fn contains(&self, x: i32, z: i32) -> bool {
        (self.min[0]..=self.max[0]).contains(&x) && (self.min[1]..=self.max[1]).contains(&z)
    }

    /// The same rectangle with every edge moved out by `margin`.
    pub(crate) fn grown(&self, margin: i32) -> Rect {
        Rect { min: [self.min[0] - margin, self.min[1] - margin], max: [self.max[0] + margin, self.max[1] + margin] }
    }
}
