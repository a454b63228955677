//! The terms of a loss by name, and the guard against those that are not finite.

use std::collections::BTreeMap;

use tch::{Device, Kind, Tensor};

/// The losses by name, looked at before any weight is changed.
#[derive(Default)]
pub(super) struct LossTerms {
    names: Vec<String>,
    tensors: Vec<Tensor>,
}

impl LossTerms {
    /// Keeps the value of a scalar `tensor`, without its graph.
    pub(crate) fn add(&mut self, name: String, tensor: &Tensor) {
        self.names.push(name);
        self.tensors.push(tensor.detach());
    }

    /// All of them, in one transfer from the device.
    ///
    /// # Errors
    /// [`NotFinite`].
    pub(crate) fn numbers(self, step: u64) -> Result<BTreeMap<String, f64>, NotFinite> {
        let stacked = Tensor::stack(&self.tensors, 0).to_kind(Kind::Double).to_device(Device::Cpu);
        let values = (0..self.tensors.len() as i64).map(|i| stacked.double_value(&[i]));
        let found: BTreeMap<String, f64> = self.names.into_iter().zip(values).collect();
        match found.iter().find(|(_, value)| !value.is_finite()) {
            Some((term, &value)) => Err(NotFinite { step, term: term.clone(), value }),
            None => Ok(found),
        }
    }
}

/// A loss that is not finite; no weight was changed by it. Running statistics of batch norms already include its step.
#[derive(Debug, thiserror::Error)]
#[error("step {step}: {term} is {value}; no weight was changed by this step, and the last saved state is kept")]
pub struct NotFinite {
    /// The step that failed, from 1.
    pub(crate) step: u64,
    /// The loss's name.
    pub(crate) term: String,
    /// NaN or infinite.
    pub(crate) value: f64,
}
