//! The visibility buffer: for every pixel the nearest surface so far, as an inverse depth and a material.
//!
//! Inverse depth is linear over the image for a plane, so a span needs one addition per pixel; it also is larger the nearer,
//! and 0 at infinity. Rows are padded to whole blocks of eight pixels, which the compiler turns into vector code.

use glam::{Vec2, Vec3};

/// Pixels that are treated at once.
pub const BLOCK: usize = 8;

/// What a pixel shows: a finished colour and the number of an instance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Material {
    /// Red, green, blue, unused; lowest byte first.
    pub rgb: u32,
    /// The instance: see [`crate::house::view::code`].
    pub id: u16,
}

/// Inverse depth as a linear function of the column and the row of a pixel's middle.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// Change per column.
    pub dx: f32,
    /// Change per row.
    pub dy: f32,
    /// At the image's upper left corner.
    pub base: f32,
}

/// Per-pixel nearest surfaces of one frame.
pub struct Raster {
    size: usize,
    stride: usize,
    near: Vec<f32>,
    shows: Vec<u16>,
    materials: Vec<Material>,
    left: Vec<f32>,
    right: Vec<f32>,
}

impl Raster {
    /// An empty square buffer with `size` pixels a side.
    pub fn new(size: usize) -> Raster {
        let stride = size.next_multiple_of(BLOCK);
        Raster {
            size,
            stride,
            near: vec![0.0; stride * size],
            shows: vec![0; stride * size],
            materials: Vec::with_capacity(4096),
            left: vec![0.0; size],
            right: vec![0.0; size],
        }
    }

    /// Pixels a side.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Forgets all materials; the pixels have to be set row by row with [`Raster::row`].
    pub fn clear(&mut self) {
        self.materials.clear();
    }

    /// The number of a new material. After 65,535 in one frame the last one is used again.
    pub fn material(&mut self, material: Material) -> u16 {
        if self.materials.len() <= usize::from(u16::MAX) {
            self.materials.push(material);
        }
        (self.materials.len() - 1) as u16
    }

    /// The materials of this frame.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// A row of inverse depths and materials, padding included.
    pub fn row(&self, row: usize) -> (&[f32], &[u16]) {
        let range = row * self.stride..(row + 1) * self.stride;
        (&self.near[range.clone()], &self.shows[range])
    }

    /// A row to be set.
    pub fn row_mut(&mut self, row: usize) -> (&mut [f32], &mut [u16]) {
        let range = row * self.stride..(row + 1) * self.stride;
        (&mut self.near[range.clone()], &mut self.shows[range])
    }

    /// Fills a convex polygon (pixel coordinates, any winding) that lies in `plane`.
    pub fn polygon(&mut self, corners: &[Vec2], plane: &Plane, material: u16) {
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
        let lanes: [f32; BLOCK] = std::array::from_fn(|lane| dx * lane as f32);
        for row in top..bottom {
            let first = (self.left[row].max(0.0) + 0.5) as usize;
            let end = (self.right[row].clamp(0.0, size) + 0.5) as usize;
            let end = end.min(self.size);
            if first >= end {
                continue;
            }
            let at_row = base + dy * (row as f32 + 0.5) + dx * 0.5;
            let blocks = row * self.stride / BLOCK + first / BLOCK..row * self.stride / BLOCK + (end - 1) / BLOCK + 1;
            let near = &mut self.near.as_chunks_mut::<BLOCK>().0[blocks.clone()];
            let shows = &mut self.shows.as_chunks_mut::<BLOCK>().0[blocks];
            let mut column = first / BLOCK * BLOCK;
            for (near, shows) in near.iter_mut().zip(shows) {
                let at_block = at_row + dx * column as f32;
                let mut depth: [f32; BLOCK] = std::array::from_fn(|lane| at_block + lanes[lane]);
                if column < first || column + BLOCK > end {
                    for (lane, depth) in depth.iter_mut().enumerate() {
                        let inside = column + lane >= first && column + lane < end;
                        *depth = if inside { *depth } else { -1.0 };
                    }
                }
                cover(near, shows, &depth, material);
                column += BLOCK;
            }
        }
    }

    /// Fills an ellipsoid's outline. In the frame where it is the unit sphere, a ray through column x and row y is
    /// `ray[0] + ray[1] x + ray[2] y` and its middle is `centre`; `bounds` are its left, top, right and bottom. The surface is
    /// drawn in `tones.len()` tones from dark to light by its direction along `light`.
    pub fn ellipsoid(&mut self, ray: [Vec3; 3], centre: Vec3, bounds: [f32; 4], light: Vec3, tones: [u16; 2]) {
        let outside = centre.length_squared() - 1.0;
        if outside <= 0.0 {
            return;
        }
        let size = self.size as f32;
        let (top, bottom) = (nearest_row(bounds[1] - 1.0, size), nearest_row(bounds[3] + 1.0, size));
        let first = (bounds[0].max(0.0)) as usize;
        let end = ((bounds[2] + 1.0).clamp(0.0, size)) as usize;
        if first >= end {
            return;
        }
        let [darkest, count] = tones;
        for row in top..bottom {
            let at_row = ray[0] + ray[2] * (row as f32 + 0.5) + ray[1] * 0.5;
            let blocks = row * self.stride / BLOCK + first / BLOCK..row * self.stride / BLOCK + (end - 1) / BLOCK + 1;
            let near = &mut self.near.as_chunks_mut::<BLOCK>().0[blocks.clone()];
            let shows = &mut self.shows.as_chunks_mut::<BLOCK>().0[blocks];
            let mut column = first / BLOCK * BLOCK;
            for (near, shows) in near.iter_mut().zip(shows) {
                for lane in 0..BLOCK {
                    // |ray / w - centre| = 1 with w the inverse depth; the larger root is the nearer side.
                    let through = at_row + ray[1] * (column + lane) as f32;
                    let along = through.dot(centre);
                    let apart = along * along - outside * through.length_squared();
                    let w = (along + apart.max(0.0).sqrt()) / outside;
                    let keep = apart > 0.0 && w > near[lane];
                    if keep {
                        let lit = (through / w - centre).dot(light).clamp(-1.0, 1.0);
                        let tone = (0.5 * (lit + 1.0) * (f32::from(count) - 0.01)) as u16;
                        near[lane] = w;
                        shows[lane] = darkest + tone.min(count - 1);
                    }
                }
                column += BLOCK;
            }
        }
    }
}

/// Puts a surface into eight pixels where it is nearer than what they show.
fn cover(near: &mut [f32; BLOCK], shows: &mut [u16; BLOCK], depth: &[f32; BLOCK], material: u16) {
    for lane in 0..BLOCK {
        let keep = depth[lane] > near[lane];
        near[lane] = if keep { depth[lane] } else { near[lane] };
        shows[lane] = if keep { material } else { shows[lane] };
    }
}

/// The first row whose middle is at or below `y`, within the image.
fn nearest_row(y: f32, size: f32) -> usize {
    (y + 0.5).clamp(0.0, size) as usize
}
