//! What a detector should say of a frame: which classes show in each place, and what stands open or is switched on.

use std::collections::BTreeMap;

use crate::domain::{Class, Scene, World};
use crate::house::view::{FEWEST_PIXELS, Frame, decode, pixels_by_place, places_of};
use crate::nets::detector::{GRID, LABELS};

/// Places of a frame.
pub(crate) const PLACES: usize = GRID * GRID;
/// A thing of so many places weighs as much as the same number of places without it; smaller ones weigh more in each.
const PLAIN: f32 = 36.0;

/// A thing in a frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct VisibleThing {
    /// What it is.
    pub(crate) class: Class,
    /// How many pixels of the frame show it.
    pub(crate) pixels: u32,
    /// The places where it shows.
    pub(crate) places: Vec<usize>,
}

/// The labels of one frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlaceLabels {
    /// Which of [`LABELS`] x [`PLACES`], label by label, hold, with their weight in the loss. Each place of a small thing weighs more
    /// than one of a large thing, or the detector would learn counters and walls alone.
    pub(crate) holding: BTreeMap<usize, f32>,
    /// What counts as seen, each thing by itself.
    pub(crate) things: Vec<VisibleThing>,
}

impl PlaceLabels {
    /// The labels of a frame that was drawn of `world`. What the agent holds is no instance of the frame, and so has no label.
    pub(crate) fn of(scene: &Scene, world: &World, frame: &Frame) -> PlaceLabels {
        let mut holding: BTreeMap<usize, f32> = BTreeMap::new();
        let mut things = Vec::new();
        for (code, pixels) in pixels_by_place(frame, GRID) {
            let Some(instance) = decode(code) else { continue };
            let class = world.class_of(scene, instance).unwrap_or_default();
            if !class.in_vocabulary() {
                continue;
            }
            let total: u32 = pixels.values().map(|&count| u32::from(count)).sum();
            let places = places_of(&pixels);
            if total < FEWEST_PIXELS {
                continue;
            }
            let weight = (PLAIN / places.len() as f32).sqrt().clamp(1.0, 6.0);
            let active = world.is_open(instance) || world.is_on(instance);
            for label in [Some(class.index()), active.then_some(LABELS - 1)].into_iter().flatten() {
                for &place in &places {
                    let here = holding.entry(label * PLACES + place).or_default();
                    *here = here.max(weight);
                }
            }
            things.push(VisibleThing { class, pixels: total, places });
        }
        PlaceLabels { holding, things }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::house::House;
    use crate::house::render::Renderer;
    use crate::house::testing::kitchen;

    #[test]
    fn every_thing_that_counts_as_seen_shows_in_a_place_and_small_ones_weigh_more() {
        let (scene, mut world) = kitchen();
        let mut renderer = Renderer::new(House::FRAME);
        let mut weights = Vec::new();
        for _ in 0..4 {
            let frame = renderer.draw(&scene, &world).clone();
            let labels = PlaceLabels::of(&scene, &world, &frame);
            let view = crate::house::view::View::of(&frame);
            let named = view.sightings.iter().filter_map(|sighting| world.class_of(&scene, sighting.instance));
            assert_eq!(labels.things.len(), named.filter(|class| class.in_vocabulary()).count());
            for thing in &labels.things {
                assert!(!thing.places.is_empty(), "{thing:?}");
                let weight = labels.holding[&(thing.class.index() * PLACES + thing.places[0])];
                weights.push((thing.places.len(), weight));
            }
            world.agent.heading = world.agent.heading.right();
        }
        assert!(weights.iter().any(|&(places, weight)| places > 100 && weight == 1.0));
        assert!(weights.iter().any(|&(places, weight)| places < 5 && weight > 2.0));
    }
}
