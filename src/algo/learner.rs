//! A learner: weights and their optimiser, as one state that can be saved and taken up again.

use std::path::Path;

use tch::{Tensor, nn};

use super::adamw::{AdamW, AdamWConfig};
use super::schedule::Schedule;
use crate::nets::weights::{self, Form, Tensors};

/// How weights are optimised.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Optimisation {
    /// How many steps.
    pub steps: u64,
    /// Items in a step.
    pub batch: usize,
    /// The learning rate.
    pub schedule: Schedule,
    /// The optimiser.
    pub adamw: AdamWConfig,
}

/// Weights under training.
pub struct Learner<'a> {
    store: &'a nn::VarStore,
    optimiser: AdamW,
    optimisation: Optimisation,
    seed: u64,
}

impl<'a> Learner<'a> {
    /// A learner at step 0. The seed drives dropout.
    pub fn new(store: &'a nn::VarStore, optimisation: Optimisation, seed: u64) -> Learner<'a> {
        Learner { store, optimiser: AdamW::new(store, optimisation.adamw.clone()), optimisation, seed }
    }

    /// Steps taken.
    pub fn step(&self) -> u64 {
        self.optimiser.steps()
    }

    /// The share of all steps that is taken.
    pub fn share(&self) -> f64 {
        self.step() as f64 / self.optimisation.steps.max(1) as f64
    }

    /// Whether all steps are taken.
    pub fn is_done(&self) -> bool {
        self.step() >= self.optimisation.steps
    }

    /// Before a step's forward pass: whatever libtorch draws in it is a function of seed and step.
    pub fn begin_step(&self) {
        let mixed = self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(self.step());
        tch::manual_seed((mixed >> 1) as i64);
    }

    /// Takes a step against the gradients of `loss`.
    pub fn minimise(&mut self, loss: &Tensor) {
        let rate = self.optimisation.schedule.at(self.step(), self.optimisation.steps);
        self.optimiser.minimise(loss, rate);
    }

    /// Weights and moments by name: `weight.NAME`, `mean.NAME`, `square.NAME`.
    pub fn state(&self) -> Tensors {
        let mut tensors: Tensors =
            self.store.variables().into_iter().map(|(name, tensor)| (format!("weight.{name}"), tensor)).collect();
        tensors.extend(self.optimiser.moments());
        tensors
    }

    /// Takes up a state as it was after `step` steps.
    ///
    /// # Errors
    /// When a tensor is missing or of another shape.
    pub fn restore(&mut self, step: u64, tensors: &Tensors) -> anyhow::Result<()> {
        self.optimiser.restore(step, tensors)?;
        weights::copy(tensors, "weight.", self.store)
    }

    /// Writes weights, moments and the count of steps as one file, whole or not at all.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn save(&self, path: &Path) -> anyhow::Result<()> {
        let metadata = [("step".to_string(), self.step().to_string()), ("seed".to_string(), self.seed.to_string())];
        Ok(weights::write(path, &self.state(), &metadata.into())?)
    }

    /// Takes up a training that was saved.
    ///
    /// # Errors
    /// When the file cannot be read, was written with another seed, or does not fit the networks; each fault is named.
    pub fn resume(&mut self, path: &Path) -> anyhow::Result<()> {
        let (tensors, metadata) = weights::read_with_metadata(path)?;
        let number = |key: &str| -> anyhow::Result<u64> {
            let text = metadata.get(key).ok_or_else(|| anyhow::anyhow!("{}: {key} is missing", path.display()))?;
            text.parse().map_err(|_| anyhow::anyhow!("{}: {key} is {text:?}, not a number", path.display()))
        };
        let (step, seed) = (number("step")?, number("seed")?);
        anyhow::ensure!(seed == self.seed, "{}: seed is {seed}, the preset's is {}", path.display(), self.seed);
        let forms = self.state().iter().map(|(name, tensor)| (name.clone(), Form::of(tensor))).collect();
        weights::check(path, &tensors, &forms)?;
        self.restore(step, &tensors)
    }
}
