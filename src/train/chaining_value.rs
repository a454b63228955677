//! Whether a critic's reward for chaining says anything: V of the state in which one skill ends, for the instruction of another,
//! where that one can follow from there and where it cannot.

use std::collections::HashMap;

use anyhow::{Context, ensure};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use tch::{Kind, Tensor};

use super::frame_store::FrameStore;
use crate::agent::checkpoint::Networks;
use crate::agent::config::CheckpointConfig;
use crate::agent::frame_history::SharedEmbedder;
use crate::data::items::{Items, Span};
use crate::domain::Class;
use crate::house::House;
use crate::house::render::Renderer;
use crate::nets::shared_rows::SharedRows;

/// How B relates to the state that A ends in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Relation {
    /// It is what the demonstration did next.
    Next,
    /// It was demonstrated in the same floor plan, with the same class of thing in the hand, or nothing.
    Feasible,
    /// It was demonstrated in the same floor plan, with something else in the hand.
    OtherHand,
    /// It was demonstrated in another floor plan, with the same class of thing in the hand.
    OtherPlace,
}

impl Relation {
    pub(crate) const ALL: [Relation; 4] =
        [Relation::Next, Relation::Feasible, Relation::OtherHand, Relation::OtherPlace];

    /// For a person.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Relation::Next => "what was demonstrated next",
            Relation::Feasible => "feasible: same floor plan, same hand",
            Relation::OtherHand => "same floor plan, another hand",
            Relation::OtherPlace => "another floor plan, same hand",
        }
    }
}

/// V of pairs of one relation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct RelationValues {
    pub(crate) relation: Relation,
    pub(crate) pairs: usize,
    /// The mean of V, each clipped to what a reward may be.
    pub(crate) mean: f64,
    /// The share of feasible pairs of higher value than one of these, ties half: 0.5 is chance.
    pub(crate) auc: f64,
    /// The 95 % interval of the AUC (Hanley and McNeil, 1982).
    pub(crate) interval: [f64; 2],
}

/// A pair: the span that ends, and the span whose instruction is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pair {
    first: usize,
    second: usize,
}

/// Draws up to `count` pairs of each relation, by the seed alone.
fn draw(frames: &FrameStore, spans: &[Span], held: &[Option<Class>], count: usize, seed: u64) -> Vec<(Relation, Pair)> {
    let scene = |span: &Span| format!("{:?}", frames.trajectories[span.trajectory as usize].scene);
    let (scenes, hands): (Vec<String>, Vec<Option<Class>>) =
        spans.iter().map(|span| (scene(span), held[span.start as usize])).unzip();
    let mut by_place: HashMap<&str, Vec<usize>> = HashMap::new();
    let mut by_hand: HashMap<Option<Class>, Vec<usize>> = HashMap::new();
    let mut by_start: HashMap<u32, Vec<usize>> = HashMap::new();
    for (number, span) in spans.iter().enumerate() {
        by_place.entry(&scenes[number]).or_default().push(number);
        by_hand.entry(hands[number]).or_default().push(number);
        by_start.entry(span.start).or_default().push(number);
    }
    let none = Vec::new();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut pairs = Vec::new();
    for relation in Relation::ALL {
        let mut found = 0;
        // Where a relation is rare, some first spans have nothing that would fit.
        for _ in 0..20 * count {
            if found == count || spans.is_empty() {
                break;
            }
            let first = rng.random_range(0..spans.len());
            let (place, hand) = (&scenes[first], held[spans[first].end as usize]);
            let among = match relation {
                Relation::Next => by_start.get(&spans[first].end),
                Relation::Feasible | Relation::OtherHand => by_place.get(place.as_str()),
                Relation::OtherPlace => by_hand.get(&hand),
            };
            let among = among.unwrap_or(&none);
            let fits = |&second: &usize| {
                let other =
                    spans[second].trajectory != spans[first].trajectory && spans[second].text != spans[first].text;
                match relation {
                    Relation::Next => true,
                    Relation::Feasible => other && hands[second] == hand,
                    Relation::OtherHand => other && hands[second] != hand,
                    Relation::OtherPlace => other && scenes[second] != *place,
                }
            };
            let drawn = (0..50).filter(|_| !among.is_empty()).map(|_| among[rng.random_range(0..among.len())]);
            if let Some(second) = drawn.collect::<Vec<_>>().into_iter().find(fits) {
                pairs.push((relation, Pair { first, second }));
                found += 1;
            }
        }
    }
    pairs
}

