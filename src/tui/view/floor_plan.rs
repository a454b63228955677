//! What lies where on the floor of a house, and in which colour.

use std::collections::HashMap;

use ratatui::style::Color;

use super::value_colour::value_colour;
use crate::analysis::value_map::ValueMap;
use crate::domain::place::{Cuboid, Rect as Floor};
use crate::domain::{Cell, Class, Heading, Pose};
use crate::explore::exploration::SessionSnapshot;

/// Furniture that begins higher above the floor than this hangs over other furniture and is left out, in millimetres.
const OVERHEAD: i32 = 1200;
/// How far the shade of what the agent looks at reaches, in millimetres.
const GAZE: f32 = 3000.0;
const GROUND: Color = Color::Rgb(38, 41, 46);
const WALKABLE: Color = Color::Rgb(58, 63, 71);
const SEEN: Color = Color::Rgb(82, 90, 101);
const WALL: Color = Color::Rgb(120, 124, 130);
const PATH: Color = Color::Rgb(86, 140, 190);

/// A box of a piece of furniture, from above.
#[derive(Clone, Copy)]
pub(super) struct DrawnPiece {
    pub(super) floor: Floor,
    pub(super) class: Class,
    pub(super) fixture: u16,
}

pub(super) struct FloorPlan<'a> {
    pub(super) now: &'a SessionSnapshot,
    /// The share of each cell's value, where values are painted.
    pub(super) values: HashMap<Cell, f32>,
    /// The furniture that stands on the floor or on other furniture, box by box, lowest first.
    pub(super) furniture: Vec<DrawnPiece>,
    /// What the whole plan covers.
    pub(super) bounds: Option<Floor>,
}

impl<'a> FloorPlan<'a> {
    pub(super) fn of(now: &'a SessionSnapshot, values: Option<&ValueMap>, heading: Option<Heading>) -> FloorPlan<'a> {
        let values = values.map_or_else(HashMap::new, |values| values.shares(heading));
        let floor = now.scene.floor();
        let fixtures = (0u16..).zip(&now.scene.fixtures);
        let mut parts: Vec<_> = fixtures
            .flat_map(|(i, fixture)| fixture.body.iter().map(move |part| (part, fixture.class, i)))
            .filter(|(part, ..)| part.min.y - floor < OVERHEAD)
            .collect();
        parts.sort_by_key(|(part, ..)| part.max.y);
        let piece =
            |(part, class, fixture): (&Cuboid, Class, u16)| DrawnPiece { floor: part.footprint(), class, fixture };
        let furniture: Vec<DrawnPiece> = parts.into_iter().map(piece).collect();
        let cells = now.scene.cells.iter().map(|cell| {
            let at = cell.centre(0);
            Floor { min: [at.x, at.z], max: [at.x, at.z] }.grown(Cell::SIDE / 2)
        });
        let walls = now.scene.walls.iter().map(|wall| wall.footprint());
        let bounds = cells.chain(walls).chain(furniture.iter().map(|piece| piece.floor)).reduce(|a, b| Floor {
            min: [a.min[0].min(b.min[0]), a.min[1].min(b.min[1])],
            max: [a.max[0].max(b.max[0]), a.max[1].max(b.max[1])],
        });
        FloorPlan { now, values, furniture, bounds }
    }

    /// The furniture at a point, the highest of it.
    fn piece(&self, x: i32, z: i32) -> Option<&DrawnPiece> {
        self.furniture.iter().rev().find(|piece| piece.floor.contains(x, z))
    }

    /// The class of the furniture at a point.
    pub(super) fn class(&self, x: i32, z: i32) -> Option<Class> {
        self.piece(x, z).map(|piece| piece.class)
    }

    /// The fixture that the furniture at a point belongs to.
    pub(super) fn fixture(&self, x: i32, z: i32) -> Option<u16> {
        self.piece(x, z).map(|piece| piece.fixture)
    }

    pub(super) fn colour(&self, x: i32, z: i32) -> Option<Color> {
        if !self.bounds?.contains(x, z) {
            return None;
        }
        if let Some(class) = self.class(x, z) {
            return Some(furniture_colour(class));
        }
        let now = self.now;
        if now.scene.walls.iter().any(|wall| wall.footprint().contains(x, z)) {
            return Some(WALL);
        }
        let cell = Cell::nearest(crate::domain::Point::new(x, 0, z));
        if !now.scene.has_cell(cell) {
            return Some(GROUND);
        }
        if let Some(&share) = self.values.get(&cell) {
            return Some(value_colour(share));
        }
        if now.path.contains(&cell) {
            return Some(PATH);
        }
        Some(if gazed_at(now.world.agent, x, z) { SEEN } else { WALKABLE })
    }
}

pub(super) fn extent(floor: &Floor) -> i64 {
    i64::from(floor.max[0] - floor.min[0]) * i64::from(floor.max[1] - floor.min[1])
}

/// Whether a point lies in the 60 degrees that the agent looks into.
fn gazed_at(pose: Pose, x: i32, z: i32) -> bool {
    let at = pose.cell.centre(0);
    let (dx, dz) = pose.heading.step();
    let (east, north) = ((x - at.x) as f32, (z - at.z) as f32);
    let ahead = east * f32::from(dx) + north * f32::from(dz);
    let aside = east * f32::from(dz) - north * f32::from(dx);
    ahead > 0.0 && ahead < GAZE && aside.abs() < ahead * 0.577
}

/// A muted colour for a class of furniture, the same everywhere.
pub(super) fn furniture_colour(class: Class) -> Color {
    const COLOURS: [(u8, u8, u8); 12] = [
        (134, 104, 74),
        (108, 122, 137),
        (146, 126, 92),
        (96, 118, 100),
        (150, 110, 100),
        (120, 110, 140),
        (104, 128, 128),
        (140, 120, 120),
        (112, 100, 84),
        (128, 134, 104),
        (100, 108, 124),
        (148, 132, 112),
    ];
    let (r, g, b) = COLOURS[class.index() * 5 % COLOURS.len()];
    Color::Rgb(r, g, b)
}
