//! A piece of furniture's own frame: u to the right of its back edge as the piece looks out, v out of the wall, y up.

use crate::domain::place::{Cuboid, Rect};
use crate::domain::{Heading, Point};

/// Where a piece stands: its back corner on the floor plan and where its front looks. Lengths in millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PieceFrame {
    /// (x, z) of u = 0, v = 0.
    pub(crate) origin: [i32; 2],
    /// The direction of v.
    pub(crate) facing: Heading,
    /// World height of y = 0.
    pub(crate) floor: i32,
}

impl PieceFrame {
    /// (x, z) of a point of the frame.
    pub(crate) fn at(&self, u: i32, v: i32) -> [i32; 2] {
        let (vx, vz) = self.facing.step();
        let (ux, uz) = self.facing.right().step();
        let axis = |origin: i32, along: i16, out: i16| origin + u * i32::from(along) + v * i32::from(out);
        [axis(self.origin[0], ux, vx), axis(self.origin[1], uz, vz)]
    }

    /// A world point.
    pub(crate) fn point(&self, u: i32, y: i32, v: i32) -> Point {
        let [x, z] = self.at(u, v);
        Point::new(x, self.floor + y, z)
    }

    /// A world box from ranges of u, y and v.
    pub(crate) fn cuboid(&self, u: [i32; 2], y: [i32; 2], v: [i32; 2]) -> Cuboid {
        Cuboid::between(self.point(u[0], y[0], v[0]), self.point(u[1], y[1], v[1]))
    }

    /// A rectangle on the floor plan from ranges of u and v.
    pub(crate) fn rect(&self, u: [i32; 2], v: [i32; 2]) -> Rect {
        self.cuboid(u, [0, 0], v).footprint()
    }

    /// The frame moved within itself.
    pub(crate) fn moved(&self, u: i32, v: i32) -> PieceFrame {
        PieceFrame { origin: self.at(u, v), ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_lies_in_front_of_its_wall_for_every_heading() {
        for facing in Heading::ALL {
            let site = PieceFrame { origin: [1000, 2000], facing, floor: 1 };
            let centre = site.cuboid([-100, 100], [0, 500], [0, 400]).centre();
            let (dx, dz) = facing.step();
            assert_eq!((centre.x, centre.z), (1000 + 200 * i32::from(dx), 2000 + 200 * i32::from(dz)));
        }
    }
}