/// An agent with a critic, and what it reads through.
pub(crate) struct Judge<'a> {
    pub(crate) config: &'a CheckpointConfig,
    pub(crate) networks: &'a Networks,
    pub(crate) sentences: &'a SharedEmbedder,
}

/// Pairs whose values are computed together.
const TOGETHER: usize = 64;

impl Judge<'_> {
    /// V of the state that each pair's first span ends in, for the instruction of its second.
    fn values(&self, frames: &FrameStore, items: &Items, spans: &[Span], pairs: &[Pair]) -> anyhow::Result<Vec<f64>> {
        let critic = self.networks.critic.as_ref().context("the checkpoint has no critic: there is no V to measure")?;
        let encoder = self.networks.visual_encoder.frozen()?;
        let history = self.config.policy.history as usize;
        let mut renderer = Renderer::new(House::FRAME);
        let mut values = Vec::new();
        for chunk in pairs.chunks(TOGETHER) {
            let mut maps = Vec::new();
            for pair in chunk {
                let span = &spans[pair.first];
                let (first, last) = (span.first as usize, span.end as usize);
                let wanted = (0..history).map(|back| (last - back.min(last - first)).max(first)).rev();
                let mut images = Vec::new();
                for frame in wanted {
                    let (scene, world) = frames.state(frame)?;
                    images.push(encoder.image(renderer.draw(scene, &world)));
                }
                maps.push(encoder.encode(&images).flatten(0, 1));
            }
            let observations = SharedRows::from(Tensor::stack(&maps, 0).to_kind(Kind::Float));
            let texts: Vec<&str> =
                chunk.iter().map(|pair| items.texts[spans[pair.second].text as usize].as_str()).collect();
            let mut embedder =
                self.sentences.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))?;
            let conditioning = embedder.embed(&texts)?.to_kind(Kind::Float).to_device(observations.distinct.device());
            let found = critic.online.value(&observations, &conditioning.into()).to_kind(Kind::Double);
            values.extend(Vec::<f64>::try_from(found.to_device(tch::Device::Cpu))?);
        }
        Ok(values)
    }

    /// Measures up to `count` pairs of each relation of the spans to learn from; against the feasible ones.
    ///
    /// # Errors
    /// When the checkpoint has no critic, or there is no feasible pair.
    pub(crate) fn measure(
        &self,
        frames: &FrameStore,
        items: &Items,
        spans: &[Span],
        (count, seed): (usize, u64),
    ) -> anyhow::Result<Vec<RelationValues>> {
        let drawn = draw(frames, spans, &frames.held()?, count, seed);
        let pairs: Vec<Pair> = drawn.iter().map(|(_, pair)| *pair).collect();
        let values = self.values(frames, items, spans, &pairs)?;
        let of = |relation: Relation| -> Vec<f64> {
            drawn.iter().zip(&values).filter(|((one, _), _)| *one == relation).map(|(_, value)| *value).collect()
        };
        let feasible = of(Relation::Feasible);
        ensure!(!feasible.is_empty(), "no skill of the data can follow another's end: there is nothing to measure");
        let measured = |relation: Relation| {
            let values = of(relation);
            (!values.is_empty()).then(|| RelationValues {
                relation,
                pairs: values.len(),
                mean: values.iter().map(|value| value.clamp(0.0, 1.0)).sum::<f64>() / values.len() as f64,
                auc: auc(&feasible, &values),
                interval: interval(auc(&feasible, &values), feasible.len(), values.len()),
            })
        };
        Ok(Relation::ALL.into_iter().filter_map(measured).collect())
    }
}

