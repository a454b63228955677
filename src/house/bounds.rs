//! Where in the image an instance's measured shape lies, whatever hides it.

use glam::{Mat3, Vec3};

use super::camera::Camera;
use super::extent::Extent;
use super::{doors, placing};
use crate::domain::class::Shape;
use crate::domain::place::{Cuboid, Pose};
use crate::domain::world::{Instance, World};
use crate::domain::{Point, Scene};

/// The bounds of an instance's measured shape in a 300 x 300 image: left, top, right, bottom edges in pixels, clipped to the
/// image. Nothing hides anything. `None` when it is out of view or does not exist. For a fixture the shape is its body and its
/// surfaces; an open drawer is where it slid to, an open door counts.
pub(crate) fn projected_bounds(scene: &Scene, world: &World, pose: Pose, instance: Instance) -> Option<[f32; 4]> {
    let camera = Camera::of(scene, pose);
    let mut bounds = Bounds::default();
    match instance {
        Instance::Object(index) => {
            let object = world.object(index)?;
            bounds.add(&camera, &Extent::of_object(scene, object));
            doors::open_lid(scene, object).iter().for_each(|lid| bounds.add(&camera, lid));
        }
        Instance::Fixture(index) => {
            let fixture = scene.fixture(index)?;
            let open = world.is_open(instance);
            let shift = if open { placing::drawer_shift(scene, index).metres() } else { Vec3::ZERO };
            let surfaces = fixture.surfaces.iter().flat_map(|surface| {
                let y = surface.height;
                surface.areas.iter().map(move |area| Cuboid {
                    min: Point::new(area.min[0], y, area.min[1]),
                    max: Point::new(area.max[0], y, area.max[1]),
                })
            });
            for cuboid in fixture.body.iter().copied().chain(surfaces) {
                let mut extent = Extent::of_cuboid(&cuboid);
                extent.centre += shift;
                bounds.add(&camera, &extent);
            }
            let door = doors::open_door(fixture).filter(|_| open);
            door.iter().for_each(|door| bounds.add(&camera, door));
        }
    }
    bounds.edges()
}

/// The smallest rectangle around what was added to it, in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    min: [f32; 2],
    max: [f32; 2],
}

impl Default for Bounds {
    fn default() -> Bounds {
        Bounds { min: [f32::INFINITY; 2], max: [f32::NEG_INFINITY; 2] }
    }
}

impl Bounds {
    /// Left, top, right, bottom; `None` when nothing in view was added.
    pub(crate) fn edges(&self) -> Option<[f32; 4]> {
        let inside = |edge: f32| edge.clamp(0.0, Camera::IMAGE);
        let edges = [inside(self.min[0]), inside(self.min[1]), inside(self.max[0]), inside(self.max[1])];
        (self.min[0] <= self.max[0] && edges[0] <= edges[2] && edges[1] <= edges[3]).then_some(edges)
    }

    /// Adds what is seen of a body.
    pub(crate) fn add(&mut self, camera: &Camera, extent: &Extent) {
        let (centre, axes) = (camera.local(extent.centre), camera.turn() * extent.axes);
        if extent.shape == Shape::Ellipsoid
            && let Some([left, top, right, bottom]) = ellipse(centre, &axes)
            && left >= 0.0
            && top >= 0.0
            && right <= Camera::IMAGE
            && bottom <= Camera::IMAGE
        {
            self.include(left, top);
            self.include(right, bottom);
            return;
        }
        for face in faces(extent.shape) {
            let corners = face.iter().map(|corner| centre + axes * *corner).collect();
            for corner in clipped(corners) {
                let seen = Camera::image(corner);
                self.include(seen.x, seen.y);
            }
        }
    }

    fn include(&mut self, u: f32, v: f32) {
        self.min = [self.min[0].min(u), self.min[1].min(v)];
        self.max = [self.max[0].max(u), self.max[1].max(v)];
    }
}

