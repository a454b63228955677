//! MPNet as an encoder of tokens (Song et al. 2020): relative position bias, positions that skip padding.

use std::collections::BTreeMap;

use tch::{Kind, Tensor};

use super::encoder_stack::{CheckedTensors, EncoderStack, LayerNames, LayerNorm, padding_bias};
use super::transformer_config::TransformerConfig;
use super::weights::TensorSpec;

const NAMES: LayerNames = LayerNames {
    query: "attention.attn.q",
    key: "attention.attn.k",
    value: "attention.attn.v",
    output: "attention.attn.o",
    attention_norm: "attention.LayerNorm",
};

/// Distances beyond this share the last bucket.
const FARTHEST: f64 = 128.0;

/// MPNet's embeddings and layers; its pooler is not used.
pub(super) struct Mpnet {
    words: Tensor,
    positions: Tensor,
    padding: i64,
    norm: LayerNorm,
    /// Bias by bucket and head, `[buckets, heads]`; one table for all layers.
    relative: Tensor,
    stack: EncoderStack,
}

impl Mpnet {
    /// Names, shapes and types of the tensors that are used.
    pub(super) fn tensor_specs(config: &TransformerConfig) -> BTreeMap<String, TensorSpec> {
        let hidden = config.hidden_size;
        let relative = [config.relative_attention_num_buckets, config.num_attention_heads];
        let mut specs = BTreeMap::from([
            ("embeddings.word_embeddings.weight".into(), TensorSpec::float(&[config.vocab_size, hidden])),
            (
                "embeddings.position_embeddings.weight".into(),
                TensorSpec::float(&[config.max_position_embeddings, hidden]),
            ),
            ("embeddings.LayerNorm.weight".into(), TensorSpec::float(&[hidden])),
            ("embeddings.LayerNorm.bias".into(), TensorSpec::float(&[hidden])),
            ("encoder.relative_attention_bias.weight".into(), TensorSpec::float(&relative)),
        ]);
        specs.extend(
            (0..config.num_hidden_layers).flat_map(|n| NAMES.tensor_specs(n, hidden, config.intermediate_size)),
        );
        specs
    }

    pub(super) fn load(tensors: &CheckedTensors<'_>, config: &TransformerConfig) -> anyhow::Result<Mpnet> {
        Ok(Mpnet {
            words: tensors.tensor("embeddings.word_embeddings.weight")?,
            positions: tensors.tensor("embeddings.position_embeddings.weight")?,
            padding: config.padding(),
            norm: tensors.norm("embeddings.LayerNorm")?,
            relative: tensors.tensor("encoder.relative_attention_bias.weight")?,
            stack: EncoderStack::load(tensors, &NAMES, config.num_hidden_layers, config.num_attention_heads)?,
        })
    }

    /// Hidden states `[batch, tokens, hidden]` of token ids and their mask, both `[batch, tokens]`.
    pub(super) fn forward(&self, ids: &Tensor, mask: &Tensor) -> Tensor {
        let real = ids.ne(self.padding).to_kind(Kind::Int64);
        let positions = real.cumsum(1, Kind::Int64) * real + self.padding;
        let words = Tensor::embedding(&self.words, ids, -1, false, false);
        let places = Tensor::embedding(&self.positions, &positions, -1, false, false);
        let bias = self.relative_bias(ids.size()[1]) + padding_bias(mask);
        self.stack.forward(self.norm.forward(&(words + places)), Some(&bias))
    }

    /// Scores to add for how far apart two tokens stand: `[1, heads, tokens, tokens]`.
    fn relative_bias(&self, tokens: i64) -> Tensor {
        let place = Tensor::arange(tokens, (Kind::Int64, self.relative.device()));
        let buckets = bucket(&(place.unsqueeze(0) - place.unsqueeze(1)), self.relative.size()[0]);
        Tensor::embedding(&self.relative, &buckets, -1, false, false).permute([2, 0, 1]).unsqueeze(0)
    }
}

/// The bucket of a relative position (key minus query): half of the buckets for each direction; in each half the near
/// distances have a bucket each, and farther ones share buckets that widen logarithmically.
fn bucket(relative: &Tensor, buckets: i64) -> Tensor {
    let half = buckets / 2;
    let near = half / 2;
    let distance = relative.abs();
    let scale = (FARTHEST / near as f64).ln();
    let widening = (distance.to_kind(Kind::Float) / near as f64).log() / scale * (half - near) as f64;
    // Distance 0 gives -inf, which the near branch replaces; clamp first so that the conversion is defined.
    let far = (widening.clamp(0.0, (half - near) as f64).to_kind(Kind::Int64) + near).clamp_max(half - 1);
    relative.gt(0).to_kind(Kind::Int64) * half + distance.where_self(&distance.lt(near), &far)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_are_exact_when_near_and_widen_when_far() {
        let relative = Tensor::from_slice(&[0i64, -1, 1, -7, -8, 8, -15, -16, -127, -128, -500, 500]);
        let buckets: Vec<i64> = Vec::try_from(bucket(&relative, 32)).unwrap();
        assert_eq!(buckets, [0, 1, 17, 7, 8, 24, 9, 10, 15, 15, 15, 31]);
    }
}