/// How often one of `high` is above one of `low`, ties half.
fn auc(high: &[f64], low: &[f64]) -> f64 {
    let mut sorted = low.to_vec();
    sorted.sort_by(f64::total_cmp);
    let wins = |value: &f64| {
        let below = sorted.partition_point(|other| other < value);
        let up_to = sorted.partition_point(|other| other <= value);
        (below + up_to) as f64 / 2.0
    };
    high.iter().map(wins).sum::<f64>() / (high.len() * low.len()) as f64
}

/// The 95 % interval of an AUC of so many values of either kind (Hanley and McNeil, 1982).
fn interval(auc: f64, high: usize, low: usize) -> [f64; 2] {
    let (q1, q2) = (auc / (2.0 - auc), 2.0 * auc * auc / (1.0 + auc));
    let (high, low) = (high as f64, low as f64);
    let variance =
        (auc * (1.0 - auc) + (high - 1.0) * (q1 - auc * auc) + (low - 1.0) * (q2 - auc * auc)) / (high * low);
    let half = 1.96 * variance.max(0.0).sqrt();
    [(auc - half).max(0.0), (auc + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::visual::testing::frame_store;

    #[test]
    fn an_auc_counts_how_often_the_one_is_higher() {
        assert_eq!(auc(&[3.0, 2.0], &[1.0, 0.0]), 1.0);
        assert_eq!(auc(&[0.0], &[1.0, 2.0]), 0.0);
        assert_eq!(auc(&[1.0, 1.0], &[1.0]), 0.5);
        assert_eq!(auc(&[1.0, 3.0], &[2.0]), 0.5);
        let [low, high] = interval(0.8, 200, 200);
        assert!(0.75 < low && low < 0.8 && 0.8 < high && high < 0.85, "{low} to {high}");
    }

    #[test]
    fn pairs_are_of_the_relation_that_they_are_drawn_for() {
        let frames = frame_store();
        // Two demonstrations in one kitchen, of two skills each; the hand is made up: full between the skills of both.
        let length = frames.trajectories[0].actions.len() as u32;
        let span = |trajectory: u32, skill: u8, text: u32| {
            let first = trajectory * (length + 1);
            let (start, end) = if skill == 0 { (first, first + 1) } else { (first + 1, first + 2) };
            Span { trajectory, skills: skill..skill + 1, first, start, end, text }
        };
        let spans = [span(0, 0, 0), span(0, 1, 1), span(1, 0, 2), span(1, 1, 3)];
        let mut held = vec![None; frames.frames()];
        for trajectory in 0..2 {
            held[(trajectory * (length + 1) + 1) as usize] = Class::named("Mug");
        }
        let pairs = draw(&frames, &spans, &held, 8, 1);
        let of = |relation| -> Vec<Pair> {
            pairs.iter().filter(|(one, _)| *one == relation).map(|(_, pair)| *pair).collect()
        };
        assert!(of(Relation::Next).iter().all(|pair| [(0, 1), (2, 3)].contains(&(pair.first, pair.second))));
        assert!(!of(Relation::Feasible).is_empty());
        for pair in of(Relation::Feasible) {
            assert!(spans[pair.first].trajectory != spans[pair.second].trajectory);
            assert_eq!(held[spans[pair.first].end as usize], held[spans[pair.second].start as usize]);
        }
        for pair in of(Relation::OtherHand) {
            assert!(held[spans[pair.first].end as usize] != held[spans[pair.second].start as usize]);
        }
        assert!(of(Relation::OtherPlace).is_empty(), "there is one kitchen");
        assert_eq!(pairs, draw(&frames, &spans, &held, 8, 1));
    }
}
