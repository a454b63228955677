//! Everything that batches are made of: items, feature maps, what networks are conditioned on, and the pool of pairs to chain.

use std::collections::HashMap;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use tch::{Device, Kind, Tensor};

use crate::data::features::Features;
use crate::data::items::{Item, Items};

/// Embeds texts as [texts, width].
pub(crate) type TextEmbedder<'a> = dyn Fn(&[&str]) -> anyhow::Result<Tensor> + Sync + 'a;

/// Everything that batches are made of.
pub struct TrainingData<'a> {
    /// Spans to sample from, and the label of each frame.
    pub items: &'a Items,
    /// The feature map of each frame.
    pub feature_maps: FeatureMaps<'a>,
    /// What networks are conditioned on.
    pub conditioning: ConditioningTable,
    /// Pairs of texts to chain, where they are drawn beforehand.
    pub pool: Option<ChainingPool>,
    /// Embeds texts that are joined while training, [texts, width].
    pub embed: &'a TextEmbedder<'a>,
}

/// Feature maps, in memory or, where it computes elsewhere, on the device.
pub enum FeatureMaps<'a> {
    /// In this machine's memory.
    Memory(&'a Features),
    /// [frames, numbers], 16-bit floats.
    Device(Tensor),
}

impl<'a> FeatureMaps<'a> {
    /// Keeps the maps where `device` reads them best: on a device with memory of its own they are copied there if they fit.
    pub fn on(features: &'a Features, device: Device) -> FeatureMaps<'a> {
        if device == Device::Cpu || features.is_empty() {
            return FeatureMaps::Memory(features);
        }
        match copy_to(features, device) {
            Ok(maps) => FeatureMaps::Device(maps),
            Err(error) => {
                tracing::warn!("the features stay in memory: {error:#}");
                FeatureMaps::Memory(features)
            }
        }
    }

    /// The maps of frames [frames, numbers] on `device`, 16-bit floats.
    ///
    /// # Errors
    /// When a map cannot be read, or the device's memory is full.
    pub(crate) fn gather(&self, frames: impl Iterator<Item = usize>, device: Device) -> anyhow::Result<Tensor> {
        match self {
            FeatureMaps::Memory(features) => {
                let (frames, width): (Vec<usize>, _) = (frames.collect(), features.width());
                // Reserved at once: a batch is several megabytes.
                let mut bytes = Vec::with_capacity(frames.len() * width);
                features.gather_all(frames.into_iter(), &mut bytes)?;
                let rows = (bytes.len() / width.max(1)) as i64;
                Ok(Tensor::f_from_data_size(&bytes, &[rows, width as i64 / 2], Kind::Half)?.to_device(device))
            }
            FeatureMaps::Device(maps) => {
                let rows: Vec<i64> = frames.map(|frame| frame as i64).collect();
                Ok(maps.index_select(0, &Tensor::from_slice(&rows).to_device(maps.device())))
            }
        }
    }
}

/// EmbeddingTable that are copied to a device at once.
const ROWS_PER_COPY: usize = 4096;

fn copy_to(features: &Features, device: Device) -> anyhow::Result<Tensor> {
    let mut bytes = Vec::new();
    let width = features.width() as i64 / 2;
    let maps = Tensor::f_empty([features.len() as i64, width], (Kind::Half, device))?;
    for first in (0..features.len()).step_by(ROWS_PER_COPY) {
        bytes.clear();
        let last = (first + ROWS_PER_COPY).min(features.len());
        features.gather_run(first..last, &mut bytes)?;
        let rows = (last - first) as i64;
        let chunk = Tensor::f_from_data_size(&bytes, &[rows, width], Kind::Half)?;
        maps.narrow(0, first as i64, rows).f_copy_(&chunk)?;
    }
    Ok(maps)
}

/// EmbeddingTable of numbers, such as embeddings.
pub struct EmbeddingTable {
    numbers: Vec<f32>,
    width: usize,
    /// The same on the device, where that is not the CPU.
    on_device: Option<Tensor>,
}

impl EmbeddingTable {
    /// Of a tensor [rows, width], to be read on `device`.
    ///
    /// # Errors
    /// When the tensor is no matrix of numbers.
    pub fn new(tensor: &Tensor, device: Device) -> anyhow::Result<EmbeddingTable> {
        let (_, width) = tensor.size2()?;
        let numbers = Vec::<f32>::try_from(tensor.to_device(Device::Cpu).to_kind(Kind::Float).flatten(0, -1))?;
        let on_device = (device != Device::Cpu).then(|| tensor.to_device(device));
        Ok(EmbeddingTable { numbers, width: width as usize, on_device })
    }

