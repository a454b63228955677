//! Trains the detector on drawn frames, of which the simulator knows what shows where.

pub(crate) mod accuracy;
pub(crate) mod labels;

use std::path::Path;

use anyhow::ensure;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use tch::{Device, Kind, Tensor, nn};

use self::accuracy::Accuracy;
use self::labels::{PLACES, PlaceLabels};
use super::frame_store::FrameStore;
use super::metrics::Scalars;
use super::stage::{Learning, Rhythm};
use crate::algo::learner::{Learner, Optimisation};
use crate::domain::place::Heading;
use crate::domain::{Pose, Scene, World};
use crate::house::House;
use crate::house::render::Renderer;
use crate::nets::detector::{Detector, DetectorSpec, LABELS};
use crate::nets::precision::Precision;
use crate::nets::weights::Tensors;

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

/// A detector under training.
pub(crate) struct DetectorLearning<'a> {
    learner: Learner<'a>,
    detector: &'a Detector,
    training: &'a DetectorTraining,
    seed: u64,
    frame_store: &'a FrameStore,
    /// For each trajectory, whether it is held out.
    apart: Vec<bool>,
    held_out: Vec<Glimpse>,
}

impl<'a> DetectorLearning<'a> {
    /// A detector at step 0.
    ///
    /// # Errors
    /// When every trajectory is held out, or a scene is missing.
    pub(crate) fn new(
        (store, detector): (&'a nn::VarStore, &'a Detector),
        frame_store: &'a FrameStore,
        training: &'a DetectorTraining,
        Rhythm { seed, hold_out, .. }: Rhythm,
    ) -> anyhow::Result<DetectorLearning<'a>> {
        let learner = Learner::new(store, training.optimisation.clone(), seed);
        let apart = frame_store.kept_apart(hold_out);
        ensure!(apart.contains(&false), "there is nothing to learn from: every trajectory is held out");
        let any_held_out = apart.contains(&true);
        let mut learning =
            DetectorLearning { learner, detector, training, seed, frame_store, apart, held_out: Vec::new() };
        if any_held_out {
            learning.held_out = learning.glimpses(0, MEASURED, true)?;
        }
        Ok(learning)
    }

    fn glimpses(&self, step: u64, count: usize, held_out: bool) -> anyhow::Result<Vec<Glimpse>> {
        let drawn = Draw { seed: self.seed, step, count, held_out, anywhere: self.training.anywhere };
        drawn.glimpses(self.frame_store, &self.apart)
    }
}

impl<'a> Learning<'a> for DetectorLearning<'a> {
    fn learner(&self) -> &Learner<'a> {
        &self.learner
    }

    fn step(&mut self) -> anyhow::Result<Vec<(&'static str, Tensor)>> {
        let drawn = self.glimpses(self.learner.step() + 1, self.training.optimisation.batch_size, false)?;
        self.learner.begin_step();
        let logits = self.detector.forward(self.training.precision, &images(&drawn), true);
        let loss = loss(&logits, &holding(&drawn, self.detector.device()));
        self.learner.minimise(&loss);
        Ok(vec![("detector_loss", loss)])
    }

    fn measure(&self, scalars: &mut Scalars) -> anyhow::Result<()> {
        if !self.held_out.is_empty() {
            accuracy(self.detector, &self.held_out)?.report(scalars);
        }
        Ok(())
    }

    fn restore(&mut self, path: &Path, step: u64, tensors: Tensors) -> anyhow::Result<()> {
        self.learner.restore_checked(path, step, &tensors)
    }
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
