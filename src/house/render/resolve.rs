//! From the visibility buffer to the frame: the floor and ceiling behind everything, then colours, depths and instances.

use glam::Vec4;

use super::draw::{dimming, pack};
use super::raster::{GROUP, Material, Raster, mark, unmark};
use super::solid::RgbF32;
use crate::domain::Room;
use crate::house::camera::Camera;
use crate::house::view::Frame;

/// How the floor of a room looks: two colours in tiles of so many metres, or in planks when `planks`.
struct FloorPattern {
    colours: [RgbF32; 2],
    side: f32,
    planks: bool,
}

fn ground(room: Room) -> FloorPattern {
    let (colours, side, planks) = match room {
        Room::Kitchen => ([[0.80, 0.76, 0.70], [0.70, 0.66, 0.60]], 0.5, false),
        Room::LivingRoom => ([[0.62, 0.45, 0.30], [0.56, 0.40, 0.26]], 0.25, true),
        Room::Bedroom => ([[0.66, 0.52, 0.38], [0.61, 0.47, 0.34]], 0.25, true),
        Room::Bathroom => ([[0.70, 0.76, 0.78], [0.58, 0.65, 0.68]], 0.25, false),
    };
    FloorPattern { colours, side, planks }
}

/// Sets every pixel to the floor, the ceiling, or nothing. Heights are in metres of the scene.
pub(crate) fn backdrop(raster: &mut Raster, camera: &Camera, room: Room, floor: f32, ceiling: Option<f32>) {
    let size = raster.size();
    let middle = size as f32 / 2.0;
    let slope = Camera::SLOPE / middle;
    let (eye, turn) = (camera.eye(), camera.turn());
    let ground = ground(room);
    let sky = raster.material(Material { rgb: pack([0.80, 0.87, 0.92], 1.0), id: 0 });
    // A direction of the camera's frame as one of the scene: the rows of `turn` are its axes.
    let [right, up, forward] = [turn.row(0), turn.row(1), turn.row(2)];
    for row in 0..size {
        // There is no roll: along a row the direction changes by `right` only, which is level, so a level plane has one depth.
        let ray = forward + up * ((middle - row as f32 - 0.5) * slope);
        let plane = if ray.y < 0.0 { Some(floor) } else { ceiling };
        let depth = plane.map(|height| (height - eye.y) / ray.y).filter(|depth| *depth > 0.0 && *depth < 60.0);
        let Some(depth) = depth else {
            let (near, shows) = raster.row_mut(row);
            near.fill(Vec4::ZERO);
            shows.fill(Vec4::splat(mark(sky)));
            continue;
        };
        let shade = dimming(depth);
        // Tiles narrower than some pixels blend.
        let step = depth * slope / ground.side;
        let mixed = std::array::from_fn(|i| (ground.colours[0][i] + ground.colours[1][i]) / 2.0);
        let colours = match (ray.y >= 0.0, step > 0.16) {
            (true, _) => [[0.93, 0.92, 0.88]; 2],
            (false, true) => [mixed; 2],
            (false, false) => ground.colours,
        };
        let marks =
            colours.map(|colour| Vec4::splat(mark(raster.material(Material { rgb: pack(colour, shade), id: 0 }))));
        let (near, shows) = raster.row_mut(row);
        near.fill(Vec4::splat(1.0 / depth));
        // Where on the floor the middle of the row's first pixel is, in tiles; `right` runs along x or z.
        let start = (eye + (ray - right * ((middle - 0.5) * slope)) * depth) / ground.side;
        let (along, across, towards) =
            if right.x != 0.0 { (start.x, start.z, right.x) } else { (start.z, start.x, right.z) };
        let odd = across.floor().rem_euclid(2.0);
        // Planks lie along the scene's x axis: rows cross them when they run along z, and lie in one when along x.
        let shift = match (ground.planks, right.x != 0.0) {
            (false, _) => odd,
            (true, true) => {
                shows.fill(marks[odd as usize]);
                continue;
            }
            (true, false) => 0.0,
        };
        if colours[0] == colours[1] {
            shows.fill(marks[0]);
            continue;
        }
        // Half tiles, so that a whole number is a pair of them.
        let mut half = (Vec4::new(0.0, 1.0, 2.0, 3.0) * (towards * step) + along + shift) / 2.0;
        let stride = Vec4::splat(towards * step * GROUP as f32 / 2.0);
        for shows in shows {
            let first = (half - half.floor()).cmplt(Vec4::splat(0.5));
            *shows = Vec4::select(first, marks[0], marks[1]);
            half += stride;
        }
    }
}

/// Writes the finished frame.
pub(crate) fn resolve(raster: &Raster, frame: &mut Frame) {
    let size = raster.size();
    let materials = raster.materials();
    let rows = frame.rgb.chunks_exact_mut(3 * size).zip(frame.depth.chunks_exact_mut(size));
    for (row, ((rgb, depth), ids)) in rows.zip(frame.ids.chunks_exact_mut(size)).enumerate() {
        let (near, shows) = raster.row(row);
        let (depth, depth_rest) = depth.as_chunks_mut::<GROUP>();
        for (depth, near) in depth.iter_mut().zip(near) {
            *depth = near.recip().to_array();
        }
        let (rgb, rgb_rest) = rgb.as_chunks_mut::<{ 3 * GROUP }>();
        let (ids, ids_rest) = ids.as_chunks_mut::<GROUP>();
        let mut paint = PixelPaint::of(0, materials[0]);
        for ((rgb, ids), shows) in rgb.iter_mut().zip(ids).zip(shows) {
            if shows.cmpeq(Vec4::splat(shows.x)).all() {
                let number = unmark(shows.x);
                if number != paint.number {
                    paint = PixelPaint::of(number, materials[number]);
                }
                (*rgb, *ids) = (paint.rgb, paint.ids);
            } else {
                let four = shows.to_array().map(|show| materials[unmark(show)]);
                *ids = four.map(|material| material.id);
                *rgb = packed(four.map(|material| material.rgb));
            }
        }
        // What is left of a row whose length is no multiple of four.
        if let (Some(near), Some(shows)) = (near.last(), shows.last()) {
            for (lane, ((rgb, id), depth)) in rgb_rest.chunks_exact_mut(3).zip(ids_rest).zip(depth_rest).enumerate() {
                let material = materials[unmark(shows[lane])];
                *depth = 1.0 / near[lane];
                *id = material.id;
                rgb.copy_from_slice(&material.rgb.to_le_bytes()[..3]);
            }
        }
    }
}

/// Four colours in twelve bytes: three whole words.
fn packed([a, b, c, d]: [u32; GROUP]) -> [u8; 3 * GROUP] {
    let low = u64::from(a) | u64::from(b) << 24 | u64::from(c) << 48;
    let high = c >> 16 | d << 8;
    let mut bytes = [0; 3 * GROUP];
    bytes[..8].copy_from_slice(&low.to_le_bytes());
    bytes[8..].copy_from_slice(&high.to_le_bytes());
    bytes
}

/// Four pixels of one material, ready to be copied.
struct PixelPaint {
    number: usize,
    rgb: [u8; 3 * GROUP],
    ids: [u16; GROUP],
}

impl PixelPaint {
    fn of(number: usize, material: Material) -> PixelPaint {
        PixelPaint { number, rgb: packed([material.rgb; GROUP]), ids: [material.id; GROUP] }
    }
}
