//! Doors and lids that stand open: where their panels are.

use glam::{Mat3, Vec3};

use super::extent::Extent;
use crate::domain::class::Shape;
use crate::domain::place::{Cuboid, Heading};
use crate::domain::scene::Fixture;
use crate::domain::{Object, Point, Scene};

/// How thick a door is, in metres.
const THICK: f32 = 0.03;
/// Sine and cosine of how far a door swings beyond a right angle: it stands open by 110 degrees.
const BEYOND: [f32; 2] = [0.342_020_15, 0.939_692_6];

/// A piece of furniture's own directions as somebody sees it who stands before it: to the right, up, and to the back.
pub(crate) fn front(facing: Heading) -> Mat3 {
    let along = |heading: Heading| {
        let (x, z) = heading.step();
        Vec3::new(f32::from(x), 0.0, f32::from(z))
    };
    let inwards = facing.right().right();
    Mat3::from_cols(along(inwards.right()), Vec3::Y, along(inwards))
}

/// Half of a box's width, height and depth along the directions of [`front`].
pub(crate) fn half_sides(facing: Heading, cuboid: &Cuboid) -> Vec3 {
    let half = (cuboid.max.metres() - cuboid.min.metres()) / 2.0;
    match facing {
        Heading::North | Heading::South => half,
        Heading::East | Heading::West => Vec3::new(half.z, half.y, half.x),
    }
}

/// The open door of a fixture, hinged at its left edge. Its own x axis runs along the panel, its z axis out of the panel's
/// face. `None` for what has no door.
pub(crate) fn open_door(fixture: &Fixture) -> Option<Extent> {
    if !fixture.class.info().door {
        return None;
    }
    let cuboid = fixture.body.first()?;
    let (sides, half) = (front(fixture.facing), half_sides(fixture.facing, cuboid));
    let [sin, cos] = BEYOND;
    // From the hinge to the free edge: straight out of the front, and a little to the left.
    let along = sides * Vec3::new(-sin, 0.0, -cos);
    let out = sides * Vec3::new(cos, 0.0, -sin);
    let hinge = cuboid.centre().metres() + sides * Vec3::new(-half.x, 0.0, -half.z);
    Some(Extent {
        shape: Shape::Box,
        centre: hinge + along * half.x,
        axes: Mat3::from_cols(along * half.x, Vec3::Y * half.y, out * (THICK / 2.0)),
    })
}

/// The open lid of a laptop, standing at its back edge. `None` for objects without one, or closed.
pub(crate) fn open_lid(scene: &Scene, object: &Object) -> Option<Extent> {
    if !object.open || !object.class.info().lid {
        return None;
    }
    let (_, size, _) = object.shape_in(scene);
    let half = Point::from(size).metres() / 2.0;
    let base = Extent::of_object(scene, object);
    let unit = Mat3::from_cols(
        base.axes.x_axis.normalize_or_zero(),
        base.axes.y_axis.normalize_or_zero(),
        base.axes.z_axis.normalize_or_zero(),
    );
    // The lid is as long as the base is deep and leans back a little.
    let [sin, cos] = BEYOND;
    let (along, out) = (unit * Vec3::new(0.0, cos, sin), unit * Vec3::new(0.0, -sin, cos));
    let hinge = base.centre + unit * Vec3::new(0.0, half.y, half.z);
    Some(Extent {
        shape: Shape::Box,
        centre: hinge + along * half.z,
        axes: Mat3::from_cols(unit.x_axis * half.x, along * half.z, out * 0.006),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Class;

    #[test]
    fn a_door_swings_into_the_room() {
        for facing in Heading::ALL {
            let body = vec![Cuboid::between(Point::new(-300, 0, -300), Point::new(300, 1800, 300))];
            let class = Class::named("Fridge").unwrap();
            let pivot = Point::default();
            let fixture = Fixture { id: "fridge".into(), class, pivot, facing, body, surfaces: vec![], stand: None };
            let door = open_door(&fixture).unwrap();
            let (x, z) = facing.step();
            let out = door.centre.dot(Vec3::new(f32::from(x), 0.0, f32::from(z)));
            assert!(out > 0.5, "{facing:?}: {}", door.centre);
            assert!(door.axes.determinant() > 0.0, "{facing:?}: mirrored");
        }
    }
}
