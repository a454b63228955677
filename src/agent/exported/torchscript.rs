//! TorchScript files, computed by libtorch. What such a file holds is code.

use std::path::Path;

use anyhow::{anyhow, bail, ensure};
use tch::{CModule, Device, IValue, Kind, Tensor};

use super::model::{Input, Model, in_one_line};
use super::spec::{PolicySpec, Port};
use crate::nets::device;

/// A policy in a TorchScript file: `forward` takes the inputs in the description's order, and returns a tensor or a tuple of
/// the outputs in its order.
pub(super) struct TorchScriptModel {
    module: CModule,
    inputs: Vec<Port>,
    outputs: usize,
}

impl TorchScriptModel {
    /// Opens a file.
    ///
    /// # Errors
    /// When it cannot be read, or is no TorchScript.
    pub(super) fn open(path: &Path, spec: &PolicySpec) -> anyhow::Result<TorchScriptModel> {
        ensure!(path.is_file(), "there is no such file");
        device::set_threads(1);
        let module = CModule::load_on_device(path, Device::Cpu);
        let mut module = module.map_err(|error| told("it is no TorchScript that can be computed here", &error))?;
        module.set_eval();
        Ok(TorchScriptModel { module, inputs: spec.inputs(), outputs: spec.outputs().len() })
    }
}

fn told(what: &str, error: &tch::TchError) -> anyhow::Error {
    anyhow!("{what}: {}", in_one_line(&error.to_string()))
}

impl Model for TorchScriptModel {
    fn run(&mut self, inputs: Vec<Input>) -> anyhow::Result<Vec<Vec<f32>>> {
        let tensor = |(input, (_, shape)): (Input, &Port)| {
            let shape: Vec<i64> = std::iter::once(1).chain(shape.iter().map(|&size| size as i64)).collect();
            let flat = match input {
                Input::Floats(values) => Tensor::from_slice(&values),
                Input::Tokens(values) => Tensor::from_slice(&values).to_kind(Kind::Int64),
            };
            IValue::Tensor(flat.reshape(shape))
        };
        let given: Vec<IValue> = inputs.into_iter().zip(&self.inputs).map(tensor).collect();
        let answer =
            tch::no_grad(|| self.module.forward_is(&given)).map_err(|error| told("its forward fails", &error))?;
        let outputs = match answer {
            IValue::Tensor(tensor) => vec![tensor],
            IValue::Tuple(parts) => parts
                .into_iter()
                .map(|part| match part {
                    IValue::Tensor(tensor) => Ok(tensor),
                    _ => bail!("its forward returns something else than tensors"),
                })
                .collect::<anyhow::Result<_>>()?,
            _ => bail!("its forward returns neither a tensor nor a tuple of tensors"),
        };
        let (found, wanted) = (outputs.len(), self.outputs);
        ensure!(found == wanted, "its forward returns {found} tensors, not {wanted}");
        let numbers = |tensor: Tensor| Ok(Vec::<f32>::try_from(tensor.to_kind(Kind::Float).reshape([-1]))?);
        outputs.into_iter().map(numbers).collect()
    }
}
