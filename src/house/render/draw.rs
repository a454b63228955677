//! Puts bodies into the visibility buffer.

use glam::{Mat3, Vec2, Vec3};

use super::raster::{Material, Plane, Raster};
use super::solid::{Lathe, RgbF32, Solid, SolidKind};
use crate::house::bounds;
use crate::house::camera::Camera;

/// Tones of a round body's shading.
const TONES: u16 = 20;
/// The most corners of a face: a lathe's ring.
const MOST_SIDES: usize = 20;

/// Draws one frame's bodies.
pub(crate) struct Brush<'a> {
    raster: &'a mut Raster,
    camera: Camera,
    /// Towards the light, in the camera's frame, and the scene's upward direction.
    light: Vec3,
    up: Vec3,
    /// Pixels per unit of slope, and the middle of the image.
    focal: f32,
    middle: f32,
    /// How much nearer than it is an instance counts when surfaces are compared: a factor of its inverse depth.
    forward: f32,
}

impl<'a> Brush<'a> {
    /// A brush for one frame.
    pub(crate) fn new(raster: &'a mut Raster, camera: Camera) -> Brush<'a> {
        let middle = raster.size() as f32 / 2.0;
        let light = camera.turn() * Vec3::new(0.35, 0.8, -0.5).normalize();
        Brush {
            light,
            up: camera.turn() * Vec3::Y,
            focal: middle / Camera::SLOPE,
            middle,
            raster,
            camera,
            forward: 1.0,
        }
    }

    /// Whether a ball is partly in view.
    pub(crate) fn sees(&self, centre: Vec3, radius: f32) -> bool {
        // The side planes of the pyramid of sight lean outwards by 30 degrees: cosine and sine of that.
        const COS: f32 = 0.866_025_4;
        let local = self.camera.local(centre);
        let side = |across: f32| across.abs() * COS - local.z * 0.5 < radius;
        local.z + radius > Camera::NEAR && side(local.x) && side(local.y)
    }

    /// From here on, bodies around `centre` come forward by so many metres where they meet others; their outlines stay.
    pub(crate) fn bring_forward(&mut self, centre: Vec3, metres: f32) {
        let depth = self.camera.local(centre).z.max(0.3);
        self.forward = depth / (depth - metres.min(0.7 * depth));
    }

    /// Draws a body as part of instance `id`.
    pub(crate) fn solid(&mut self, solid: &Solid, id: u16) {
        let centre = self.camera.local(solid.centre);
        let axes = self.camera.turn() * solid.axes;
        self.local(solid, centre, axes, id);
    }

    /// Draws a body whose middle and axes are given in the camera's frame.
    pub(crate) fn local(&mut self, solid: &Solid, centre: Vec3, axes: Mat3, id: u16) {
        match solid.kind {
            SolidKind::Box { missing } => self.cuboid(solid, centre, axes, missing, id),
            SolidKind::Lathe(lathe) => self.lathe(solid, centre, axes, lathe, id),
            SolidKind::Ellipsoid => self.ellipsoid(solid, centre, axes, id),
        }
    }

    /// A lit colour. The normal is a unit vector of the camera's frame; `depth` in metres dims what is far.
    fn lit(&self, colour: RgbF32, normal: Vec3, depth: f32) -> u32 {
        let shade = 0.80 + 0.20 * normal.dot(self.light) + 0.07 * normal.dot(self.up);
        pack(colour, shade * dimming(depth))
    }

    fn pixel(&self, local: Vec3) -> Vec2 {
        let scale = self.focal / local.z;
        Vec2::new(self.middle + scale * local.x, self.middle - scale * local.y)
    }

    /// A face: a convex polygon of the camera's frame with its normal (any length) and the normal's product with its points.
    fn face(
        &mut self,
        corners: &[Vec3],
        pixels: &[Vec2],
        clipped: bool,
        normal: Vec3,
        distance: f32,
        material: Material,
    ) {
        let material = self.raster.material(material);
        // The plane n.p = d seen along the ray r is at inverse depth n.r / d.
        let (dx, dy) = (normal.x / (self.focal * distance), -normal.y / (self.focal * distance));
        let base = normal.z / distance - (dx + dy) * self.middle;
        let plane = Plane { dx: dx * self.forward, dy: dy * self.forward, base: base * self.forward };
        if !clipped {
            self.raster.polygon(pixels, &plane, material);
            return;
        }
        let mut kept = [Vec2::ZERO; 2 * MOST_SIDES];
        let mut count = 0;
        let mut from = corners[corners.len() - 1];
        for &to in corners {
            let (a, b) = (from.z - Camera::NEAR, to.z - Camera::NEAR);
            if (a < 0.0) != (b < 0.0) {
                kept[count] = self.pixel(from + (to - from) * (a / (a - b)));
                count += 1;
            }
            if b >= 0.0 {
                kept[count] = self.pixel(to);
                count += 1;
            }
            from = to;
        }
        if count >= 3 {
            self.raster.polygon(&kept[..count], &plane, material);
        }
    }

    fn cuboid(&mut self, solid: &Solid, centre: Vec3, axes: Mat3, missing: u8, id: u16) {
        let [x, y, z] = [axes.x_axis, axes.y_axis, axes.z_axis];
        let corners: [Vec3; 8] = std::array::from_fn(|i| {
            let sign = |bit: usize, axis: Vec3| if i & bit != 0 { axis } else { -axis };
            centre + sign(1, x) + sign(2, y) + sign(4, z)
        });
        let clipped = corners.iter().any(|corner| corner.z < Camera::NEAR);
        if clipped && corners.iter().all(|corner| corner.z < Camera::NEAR) {
            return;
        }
        let pixels = if clipped { [Vec2::ZERO; 8] } else { corners.map(|corner| self.pixel(corner)) };
        // Corner numbers around each face: -x, +x, -y, +y, -z, +z.
        const FACES: [[usize; 4]; 6] =
            [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]];
        for (number, face) in FACES.iter().enumerate() {
            if missing >> number & 1 == 1 {
                continue;
            }
            let axis = [x, y, z][number / 2];
            let outwards = if number % 2 == 0 { -axis } else { axis };
            let distance = outwards.dot(centre) + outwards.length_squared();
            let behind = distance >= 0.0;
            if distance == 0.0 || (behind && missing == 0) {
                continue;
            }
            let material = self.finish(solid, outwards, behind, (centre + outwards).z, id);
            let at = face.map(|corner| corners[corner]);
            let pixels = face.map(|corner| pixels[corner]);
            self.face(&at, &pixels, clipped, outwards, distance, material);
        }
    }

