//! Collects the fixtures of a scene and names them.

use crate::domain::place::{Cuboid, Rect};
use crate::domain::scene::{Fixture, Surface};
use crate::domain::{Class, Heading, Point};

/// Room between the edge of a surface and the pivots of what stands on it, in millimetres.
pub(crate) const INSET: i32 = 70;

/// The fixtures of a scene under construction.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    /// In the order in which they were added.
    pub(crate) fixtures: Vec<Fixture>,
}

impl Builder {
    /// Adds a fixture and returns its number. An unknown class name adds nothing that anyone could use: a test forbids it.
    pub(crate) fn add(
        &mut self,
        class: &str,
        pivot: Point,
        facing: Heading,
        body: Vec<Cuboid>,
        surfaces: Vec<Surface>,
    ) -> usize {
        let class = Class::named(class).unwrap_or_default();
        let number = 1 + self.fixtures.iter().filter(|fixture| fixture.class == class).count();
        let id = format!("{}_{number}", class.name());
        self.fixtures.push(Fixture { id, class, pivot, facing, body, surfaces, stand: None });
        self.fixtures.len() - 1
    }
}

/// A surface of one rectangle at a world height.
pub(crate) fn surface(height: i32, area: Rect) -> Surface {
    Surface { height, areas: vec![area] }
}

/// The part of a box's top on which pivots may be.
pub(crate) fn top(body: &Cuboid) -> Surface {
    surface(body.max.y, inset(body.footprint(), INSET))
}

/// A rectangle with every edge moved in, but never past its middle.
pub(crate) fn inset(rect: Rect, by: i32) -> Rect {
    let mut inner = rect;
    for axis in 0..2 {
        let by = by.min((rect.max[axis] - rect.min[axis]) / 2);
        inner.min[axis] += by;
        inner.max[axis] -= by;
    }
    inner
}
