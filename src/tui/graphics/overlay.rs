//! Other views of the frame: distance, instances, and the frames that a trained agent sees at once.

use std::sync::Arc;

use crate::house::view::Frame;

/// What the frame's panel shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overlay {
    /// The frame itself.
    #[default]
    Colour,
    /// Near is light.
    Depth,
    /// A colour for each thing.
    Things,
    /// This frame and the four before it, as the agent gets them.
    Frames,
}

impl Overlay {
    /// The next one, around.
    pub(crate) fn next(self) -> Overlay {
        match self {
            Overlay::Colour => Overlay::Depth,
            Overlay::Depth => Overlay::Things,
            Overlay::Things => Overlay::Frames,
            Overlay::Frames => Overlay::Colour,
        }
    }

    /// What the panel is called then.
    pub(crate) fn title(self) -> &'static str {
        match self {
            Overlay::Colour => "Sees",
            Overlay::Depth => "Sees: depth",
            Overlay::Things => "Sees: things",
            Overlay::Frames => "Sees: 5 frames",
        }
    }
}

/// Distances that the depth view tells apart end here, in metres.
const FARTHEST: f32 = 5.0;

/// What an overlay shows of a frame and those before it.
pub(crate) fn shown(overlay: Overlay, frame: &Arc<Frame>, before: &[Arc<Frame>]) -> Arc<Frame> {
    match overlay {
        Overlay::Colour => frame.clone(),
        Overlay::Depth => painted(frame, |frame, at| {
            let near = 1.0 - (frame.depth[at] / FARTHEST).clamp(0.0, 1.0);
            // Light and warm is near, dark and blue far: both can be told without colours.
            let level = |low: f32, high: f32| (low + (high - low) * near) as u8;
            [level(16.0, 255.0), level(24.0, 236.0), level(64.0, 190.0)]
        }),
        Overlay::Things => painted(frame, |frame, at| tint(frame.ids[at])),
        Overlay::Frames => Arc::new(mosaic(frame, before)),
    }
}

fn painted(frame: &Arc<Frame>, colour: impl Fn(&Frame, usize) -> [u8; 3]) -> Arc<Frame> {
    let rgb = (0..frame.ids.len()).flat_map(|at| colour(frame, at)).collect();
    Arc::new(Frame { rgb, ..(**frame).clone() })
}

/// A colour for an instance's number, so that neighbours in the list differ; structure is dark.
fn tint(id: u16) -> [u8; 3] {
    if id == 0 {
        return [40, 42, 46];
    }
    // Steps of the golden ratio around the colour wheel.
    let hue = (f32::from(id & 0x7fff) * 0.618_034 + if id >= 0x8000 { 0.31 } else { 0.0 }).fract() * 6.0;
    let value = if id >= 0x8000 { 250.0 } else { 170.0 };
    let channel = |shift: f32| {
        let part = ((hue + shift).rem_euclid(6.0) - 3.0).abs() - 1.0;
        (value * (0.25 + 0.75 * part.clamp(0.0, 1.0))) as u8
    };
    [channel(0.0), channel(4.0), channel(2.0)]
}

/// The frame large, the four before it around its lower right corner, the newest of them at the top.
fn mosaic(now: &Frame, before: &[Arc<Frame>]) -> Frame {
    let (width, height) = (now.width, now.height);
    let mut rgb = vec![20; 3 * width * height];
    let mut place = |frame: &Frame, left: usize, top: usize, side: usize| {
        for y in 0..side {
            for x in 0..side {
                // A dark line parts the pictures.
                if x == 0 || y == 0 {
                    continue;
                }
                let from = 3 * (y * frame.height / side * frame.width + x * frame.width / side);
                let to = 3 * ((top + y) * width + left + x);
                rgb[to..to + 3].copy_from_slice(&frame.rgb[from..from + 3]);
            }
        }
    };
    let third = width.min(height) / 3;
    place(now, 0, 0, 2 * third);
    let corners = [(2 * third, 0), (2 * third, third), (2 * third, 2 * third), (third, 2 * third)];
    for (frame, (left, top)) in before.iter().zip(corners) {
        place(frame, left, top, third);
    }
    // Letters show the present frame: a mosaic of letters would say nothing.
    Frame { rgb, ..now.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_have_colours_of_their_own_and_the_mosaic_shows_five() {
        let tints: Vec<[u8; 3]> = (0..12).chain(0x8000..0x800c).map(tint).collect();
        for (at, one) in tints.iter().enumerate() {
            assert!(!tints[at + 1..].contains(one), "{at}");
        }
        let flat = |value: u8| Frame {
            width: 30,
            height: 30,
            rgb: vec![value; 2700],
            depth: vec![1.0; 900],
            ids: vec![0; 900],
        };
        let before: Vec<Arc<Frame>> = [60, 70, 80, 90].into_iter().map(|value| Arc::new(flat(value))).collect();
        let all = mosaic(&flat(50), &before);
        let at = |x: usize, y: usize| all.rgb[3 * (y * 30 + x)];
        assert_eq!([at(10, 10), at(25, 5), at(25, 15), at(25, 25), at(15, 25)], [50, 60, 70, 80, 90]);
    }
}
