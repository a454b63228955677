//! The bodies that everything is built of.

use glam::{Mat3, Vec3};

use crate::domain::class::Shape;
use crate::house::extent::Extent;

/// A colour before lighting: red, green, blue from 0 to 1.
pub(crate) type RgbF32 = [f32; 3];

/// The outline that a round body turns about its y axis: rings of (height, radius) from bottom to top, each from -1 or 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lathe {
    pub(crate) rings: &'static [[f32; 2]],
    /// The top is open and one looks inside.
    pub(crate) hollow: bool,
}

/// The body's surface in its own frame, from -1 to 1 along each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum SolidKind {
    /// A box; the bits of `missing` leave out faces (-x, +x, -y, +y, -z, +z from the lowest), and then one looks inside.
    Box {
        /// Which faces are left out.
        missing: u8,
    },
    /// A body of revolution.
    Lathe(Lathe),
    Ellipsoid,
}

/// A body in space. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Solid {
    /// The surface that is stretched along the axes.
    pub(crate) kind: SolidKind,
    /// Its middle.
    pub(crate) centre: Vec3,
    /// Columns: its half axes, at right angles to each other.
    pub(crate) axes: Mat3,
    /// The colour outside.
    pub(crate) colour: RgbF32,
    /// The colour inside, where one can look inside.
    pub(crate) inner: RgbF32,
    /// It shines: no shading.
    pub(crate) glows: bool,
}

/// A plain upright cylinder.
pub(crate) const CYLINDER: Lathe = Lathe { rings: &[[-1.0, 1.0], [1.0, 1.0]], hollow: false };

impl Solid {
    /// A closed body of the given extent in one colour.
    pub(crate) fn filling(extent: &Extent, colour: RgbF32) -> Solid {
        let kind = match extent.shape {
            Shape::Box => SolidKind::Box { missing: 0 },
            Shape::Cylinder => SolidKind::Lathe(CYLINDER),
            Shape::Ellipsoid => SolidKind::Ellipsoid,
        };
        Solid { kind, centre: extent.centre, axes: extent.axes, colour, inner: colour.map(|c| 0.6 * c), glows: false }
    }

    /// The radius of a ball around the middle that holds it.
    pub(crate) fn radius(&self) -> f32 {
        let squared = |axis: Vec3| axis.length_squared();
        (squared(self.axes.x_axis) + squared(self.axes.y_axis) + squared(self.axes.z_axis)).sqrt()
    }
}