/// The bounds of an ellipsoid's outline in the image, unclipped: the four planes through the eye that touch it. `None` unless
/// all of it is in front of the eye. `centre` and `axes` are in the camera's frame.
pub(crate) fn ellipse(centre: Vec3, axes: &Mat3) -> Option<[f32; 4]> {
    // A plane n.p = 0 touches when (n.c)^2 = n.M.n with M = A A^T; for n = (1, 0, -k) that is a quadratic in the slope k.
    let spread = *axes * axes.transpose();
    let ahead = centre.z * centre.z - spread.z_axis.z;
    if ahead <= Camera::NEAR * Camera::NEAR || centre.z <= 0.0 {
        return None;
    }
    let touch = |c: f32, along: f32, across: f32| {
        let middle = c * centre.z - across;
        let root = (middle * middle - ahead * (c * c - along)).max(0.0).sqrt();
        [(middle - root) / ahead, (middle + root) / ahead]
    };
    let [left, right] = touch(centre.x, spread.x_axis.x, spread.x_axis.z);
    let [bottom, top] = touch(centre.y, spread.y_axis.y, spread.y_axis.z);
    let half = Camera::IMAGE / 2.0;
    let pixel = |slope: f32| half * slope / Camera::SLOPE;
    Some([half + pixel(left), half - pixel(top), half + pixel(right), half - pixel(bottom)])
}

/// The faces of a body in the frame of its axes: a box's six, or enough facets of a round one.
fn faces(shape: Shape) -> Vec<Vec<Vec3>> {
    const SIDES: usize = 32;
    let ring = |y: f32, radius: f32| -> Vec<Vec3> {
        (0..SIDES)
            .map(|side| {
                let round = glam::Vec2::from_angle(side as f32 * std::f32::consts::TAU / SIDES as f32) * radius;
                Vec3::new(round.x, y, round.y)
            })
            .collect()
    };
    let between = |low: &[Vec3], high: &[Vec3]| -> Vec<Vec<Vec3>> {
        (0..SIDES).map(|side| vec![low[side], low[(side + 1) % SIDES], high[(side + 1) % SIDES], high[side]]).collect()
    };
    match shape {
        Shape::Box => {
            let mut faces = Vec::with_capacity(6);
            for axis in 0..3 {
                for sign in [-1.0, 1.0] {
                    let corner = |a: f32, b: f32| {
                        let mut at = [0.0; 3];
                        (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (sign, a, b);
                        Vec3::from(at)
                    };
                    faces.push(vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
                }
            }
            faces
        }
        Shape::Cylinder => {
            let (low, high) = (ring(-1.0, 1.0), ring(1.0, 1.0));
            let mut faces = between(&low, &high);
            faces.extend([low, high]);
            faces
        }
        Shape::Ellipsoid => {
            let rings: Vec<Vec<Vec3>> = (0..=SIDES / 2)
                .map(|step| {
                    let angle = glam::Vec2::from_angle(step as f32 * std::f32::consts::TAU / SIDES as f32);
                    ring(-angle.x, angle.y)
                })
                .collect();
            rings.windows(2).flat_map(|pair| between(&pair[0], &pair[1])).collect()
        }
    }
}

/// A polygon of the camera's frame, cut to what the image shows.
fn clipped(mut polygon: Vec<Vec3>) -> Vec<Vec3> {
    let slope = Camera::SLOPE;
    let near = Camera::NEAR;
    let planes: [(Vec3, f32); 5] = [
        (Vec3::Z, -near),
        (Vec3::new(1.0, 0.0, slope), 0.0),
        (Vec3::new(-1.0, 0.0, slope), 0.0),
        (Vec3::new(0.0, 1.0, slope), 0.0),
        (Vec3::new(0.0, -1.0, slope), 0.0),
    ];
    for (normal, offset) in planes {
        let side = |point: Vec3| normal.dot(point) + offset;
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, &to) in polygon.iter().enumerate() {
            let from = polygon[(i + polygon.len() - 1) % polygon.len()];
            let (a, b) = (side(from), side(to));
            if (a < 0.0) != (b < 0.0) {
                kept.push(from + (to - from) * (a / (a - b)));
            }
            if b >= 0.0 {
                kept.push(to);
            }
        }
        polygon = kept;
    }
    polygon
}
