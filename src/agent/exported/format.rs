//! The formats of exported policies, and how a file of each is opened and computed.

use std::path::Path;

use anyhow::{Context, ensure};

use super::model::{Input, Model};
use super::onnx::OnnxModel;
use super::spec::{PolicySpec, Port};
use super::torchscript::TorchScriptModel;

/// The format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Onnx,
    /// Runs code of whoever wrote it.
    TorchScript,
}

impl Format {
    /// What `--policy` calls it.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Format::Onnx => "onnx",
            Format::TorchScript => "torchscript",
        }
    }
}

/// Opens a file and checks that it fits its description; it computes once, because not every file tells all of its sizes.
///
/// # Errors
/// When it cannot be read, or does not fit; says how in one sentence.
pub(super) fn open(path: &Path, format: Format, spec: &PolicySpec) -> anyhow::Result<Box<dyn Model>> {
    let opened = || -> anyhow::Result<Box<dyn Model>> {
        let mut model: Box<dyn Model> = match format {
            Format::Onnx => Box::new(OnnxModel::open(path, spec)?),
            Format::TorchScript => Box::new(TorchScriptModel::open(path, spec)?),
        };
        run(model.as_mut(), spec, spec.inputs().iter().map(blank).collect())
            .context("it does not fit its description")?;
        Ok(model)
    };
    opened().with_context(|| path.display().to_string())
}

fn blank((name, shape): &Port) -> Input {
    let size = shape.iter().product();
    if *name == PolicySpec::TOKENS { Input::Tokens(vec![0; size]) } else { Input::Floats(vec![0.0; size]) }
}

/// Computes one step, and checks the sizes of what comes out.
///
/// # Errors
/// When it fails, or its outputs have another size than the description says.
pub(super) fn run(model: &mut dyn Model, spec: &PolicySpec, inputs: Vec<Input>) -> anyhow::Result<Vec<Vec<f32>>> {
    let outputs = model.run(inputs)?;
    for ((name, shape), values) in spec.outputs().iter().zip(&outputs) {
        let wanted: usize = shape.iter().product();
        ensure!(values.len() == wanted, "its output {name:?} has {} numbers, not {wanted}", values.len());
    }
    Ok(outputs)
}
