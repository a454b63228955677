//! How well a detector finds things, by how large they show.

use super::labels::{PLACES, PlaceLabels};
use crate::domain::Class;
use crate::nets::detector::GRID;
use crate::train::metrics::Scalars;

/// From this probability on a class counts as found in a place.
const FOUND: f32 = 0.5;
/// The sizes by which things are told apart: fewer pixels of a 300 x 300 frame than this, and a name.
const SIZES: [(u32, &str); 4] = [(50, "tiny"), (200, "small"), (1000, "medium"), (u32::MAX, "large")];

/// What was found of what shows, and what was found that does not show.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Accuracy {
    /// Things that show, and of those the found ones, by size.
    things: [[u32; 2]; SIZES.len()],
    /// Places in which a class was found, and of those the ones in or next to a place where it shows.
    places: [u32; 2],
}

impl Accuracy {
    /// Counts a frame: the probabilities [83 x 1600] that were said of it against its labels.
    pub(crate) fn add(&mut self, said: &[f32], labels: &PlaceLabels) {
        for thing in &labels.things {
            let size = SIZES.iter().position(|(below, _)| thing.pixels < *below).unwrap_or(SIZES.len() - 1);
            let found = thing.places.iter().any(|place| said[thing.class.index() * PLACES + place] >= FOUND);
            self.things[size][0] += 1;
            self.things[size][1] += u32::from(found);
        }
        for class in 0..Class::VOCABULARY {
            for (place, _) in said[class * PLACES..][..PLACES].iter().enumerate().filter(|(_, p)| **p >= FOUND) {
                self.places[0] += 1;
                self.places[1] +=
                    u32::from(around(place).any(|near| labels.holding.contains_key(&(class * PLACES + near))));
            }
        }
    }

    /// The share of the things that were found, of all sizes.
    pub(crate) fn recall(&self) -> f64 {
        let sum = |at: usize| self.things.iter().map(|size| f64::from(size[at])).sum::<f64>();
        sum(1) / sum(0).max(1.0)
    }

    /// The share of the places in which a class was found that lie in or next to one where it shows.
    pub(crate) fn precision(&self) -> f64 {
        f64::from(self.places[1]) / f64::from(self.places[0].max(1))
    }

    /// Adds the figures to a step's.
    pub(crate) fn report(&self, scalars: &mut Scalars) {
        scalars.set("held_out_recall", self.recall());
        scalars.set("held_out_precision", self.precision());
        for ((_, name), [all, found]) in SIZES.iter().zip(self.things) {
            scalars.set(&format!("held_out_recall_{name}"), f64::from(found) / f64::from(all.max(1)));
        }
    }
}

/// A place and its neighbours.
fn around(place: usize) -> impl Iterator<Item = usize> {
    let (row, column) = (place / GRID, place % GRID);
    let near = |at: usize| at.saturating_sub(1)..=(at + 1).min(GRID - 1);
    near(row).flat_map(move |row| near(column).map(move |column| row * GRID + column))
}

#[cfg(test)]
mod tests {
    use super::super::labels::VisibleThing;
    use super::*;
    use crate::nets::detector::LABELS;

    #[test]
    fn things_count_as_found_by_size_and_places_as_right_next_to_what_shows() {
        let class = Class::named("Mug").unwrap();
        let mut labels = PlaceLabels { holding: Default::default(), things: Vec::new() };
        for (pixels, place) in [(20, 45), (300, 900)] {
            labels.holding.insert(class.index() * PLACES + place, 1.0);
            labels.things.push(VisibleThing { class, pixels, places: vec![place] });
        }
        let mut said = vec![0.0; LABELS * PLACES];
        for place in [45, 46, 47] {
            said[class.index() * PLACES + place] = 0.9;
        }
        let mut accuracy = Accuracy::default();
        accuracy.add(&said, &labels);
        assert_eq!((accuracy.things[0], accuracy.things[2]), ([1, 1], [1, 0]));
        assert_eq!((accuracy.recall(), accuracy.precision()), (0.5, 2.0 / 3.0));
        assert_eq!(around(0).collect::<Vec<_>>(), [0, 1, 40, 41]);
    }
}
