//! How fast the program is on this machine: the simulator, an agent's decision, the sentence encoder, an update of a training.
//!
//! Times are the least of several rounds, so that other work on the machine matters little. Beside each stands how many times as
//! long it takes as what is stored, both counted in copies of a mebibyte in the same process: figures of different machines can
//! be compared.

use std::path::PathBuf;

use serde::Serialize;

mod agent;
mod baselines;
mod simulator;

pub(crate) use agent::DecisionTime;
pub use baselines::{Baselines, copy_seconds};
pub(crate) use simulator::SimulatorSpeed;

use crate::agent::DecisionOverride;
use crate::agent::policy_source::{self, PolicySource};
use crate::nets::device;
use crate::nets::sentence::{SentenceEncoder, default_folder};
use crate::train::preset::Preset;
use crate::train::update_timing;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// House: frames, steps, resets.
    Simulator,
    /// A decision of an agent.
    Policy,
    /// A sentence.
    Encoder,
    /// An update of a training.
    Training,
}

impl Part {
    pub(crate) const ALL: [Part; 4] = [Part::Simulator, Part::Policy, Part::Encoder, Part::Training];
}

/// What is measured with which agent and preset.
pub(crate) struct BenchOptions {
    pub(crate) parts: Vec<Part>,
    /// The agent's checkpoint; the shipped one without.
    pub(crate) checkpoint: Option<PathBuf>,
    /// The preset of the training.
    pub(crate) preset: String,
    pub(crate) baselines: Baselines,
}

/// A sentence encoder's speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct EncoderTime {
    /// Milliseconds for one short sentence on one core.
    pub(crate) sentence_ms: f64,
}

/// A training's speed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct TrainingSpeed {
    pub(crate) preset: String,
    /// CPU threads that computed.
    pub(crate) threads: usize,
    pub(crate) device: String,
    pub(crate) steps_per_s: f64,
    /// Demonstrated steps that were learned from; chained ones not counted.
    pub(crate) samples_per_s: f64,
}

/// All figures; what was not measured is absent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct BenchReport {
    /// Milliseconds for copying a mebibyte.
    pub(crate) copy_ms: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) sim: Option<SimulatorSpeed>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) policy: Option<DecisionTime>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) encoder: Option<EncoderTime>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) train: Option<TrainingSpeed>,
    /// Each figure's time beside the stored one, in copies.
    pub(crate) baselines: Vec<baselines::Comparison>,
}

/// Measures; `tell` hears what is measured next.
///
/// # Errors
/// When an agent, an encoder or a preset that was asked for cannot be opened.
pub(crate) fn run(options: BenchOptions, tell: &dyn Fn(&str)) -> anyhow::Result<BenchReport> {
    let BenchOptions { parts, checkpoint, preset, mut baselines } = options;
    let asked = |part: Part| parts.contains(&part);
    let mut report = BenchReport {
        copy_ms: baselines.copy_seconds() * 1e3,
        sim: None,
        policy: None,
        encoder: None,
        train: None,
        baselines: Vec::new(),
    };
    if asked(Part::Simulator) {
        tell("the simulator");
        report.sim = Some(simulator::measure(&mut baselines, simulator::ROUNDS)?);
    }
    // The training computes on all threads, what decides on one.
    if asked(Part::Training) {
        tell("a training");
        report.train = Some(training(&preset, &mut baselines)?);
    }
    if asked(Part::Policy) {
        tell("an agent");
        let folder = checkpoint.map_or_else(policy_source::shipped, |named| Ok(policy_source::folder_of(&named)))?;
        let source = PolicySource::checkpoint(folder, false, DecisionOverride::default())?;
        report.policy = Some(agent::measure(&source, agent::EPISODES, &mut baselines)?);
    }
    if asked(Part::Encoder) {
        tell("the sentence encoder");
        device::set_threads(1);
        let encoder = SentenceEncoder::load(&default_folder(), device::best_device())?;
        let least = baselines::least(40, || encoder.encode_rows(&["put a clean mug in the coffee machine"]).map(drop))?;
        baselines.compare("encoder/one short sentence", least);
        report.encoder = Some(EncoderTime { sentence_ms: least.as_secs_f64() * 1e3 });
    }
    report.baselines = baselines.into_comparisons();
    Ok(report)
}

fn training(name: &str, baselines: &mut Baselines) -> anyhow::Result<TrainingSpeed> {
    let preset = update_timing::warm(Preset::named(name)?);
    let timing = update_timing::measure(&preset, device::best_device(), 10)?;
    let threads = device::threads();
    let step = timing.least_update + timing.least_gathering;
    baselines.compare(&format!("training/{}/update on {threads} threads", preset.name), timing.least_update);
    let steps_per_s = 1.0 / step.as_secs_f64();
    Ok(TrainingSpeed {
        preset: preset.name.clone(),
        threads,
        device: device::device_report(),
        steps_per_s,
        samples_per_s: steps_per_s * preset.training.batch_size as f64,
    })
}