    /// The embeddings of some rows, [n, width].
    ///
    /// # Errors
    /// When there is no such row.
    pub(crate) fn rows(&self, rows: impl Iterator<Item = usize>, device: Device) -> anyhow::Result<Tensor> {
        if let Some(on_device) = &self.on_device {
            let rows: Vec<i64> = rows.map(|row| row as i64).collect();
            return Ok(on_device.f_index_select(0, &Tensor::from_slice(&rows).to_device(on_device.device()))?);
        }
        let mut numbers: Vec<f32> = Vec::new();
        for row in rows {
            let numbers_of = self.numbers.get(row * self.width..(row + 1) * self.width);
            numbers.extend(numbers_of.ok_or_else(|| anyhow::anyhow!("there is no row {row}"))?);
        }
        let width = self.width as i64;
        Ok(Tensor::from_slice(&numbers).view([-1, width]).to_device(device))
    }
}

/// What policy and critic are conditioned on, by text.
pub enum ConditioningTable {
    /// A row a text: its sentence's embedding.
    SentenceEmbeddings(EmbeddingTable),
    /// The words of a text, by their numbers.
    TokenIds(Vec<Vec<i64>>),
    /// The frames of a state to reach anywhere in the trajectory.
    Goals,
}

/// Pairs of texts to chain, drawn once, with their joint sentences' embeddings.
pub struct ChainingPool {
    /// The numbers of A's and B's text.
    pub(crate) pairs: Vec<(u32, u32)>,
    /// The embedding of "A. B." of each pair.
    pub(crate) joint: EmbeddingTable,
    /// The training spans under each text, by their numbers.
    spans_by_text: HashMap<u32, Vec<u32>>,
}

impl ChainingPool {
    /// So many pairs, texts as often as items bear them; drawn by the seed alone.
    pub fn draw(items: &Items, seed: u64, count: usize) -> Vec<(u32, u32)> {
        let drawn = items.draw(&items.training, seed, u64::MAX / 3, 2 * count);
        drawn.chunks_exact(2).map(|pair| (pair[0].text, pair[1].text)).collect()
    }

    /// A pool of pairs and their joint sentences' embeddings [pairs, width].
    ///
    /// # Errors
    /// When there are no pairs.
    pub fn new(items: &Items, pairs: Vec<(u32, u32)>, joint: &Tensor, device: Device) -> anyhow::Result<ChainingPool> {
        anyhow::ensure!(!pairs.is_empty(), "there are no pairs of texts to chain");
        let mut spans_by_text: HashMap<u32, Vec<u32>> = HashMap::new();
        for (number, span) in items.training.iter().enumerate() {
            spans_by_text.entry(span.text).or_default().push(number as u32);
        }
        Ok(ChainingPool { pairs, joint: EmbeddingTable::new(joint, device)?, spans_by_text })
    }

    /// An item of a span that bears `text`.
    pub(crate) fn item(&self, items: &Items, text: u32, rng: &mut ChaCha8Rng) -> Item {
        let spans_by_text = &self.spans_by_text[&text];
        items.step_of(&items.training[spans_by_text[rng.random_range(0..spans_by_text.len())] as usize], rng)
    }
}

/// The text "A. B." of a pair.
pub fn joint_text(items: &Items, (first, second): (u32, u32)) -> String {
    format!("{} {}", items.texts[first as usize], items.texts[second as usize])
}

impl TrainingData<'_> {
    /// "A. B." of pairs of items, embedded now and not kept: [pairs, width].
    ///
    /// # Errors
    /// When the encoder fails.
    pub(crate) fn embed_joint(&self, first: &[Item], second: &[Item]) -> anyhow::Result<Tensor> {
        let texts: Vec<String> =
            first.iter().zip(second).map(|(a, b)| joint_text(self.items, (a.text, b.text))).collect();
        let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
        (self.embed)(&texts)
    }
}
