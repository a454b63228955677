//! The transformer of a sentence encoder's folder, BERT or MPNet, from its `model.safetensors`.

use std::path::Path;

use anyhow::bail;
use tch::{Device, Kind, Tensor};

use super::bert::Bert;
use super::encoder_stack::CheckedTensors;
use super::mpnet::Mpnet;
use super::transformer_config::TransformerConfig;
use super::weights::{self, Tensors, WeightsError};

/// An encoder of tokens.
pub(super) enum Transformer {
    Bert(Bert),
    Mpnet(Mpnet),
}

impl Transformer {
    /// Reads `bytes`, the contents of the weights file at `path`, strictly.
    pub(super) fn build(
        config: &TransformerConfig,
        path: &Path,
        bytes: &[u8],
        device: Device,
    ) -> anyhow::Result<Transformer> {
        let (tensors, _) =
            weights::parse(bytes).map_err(|reason| WeightsError::Malformed { path: path.to_path_buf(), reason })?;
        let tensors: Tensors = tensors
            .into_iter()
            .filter(|(name, _)| !unused(name))
            .map(|(name, tensor)| {
                // Half-precision files are published too; computing stays in 32 bits.
                let kind = if tensor.is_floating_point() { Kind::Float } else { tensor.kind() };
                (name, tensor.to_kind(kind).to_device(device))
            })
            .collect();
        weights::check_finite(path, &tensors)?;
        let checked = CheckedTensors { tensors: &tensors, epsilon: config.layer_norm_eps };
        match config.model_type.as_str() {
            "bert" => {
                weights::check(path, &tensors, &Bert::tensor_specs(config))?;
                Ok(Transformer::Bert(Bert::load(&checked, config)?))
            }
            "mpnet" => {
                weights::check(path, &tensors, &Mpnet::tensor_specs(config))?;
                Ok(Transformer::Mpnet(Mpnet::load(&checked, config)?))
            }
            other => bail!("model_type {other:?} is not supported (bert and mpnet are)"),
        }
    }

    /// Hidden states `[batch, tokens, hidden]` of token ids and their mask, both `[batch, tokens]`.
    pub(super) fn forward(&self, ids: &Tensor, mask: &Tensor) -> Tensor {
        match self {
            Transformer::Bert(bert) => bert.forward(ids, mask),
            Transformer::Mpnet(mpnet) => mpnet.forward(ids, mask),
        }
    }
}

/// Tensors that are published and that a sentence encoder does not compute with.
fn unused(name: &str) -> bool {
    name == "embeddings.position_ids" || name.starts_with("pooler.")
}
