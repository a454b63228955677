//! ONNX files, computed by rten.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, anyhow, bail, ensure};
use rten::{DataType, Dimension, Model as Graph, NodeId, RunOptions, ThreadPool, Value, ValueType};

use super::model::{Input, Model, in_one_line};
use super::spec::{PolicySpec, Port};
use crate::data::plain_file;

/// A policy in an ONNX file.
pub(super) struct OnnxModel {
    graph: Graph,
    inputs: Vec<(NodeId, Port)>,
    outputs: Vec<(NodeId, Port)>,
    options: RunOptions,
}

impl OnnxModel {
    /// Opens a file and checks its inputs and outputs.
    ///
    /// # Errors
    /// When it is no ONNX, uses operators that are not known, or does not fit its description.
    pub(super) fn open(path: &Path, spec: &PolicySpec) -> anyhow::Result<OnnxModel> {
        let bytes = plain_file::read(path).context("it cannot be read")?;
        let graph = Graph::load(bytes)
            .map_err(|error| anyhow!("it is no ONNX that can be computed here: {}", in_one_line(&error.to_string())))?;
        let inputs = ports(&graph, graph.input_ids(), spec.inputs(), "input")?;
        if let Some(other) = names(&graph, graph.input_ids()).iter().find(|name| is_none_of(name, &inputs)) {
            let wanted = spec.inputs().iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
            bail!("the input {other:?} is none of those that its description asks for: {wanted}");
        }
        // Outputs beyond those that are asked for are not computed.
        let outputs = ports(&graph, graph.output_ids(), spec.outputs(), "output")?;
        let mut options = RunOptions::default();
        // There is a worker a core already.
        options.thread_pool = Some(Arc::new(ThreadPool::with_num_threads(1)));
        Ok(OnnxModel { graph, inputs, outputs, options })
    }
}

fn is_none_of(name: &str, ports: &[(NodeId, Port)]) -> bool {
    ports.iter().all(|(_, (known, _))| *known != name)
}

fn names(graph: &Graph, ids: &[NodeId]) -> Vec<String> {
    ids.iter().map(|id| graph.node_info(*id).and_then(|node| node.name()).unwrap_or("").to_owned()).collect()
}

/// The nodes of these inputs or outputs.
fn ports(graph: &Graph, ids: &[NodeId], wanted: Vec<Port>, what: &str) -> anyhow::Result<Vec<(NodeId, Port)>> {
    let named = names(graph, ids);
    let find = |port: Port| {
        let at = named.iter().position(|name| *name == port.0);
        let at = at.with_context(|| format!("the {what} {:?} is missing: it has {}", port.0, named.join(", ")))?;
        check(graph, ids[at], &port, what)?;
        Ok((ids[at], port))
    };
    wanted.into_iter().map(find).collect()
}

/// Checks a node's numbers and dimensions, where the file tells them.
fn check(graph: &Graph, id: NodeId, (name, shape): &Port, what: &str) -> anyhow::Result<()> {
    let node = graph.node_info(id);
    // Whole numbers of 64 bits are computed with 32.
    let wanted = if *name == PolicySpec::TOKENS { (DataType::Int32, "int64") } else { (DataType::Float, "float32") };
    let fits = node.as_ref().and_then(|node| node.dtype()).is_none_or(|told| told == ValueType::Tensor(wanted.0));
    ensure!(fits, "the {what} {name:?} has other numbers than {}", wanted.1);
    let Some(told) = node.and_then(|node| node.shape()) else { return Ok(()) };
    let whole: Vec<usize> = std::iter::once(1).chain(shape.iter().copied()).collect();
    let same = |(told, wanted): (&Dimension, &usize)| match told {
        Dimension::Fixed(size) => size == wanted,
        Dimension::Symbolic(_) => true,
    };
    // A value may have a dimension of its own, of one number.
    let is_value = shape.is_empty() && told.len() == 2 && told.iter().zip(&[1, 1]).all(same);
    let sizes: Vec<String> = told.iter().map(size).collect();
    ensure!(
        is_value || (told.len() == whole.len() && told.iter().zip(&whole).all(same)),
        "the {what} {name:?} has the shape [{}], and its description asks for {whole:?}",
        sizes.join(", ")
    );
    Ok(())
}

fn size(dimension: &Dimension) -> String {
    match dimension {
        Dimension::Fixed(size) => size.to_string(),
        Dimension::Symbolic(name) => name.clone(),
    }
}

impl Model for OnnxModel {
    fn run(&mut self, inputs: Vec<Input>) -> anyhow::Result<Vec<Vec<f32>>> {
        let mut given = Vec::with_capacity(inputs.len());
        for (input, (id, (_, shape))) in inputs.into_iter().zip(&self.inputs) {
            let shape: Vec<usize> = std::iter::once(1).chain(shape.iter().copied()).collect();
            let value = match input {
                Input::Floats(values) => Value::from_shape(&shape, values)?,
                Input::Tokens(values) => Value::from_shape(&shape, values)?,
            };
            given.push((*id, value.into()));
        }
        let ids: Vec<NodeId> = self.outputs.iter().map(|(id, _)| *id).collect();
        let computed = self.graph.run(given, &ids, Some(self.options.clone()));
        let computed = computed.map_err(|error| anyhow!(in_one_line(&error.to_string())))?;
        let outputs = computed.into_iter().zip(&self.outputs);
        outputs
            .map(|(value, (_, port))| match value {
                Value::FloatTensor(tensor) => Ok(tensor.into_data()),
                _ => bail!("its output {:?} has other numbers than float32", port.0),
            })
            .collect()
    }
}
