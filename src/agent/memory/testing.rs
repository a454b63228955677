//! For tests: eyes that make no mistake, and places of the house in the agent's own frame.

use std::collections::BTreeMap;

use crate::agent::memory::percept::{GRID, Percept, median_depths};
use crate::domain::{Cell, Heading, Point, Pose, Scene, World};
use crate::house::view::{Frame, decode};

/// As few pixels of a raster cell show a thing there.
const FEWEST_PIXELS: u32 = 8;

/// What eyes without fault would make of a frame that was drawn of `world`.
pub(crate) fn true_percept(scene: &Scene, world: &World, frame: &Frame) -> Percept {
    let mut counts: Vec<BTreeMap<u16, u32>> = vec![BTreeMap::new(); GRID * GRID];
    for (at, &id) in frame.ids.iter().enumerate().filter(|(_, id)| **id != 0) {
        let (row, column) = (at / frame.width * GRID / frame.height, at % frame.width * GRID / frame.width);
        *counts[row * GRID + column].entry(id).or_default() += 1;
    }
    let mut percept = Percept { detections: vec![], open: vec![0.0; GRID * GRID], depth: median_depths(frame) };
    for (cell, counts) in counts.iter().enumerate() {
        for (&id, _) in counts.iter().filter(|(_, pixels)| **pixels >= FEWEST_PIXELS) {
            let instance = decode(id).unwrap();
            let class = world.class_of(scene, instance).unwrap();
            if class.in_vocabulary() && !percept.detections.contains(&(class, cell as u16, 0.9)) {
                percept.detections.push((class, cell as u16, 0.9));
            }
            if world.is_open(instance) || world.is_on(instance) {
                percept.open[cell] = 1.0;
            }
        }
    }
    percept
}

/// A point of the house as an agent that started at `start` would call it, its height above the floor.
pub(crate) fn point_in_own_frame(scene: &Scene, start: Pose, point: Point) -> Point {
    let from = start.cell.centre(0);
    let (dx, dz, y) = (point.x - from.x, point.z - from.z, point.y - scene.floor());
    match start.heading {
        Heading::North => Point::new(dx, y, dz),
        Heading::East => Point::new(-dz, y, dx),
        Heading::South => Point::new(-dx, y, -dz),
        Heading::West => Point::new(dz, y, -dx),
    }
}

/// A pose of the house as an agent that started at `start` would call it.
pub(crate) fn in_own_frame(scene: &Scene, start: Pose, pose: Pose) -> Pose {
    let cell = Cell::nearest(point_in_own_frame(scene, start, pose.cell.centre(0)));
    let heading = Heading::from_quarters(pose.heading.quarters() - start.heading.quarters());
    Pose { cell, heading, ..pose }
}
