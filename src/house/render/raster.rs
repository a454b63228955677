//! The visibility buffer: for every pixel the nearest surface so far, as an inverse depth and a material.
//!
//! Inverse depth is linear over the image for a plane, so a span needs one addition per pixel; it also is larger the nearer,
//! and 0 at infinity. Pixels are kept in groups of four, for which glam has vector instructions; rows are padded to whole
//! groups. A material's number is kept as the bits of a float, so that both halves of a pixel go through the same mask.

use glam::{Vec2, Vec3, Vec4};

/// Pixels that are treated at once.
pub(crate) const GROUP: usize = 4;
const LANES: Vec4 = Vec4::new(0.0, 1.0, 2.0, 3.0);

/// What a pixel shows: a finished colour and the number of an instance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Material {
    /// Red, green, blue, unused; lowest byte first.
    pub(crate) rgb: u32,
    /// The instance: see [`crate::house::view::code`].
    pub(crate) id: u16,
}

/// Inverse depth as a linear function of the column and the row of a pixel's middle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    /// Change per column.
    pub(crate) dx: f32,
    /// Change per row.
    pub(crate) dy: f32,
    /// At the image's upper left corner.
    pub(crate) base: f32,
}

/// Per-pixel nearest surfaces of one frame.
pub(crate) struct Raster {
    size: usize,
    groups: usize,
    near: Vec<Vec4>,
    shows: Vec<Vec4>,
    materials: Vec<Material>,
    left: Vec<f32>,
    right: Vec<f32>,
}

/// A material's number as it is kept in a pixel: the bits of a number from 1 to 2.
pub(crate) fn mark(material: u16) -> f32 {
    f32::from_bits(0x3f80_0000 | u32::from(material))
}

/// The material's number that is kept in a pixel.
pub(crate) fn unmark(mark: f32) -> usize {
    (mark.to_bits() & 0xffff) as usize
}

impl Raster {
    /// An empty square buffer with `size` pixels a side.
    pub(crate) fn new(size: usize) -> Raster {
        let groups = size.div_ceil(GROUP);
        Raster {
            size,
            groups,
            near: vec![Vec4::ZERO; groups * size],
            shows: vec![Vec4::ZERO; groups * size],
            materials: Vec::new(),
            left: vec![0.0; size],
            right: vec![0.0; size],
        }
    }

    /// Pixels a side.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// Forgets all materials; the pixels have to be set row by row with [`Raster::row_mut`].
    pub(crate) fn clear(&mut self) {
        self.materials.clear();
    }

    /// The number of a new material. After 65,536 in one frame the last one is used again.
    pub(crate) fn material(&mut self, material: Material) -> u16 {
        if self.materials.len() <= usize::from(u16::MAX) {
            self.materials.push(material);
        }
        (self.materials.len() - 1) as u16
    }

    /// The materials of this frame.
    pub(crate) fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// A row of inverse depths and marks of materials, padding included.
    pub(crate) fn row(&self, row: usize) -> (&[Vec4], &[Vec4]) {
        let range = row * self.groups..(row + 1) * self.groups;
        (&self.near[range.clone()], &self.shows[range])
    }

    /// A row to be set.
    pub(crate) fn row_mut(&mut self, row: usize) -> (&mut [Vec4], &mut [Vec4]) {
        let range = row * self.groups..(row + 1) * self.groups;
        (&mut self.near[range.clone()], &mut self.shows[range])
    }

