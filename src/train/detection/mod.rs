//! Trains the detector on drawn frames, of which the simulator knows what shows where.

pub(crate) mod accuracy;
pub(crate) mod labels;

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::ensure;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use tch::{Device, Kind, Tensor, nn};

use self::accuracy::Accuracy;
use self::labels::{PLACES, PlaceLabels};
use super::frame_store::FrameStore;
use super::metrics::{ProgressLogger, Scalars};
use super::training_state::TrainingState;
use crate::algo::learner::{Learner, Optimisation};
use crate::domain::place::Heading;
use crate::domain::{Pose, Scene, World};
use crate::house::House;
use crate::house::render::Renderer;
use crate::nets::detector::{Detector, DetectorSpec, LABELS};
use crate::nets::precision::Precision;

/// Frames on which the detector is measured while it trains.
const MEASURED: usize = 256;

/// How a detector is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DetectorTraining {
    /// Steps, batch size, learning rate and optimiser.
    pub(crate) optimisation: Optimisation,
    /// The share of frames that are drawn from anywhere in the house instead of from where a demonstration stood.
    pub(crate) anywhere: f64,
    /// How wide the numbers are that the detector computes with while it learns.
    #[serde(default)]
    pub(crate) precision: Precision,
}

impl DetectorTraining {
    /// Whether a detector can be trained so. `name` is the section of the preset.
    ///
    /// # Errors
    /// Names the field that is out of its bounds.
    pub(crate) fn check(&self, name: &str) -> anyhow::Result<()> {
        let anywhere = self.anywhere;
        ensure!((0.0..=1.0).contains(&anywhere), "{name}.anywhere is {anywhere}, which is not a share");
        self.optimisation.check(&format!("{name}.optimisation"))
    }
}

/// What the stages of a training have in common.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rhythm {
    /// Drives the choice of frames.
    pub(crate) seed: u64,
    /// One trajectory in that many is held out.
    pub(crate) hold_out: usize,
    /// Steps between two saved states.
    pub(crate) save_every: u64,
    /// Steps between two lines of progress.
    pub(crate) report_every: u64,
}

/// Trains a detector up to the last step, from where `state` left off if it is there. Returns false when it was stopped; its
/// state is saved then.
///
/// # Errors
/// When a state cannot be read or written, or a frame not be drawn.
pub(crate) fn train(
    store: &nn::VarStore,
    detector: &Detector,
    frame_store: &FrameStore,
    (training, rhythm): (&DetectorTraining, Rhythm),
    state: TrainingState<'_>,
    logger: &mut dyn ProgressLogger,
    stop: &AtomicBool,
) -> anyhow::Result<bool> {
    let mut learner = Learner::new(store, training.optimisation.clone(), rhythm.seed);
    if let Some((step, tensors)) = state.read()? {
        learner.restore_checked(state.path, step, &tensors)?;
    }
    let apart = frame_store.kept_apart(rhythm.hold_out);
    ensure!(apart.contains(&false), "there is nothing to learn from: every trajectory is held out");
    let glimpses = |step, count, held_out| {
        let drawn = Draw { seed: rhythm.seed, step, count, held_out, anywhere: training.anywhere };
        drawn.glimpses(frame_store, &apart)
    };
    let held_out = if apart.contains(&true) { glimpses(0, MEASURED, true)? } else { Vec::new() };
    while !learner.is_done() {
        if stop.load(Ordering::Relaxed) {
            state.write(learner.step(), &learner.state())?;
            return Ok(false);
        }
        let drawn = glimpses(learner.step() + 1, training.optimisation.batch_size, false)?;
        learner.begin_step();
        let logits = detector.forward(training.precision, &images(&drawn), true);
        let loss = loss(&logits, &holding(&drawn, detector.device()));
        learner.minimise(&loss);
        let mut scalars = Scalars::new("detector", learner.step(), training.optimisation.steps);
        if learner.step().is_multiple_of(rhythm.report_every) || learner.is_done() {
            scalars.add("detector_loss", &loss);
        }
        if (learner.step().is_multiple_of(rhythm.report_every * 10) || learner.is_done()) && !held_out.is_empty() {
            accuracy(detector, &held_out)?.report(&mut scalars);
        }
        logger.log(&scalars)?;
        if learner.step().is_multiple_of(rhythm.save_every) || learner.is_done() {
            state.write(learner.step(), &learner.state())?;
        }
    }
    Ok(true)
}

