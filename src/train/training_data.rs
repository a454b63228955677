//! Everything that batches are made of: items, feature maps, what networks are conditioned on, and the pool of pairs to chain.

use tch::{Device, Kind, Tensor};

use super::chaining_pool::ChainingPool;
use super::embedding_table::EmbeddingTable;
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
    /// Pairs to chain, where they are drawn beforehand.
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

/// Maps that are copied to a device at once.
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

/// What policy and critic are conditioned on, by text.
pub enum ConditioningTable {
    /// A row a text: its sentence's embedding.
    SentenceEmbeddings(EmbeddingTable),
    /// The words of a text, by their numbers.
    TokenIds(Vec<Vec<i64>>),
    /// The frames of a state to reach anywhere in the trajectory.
    Goals,
}

impl TrainingData<'_> {
    /// "A. B." of pairs of items, embedded now and not kept: [pairs, width].
    ///
    /// # Errors
    /// When the encoder fails.
    pub(crate) fn embed_joint(&self, first: &[Item], second: &[Item]) -> anyhow::Result<Tensor> {
        let texts: Vec<String> = first.iter().zip(second).map(|(a, b)| self.items.joint_text(a.text, b.text)).collect();
        let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
        (self.embed)(&texts)
    }
}
