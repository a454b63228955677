//! A learner: weights and their optimiser, as one state that can be saved and restored.

use std::path::Path;

use anyhow::ensure;
use tch::{Tensor, nn};

use super::adamw::{AdamW, AdamWConfig};
use super::schedule::Schedule;
use crate::nets::weights::{self, TensorSpec, Tensors};

/// Length, batch size and optimiser of a training.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Optimisation {
    /// Steps of the whole training.
    pub(crate) steps: u64,
    /// Items in a step.
    pub batch_size: usize,
    /// The learning rate over the steps.
    pub(crate) schedule: Schedule,
    /// The optimiser's other settings.
    pub(crate) adamw: AdamWConfig,
}

impl Optimisation {
    /// Whether weights can be optimised so. `name` is the field of the preset that holds these numbers.
    ///
    /// # Errors
    /// Names the field that is out of its bounds.
    pub(crate) fn check(&self, name: &str) -> anyhow::Result<()> {
        let Schedule { learning_rate, final_fraction, .. } = self.schedule;
        let AdamWConfig { beta1, beta2, epsilon, weight_decay } = self.adamw;
        let batch_size = self.batch_size;
        ensure!(
            (2..=65_536).contains(&batch_size),
            "{name}.batch_size is {batch_size}, which is not between 2 and 65536"
        );
        let positive = |number: f64| number.is_finite() && number > 0.0;
        ensure!(positive(learning_rate), "{name}.schedule.learning_rate is {learning_rate}, which is no rate");
        ensure!(
            (0.0..=1.0).contains(&final_fraction),
            "{name}.schedule.final_fraction is {final_fraction}, which is not a share"
        );
        for (field, beta) in [("beta1", beta1), ("beta2", beta2)] {
            ensure!((0.0..1.0).contains(&beta), "{name}.adamw.{field} is {beta}, which is not below 1, or negative");
        }
        ensure!(positive(epsilon), "{name}.adamw.epsilon is {epsilon}, which is not above 0");
        ensure!(
            weight_decay.is_finite() && weight_decay >= 0.0,
            "{name}.adamw.weight_decay is {weight_decay}, which is no weight"
        );
        Ok(())
    }
}

/// The weights of a store with their AdamW.
pub(crate) struct Learner<'a> {
    store: &'a nn::VarStore,
    optimiser: AdamW,
    optimisation: Optimisation,
    seed: u64,
}

impl<'a> Learner<'a> {
    /// A learner at step 0. The seed drives dropout.
    pub(crate) fn new(store: &'a nn::VarStore, optimisation: Optimisation, seed: u64) -> Learner<'a> {
        Learner { store, optimiser: AdamW::new(store, optimisation.adamw.clone()), optimisation, seed }
    }

    /// Steps taken.
    pub(crate) fn step(&self) -> u64 {
        self.optimiser.steps()
    }

    /// Steps of the whole training.
    pub(crate) fn steps(&self) -> u64 {
        self.optimisation.steps
    }

    /// The share of all steps that is taken.
    pub(crate) fn share(&self) -> f64 {
        self.step() as f64 / self.optimisation.steps.max(1) as f64
    }

    /// Whether all steps are taken.
    pub(crate) fn is_done(&self) -> bool {
        self.step() >= self.optimisation.steps
    }

    /// Before a step's forward pass: whatever libtorch draws in it is a function of seed and step.
    pub(crate) fn begin_step(&self) {
        let mixed = self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(self.step());
        tch::manual_seed(mixed as i64);
    }

    /// Takes a step against the gradients of `loss`.
    pub(crate) fn minimise(&mut self, loss: &Tensor) {
        let rate = self.optimisation.schedule.at(self.step(), self.optimisation.steps);
        self.optimiser.minimise(loss, rate);
    }

    /// The gradients of `loss`, of a whole batch or of a part of it.
    pub(crate) fn gradients(&self, loss: &Tensor) -> Vec<Tensor> {
        self.optimiser.gradients(loss)
    }

    /// Takes a step against gradients.
    pub(crate) fn step_against(&mut self, gradients: Vec<Tensor>) {
        let rate = self.optimisation.schedule.at(self.step(), self.optimisation.steps);
        self.optimiser.step(gradients, rate);
    }

    /// Weights and moments by name: `weight.NAME`, `mean.NAME`, `square.NAME`.
    pub(crate) fn state(&self) -> Tensors {
        let mut tensors: Tensors =
            self.store.variables().into_iter().map(|(name, tensor)| (format!("weight.{name}"), tensor)).collect();
        tensors.extend(self.optimiser.moments());
        tensors
    }

    /// Continues from a state as it was after `step` steps.
    ///
    /// # Errors
    /// When a tensor is missing or of another shape.
    pub(crate) fn restore(&mut self, step: u64, tensors: &Tensors) -> anyhow::Result<()> {
        self.optimiser.restore(step, tensors)?;
        weights::copy(tensors, "weight.", self.store)
    }

    /// Restores the state that was read from the file `path`.
    ///
    /// # Errors
    /// When it does not fit the networks; each tensor that is at fault is named.
    pub(crate) fn restore_checked(&mut self, path: &Path, step: u64, tensors: &Tensors) -> anyhow::Result<()> {
        let forms = self.state().iter().map(|(name, tensor)| (name.clone(), TensorSpec::of(tensor))).collect();
        weights::check(path, tensors, &forms)?;
        self.restore(step, tensors)
    }
}

#[cfg(test)]
mod tests {
    use tch::{Device, Kind};

    use super::*;

    #[test]
    fn what_is_drawn_in_a_step_is_its_own_and_the_same_again() {
        let _chance = crate::nets::testing::chance();
        let store = nn::VarStore::new(Device::Cpu);
        let weight = store.root().zeros("weight", &[1]);
        let mut learner = Learner::new(&store, optimisation(), 3);
        let mut drawn = || {
            let draw = || {
                learner.begin_step();
                f32::try_from(Tensor::rand([1], (Kind::Float, Device::Cpu)).get(0)).unwrap()
            };
            let (once, again) = (draw(), draw());
            assert_eq!(once, again);
            learner.minimise(&weight.square().sum(Kind::Float));
            once
        };
        let steps = [(); 4].map(|()| drawn());
        assert!(steps.windows(2).all(|pair| pair[0] != pair[1]), "{steps:?}");
    }

    fn optimisation() -> Optimisation {
        Optimisation {
            steps: 9,
            batch_size: 2,
            schedule: Schedule { learning_rate: 0.1, warmup_steps: 0, final_fraction: 1.0 },
            adamw: AdamWConfig { beta1: 0.9, beta2: 0.999, epsilon: 1e-8, weight_decay: 0.0 },
        }
    }
}
