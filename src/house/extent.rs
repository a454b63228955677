//! The measured shape of a thing, placed in space.

use glam::{Mat3, Vec3};

use crate::domain::class::Shape;
use crate::domain::place::Cuboid;
use crate::domain::world::Object;
use crate::domain::{Point, Scene};

/// A box or the round body inscribed in it, anywhere in space. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    /// Which body.
    pub(crate) shape: Shape,
    /// Its middle.
    pub(crate) centre: Vec3,
    /// Columns: from the middle to the middle of the faces towards its own x, y and z.
    pub(crate) axes: Mat3,
}

impl Extent {
    /// An axis-aligned box.
    pub(crate) fn of_cuboid(cuboid: &Cuboid) -> Extent {
        let (min, max) = (cuboid.min.metres(), cuboid.max.metres());
        Extent { shape: Shape::Box, centre: (min + max) / 2.0, axes: Mat3::from_diagonal((max - min) / 2.0) }
    }

    /// The measured shape of a movable object, where and as it lies.
    pub(crate) fn of_object(scene: &Scene, object: &Object) -> Extent {
        let (shape, size, offset) = object.shape_in(scene);
        let turn = rotation(object.turn);
        let half = Point::from(size).metres() / 2.0;
        Extent {
            shape,
            centre: object.at.metres() + turn * Point::from(offset).metres(),
            axes: turn * Mat3::from_diagonal(half.max(Vec3::splat(0.0005))),
        }
    }
}

/// The rotation that an object's `turn` stands for: about z first, then x, then y.
pub(crate) fn rotation(turn: [i16; 3]) -> Mat3 {
    let [x, y, z] = turn.map(|tenths| (f32::from(tenths) / 10.0).to_radians());
    Mat3::from_rotation_y(y) * Mat3::from_rotation_x(x) * Mat3::from_rotation_z(z)
}
