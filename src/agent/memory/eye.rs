//! From pixels to places and back, in the agent's own frame.

use glam::Vec3;

use crate::domain::{Cell, Point, Pose};
use crate::house::camera::Camera;

/// The eye's height above the floor, in millimetres.
pub(crate) const HEIGHT: i32 = 1575;
/// Where the held thing is drawn: right of this column and below this row of a 300 x 300 frame, and between these depths in
/// metres.
const HAND: (f32, f32) = (205.0, 228.0);
const ARM: std::ops::Range<f32> = 0.5..0.72;

/// The camera of an agent at `pose`: heights are above the floor.
pub(crate) fn camera(pose: Pose) -> Camera {
    Camera::at(pose, HEIGHT)
}

/// Whether a pixel of a 300 x 300 frame shows what is in the hand, which says nothing of the room.
pub(crate) fn is_in_hand(column: f32, row: f32, depth: f32) -> bool {
    ARM.contains(&depth) && column > HAND.0 && row > HAND.1
}

/// The cell that a point (metres) lies over.
pub(crate) fn cell_under(point: Vec3) -> Cell {
    Cell::nearest(Point::from_metres(point.x.into(), point.y.into(), point.z.into()))
}

/// The point (metres) over the middle of a cell at that height.
pub(crate) fn over(cell: Cell, height: f32) -> Vec3 {
    cell.centre(0).metres().with_y(height)
}

/// Distance between the middles of two cells, in metres.
pub(crate) fn between(a: Cell, b: Cell) -> f32 {
    a.centre(0).floor_distance(b.centre(0)) / 1000.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::world::{Object, Parent};
    use crate::domain::{Class, Room};
    use crate::house::generate;
    use crate::house::render::Renderer;

    #[test]
    fn whatever_is_held_is_drawn_where_the_hand_is_taken_to_be() {
        let (scene, mut world) = generate::house(Room::LivingRoom, 3);
        world.agent.horizon = 0;
        world.objects.truncate(0);
        let mut renderer = Renderer::new(300);
        let empty = renderer.draw(&scene, &world).clone();
        for class in Class::all().filter(|class| class.info().pickupable) {
            world.objects = vec![Object { class, parent: Parent::Hand, ..Object::default() }];
            world.held = Some(0);
            let frame = renderer.draw(&scene, &world);
            let changed = (0..90_000).filter(|&i| frame.depth[i] != empty.depth[i]);
            assert!(changed.clone().count() > 0, "{class} is not drawn");
            let strays = changed.filter(|i| !is_in_hand((i % 300) as f32, (i / 300) as f32, frame.depth[*i])).count();
            assert_eq!(strays, 0, "{class}");
        }
    }
}
