//! Batches: sampled items as tensors. What is sampled is a function of the seed and the step alone.

use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tch::{Device, Kind, Tensor};

use super::chaining_pool::PairEnd;
use super::training_data::{ConditioningTable, TrainingData};
use crate::algo::batch::{Batch, ChainedPairs, Transitions};
use crate::algo::chain::{Chaining, cut_chance};
use crate::data::items::{Item, Span};
use crate::nets::shared_rows::SharedRows;
use crate::nets::visual::SIDE;

/// Mixed into the seed: pairs are drawn from another random stream than items.
const CHAINING: u64 = 0x63a1;
/// The same for goals.
const GOALS: u64 = 0x90a1;

/// Samples the batches of one training, on a thread of its own ahead of the updates.
pub struct BatchSampler<'a> {
    data: TrainingData<'a>,
    /// Frames in an observation.
    history: u32,
    /// Whether the next observation is gathered too, which critics alone need.
    with_next: bool,
    chaining: Option<&'a Chaining>,
    seed: u64,
    size: usize,
    device: Device,
}

impl<'a> BatchSampler<'a> {
    /// Samples batches of `size` items for networks that see `history` frames on `device`; a critic needs them `with_next`.
    pub fn new(
        data: TrainingData<'a>,
        history: i64,
        with_next: bool,
        chaining: Option<&'a Chaining>,
        (seed, size): (u64, usize),
        device: Device,
    ) -> BatchSampler<'a> {
        BatchSampler { data, history: history as u32, with_next, chaining, seed, size, device }
    }

    /// The batch of a step: `size` base items and, where skills are chained, pairs of them.
    ///
    /// # Errors
    /// When a frame has no label, or a sentence cannot be embedded.
    pub fn at(&self, step: u64) -> anyhow::Result<Batch> {
        let items = self.draw(&self.data.items.training, step, self.size);
        self.part(&items, (0, 1), step)
    }

    /// The same items in so many parts, each with pairs of its own.
    ///
    /// # Errors
    /// As [`at`](BatchSampler::at).
    pub(crate) fn in_parts(&self, step: u64, parts: usize) -> anyhow::Result<Vec<Batch>> {
        let items = self.draw(&self.data.items.training, step, self.size);
        let of_part = items.chunks(self.size.div_ceil(parts.max(1)));
        of_part.enumerate().map(|(number, items)| self.part(items, (number, parts.max(1)), step)).collect()
    }

    fn part(&self, items: &[Item], part: (usize, usize), step: u64) -> anyhow::Result<Batch> {
        let base = self.base(items)?;
        let pairs = self.chaining.map(|chaining| self.pairs(chaining, (items, &base), part, step)).transpose()?;
        Ok(Batch { base, pairs })
    }

    /// Items of some spans; with goals, each ends at a random later frame of its trajectory.
    fn draw(&self, spans: &[Span], step: u64, size: usize) -> Vec<Item> {
        let mut items = self.data.items.draw(spans, self.seed, step, size);
        if let ConditioningTable::Goals = self.data.conditioning {
            let mut rng = self.random_stream(GOALS, step);
            for item in &mut items {
                item.end = rng.random_range(self.data.items.goals(item));
            }
        }
        items
    }

    /// Transitions of items, each conditioned on its own text or goal.
    fn base(&self, items: &[Item]) -> anyhow::Result<Transitions> {
        self.transitions(items, self.conditioning(items)?.into())
    }

    /// The same items of held-out spans every time, in chunks.
    ///
    /// # Errors
    /// When a frame has no label.
    pub(crate) fn held_out(&self, spans: &[Span], count: usize, chunk: usize) -> anyhow::Result<Vec<Transitions>> {
        let items = self.draw(spans, u64::MAX / 2, count);
        items.chunks(chunk).map(|items| self.base(items)).collect()
    }

    fn random_stream(&self, purpose: u64, step: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ purpose);
        rng.set_stream(step.wrapping_add(1));
        rng
    }

    /// Pairs (A, B): from the batch by a permutation, or from the pool. Those from the batch share its observations.
    fn pairs(
        &self,
        chaining: &Chaining,
        (items, base): (&[Item], &Transitions),
        (part, parts): (usize, usize),
        step: u64,
    ) -> anyhow::Result<ChainedPairs> {
        let mut rng = self.random_stream(CHAINING ^ ((part as u64) << 32), step);
        let count = chaining.batch_size.div_ceil(parts);
        let mut permuted = None;
        let (first, second, joint) = match &self.data.pool {
            Some(pool) => {
                let drawn: Vec<usize> = (0..count).map(|_| rng.random_range(0..pool.pairs.len())).collect();
                let mut of = |end: PairEnd| pool.item(self.data.items, end, &mut rng);
                let first: Vec<Item> = drawn.iter().map(|&pair| of(pool.pairs[pair].0)).collect();
                let second: Vec<Item> = drawn.iter().map(|&pair| of(pool.pairs[pair].1)).collect();
                (first, second, pool.joint.rows(drawn.into_iter(), self.device)?)
            }
            None => {
                let mut order: Vec<usize> = (0..items.len()).collect();
                order.shuffle(&mut rng);
                let first = items[..count.min(items.len())].to_vec();
                let second: Vec<Item> = order[..first.len()].iter().map(|&i| items[i]).collect();
                let joint = match chaining.aggregate_weight > 0.0 {
                    true => self.data.embed_joint(&first, &second)?.to_device(self.device),
                    false => Tensor::from(0.0),
                };
                let rows: Vec<i64> = order[..first.len()].iter().map(|&i| i as i64).collect();
                permuted = Some(Tensor::from_slice(&rows).to_device(self.device));
                (first, second, joint)
            }
        };
        let cut: Vec<f32> = first.iter().map(|item| flag(rng.random_bool(cut_chance(item.end - item.frame)))).collect();
        let with_joint = chaining.aggregate_weight > 0.0;
        let under_joint = joint.shallow_clone();
        let (of_base, first, second) = match permuted {
            Some(rows) => {
                let count = Tensor::arange(rows.size()[0], (Kind::Int64, self.device));
                let first = base.picked(&count, base.conditioning.picked(&rows));
                (true, first, with_joint.then(|| base.picked(&rows, joint.into())))
            }
            None => {
                let under_second = self.transitions(&first, self.conditioning(&second)?.into())?;
                (false, under_second, with_joint.then(|| self.transitions(&second, joint.into())).transpose()?)
            }
        };
        let joint = second.map(|second| (under_joint.into(), second));
        Ok(ChainedPairs { of_base, first, cut: Tensor::from_slice(&cut).to_device(self.device), joint })
    }

    /// What networks are conditioned on for these items: embeddings [n, width], token ids [n, longest], or goal observations.
    fn conditioning(&self, items: &[Item]) -> anyhow::Result<Tensor> {
        match &self.data.conditioning {
            ConditioningTable::SentenceEmbeddings(rows) => {
                rows.rows(items.iter().map(|item| item.text as usize), self.device)
            }
            ConditioningTable::TokenIds(texts) => {
                let texts: Vec<&[i64]> =
                    items.iter().map(|item| texts.get(item.text as usize).map_or(&[][..], Vec::as_slice)).collect();
                let longest = texts.iter().map(|text| text.len()).max().unwrap_or(0);
                let padded = |text: &&[i64]| {
                    text.iter().copied().chain(std::iter::repeat(0)).take(longest).collect::<Vec<i64>>()
                };
                let numbers: Vec<i64> = texts.iter().flat_map(padded).collect();
                Ok(Tensor::from_slice(&numbers).view([items.len() as i64, longest as i64]).to_device(self.device))
            }
            ConditioningTable::Goals => {
                let at_goal = |item: &Item| Item { frame: item.end, ..*item };
                let goals: Vec<Item> = items.iter().map(at_goal).collect();
                let maps = self
                    .data
                    .feature_maps
                    .gather(goals.iter().flat_map(|goal| goal.stack(self.history)), self.device)?;
                Ok(maps.view([items.len() as i64, -1, SIDE, SIDE]).to_kind(Kind::Float))
            }
        }
    }

    fn transitions(&self, items: &[Item], conditioning: SharedRows) -> anyhow::Result<Transitions> {
        let n = items.len() as i64;
        let (mut actions, mut objects, mut executed) = (Vec::new(), Vec::new(), Vec::new());
        let object_target: Vec<i64> = items.iter().map(|item| i64::from(self.data.items.object_target(item))).collect();
        for item in items {
            let label = self.data.items.labels.get(item.frame as usize).copied().flatten();
            let label = label.ok_or_else(|| anyhow::anyhow!("frame {} has no label", item.frame))?;
            actions.push(i64::from(label.action));
            objects.push(i64::from(label.object));
            executed.push(flag(label.executed));
        }
        let terminal: Vec<f32> = items.iter().map(|item| flag(item.is_last())).collect();
        let ended = crate::algo::chain::RewardDone::of_skill(&Tensor::from_slice(&terminal).to_device(self.device));
        // Both observations share all frames but two, which are gathered once.
        let last = u32::from(self.with_next);
        let stack = |item: &Item| Item { frame: item.frame + last, ..*item }.stack(self.history + last);
        let maps = self.data.feature_maps.gather(items.iter().flat_map(stack), self.device)?;
        let maps = maps.view([n, i64::from(self.history + last), -1, SIDE, SIDE]);
        let seen = |from: i64| maps.narrow(1, from, i64::from(self.history));
        Ok(Transitions {
            observation: seen(0),
            next: self.with_next.then(|| seen(1)),
            rows: None,
            conditioning,
            actions: Tensor::from_slice(&actions).to_device(self.device),
            objects: Tensor::from_slice(&objects).to_device(self.device),
            object_target: Tensor::from_slice(&object_target).to_device(self.device),
            reward: ended.reward,
            terminal: ended.terminal,
            executed: Tensor::from_slice(&executed).to_device(self.device),
        })
    }
}

fn flag(set: bool) -> f32 {
    f32::from(u8::from(set))
}
