//! From the visibility buffer to the frame: the floor and ceiling behind everything, then colours, depths and instances.

use super::draw::{dimming, pack};
use super::raster::{BLOCK, Material, Raster};
use super::solid::Colour;
use crate::domain::Room;
use crate::house::camera::Camera;
use crate::house::view::Frame;

/// How the floor of a room looks: two colours in tiles of so many metres, or in planks when `planks`.
struct Ground {
    colours: [Colour; 2],
    side: f32,
    planks: bool,
}

fn ground(room: Room) -> Ground {
    let (colours, side, planks) = match room {
        Room::Kitchen => ([[0.80, 0.76, 0.70], [0.70, 0.66, 0.60]], 0.5, false),
        Room::LivingRoom => ([[0.62, 0.45, 0.30], [0.56, 0.40, 0.26]], 0.25, true),
        Room::Bedroom => ([[0.66, 0.52, 0.38], [0.61, 0.47, 0.34]], 0.25, true),
        Room::Bathroom => ([[0.70, 0.76, 0.78], [0.58, 0.65, 0.68]], 0.25, false),
    };
    Ground { colours, side, planks }
}

/// Sets every pixel to the floor, the ceiling, or nothing. Heights are in metres of the scene.
pub fn backdrop(raster: &mut Raster, camera: &Camera, room: Room, floor: f32, ceiling: Option<f32>) {
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
            near.fill(0.0);
            shows.fill(sky);
            continue;
        };
        let shade = dimming(depth);
        if ray.y >= 0.0 {
            let material = raster.material(Material { rgb: pack([0.93, 0.92, 0.88], shade), id: 0 });
            let (near, shows) = raster.row_mut(row);
            near.fill(1.0 / depth);
            shows.fill(material);
            continue;
        }
        let pair = ground.colours.map(|colour| raster.material(Material { rgb: pack(colour, shade), id: 0 }));
        let mixed = std::array::from_fn(|i| (ground.colours[0][i] + ground.colours[1][i]) / 2.0);
        let blend = raster.material(Material { rgb: pack(mixed, shade), id: 0 });
        let (near, shows) = raster.row_mut(row);
        near.fill(1.0 / depth);
        let step = depth * slope / ground.side;
        if step > 0.5 {
            shows.fill(blend);
            continue;
        }
        // Where on the floor the row's left end is, in tiles; `right` runs along x or z.
        let start = (eye + (ray - right * (middle * slope)) * depth) / ground.side;
        let (along, across, towards) =
            if right.x != 0.0 { (start.x, start.z, right.x) } else { (start.z, start.x, right.z) };
        // Planks lie along the scene's x axis.
        let (striped, shift) = match (ground.planks, right.x != 0.0) {
            (false, _) => (true, across.floor() as i64),
            (true, true) => (false, across.floor() as i64),
            (true, false) => (true, 0),
        };
        if !striped {
            shows.fill(pair[shift.rem_euclid(2) as usize]);
            continue;
        }
        let mut from = 0;
        let mut tile = along.floor();
        while from < size {
            let edge = if towards > 0.0 { (tile + 1.0 - along) / step } else { (along - tile) / step };
            let end = ((edge + 0.5) as usize).clamp(from, size);
            shows[from..end].fill(pair[(tile as i64 + shift).rem_euclid(2) as usize]);
            from = end;
            tile += towards;
        }
        let last = shows[size - 1];
        shows[size..].fill(last);
    }
}

/// Writes the finished frame.
pub fn resolve(raster: &Raster, frame: &mut Frame) {
    let size = raster.size();
    let materials = raster.materials();
    let rows = frame.rgb.chunks_exact_mut(3 * size).zip(frame.depth.chunks_exact_mut(size));
    for (row, ((rgb, depth), ids)) in rows.zip(frame.ids.chunks_exact_mut(size)).enumerate() {
        let (near, shows) = raster.row(row);
        for (depth, near) in depth.iter_mut().zip(near) {
            *depth = 1.0 / near;
        }
        let whole = size / BLOCK * BLOCK;
        let blocks = rgb.chunks_exact_mut(3 * BLOCK).zip(ids.chunks_exact_mut(BLOCK));
        for ((rgb, ids), shows) in blocks.zip(shows.chunks_exact(BLOCK)) {
            paint(rgb, ids, shows, materials);
        }
        paint(&mut rgb[3 * whole..], &mut ids[whole..], &shows[whole..size], materials);
    }
}

fn paint(rgb: &mut [u8], ids: &mut [u16], shows: &[u16], materials: &[Material]) {
    for ((rgb, id), &number) in rgb.chunks_exact_mut(3).zip(ids).zip(shows) {
        let material = materials[usize::from(number)];
        *id = material.id;
        rgb.copy_from_slice(&material.rgb.to_le_bytes()[..3]);
    }
}
