//! How long an update takes, and its batch to gather. Maps and texts are random: they cost what real ones cost.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use tch::{Device, Kind, Tensor};

use super::batch_sampler::BatchSampler;
use super::chaining_pool::ChainingPool;
use super::embedding_table::EmbeddingTable;
use super::preset::Preset;
use super::trainer::Trainer;
use super::training_data::{ConditioningTable, FeatureMaps, TrainingData};
use super::training_state::TrainingState;
use crate::agent::checkpoint::Networks;
use crate::algo::chain::PairSource;
use crate::data::features::{FeatureHeader, FeatureWriter, Features};
use crate::data::items::{ActionLabel, Items, Span};
use crate::data::selection::{HistoryStart, ObjectTarget};
use crate::nets::visual_encoder::VisualEncoder;

const FRAMES: u32 = 6000;
/// Frames of a span, and of a trajectory of three.
const SPAN: u32 = 15;
const TEXTS: u32 = 200;
const WARM: u64 = 3;

/// Times of an update and of gathering its batch.
#[derive(Clone, Copy, Debug)]
pub struct UpdateTiming {
    /// The median, and the least.
    pub update: Duration,
    /// The same: the least.
    pub least_update: Duration,
    /// The median.
    pub gathering: Duration,
    /// The least.
    pub least_gathering: Duration,
}

/// A preset past the warm-up of its critic, in which the policy has less to compute.
pub fn warm(mut preset: Preset) -> Preset {
    if let Some(iql) = &mut preset.iql {
        iql.cloning_fraction = 0.0;
    }
    preset
}

/// Times `steps` updates with a preset in its own size.
///
/// # Errors
/// When an update fails.
pub fn measure(preset: &Preset, device: Device, steps: u64) -> anyhow::Result<UpdateTiming> {
    let (features, items) = (features(preset)?, items());
    let width = preset.policy.embedding;
    let embed = |texts: &[&str]| -> anyhow::Result<Tensor> {
        Ok(Tensor::randn([texts.len() as i64, width], (Kind::Float, Device::Cpu)) / (width as f64).sqrt())
    };
    let texts: Vec<&str> = items.texts.iter().map(String::as_str).collect();
    let conditioning = match (&preset.policy.goal_channels, &preset.policy.attention) {
        (Some(_), _) => ConditioningTable::Goals,
        (None, Some(_)) => {
            ConditioningTable::TokenIds((0..TEXTS).map(|text| (2..2 + 5 + i64::from(text % 10)).collect()).collect())
        }
        (None, None) => ConditioningTable::SentenceEmbeddings(EmbeddingTable::new(&embed(&texts)?, device)?),
    };
    let pool = match preset.chaining.as_ref().map(|chaining| chaining.pairs) {
        Some(PairSource::Pool(count)) => {
            let pairs = ChainingPool::draw(&items, preset.seed, count, None);
            let texts: Vec<String> = pairs.iter().map(|&pair| ChainingPool::joint_text(&items, pair)).collect();
            let joint = embed(&texts.iter().map(String::as_str).collect::<Vec<_>>())?;
            Some(ChainingPool::new(&items, pairs, &joint, device)?)
        }
        _ => None,
    };
    let networks = Networks::new(
        VisualEncoder::house(&preset.visual_encoder, device),
        &preset.policy,
        preset.critic.as_ref(),
        device,
    );
    let data = TrainingData {
        items: &items,
        feature_maps: FeatureMaps::on(&features, device),
        conditioning,
        pool,
        embed: &embed,
    };
    let (judged, batch) = (networks.critic.is_some(), preset.training.batch_size);
    let batches =
        BatchSampler::new(data, preset.policy.history, judged, preset.chaining.as_ref(), (preset.seed, batch), device);
    let state = TrainingState { path: Path::new(""), identity: &BTreeMap::new() };
    let trainer = Trainer { networks: &networks, preset, state };
    let mut update = trainer.update()?;
    let (mut gathering, mut updating) = (Vec::new(), Vec::new());
    for step in 0..WARM + steps {
        let begun = Instant::now();
        let gathered = batches.at(step)?;
        let between = Instant::now();
        update.update(&gathered, false)?;
        if step >= WARM {
            gathering.push(between - begun);
            updating.push(between.elapsed());
        }
    }
    let of = |mut times: Vec<Duration>| {
        times.sort_unstable();
        let median = times.get(times.len() / 2).copied();
        median.zip(times.first().copied()).unwrap_or_default()
    };
    let ((update, least_update), (gathering, least_gathering)) = (of(updating), of(gathering));
    Ok(UpdateTiming { update, least_update, gathering, least_gathering })
}

fn features(preset: &Preset) -> anyhow::Result<Features> {
    let folder = tempfile::tempdir()?;
    let numbers = preset.visual_encoder.map() as u64;
    let header =
        FeatureHeader { format_version: 1, encoder: "e".into(), dataset: "d".into(), maps: u64::from(FRAMES), numbers };
    let mut writer = FeatureWriter::open(folder.path(), header.clone())?;
    let map = Tensor::rand([numbers as i64], (Kind::Half, Device::Cpu));
    let mut bytes = vec![0; map.numel() * 2];
    map.copy_data_u8(&mut bytes, map.numel());
    for frame in 0..FRAMES {
        bytes.rotate_right(2 * (frame as usize % 7));
        writer.add(&bytes)?;
    }
    writer.finish()?;
    Features::read(folder.path(), &header)?.ok_or_else(|| anyhow::anyhow!("the features are gone"))
}

fn items() -> Items {
    let label = |frame: u32| ActionLabel {
        action: (frame % 12) as u8,
        object: if frame.is_multiple_of(4) { 7 } else { 0 },
        executed: true,
    };
    let span = |number: u32| {
        let (start, trajectory) = (number * SPAN, number / 3);
        let first = trajectory * 3 * SPAN;
        Span { trajectory, skills: 0..1, first, start, end: start + SPAN, text: number % TEXTS }
    };
    Items {
        labels: (0..FRAMES).map(|frame| Some(label(frame))).collect(),
        texts: (0..TEXTS).map(|text| format!("Text {text}.")).collect(),
        training: (0..FRAMES / SPAN - 1).map(span).collect(),
        held_out: Vec::new(),
        firsts: (0..=FRAMES / (3 * SPAN)).map(|trajectory| trajectory * 3 * SPAN).chain([FRAMES]).collect(),
        withheld: Default::default(),
        history_start: HistoryStart::Trajectory,
        object_target: ObjectTarget::Next,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_update_of_the_smallest_preset_is_timed() {
        let _chance = crate::nets::testing::chance();
        let mut preset = Preset::named("l-bc").unwrap();
        preset.training.batch_size = 2;
        let timing = measure(&warm(preset), Device::Cpu, 2).unwrap();
        assert!(timing.least_update > Duration::ZERO && timing.least_update <= timing.update, "{timing:?}");
        assert!(timing.least_gathering <= timing.gathering);
    }
}
