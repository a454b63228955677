//! What the visual encoder is trained to predict of a frame, from the simulator's state: labels and depth for each cell of the
//! 7 x 7 map, and the held class.

use crate::domain::{ActionType, Class, Scene, World};
use crate::house::view;
use crate::house::view::{Frame, View, decode};
use crate::nets::visual::SIDE;

/// Cells of a feature map: 7 x 7.
pub(crate) const CELLS: usize = (SIDE * SIDE) as usize;
/// Labels of a cell: the 82 classes that may show there, the 7 interactions that are possible there, and whether something
/// there stands open.
pub(crate) const CELL_LABELS: usize = Class::VOCABULARY + INTERACTIONS + 1;
const INTERACTIONS: usize = ActionType::COUNT - 5;
/// As few pixels of a 300 x 300 frame in one cell show a thing there.
const FEWEST_PIXELS: u16 = 8;
/// Depth beyond this, in metres, counts as this.
const FARTHEST: f32 = 10.0;

/// The targets of one frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PerceptionTargets {
    /// [`CELL_LABELS`] x [`CELLS`], label by label: 1 where the label holds.
    pub(crate) cell_labels: Vec<u8>,
    /// The logarithm of each cell's mean depth in metres.
    pub(crate) depth: Vec<f32>,
    /// The held class; 0 for an empty hand.
    pub(crate) held: u8,
}

impl PerceptionTargets {
    /// The targets of a frame that was drawn of `world`.
    pub(crate) fn of(scene: &Scene, world: &World, frame: &Frame) -> PerceptionTargets {
        let mut cell_labels = vec![0u8; CELL_LABELS * CELLS];
        let candidates = view::candidates(scene, world, &View::of(frame));
        for (code, pixels) in view::pixels_by_place(frame, SIDE as usize) {
            let Some(instance) = decode(code) else { continue };
            let class = world.class_of(scene, instance).unwrap_or_default();
            let kinds = candidates.iter().filter(|candidate| candidate.instance == instance);
            let mut labels: Vec<usize> = kinds.map(|c| Class::VOCABULARY + c.kind.index() - 5).collect();
            if class.in_vocabulary() {
                labels.push(class.index());
            }
            if world.is_open(instance) {
                labels.push(CELL_LABELS - 1);
            }
            for (&cell, _) in pixels.iter().filter(|(_, count)| **count >= FEWEST_PIXELS) {
                for &label in &labels {
                    cell_labels[label * CELLS + cell] = 1;
                }
            }
        }
        let held = world.held.and_then(|index| world.object(index)).map(|object| object.class).unwrap_or_default();
        PerceptionTargets {
            cell_labels,
            depth: depth_by_cell(frame),
            held: if held.in_vocabulary() { held.index() as u8 } else { 0 },
        }
    }
}

fn depth_by_cell(frame: &Frame) -> Vec<f32> {
    let side = SIDE as usize;
    let (mut sums, mut counts) = (vec![0f32; CELLS], vec![0f32; CELLS]);
    // Every fourth pixel of every fourth row is enough for a mean.
    for y in (0..frame.height).step_by(4) {
        for x in (0..frame.width).step_by(4) {
            let cell = (y * side / frame.height) * side + x * side / frame.width;
            sums[cell] += frame.depth[y * frame.width + x].clamp(0.1, FARTHEST);
            counts[cell] += 1.0;
        }
    }
    sums.iter().zip(counts).map(|(sum, count)| (sum / count.max(1.0)).max(0.1).ln()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_counted_in_the_cell_they_fall_into() {
        let mut frame =
            Frame { width: 300, height: 300, rgb: Vec::new(), depth: vec![2.0; 90_000], ids: vec![0; 90_000] };
        for y in 0..10 {
            for x in 280..300 {
                frame.ids[y * 300 + x] = 3;
            }
        }
        let counts = view::pixels_by_place(&frame, SIDE as usize);
        assert_eq!(counts[&3][&6], 200);
        assert_eq!(counts[&3].values().map(|&n| u32::from(n)).sum::<u32>(), 200);
        assert!(depth_by_cell(&frame).iter().all(|depth| (depth - 2f32.ln()).abs() < 1e-5));
    }
}
