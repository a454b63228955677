//! For tests: places of the house in the agent's own frame.

use crate::domain::{Heading, Point, Pose, Scene};

/// A point of the house as an agent that started at `start` would call it, its height above the floor.
pub(crate) fn point_in_own_frame(scene: &Scene, start: Pose, point: Point) -> Point {
    let from = start.cell.centre(0);
    let (dx, dz, y) = (point.x - from.x, point.z - from.z, point.y - scene.floor());
    match start.heading {
        Heading::North => Point::new(dx, y, dz),
        Heading::East => Point::new(-dz, y, dx),
        Heading::South => Point::new(-dx, y, -dz),
        Heading::West => Point::new(dz, y, -dx),
    }
}