/// Binary cross-entropy added up over the labels of a place, a mean over places. A label that holds counts by its weight (see
/// [`PlaceLabels`]), one that does not counts once. Nearly all do not: only the others are gathered.
fn loss(logits: &Tensor, holding: &Holding) -> Tensor {
    let places = (logits.numel() / LABELS) as f64;
    let here = logits.flatten(0, -1).index_select(0, &holding.at);
    let corrected = (&here.softplus() * (&holding.weights - 1.0) - &here * &holding.weights).sum(Kind::Float);
    (logits.softplus().sum(Kind::Float) + corrected) / places
}

/// The labels that hold in a batch: where among its logits, and with which weight.
struct Holding {
    at: Tensor,
    weights: Tensor,
}

/// A drawn frame as the detector reads it, with what shows in it.
struct Glimpse {
    image: Vec<u8>,
    labels: PlaceLabels,
}

/// The frames of a step: a function of the seed and the step.
struct Draw {
    seed: u64,
    step: u64,
    count: usize,
    /// Of held-out trajectories, or of the others.
    held_out: bool,
    anywhere: f64,
}

impl Draw {
    fn glimpses(&self, frame_store: &FrameStore, apart: &[bool]) -> anyhow::Result<Vec<Glimpse>> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0xde7e);
        rng.set_stream(self.step);
        let frames = std::iter::repeat_with(|| rng.random_range(0..frame_store.frames()))
            .filter(|&frame| apart[frame_store.trajectory_of(frame)] == self.held_out);
        let frames: Vec<usize> = frames.take(self.count).collect();
        let elsewhere = |_| rng.random_bool(self.anywhere).then(|| rng.random::<u64>());
        let seeds: Vec<Option<u64>> = frames.iter().map(elsewhere).collect();
        let draw = |renderer: &mut Renderer, (&frame, seed): (&usize, &Option<u64>)| -> anyhow::Result<Glimpse> {
            let (scene, mut world) = frame_store.state(frame)?;
            if let Some(seed) = seed {
                stand_anywhere(scene, &mut world, &mut ChaCha8Rng::seed_from_u64(*seed));
            }
            let frame = renderer.draw(scene, &world);
            Ok(Glimpse { image: DetectorSpec::image(frame), labels: PlaceLabels::of(scene, &world, frame) })
        };
        frames.par_iter().zip(&seeds).map_init(|| Renderer::new(House::FRAME), draw).collect()
    }
}

fn stand_anywhere(scene: &Scene, world: &mut World, rng: &mut ChaCha8Rng) {
    let cell = scene.cells.get(rng.random_range(0..scene.cells.len().max(1))).copied().unwrap_or(world.agent.cell);
    let heading = Heading::from_quarters(rng.random_range(0..4));
    world.agent = Pose { cell, heading, horizon: Pose::LOOK * rng.random_range(0..4) };
}

/// Images [n, 4, 160, 160] of bytes.
fn images(glimpses: &[Glimpse]) -> Tensor {
    let n = glimpses.len() as i64;
    let bytes: Vec<u8> = glimpses.iter().flat_map(|glimpse| &glimpse.image).copied().collect();
    let side = ((bytes.len() as i64 / n.max(1)) / 4).isqrt();
    Tensor::from_slice(&bytes).view([n, 4, side, side])
}

fn holding(glimpses: &[Glimpse], device: Device) -> Holding {
    let (mut at, mut weights) = (Vec::new(), Vec::new());
    for (n, glimpse) in glimpses.iter().enumerate() {
        for (label, weight) in &glimpse.labels.holding {
            at.push((n * LABELS * PLACES + label) as i64);
            weights.push(*weight);
        }
    }
    Holding { at: Tensor::from_slice(&at).to_device(device), weights: Tensor::from_slice(&weights).to_device(device) }
}

fn accuracy(detector: &Detector, held_out: &[Glimpse]) -> anyhow::Result<Accuracy> {
    let mut accuracy = Accuracy::default();
    for glimpses in held_out.chunks(64) {
        let said = tch::no_grad(|| detector.forward(Precision::Full, &images(glimpses), false)).sigmoid();
        let said = said.to_kind(Kind::Float).to_device(Device::Cpu);
        for (row, glimpse) in (0i64..).zip(glimpses) {
            let numbers = Vec::<f32>::try_from(said.get(row).flatten(0, -1))?;
            accuracy.add(&numbers, &glimpse.labels);
        }
    }
    Ok(accuracy)
}
