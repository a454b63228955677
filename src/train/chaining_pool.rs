//! Pairs of spans to chain that are drawn before the training, with the embeddings of their joint sentences.

use std::collections::HashMap;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tch::{Device, Tensor};

use super::embedding_table::EmbeddingTable;
use super::frame_store::FrameStore;
use crate::data::items::{Item, Items};
use crate::domain::Class;

/// Mixed into the seed: pairs of a pool are drawn from a random stream of their own.
const POOL: u64 = 0x9001;

/// One of the two that are chained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairEnd {
    /// A span of [`Items::training`], by its number.
    Span(u32),
    /// Any of the spans that bear a text, by the text's number.
    Text(u32),
}

/// A, and B that is to follow.
pub type Pair = (PairEnd, PairEnd);

/// What says whether a span can follow from the end of another: where they were demonstrated, and what was in the hand.
pub struct Compatibility {
    /// The floor plan of each trajectory, by a number.
    places: Vec<u32>,
    /// The class in the hand at each frame.
    held: Vec<Option<Class>>,
}

impl Compatibility {
    /// Of the demonstrations of a training.
    ///
    /// # Errors
    /// Never for a store that was opened.
    pub(crate) fn of(frames: &FrameStore) -> anyhow::Result<Compatibility> {
        let mut numbers = HashMap::new();
        let places = frames.trajectories.iter().map(|trajectory| {
            let next = numbers.len() as u32;
            *numbers.entry(format!("{:?}", trajectory.scene)).or_insert(next)
        });
        Ok(Compatibility { places: places.collect(), held: frames.held()? })
    }

    /// The place in which a span was demonstrated, with what was in the hand at a frame.
    fn situation(&self, trajectory: u32, frame: u32) -> (u32, Option<Class>) {
        (self.places[trajectory as usize], self.held[frame as usize])
    }
}

/// Pairs to chain.
pub struct ChainingPool {
    pub(crate) pairs: Vec<Pair>,
    /// The embedding of "A. B." of each pair.
    pub(crate) joint: EmbeddingTable,
    /// The training spans under each text, by their numbers.
    spans_by_text: HashMap<u32, Vec<u32>>,
}

impl ChainingPool {
    /// So many pairs, drawn by the seed alone. Of `feasible` the share is of spans from one floor plan where A ends with in the hand
    /// what B began with; the others are of any texts, as often as items bear them.
    pub fn draw(items: &Items, seed: u64, count: usize, feasible: Option<(f64, &Compatibility)>) -> Vec<Pair> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ POOL);
        let spans = &items.training;
        let mut pairs = Vec::with_capacity(count);
        if let Some((share, compatibility)) = feasible {
            let mut beginning: HashMap<(u32, Option<Class>), Vec<u32>> = HashMap::new();
            for (number, span) in (0..).zip(spans) {
                beginning.entry(compatibility.situation(span.trajectory, span.start)).or_default().push(number);
            }
            let wanted = (share * count as f64).round() as usize;
            // Some ends have nothing that follows.
            for _ in 0..20 * wanted {
                if pairs.len() == wanted || spans.is_empty() {
                    break;
                }
                let first = rng.random_range(0..spans.len());
                let end = compatibility.situation(spans[first].trajectory, spans[first].end);
                let Some(following) = beginning.get(&end) else { continue };
                let second = following[rng.random_range(0..following.len())];
                if spans[second as usize].trajectory != spans[first].trajectory {
                    pairs.push((PairEnd::Span(first as u32), PairEnd::Span(second)));
                }
            }
        }
        let drawn = items.draw(spans, seed, u64::MAX / 3, 2 * (count - pairs.len()));
        pairs.extend(drawn.chunks_exact(2).map(|pair| (PairEnd::Text(pair[0].text), PairEnd::Text(pair[1].text))));
        pairs
    }

    /// The text "A. B." of a pair.
    pub fn joint_text(items: &Items, (first, second): Pair) -> String {
        let text = |end: PairEnd| match end {
            PairEnd::Span(span) => items.training[span as usize].text,
            PairEnd::Text(text) => text,
        };
        items.joint_text(text(first), text(second))
    }

    /// A pool of pairs and their joint sentences' embeddings [pairs, width].
    ///
    /// # Errors
    /// When there are no pairs.
    pub fn new(items: &Items, pairs: Vec<Pair>, joint: &Tensor, device: Device) -> anyhow::Result<ChainingPool> {
        anyhow::ensure!(!pairs.is_empty(), "there are no pairs to chain");
        let mut spans_by_text: HashMap<u32, Vec<u32>> = HashMap::new();
        for (number, span) in (0..).zip(&items.training) {
            spans_by_text.entry(span.text).or_default().push(number);
        }
        Ok(ChainingPool { pairs, joint: EmbeddingTable::new(joint, device)?, spans_by_text })
    }

    /// An item of one of a pair.
    pub(crate) fn item(&self, items: &Items, end: PairEnd, rng: &mut ChaCha8Rng) -> Item {
        let span = match end {
            PairEnd::Span(span) => span,
            PairEnd::Text(text) => {
                let spans = &self.spans_by_text[&text];
                spans[rng.random_range(0..spans.len())]
            }
        };
        items.step_of(&items.training[span as usize], rng)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::items::{ActionLabel, Span};

    #[test]
    fn the_share_of_feasible_pairs_is_of_one_floor_plan_with_a_fitting_hand() {
        let mug = Class::named("Mug");
        // Four trajectories of three frames, two a floor plan: take a mug, then put it down.
        let compatibility = Compatibility { places: vec![0, 0, 1, 1], held: [None, mug, None].repeat(4) };
        let span = |trajectory: u32, skill: u32| Span {
            trajectory,
            skills: skill as u8..skill as u8 + 1,
            first: 3 * trajectory,
            start: 3 * trajectory + skill,
            end: 3 * trajectory + skill + 1,
            text: 0,
        };
        let training: Vec<Span> = (0..4).flat_map(|trajectory| [span(trajectory, 0), span(trajectory, 1)]).collect();
        let labels = vec![Some(ActionLabel { action: 0, object: 0, executed: true }); 12];
        let items = Items { training, labels, ..Items::default() };
        let fits = |&(first, second): &Pair| {
            let (PairEnd::Span(first), PairEnd::Span(second)) = (first, second) else { return false };
            let (a, b) = (&items.training[first as usize], &items.training[second as usize]);
            let place = |span: &Span| compatibility.places[span.trajectory as usize];
            let hand = |frame: u32| compatibility.held[frame as usize];
            place(a) == place(b) && a.trajectory != b.trajectory && hand(a.end) == hand(b.start)
        };
        let pairs = ChainingPool::draw(&items, 1, 400, Some((0.5, &compatibility)));
        assert_eq!(pairs.len(), 400);
        assert!(pairs[..200].iter().all(fits));
        assert!(pairs[200..].iter().all(|pair| matches!(pair, (PairEnd::Text(_), PairEnd::Text(_)))));
        assert_eq!(ChainingPool::draw(&items, 1, 400, Some((0.5, &compatibility))), pairs);
        let any = ChainingPool::draw(&items, 1, 400, None);
        assert!(any.len() == 400 && !any.iter().any(fits), "of texts alone");
    }
}