    /// Fills a convex polygon (pixel coordinates, any winding) that lies in `plane`.
    pub(crate) fn polygon(&mut self, corners: &[Vec2], plane: &Plane, material: u16) {
        let (mut min, mut max) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        for &corner in corners {
            min = min.min(corner);
            max = max.max(corner);
        }
        let size = self.size as f32;
        if !(min.x < size && max.x > 0.0) {
            return;
        }
        let (top, bottom) = (nearest_row(min.y, size), nearest_row(max.y, size));
        if top >= bottom {
            return;
        }
        self.left[top..bottom].fill(f32::INFINITY);
        self.right[top..bottom].fill(f32::NEG_INFINITY);
        let mut from = corners[corners.len() - 1];
        for &to in corners {
            let (high, low) = if from.y < to.y { (from, to) } else { (to, from) };
            let (first, end) = (nearest_row(high.y, size), nearest_row(low.y, size));
            if first < end {
                let slope = (low.x - high.x) / (low.y - high.y);
                let start = high.x + slope * (first as f32 + 0.5 - high.y);
                let rows = self.left[first..end].iter_mut().zip(&mut self.right[first..end]);
                for (step, (left, right)) in rows.enumerate() {
                    let x = start + slope * step as f32;
                    *left = left.min(x);
                    *right = right.max(x);
                }
            }
            from = to;
        }
        let Plane { dx, dy, base } = *plane;
        let (slope, step, mark) = (LANES * dx, Vec4::splat(dx * GROUP as f32), Vec4::splat(mark(material)));
        for row in top..bottom {
            let (left, right) = (self.left[row].max(0.0) + 0.5, self.right[row].min(size) + 0.5);
            let (first, end) = (left as usize, (right as usize).min(self.size));
            if first >= end {
                continue;
            }
            let (from, to) = (first / GROUP, (end - 1) / GROUP);
            let start = base + dy * (row as f32 + 0.5) + dx * (0.5 + (from * GROUP) as f32);
            let mut depth = slope + start;
            let range = row * self.groups + from..row * self.groups + to + 1;
            let (near, shows) = (&mut self.near[range.clone()], &mut self.shows[range]);
            // Lanes before the first and after the last pixel of the span count as infinitely far.
            let before = LANES.cmplt(Vec4::splat((first % GROUP) as f32));
            let after = LANES.cmpge(Vec4::splat((end - to * GROUP) as f32));
            let last = near.len() - 1;
            if last == 0 {
                let inside = Vec4::select(before | after, Vec4::NEG_ONE, depth);
                cover(&mut near[0], &mut shows[0], inside, mark);
                continue;
            }
            cover(&mut near[0], &mut shows[0], Vec4::select(before, Vec4::NEG_ONE, depth), mark);
            for (near, shows) in near[1..last].iter_mut().zip(&mut shows[1..last]) {
                depth += step;
                cover(near, shows, depth, mark);
            }
            depth += step;
            cover(&mut near[last], &mut shows[last], Vec4::select(after, Vec4::NEG_ONE, depth), mark);
        }
    }

    /// Fills an ellipsoid's outline. In the frame where it is the unit sphere, a ray through column x and row y is
    /// `ray[0] + ray[1] x + ray[2] y` and its middle is `centre`; `bounds` are its left, top, right and bottom. The surface is
    /// drawn in tones by its direction along `light`: `tones` are the darkest material and how many there are from it on.
    pub(crate) fn ellipsoid(&mut self, ray: [Vec3; 3], centre: Vec3, bounds: [f32; 4], light: Vec3, tones: [u16; 2]) {
        let outside = centre.length_squared() - 1.0;
        if outside <= 0.0 {
            return;
        }
        let size = self.size as f32;
        let (top, bottom) = (nearest_row(bounds[1] - 1.0, size), nearest_row(bounds[3] + 1.0, size));
        let (first, end) = (bounds[0].max(0.0) as usize, (bounds[2] + 1.0).clamp(0.0, size) as usize);
        let [darkest, count] = tones;
        for row in top..bottom {
            let at_row = ray[0] + ray[2] * (row as f32 + 0.5) + ray[1] * 0.5;
            for column in first..end {
                // |ray / w - centre| = 1 with w the inverse depth; the larger root is the nearer side.
                let through = at_row + ray[1] * column as f32;
                let along = through.dot(centre);
                let apart = along * along - outside * through.length_squared();
                if apart <= 0.0 {
                    continue;
                }
                let w = (along + apart.sqrt()) / outside;
                let (group, lane) = (row * self.groups + column / GROUP, column % GROUP);
                if w > self.near[group][lane] {
                    let lit = (through / w - centre).dot(light).clamp(-1.0, 1.0);
                    let tone = (0.5 * (lit + 1.0) * (f32::from(count) - 0.01)) as u16;
                    self.near[group][lane] = w;
                    self.shows[group][lane] = mark(darkest + tone.min(count - 1));
                }
            }
        }
    }
}

/// Puts a surface into a group of pixels where it is nearer than what they show.
#[inline(always)]
fn cover(near: &mut Vec4, shows: &mut Vec4, depth: Vec4, mark: Vec4) {
    *shows = Vec4::select(depth.cmpgt(*near), mark, *shows);
    *near = depth.max(*near);
}

/// The first row whose middle is at or below `y`, within the image.
fn nearest_row(y: f32, size: f32) -> usize {
    (y + 0.5).clamp(0.0, size) as usize
}
