//! The camera: a pinhole of 60 degrees, 0.675 m above the agent's own point, as measured from ALFRED's recorded frames.

use glam::{Mat3, Vec3};

use crate::domain::place::{Heading, Pose};
use crate::domain::{Point, Scene};

/// Where the agent's eye is and looks, ready to project points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Camera {
    /// The eye, in metres.
    eye: Vec3,
    /// Rows: right, up, forward; takes a direction of the scene into the camera's frame.
    turn: Mat3,
}

impl Camera {
    /// The side of the image that pixels refer to.
    pub(crate) const IMAGE: f32 = 300.0;
    /// Nothing nearer than this, along the optical axis and in metres, is seen.
    pub(crate) const NEAR: f32 = 0.05;
    /// Half the image's width over the focal length: the tangent of 30 degrees.
    pub(crate) const SLOPE: f32 = 0.577_350_27;

    /// The camera of an agent at `pose`.
    pub(crate) fn of(scene: &Scene, pose: Pose) -> Camera {
        Camera::at(pose, scene.camera_y())
    }

    /// The camera of an agent at `pose` whose eye is at world height `eye_y` (millimetres).
    pub(crate) fn at(pose: Pose, eye_y: i32) -> Camera {
        let Point { x, z, .. } = pose.cell.centre(0);
        // Quarter turns have exact sines, so that the four headings see bit-equal geometry.
        let (sin, cos) = match pose.heading {
            Heading::North => (0.0, 1.0),
            Heading::East => (1.0, 0.0),
            Heading::South => (0.0, -1.0),
            Heading::West => (-1.0, 0.0),
        };
        let (down, level) = libm_sin_cos(f32::from(pose.horizon).to_radians());
        let right = Vec3::new(cos, 0.0, -sin);
        let up = Vec3::new(sin * down, level, cos * down);
        let forward = Vec3::new(sin * level, -down, cos * level);
        Camera { eye: Point::new(x, eye_y, z).metres(), turn: Mat3::from_cols(right, up, forward).transpose() }
    }

    /// The eye, in metres.
    pub(crate) fn eye(&self) -> Vec3 {
        self.eye
    }

    /// Takes a direction of the scene into the camera's frame: right, up, forward.
    pub(crate) fn turn(&self) -> Mat3 {
        self.turn
    }

    /// A point (metres) in the camera's frame: right, up, forward, in metres.
    pub(crate) fn local(&self, point: Vec3) -> Vec3 {
        self.turn * (point - self.eye)
    }

    /// A point of the camera's frame in the image: column, row and depth. Meaningless at depth 0.
    pub(crate) fn image(local: Vec3) -> Vec3 {
        let half = Camera::IMAGE / 2.0;
        let scale = half / (Camera::SLOPE * local.z);
        Vec3::new(half + scale * local.x, half - scale * local.y, local.z)
    }

    /// Where a point (metres) is seen: column and row in pixels of a 300 x 300 image, and its depth along the optical axis
    /// in metres. `None` behind the camera; a point in front may lie outside the image.
    pub(crate) fn project(&self, point: Vec3) -> Option<Vec3> {
        let local = self.local(point);
        (local.z > Camera::NEAR).then(|| Camera::image(local))
    }

    /// Whether a point (metres) lies inside the image.
    pub(crate) fn frames(&self, point: Vec3) -> bool {
        let inside = |at: f32| (0.0..Camera::IMAGE).contains(&at);
        self.project(point).is_some_and(|at| inside(at.x) && inside(at.y))
    }

    /// The point (metres) that is seen at a column and row of a 300 x 300 image, `depth` metres along the optical axis:
    /// [`Camera::project`] the other way round.
    pub(crate) fn unproject(&self, column: f32, row: f32, depth: f32) -> Vec3 {
        let half = Camera::IMAGE / 2.0;
        let scale = Camera::SLOPE * depth / half;
        self.eye + self.turn.transpose() * Vec3::new(scale * (column - half), scale * (half - row), depth)
    }
}

/// Sine and cosine by glam's libm, the same on every machine.
fn libm_sin_cos(angle: f32) -> (f32, f32) {
    let turned = glam::Vec2::from_angle(angle);
    (turned.y, turned.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::place::Cell;
    use crate::domain::scene::Room;

    fn scene() -> Scene {
        let (name, room, format_version) = ("test".into(), Room::Kitchen, Scene::FORMAT);
        Scene {
            format_version,
            name,
            room,
            agent_y: 900,
            cells: vec![],
            fixtures: vec![],
            walls: vec![],
            meshes: vec![],
        }
    }

    fn at(heading: Heading, horizon: i16) -> Camera {
        Camera::of(&scene(), Pose { cell: Cell::new(0, 0), heading, horizon })
    }

    #[test]
    fn a_point_straight_ahead_is_in_the_middle_and_one_to_the_right_is_right_of_it() {
        for (heading, ahead, right) in [
            (Heading::North, Vec3::Z, Vec3::X),
            (Heading::East, Vec3::X, Vec3::NEG_Z),
            (Heading::South, Vec3::NEG_Z, Vec3::NEG_X),
            (Heading::West, Vec3::NEG_X, Vec3::Z),
        ] {
            let eye = Vec3::new(0.0, 1.575, 0.0);
            let seen = at(heading, 0).project(eye + 2.0 * ahead).unwrap();
            assert_eq!(seen, Vec3::new(150.0, 150.0, 2.0), "{heading:?}");
            // At 30 degrees off the axis: on the edge of the image.
            let edge = at(heading, 0).project(eye + ahead + Camera::SLOPE * right).unwrap();
            assert!((edge.x - 300.0).abs() < 1e-3 && (edge.y - 150.0).abs() < 1e-3, "{heading:?}: {edge}");
            assert_eq!(at(heading, 0).project(eye - ahead), None);
        }
    }

    #[test]
    fn looking_down_by_45_degrees_puts_the_floor_in_the_middle() {
        let seen = at(Heading::North, 45).project(Vec3::new(0.0, 0.0, 1.575)).unwrap();
        assert!((seen - Vec3::new(150.0, 150.0, 1.575 * 2f32.sqrt())).length() < 1e-3, "{seen}");
    }

    #[test]
    fn a_point_is_found_again_where_it_was_seen() {
        for (heading, horizon) in [(Heading::North, 0), (Heading::East, 30), (Heading::South, -30), (Heading::West, 60)]
        {
            let camera = at(heading, horizon);
            let point = camera.unproject(40.0, 222.0, 1.7);
            let seen = camera.project(point).unwrap();
            assert!((seen - Vec3::new(40.0, 222.0, 1.7)).length() < 1e-3, "{heading:?}: {seen}");
        }
    }

    #[test]
    fn the_focal_length_is_that_of_60_degrees() {
        // 0.5 m up at 2 m depth: 259.808 * 0.25 = 64.952 rows above the middle.
        let seen = at(Heading::North, 0).project(Vec3::new(0.0, 2.075, 2.0)).unwrap();
        assert!((seen.y - (150.0 - 64.952)).abs() < 1e-3, "{seen}");
    }
}
