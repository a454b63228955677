//! Sights: what the simulator knows of a frame, place by place; the visual encoder learns to tell it.

use std::collections::HashMap;

use crate::domain::{ActionType, Class, Scene, World};
use crate::house::view;
use crate::house::view::{Frame, View, decode};
use crate::nets::visual::SIDE;

/// Places in a feature map.
pub const PLACES: usize = (SIDE * SIDE) as usize;
/// Marks of a place: the 82 classes that may show there, the 7 interactions that are possible there, and whether something
/// there stands open.
pub const MARKS: usize = Class::VOCABULARY + INTERACTIONS + 1;
const INTERACTIONS: usize = ActionType::COUNT - 5;
/// As few pixels of a 300 x 300 frame in one place show a thing there.
const FEWEST_PIXELS: u16 = 8;
/// Depth beyond this, in metres, counts as this.
const FARTHEST: f32 = 10.0;

/// What the simulator knows of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Sight {
    /// [`MARKS`] x [`PLACES`], mark by mark: 1 where the mark holds.
    pub marks: Vec<u8>,
    /// The logarithm of each place's mean depth in metres.
    pub depth: Vec<f32>,
    /// The held class; 0 for an empty hand.
    pub held: u8,
}

impl Sight {
    /// Of a drawn frame.
    pub fn of(scene: &Scene, world: &World, frame: &Frame) -> Sight {
        let mut marks = vec![0u8; MARKS * PLACES];
        let candidates = view::candidates(scene, world, &View::of(frame));
        for (code, pixels) in pixels_by_place(frame) {
            let Some(instance) = decode(code) else { continue };
            let class = world.class_of(scene, instance).unwrap_or_default();
            let kinds = candidates.iter().filter(|candidate| candidate.instance == instance);
            let mut known: Vec<usize> = kinds.map(|c| Class::VOCABULARY + c.kind.index() - 5).collect();
            if class.in_vocabulary() {
                known.push(class.index());
            }
            if world.is_open(instance) {
                known.push(MARKS - 1);
            }
            for (place, _) in pixels.iter().enumerate().filter(|(_, count)| **count >= FEWEST_PIXELS) {
                for &mark in &known {
                    marks[mark * PLACES + place] = 1;
                }
            }
        }
        let held = world.held.and_then(|index| world.object(index)).map(|object| object.class).unwrap_or_default();
        Sight { marks, depth: depth_by_place(frame), held: if held.in_vocabulary() { held.index() as u8 } else { 0 } }
    }
}

/// How many pixels of each place show each code.
fn pixels_by_place(frame: &Frame) -> HashMap<u16, [u16; PLACES]> {
    let side = SIDE as usize;
    let mut counts: HashMap<u16, [u16; PLACES]> = HashMap::new();
    for (y, row) in frame.ids.chunks_exact(frame.width).enumerate() {
        let down = y * side / frame.height;
        let mut x = 0;
        while x < row.len() {
            let (id, across) = (row[x], x * side / frame.width);
            let place_end = ((across + 1) * frame.width).div_ceil(side);
            let run = row[x..place_end.min(row.len())].iter().take_while(|&&other| other == id).count();
            if id != 0 {
                counts.entry(id).or_insert([0; PLACES])[down * side + across] += run as u16;
            }
            x += run;
        }
    }
    counts
}

fn depth_by_place(frame: &Frame) -> Vec<f32> {
    let side = SIDE as usize;
    let (mut sums, mut counts) = (vec![0f32; PLACES], vec![0f32; PLACES]);
    // Every fourth pixel of every fourth row is enough for a mean.
    for y in (0..frame.height).step_by(4) {
        for x in (0..frame.width).step_by(4) {
            let place = (y * side / frame.height) * side + x * side / frame.width;
            sums[place] += frame.depth[y * frame.width + x].clamp(0.1, FARTHEST);
            counts[place] += 1.0;
        }
    }
    sums.iter().zip(counts).map(|(sum, count)| (sum / count.max(1.0)).max(0.1).ln()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_counted_in_the_place_they_fall_into() {
        let mut frame =
            Frame { width: 300, height: 300, rgb: Vec::new(), depth: vec![2.0; 90_000], ids: vec![0; 90_000] };
        for y in 0..10 {
            for x in 280..300 {
                frame.ids[y * 300 + x] = 3;
            }
        }
        let counts = pixels_by_place(&frame);
        assert_eq!(counts[&3][6], 200);
        assert_eq!(counts[&3].iter().map(|&n| u32::from(n)).sum::<u32>(), 200);
        assert!(depth_by_place(&frame).iter().all(|depth| (depth - 2f32.ln()).abs() < 1e-5));
    }
}
