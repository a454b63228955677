//! AdamW (Loshchilov and Hutter, 2019) with moments that can be saved, so that a resumed training is the same training.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tch::{Kind, Tensor, nn};

/// The optimiser's settings besides the learning rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct AdamWConfig {
    /// Decay of the mean gradient.
    pub(crate) beta1: f64,
    /// Decay of the mean squared gradient.
    pub(crate) beta2: f64,
    /// Added to the root of the mean squared gradient.
    pub(crate) epsilon: f64,
    /// Decoupled weight decay; biases, norms and other vectors are spared.
    pub(crate) weight_decay: f64,
}

struct Parameter {
    weight: Tensor,
    mean: Tensor,
    square: Tensor,
}

/// AdamW over every trainable tensor of a store.
pub(crate) struct AdamW {
    config: AdamWConfig,
    parameters: BTreeMap<String, Parameter>,
    steps: u64,
}

impl AdamW {
    /// An optimiser at its start: no step taken, moments zero.
    pub(crate) fn new(store: &nn::VarStore, config: AdamWConfig) -> AdamW {
        let trainable = store.variables().into_iter().filter(|(_, tensor)| tensor.requires_grad());
        let parameter = |weight: Tensor| Parameter {
            mean: weight.zeros_like().detach(),
            square: weight.zeros_like().detach(),
            weight,
        };
        AdamW { config, parameters: trainable.map(|(name, weight)| (name, parameter(weight))).collect(), steps: 0 }
    }

    /// How many steps were taken.
    pub(crate) fn steps(&self) -> u64 {
        self.steps
    }

    /// Takes one step against the gradients of `loss`.
    pub(crate) fn minimise(&mut self, loss: &Tensor, learning_rate: f64) {
        let gradients = self.gradients(loss);
        self.step(gradients, learning_rate);
    }

    /// The gradients of `loss`, as [`step`](AdamW::step) takes them; undefined where a weight has none.
    pub(crate) fn gradients(&self, loss: &Tensor) -> Vec<Tensor> {
        let weights: Vec<&Tensor> = self.parameters.values().map(|parameter| &parameter.weight).collect();
        // Not added to what the weights hold: nothing has to be zeroed, and no sum is read and written once more.
        Tensor::run_backward(&[loss], &weights, false, false)
    }

    /// Takes one step against gradients.
    pub(crate) fn step(&mut self, gradients: Vec<Tensor>, learning_rate: f64) {
        self.steps += 1;
        let AdamWConfig { beta1, beta2, epsilon, weight_decay } = self.config;
        let steps = self.steps as f64;
        let (rest1, root2) = (1.0 - beta1.powf(steps), (1.0 - beta2.powf(steps)).sqrt());
        let rate = learning_rate / rest1 * root2;
        tch::no_grad(|| {
            for (Parameter { weight, mean, square }, gradient) in self.parameters.values_mut().zip(gradients) {
                if !gradient.defined() {
                    continue;
                }
                if weight.dim() > 1 {
                    *weight *= 1.0 - learning_rate * weight_decay;
                }
                let _ = mean.lerp_(&gradient, 1.0 - beta1);
                let _ = square.lerp_(&gradient.square(), 1.0 - beta2);
                // In place, because memory is what this loop takes its time for; at a rate of 0 there is nothing to do.
                if rate > 0.0 {
                    let mut divisor = square.sqrt();
                    divisor += epsilon * root2;
                    divisor *= -1.0 / rate;
                    let _ = weight.addcdiv_(mean, &divisor);
                }
            }
        });
    }

    /// Both moments of every tensor, as `mean.NAME` and `square.NAME`.
    pub(crate) fn moments(&self) -> BTreeMap<String, Tensor> {
        let both = |(name, parameter): (&String, &Parameter)| {
            [
                (format!("mean.{name}"), parameter.mean.shallow_clone()),
                (format!("square.{name}"), parameter.square.shallow_clone()),
            ]
        };
        self.parameters.iter().flat_map(both).collect()
    }

    /// Puts back the moments and the count of steps of an earlier training.
    ///
    /// # Errors
    /// When a moment is missing or has another shape; nothing is changed then.
    pub(crate) fn restore(&mut self, steps: u64, moments: &BTreeMap<String, Tensor>) -> anyhow::Result<()> {
        let find = |name: String, like: &Tensor| -> anyhow::Result<Tensor> {
            let found = moments.get(&name).ok_or_else(|| anyhow::anyhow!("the moment {name} is missing"))?;
            anyhow::ensure!(
                found.size() == like.size(),
                "the moment {name} has shape {:?}, not {:?}",
                found.size(),
                like.size()
            );
            Ok(found.to_device(like.device()).to_kind(Kind::Float).copy())
        };
        let mut found = BTreeMap::new();
        for (name, parameter) in &self.parameters {
            let pair =
                (find(format!("mean.{name}"), &parameter.mean)?, find(format!("square.{name}"), &parameter.square)?);
            found.insert(name.clone(), pair);
        }
        for (name, (mean, square)) in found {
            if let Some(parameter) = self.parameters.get_mut(&name) {
                (parameter.mean, parameter.square) = (mean, square);
            }
        }
        self.steps = steps;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use tch::Device;

    use super::*;

    const CONFIG: AdamWConfig = AdamWConfig { beta1: 0.9, beta2: 0.99, epsilon: 1e-8, weight_decay: 0.5 };

    #[test]
    fn the_first_step_moves_by_the_learning_rate_and_decays_matrices_only() {
        let store = nn::VarStore::new(Device::Cpu);
        let matrix = store.root().ones("matrix", &[1, 1]);
        let vector = store.root().ones("vector", &[1]);
        let mut optimiser = AdamW::new(&store, CONFIG);
        let loss = (&matrix * 3.0).sum(Kind::Float) + (&vector * 3.0).sum(Kind::Float);
        optimiser.minimise(&loss, 0.1);
        assert!((matrix.double_value(&[0, 0]) - (1.0 - 0.05 - 0.1)).abs() < 1e-6);
        assert!((vector.double_value(&[0]) - 0.9).abs() < 1e-6);
    }

    #[test]
    fn restored_moments_continue_to_the_bit() {
        let run = |stop: Option<u64>| {
            let store = nn::VarStore::new(Device::Cpu);
            let w = store.root().ones("w", &[2, 2]);
            let mut optimiser = AdamW::new(&store, CONFIG);
            for step in 0..6u64 {
                if stop == Some(step) {
                    let moments = optimiser.moments();
                    let mut other = AdamW::new(&store, CONFIG);
                    other.restore(optimiser.steps(), &moments).unwrap();
                    optimiser = other;
                }
                optimiser.minimise(&(w.square() * (step as f64 + 1.0)).sum(Kind::Float), 0.05);
            }
            Vec::<f32>::try_from(w.flatten(0, -1)).unwrap()
        };
        assert_eq!(run(None), run(Some(3)));
    }

    #[test]
    fn a_missing_moment_is_named() {
        let store = nn::VarStore::new(Device::Cpu);
        let _ = store.root().ones("w", &[2]);
        let error = AdamW::new(&store, CONFIG).restore(1, &BTreeMap::new()).unwrap_err();
        assert!(error.to_string().contains("mean.w"));
    }
}
