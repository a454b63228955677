//! How long an update takes with each preset in its own size once its critic is warm, and how long its batch takes to
//! gather. Maps and texts are random: they cost what real ones cost. `cargo bench --bench training -- [PRESET ...]`, where a
//! preset may be a file.

#![allow(clippy::print_stdout)]

mod baseline;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use baseline::Baselines;
use sprint_explorer::agent::checkpoint::Networks;
use sprint_explorer::algo::chain::PairSource;
use sprint_explorer::data::features::{FeatureHeader, FeatureWriter, Features};
use sprint_explorer::data::items::{ActionLabel, Items, Span};
use sprint_explorer::data::selection::{HistoryStart, ObjectTarget};
use sprint_explorer::nets::device::best_device;
use sprint_explorer::nets::visual_encoder::VisualEncoder;
use sprint_explorer::train::batch_sampler::BatchSampler;
use sprint_explorer::train::preset::Preset;
use sprint_explorer::train::trainer::Trainer;
use sprint_explorer::train::training_data::{
    ChainingPool, ConditioningTable, EmbeddingTable, FeatureMaps, TrainingData, joint_text,
};
use sprint_explorer::train::training_state::TrainingState;
use tch::{Device, Kind, Tensor};

const FRAMES: u32 = 6000;
/// Frames of a span, and of a trajectory of three.
const SPAN: u32 = 15;
const TEXTS: u32 = 200;
const WARM: u64 = 3;
const STEPS: u64 = 30;

fn main() -> anyhow::Result<()> {
    let mut asked: Vec<String> = std::env::args().skip(1).filter(|name| !name.starts_with("--")).collect();
    if asked.is_empty() {
        asked = Preset::names().into_iter().map(String::from).collect();
    }
    let device = best_device();
    let mut baselines = Baselines::open()?;
    println!("{device:?}, {} threads; milliseconds, medians of {STEPS} and the least", tch::get_num_threads());
    println!("{:<18} {:>6} {:>7} {:>8} {:>8} {:>9}", "preset", "batch", "pairs", "update", "least", "gathering");
    for name in asked {
        measure(&warm(Preset::named(&name)?), device, &mut baselines)?;
    }
    Ok(())
}

/// Past the warm-up, in which the policy has less to compute.
fn warm(mut preset: Preset) -> Preset {
    if let Some(iql) = &mut preset.iql {
        iql.cloning_fraction = 0.0;
    }
    preset
}

fn measure(preset: &Preset, device: Device, baselines: &mut Baselines) -> anyhow::Result<()> {
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
            let pairs = ChainingPool::draw(&items, preset.seed, count);
            let texts: Vec<String> = pairs.iter().map(|&pair| joint_text(&items, pair)).collect();
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
    for step in 0..WARM + STEPS {
        let begun = Instant::now();
        let gathered = batches.at(step)?;
        let between = Instant::now();
        update.update(&gathered, false)?;
        if step >= WARM {
            gathering.push((between - begun).as_secs_f64() * 1e3);
            updating.push(between.elapsed().as_secs_f64() * 1e3);
        }
    }
    let pairs = preset.chaining.as_ref().map_or(0, |chaining| chaining.batch_size);
    let least = updating.iter().copied().fold(f64::INFINITY, f64::min);
    let least_gathering = gathering.iter().copied().fold(f64::INFINITY, f64::min);
    let (update, gather) = (median(updating), median(gathering));
    println!("{:<18} {batch:>6} {pairs:>7} {update:>8.1} {least:>8.1} {gather:>9.1}", preset.name);
    // Baselines are of the CPU.
    if device == Device::Cpu {
        let threads = tch::get_num_threads();
        for (part, milliseconds) in [("update", least), ("gathering", least_gathering)] {
            let name = format!("training/{}/{part} on {threads} threads", preset.name);
            baselines.compare(&name, Duration::from_secs_f64(milliseconds / 1e3))?;
        }
    }
    Ok(())
}

fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
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
