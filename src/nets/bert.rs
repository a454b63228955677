//! BERT as an encoder of tokens (Devlin et al. 2019), with the names that its published weights use.

use std::collections::BTreeMap;

use tch::{Kind, Tensor};

use super::encoder_stack::{CheckedTensors, EncoderStack, LayerNames, LayerNorm, padding_bias};
use super::transformer_config::TransformerConfig;
use super::weights::TensorSpec;

const NAMES: LayerNames = LayerNames {
    query: "attention.self.query",
    key: "attention.self.key",
    value: "attention.self.value",
    output: "attention.output.dense",
    attention_norm: "attention.output.LayerNorm",
};

/// BERT's embeddings and layers; its pooler is not used.
pub(super) struct Bert {
    words: Tensor,
    /// Position embeddings with the first segment's embedding added: every text is one segment.
    positions: Tensor,
    norm: LayerNorm,
    stack: EncoderStack,
}

impl Bert {
    /// Names, shapes and types of the tensors that are used.
    pub(super) fn tensor_specs(config: &TransformerConfig) -> BTreeMap<String, TensorSpec> {
        let hidden = config.hidden_size;
        let mut specs = BTreeMap::from([
            ("embeddings.word_embeddings.weight".into(), TensorSpec::float(&[config.vocab_size, hidden])),
            (
                "embeddings.position_embeddings.weight".into(),
                TensorSpec::float(&[config.max_position_embeddings, hidden]),
            ),
            ("embeddings.token_type_embeddings.weight".into(), TensorSpec::float(&[config.type_vocab_size, hidden])),
            ("embeddings.LayerNorm.weight".into(), TensorSpec::float(&[hidden])),
            ("embeddings.LayerNorm.bias".into(), TensorSpec::float(&[hidden])),
        ]);
        specs.extend(
            (0..config.num_hidden_layers).flat_map(|n| NAMES.tensor_specs(n, hidden, config.intermediate_size)),
        );
        specs
    }

    pub(super) fn load(tensors: &CheckedTensors<'_>, config: &TransformerConfig) -> anyhow::Result<Bert> {
        let segments = tensors.tensor("embeddings.token_type_embeddings.weight")?;
        Ok(Bert {
            words: tensors.tensor("embeddings.word_embeddings.weight")?,
            positions: tensors.tensor("embeddings.position_embeddings.weight")? + segments.get(0),
            norm: tensors.norm("embeddings.LayerNorm")?,
            stack: EncoderStack::load(tensors, &NAMES, config.num_hidden_layers, config.num_attention_heads)?,
        })
    }

    /// Hidden states `[batch, tokens, hidden]` of token ids and their mask, both `[batch, tokens]`.
    pub(super) fn forward(&self, ids: &Tensor, mask: &Tensor) -> Tensor {
        let words = Tensor::embedding(&self.words, ids, -1, false, false);
        let positions = self.positions.narrow(0, 0, ids.size()[1]);
        let padded = mask.min().int64_value(&[]) == 0;
        let bias = padded.then(|| padding_bias(mask));
        debug_assert_eq!(ids.kind(), Kind::Int64);
        self.stack.forward(self.norm.forward(&(words + positions)), bias.as_ref())
    }
}
