//! The transformer encoder that BERT and MPNet share: post-norm layers of self-attention and a GELU network.

use tch::{Kind, Tensor};

use super::weights::{TensorSpec, Tensors};

/// A fully connected layer, its weight kept as `[inputs, outputs]`: for the few rows of a short sentence the product
/// is a third faster than with the published `[outputs, inputs]`.
pub(super) struct Linear {
    weight: Tensor,
    bias: Tensor,
}

impl Linear {
    /// Joins published layers that read the same input into one.
    fn join(parts: &[Linear]) -> Linear {
        let weights: Vec<&Tensor> = parts.iter().map(|part| &part.weight).collect();
        let biases: Vec<&Tensor> = parts.iter().map(|part| &part.bias).collect();
        Linear { weight: Tensor::cat(&weights, 1), bias: Tensor::cat(&biases, 0) }
    }

    /// `[batch, tokens, outputs]` from `[batch, tokens, inputs]`.
    pub(super) fn forward(&self, input: &Tensor) -> Tensor {
        let (batch, tokens) = (input.size()[0], input.size()[1]);
        self.bias.addmm(&input.reshape([batch * tokens, -1]), &self.weight).view([batch, tokens, -1])
    }
}

/// A layer normalisation over the last dimension.
pub(super) struct LayerNorm {
    weight: Tensor,
    bias: Tensor,
    epsilon: f64,
}

impl LayerNorm {
    pub(super) fn forward(&self, input: &Tensor) -> Tensor {
        input.layer_norm(self.weight.size(), Some(&self.weight), Some(&self.bias), self.epsilon, false)
    }
}

/// Hands out the tensors of a weights file by name. The file was checked against the model's specifications before.
pub(super) struct CheckedTensors<'a> {
    pub(super) tensors: &'a Tensors,
    pub(super) epsilon: f64,
}

impl CheckedTensors<'_> {
    pub(super) fn tensor(&self, name: &str) -> anyhow::Result<Tensor> {
        let tensor = self.tensors.get(name);
        tensor.map(Tensor::shallow_clone).ok_or_else(|| anyhow::anyhow!("the tensor {name} is missing"))
    }

    pub(super) fn dense(&self, name: &str) -> anyhow::Result<Linear> {
        let weight = self.tensor(&format!("{name}.weight"))?.tr().contiguous();
        Ok(Linear { weight, bias: self.tensor(&format!("{name}.bias"))? })
    }

    pub(super) fn norm(&self, name: &str) -> anyhow::Result<LayerNorm> {
        let (weight, bias) = (self.tensor(&format!("{name}.weight"))?, self.tensor(&format!("{name}.bias"))?);
        Ok(LayerNorm { weight, bias, epsilon: self.epsilon })
    }
}

/// The names, below `encoder.layer.N`, that an architecture gives to the parts of a layer.
pub(super) struct LayerNames {
    pub(super) query: &'static str,
    pub(super) key: &'static str,
    pub(super) value: &'static str,
    pub(super) output: &'static str,
    pub(super) attention_norm: &'static str,
}

impl LayerNames {
    /// The tensors of one layer, for `hidden` and `inner` units.
    pub(super) fn tensor_specs(&self, layer: i64, hidden: i64, inner: i64) -> Vec<(String, TensorSpec)> {
        let dense = |name: &str, to: i64, from: i64| {
            let name = format!("encoder.layer.{layer}.{name}");
            [
                (format!("{name}.weight"), TensorSpec::float(&[to, from])),
                (format!("{name}.bias"), TensorSpec::float(&[to])),
            ]
        };
        let norm = |name: &str| {
            let name = format!("encoder.layer.{layer}.{name}");
            [
                (format!("{name}.weight"), TensorSpec::float(&[hidden])),
                (format!("{name}.bias"), TensorSpec::float(&[hidden])),
            ]
        };
        [
            dense(self.query, hidden, hidden),
            dense(self.key, hidden, hidden),
            dense(self.value, hidden, hidden),
            dense(self.output, hidden, hidden),
            norm(self.attention_norm),
            dense("intermediate.dense", inner, hidden),
            dense("output.dense", hidden, inner),
            norm("output.LayerNorm"),
        ]
        .concat()
    }
}

/// One layer; queries, keys and values are one matrix so that a short sentence costs one product instead of three.
struct EncoderLayer {
    query_key_value: Linear,
    attention_output: Linear,
    attention_norm: LayerNorm,
    inner: Linear,
    outer: Linear,
    norm: LayerNorm,
}

/// The layers of an encoder.
pub(super) struct EncoderStack {
    layers: Vec<EncoderLayer>,
    heads: i64,
}

impl EncoderStack {
    pub(super) fn load(
        tensors: &CheckedTensors<'_>,
        names: &LayerNames,
        layers: i64,
        heads: i64,
    ) -> anyhow::Result<EncoderStack> {
        let layers = (0..layers).map(|layer| {
            let at = |name: &str| format!("encoder.layer.{layer}.{name}");
            let [query, key, value] = [names.query, names.key, names.value].map(|name| tensors.dense(&at(name)));
            Ok(EncoderLayer {
                query_key_value: Linear::join(&[query?, key?, value?]),
                attention_output: tensors.dense(&at(names.output))?,
                attention_norm: tensors.norm(&at(names.attention_norm))?,
                inner: tensors.dense(&at("intermediate.dense"))?,
                outer: tensors.dense(&at("output.dense"))?,
                norm: tensors.norm(&at("output.LayerNorm"))?,
            })
        });
        Ok(EncoderStack { layers: layers.collect::<anyhow::Result<_>>()?, heads })
    }

    /// Hidden states `[batch, tokens, hidden]` after all layers; `bias` is added to the attention scores and broadcasts
    /// to `[batch, heads, tokens, tokens]`.
    pub(super) fn forward(&self, embedded: Tensor, bias: Option<&Tensor>) -> Tensor {
        self.layers.iter().fold(embedded, |states, layer| layer.forward(&states, bias, self.heads))
    }
}

impl EncoderLayer {
    fn forward(&self, states: &Tensor, bias: Option<&Tensor>, heads: i64) -> Tensor {
        let attended = self.attention_output.forward(&self.attend(states, bias, heads));
        let states = self.attention_norm.forward(&(attended + states));
        let widened = self.inner.forward(&states).gelu("none");
        self.norm.forward(&(self.outer.forward(&widened) + states))
    }

    fn attend(&self, states: &Tensor, bias: Option<&Tensor>, heads: i64) -> Tensor {
        let (batch, tokens) = (states.size()[0], states.size()[1]);
        let split = self.query_key_value.forward(states).view([batch, tokens, 3, heads, -1]).permute([2, 0, 3, 1, 4]);
        let (query, key, value) = (split.get(0), split.get(1), split.get(2));
        let attended = Tensor::scaled_dot_product_attention(&query, &key, &value, bias, 0.0, false, None, false);
        attended.transpose(1, 2).reshape([batch, tokens, -1])
    }
}

/// Scores to add so that no token attends to padding: 0 where `mask` `[batch, tokens]` is 1, the lowest float where 0.
pub(super) fn padding_bias(mask: &Tensor) -> Tensor {
    (mask.to_kind(Kind::Float) * -1.0 + 1.0).unsqueeze(1).unsqueeze(1) * f64::from(f32::MIN)
}