    /// The finish of a face that looks `outwards`; seen from `behind`, it is an inside.
    fn finish(&self, solid: &Solid, outwards: Vec3, behind: bool, depth: f32, id: u16) -> Material {
        let normal = outwards.normalize_or_zero();
        let rgb = match (solid.glows, behind) {
            (true, _) => pack(solid.colour, 1.0),
            (false, false) => self.lit(solid.colour, normal, depth),
            (false, true) => self.lit(solid.inner, -normal, depth),
        };
        Material { rgb, id }
    }

    fn lathe(&mut self, solid: &Solid, centre: Vec3, axes: Mat3, lathe: Lathe, id: u16) {
        let radius = axes.x_axis.length().max(axes.z_axis.length());
        if centre.z + solid.radius() < Camera::NEAR {
            return;
        }
        let seen = radius * self.focal / centre.z.max(0.1);
        let sides = if seen < 8.0 {
            8
        } else if seen < 24.0 {
            12
        } else {
            16
        };
        let ring = |[height, width]: [f32; 2]| {
            let mut corners = [Vec3::ZERO; MOST_SIDES];
            for (corner, turn) in corners.iter_mut().zip(circle(sides)) {
                *corner = centre + axes.y_axis * height + (axes.x_axis * turn[0] + axes.z_axis * turn[1]) * width;
            }
            corners
        };
        let image = |brush: &Brush, corners: &[Vec3; MOST_SIDES]| {
            let mut pixels = [Vec2::ZERO; MOST_SIDES];
            let mut clipped = false;
            for (pixel, corner) in pixels.iter_mut().zip(&corners[..sides]) {
                clipped |= corner.z < Camera::NEAR;
                *pixel = brush.pixel(*corner);
            }
            (pixels, clipped)
        };
        let Some((&first, rest)) = lathe.rings.split_first() else { return };
        let mut low = ring(first);
        let (mut low_pixels, mut low_clipped) = image(self, &low);
        if first[1] > 0.0 {
            self.cap(solid, &low[..sides], &low_pixels[..sides], low_clipped, -axes.y_axis, lathe.hollow, id);
        }
        for &next in rest {
            let high = ring(next);
            let (high_pixels, high_clipped) = image(self, &high);
            for side in 0..sides {
                let after = (side + 1) % sides;
                let at = [low[side], low[after], high[after], high[side]];
                let outwards = (at[2] - at[0]).cross(at[1] - at[3]);
                let distance = outwards.dot(at[0] + at[2]) * 0.5;
                let behind = distance >= 0.0;
                if distance == 0.0 || (behind && !lathe.hollow) {
                    continue;
                }
                let material = self.finish(solid, outwards, behind, at[0].z, id);
                let pixels = [low_pixels[side], low_pixels[after], high_pixels[after], high_pixels[side]];
                self.face(&at, &pixels, low_clipped || high_clipped, outwards, distance, material);
            }
            (low, low_pixels, low_clipped) = (high, high_pixels, high_clipped);
        }
        if !lathe.hollow && rest.last().is_some_and(|last| last[1] > 0.0) {
            self.cap(solid, &low[..sides], &low_pixels[..sides], low_clipped, axes.y_axis, false, id);
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn cap(
        &mut self,
        solid: &Solid,
        at: &[Vec3],
        pixels: &[Vec2],
        clipped: bool,
        outwards: Vec3,
        hollow: bool,
        id: u16,
    ) {
        let distance = outwards.dot(at[0]);
        let behind = distance >= 0.0;
        if distance != 0.0 && (!behind || hollow) {
            let material = self.finish(solid, outwards, behind, at[0].z, id);
            self.face(at, pixels, clipped, outwards, distance, material);
        }
    }

    fn ellipsoid(&mut self, solid: &Solid, centre: Vec3, axes: Mat3, id: u16) {
        let Some(edges) = bounds::ellipse(centre, &axes) else { return };
        let scale = 2.0 * self.middle / Camera::IMAGE;
        let edges = edges.map(|edge| edge * scale);
        let full = 2.0 * self.middle;
        if edges[0] >= full || edges[1] >= full || edges[2] <= 0.0 || edges[3] <= 0.0 {
            return;
        }
        // Into the frame where the body is the unit sphere.
        let [x, y, z] = [axes.x_axis, axes.y_axis, axes.z_axis].map(|axis| axis / axis.length_squared());
        let sphere = |v: Vec3| Vec3::new(x.dot(v), y.dot(v), z.dot(v));
        let (right, down) = (Vec3::X / self.focal, Vec3::NEG_Y / self.focal);
        let corner = Vec3::Z - (right + down) * self.middle;
        let light = sphere(self.light * 0.8 + self.up * 0.2).normalize_or_zero();
        let dim = dimming(centre.z);
        let mut darkest = 0;
        for tone in 0..TONES {
            let shade = if solid.glows { 1.0 } else { dim * (0.5 + 0.5 * f32::from(tone) / f32::from(TONES - 1)) };
            let number = self.raster.material(Material { rgb: pack(solid.colour, shade), id });
            darkest = if tone == 0 { number } else { darkest };
        }
        // Longer rays reach the body at larger inverse depths.
        let rays = [corner, right, down].map(|ray| sphere(ray) * self.forward);
        self.raster.ellipsoid(rays, sphere(centre), edges, light, [darkest, TONES]);
    }
}

/// How much of the light is left at a distance.
pub(crate) fn dimming(depth: f32) -> f32 {
    (1.04 - 0.05 * depth).clamp(0.6, 1.0)
}

/// A shaded colour as bytes.
pub(crate) fn pack(colour: RgbF32, shade: f32) -> u32 {
    let [r, g, b] = colour.map(|part| (part * shade * 255.0).clamp(0.0, 255.0) as u32);
    r | g << 8 | b << 16
}

/// The corners of a regular polygon with 8, 12 or 16 corners, one of them on each half axis.
fn circle(sides: usize) -> impl Iterator<Item = [f32; 2]> {
    const COS_22: f32 = 0.923_879_5;
    const SIN_22: f32 = 0.382_683_43;
    const DIAGONAL: f32 = std::f32::consts::FRAC_1_SQRT_2;
    const COS_30: f32 = 0.866_025_4;
    const EIGHT: [[f32; 2]; 2] = [[1.0, 0.0], [DIAGONAL, DIAGONAL]];
    const TWELVE: [[f32; 2]; 3] = [[1.0, 0.0], [COS_30, 0.5], [0.5, COS_30]];
    const SIXTEEN: [[f32; 2]; 4] = [[1.0, 0.0], [COS_22, SIN_22], [DIAGONAL, DIAGONAL], [SIN_22, COS_22]];
    let quarter: &'static [[f32; 2]] = match sides {
        8 => &EIGHT,
        12 => &TWELVE,
        _ => &SIXTEEN,
    };
    (0..4).flat_map(move |quarters| {
        quarter.iter().map(move |&[x, y]| match quarters {
            0 => [x, y],
            1 => [-y, x],
            2 => [-x, -y],
            _ => [y, -x],
        })
    })
}
