//! The Episodic Transformer (Pashevich et al., 2021): words and the last frames as one sequence of tokens. Of its inputs, past
//! actions are left out: in demonstrations they give the next one away.

use serde::{Deserialize, Serialize};
use tch::nn::{self, Module};
use tch::{Kind, Tensor};

use super::bounds;
use super::precision;
use super::trunk::{Convolutions, Trunk};
use super::visual::SIDE;

/// The size of the attention layers; the tokens' width is the policy's `embedding`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AttentionSpec {
    /// Entries of the table of words: at most so many, those for padding and unknown words included.
    pub(crate) vocabulary_size: i64,
    /// Layers that read the words alone, and again as many that read words and frames.
    pub(crate) layers: i64,
    /// Heads of a layer.
    pub(crate) heads: i64,
    /// Width of a layer's inner network.
    pub(crate) feedforward: i64,
}

impl AttentionSpec {
    /// Whether there can be such layers over tokens of `width` numbers.
    ///
    /// # Errors
    /// Names the field of `policy` that is out of its bounds; also when tokens do not divide among the heads, or have no halves
    /// for sines and cosines.
    pub(crate) fn check(&self, width: i64) -> anyhow::Result<()> {
        bounds::sizes("policy.attention.vocabulary_size", &[self.vocabulary_size], 1 << 20)?;
        bounds::sizes("policy.attention.layers", &[self.layers], 64)?;
        bounds::sizes("policy.attention.heads", &[self.heads], 64)?;
        bounds::sizes("policy.attention.feedforward", &[self.feedforward], 16_384)?;
        anyhow::ensure!(
            width % 2 == 0 && width % self.heads == 0,
            "policy.embedding is {width}, which is not even or no multiple of policy.attention.heads, {}",
            self.heads
        );
        Ok(())
    }
}

#[derive(Debug)]
struct AttentionLayer {
    query_key_value: nn::Linear,
    attended: nn::Linear,
    attended_norm: nn::LayerNorm,
    inner: nn::Linear,
    outer: nn::Linear,
    norm: nn::LayerNorm,
    heads: i64,
    dropout: f64,
}

impl AttentionLayer {
    fn new(path: &nn::Path<'_>, width: i64, spec: &AttentionSpec, dropout: f64) -> AttentionLayer {
        let linear = |name: &str, from: i64, to: i64| nn::linear(path / name, from, to, Default::default());
        let norm = |name: &str| nn::layer_norm(path / name, vec![width], Default::default());
        AttentionLayer {
            query_key_value: linear("query_key_value", width, 3 * width),
            attended: linear("attended", width, width),
            attended_norm: norm("attended_norm"),
            inner: linear("inner", width, spec.feedforward),
            outer: linear("outer", spec.feedforward, width),
            norm: norm("norm"),
            heads: spec.heads,
            dropout,
        }
    }

    /// `tokens` [n, tokens, width], 32 bits as what comes out; `bias` [n, 1, 1, tokens] keeps attention away from padding.
    /// Between the sums and norms it computes with numbers of `kind`.
    fn forward(&self, tokens: &Tensor, bias: &Tensor, kind: Kind, train: bool) -> Tensor {
        let (n, count) = (tokens.size()[0], tokens.size()[1]);
        let split = precision::linear(&self.query_key_value, &tokens.to_kind(kind));
        let split = split.view([n, count, 3, self.heads, -1]).permute([2, 0, 3, 1, 4]);
        let (query, key, value) = (split.get(0), split.get(1), split.get(2));
        let scores = query.matmul(&key.transpose(-1, -2)) / (key.size()[3] as f64).sqrt() + bias;
        let read = scores.softmax(-1, Kind::Float).to_kind(kind).matmul(&value).transpose(1, 2).reshape([n, count, -1]);
        let read = precision::linear(&self.attended, &read).dropout(self.dropout, train);
        let tokens = self.attended_norm.forward(&(tokens + read));
        let changed = precision::linear(&self.inner, &tokens.to_kind(kind)).relu();
        let changed = precision::linear(&self.outer, &changed).dropout(self.dropout, train);
        self.norm.forward(&(tokens + changed))
    }
}

/// Reads words and frames; gives the last frame's token.
#[derive(Debug)]
pub(crate) struct Episodic {
    words: nn::Embedding,
    trunk: Trunk,
    frame: nn::Linear,
    language: Vec<AttentionLayer>,
    fusion: Vec<AttentionLayer>,
    norm: nn::LayerNorm,
    history: i64,
    width: i64,
}

impl Episodic {
    /// A network with fresh weights under `path` over `history` frames of `features` channels.
    pub(crate) fn new(
        path: &nn::Path<'_>,
        spec: &AttentionSpec,
        (history, features): (i64, i64),
        (width, convolutions, dropout): (i64, Convolutions<'_>, f64),
    ) -> Episodic {
        let layers = |name: &str| -> Vec<AttentionLayer> {
            (1..=spec.layers)
                .map(|i| AttentionLayer::new(&(path / format!("{name}{i}")), width, spec, dropout))
                .collect()
        };
        let trunk = Trunk::new(&(path / "frame"), features, convolutions, None);
        Episodic {
            words: nn::embedding(path / "words", spec.vocabulary_size, width, Default::default()),
            frame: nn::linear(path / "frame" / "out", trunk.width(), width, Default::default()),
            trunk,
            language: layers("language"),
            fusion: layers("fusion"),
            norm: nn::layer_norm(path / "norm", vec![width], Default::default()),
            history,
            width,
        }
    }

    /// `observation` [n, history * features, 7, 7] and `words` [n, words], 0 for padding, to [n, width].
    pub(crate) fn forward(&self, observation: &Tensor, words: &Tensor, train: bool) -> Tensor {
        let (n, kind) = (words.size()[0], observation.kind());
        let present = words.gt(0).to_kind(Kind::Float);
        let bias = |mask: &Tensor| (mask.unsqueeze(1).unsqueeze(1) - 1.0) * 1e4;
        let read = self.words.forward(words) + self.places(0, words.size()[1], words);
        let read =
            self.language.iter().fold(read, |tokens, layer| layer.forward(&tokens, &bias(&present), kind, train));
        let frames = observation.reshape([n * self.history, -1, SIDE, SIDE]);
        let seen =
            precision::linear_f32(&self.frame, &self.trunk.forward(&frames, None, train)).view([n, self.history, -1]);
        // Frames come after the longest text, so that their places do not depend on the instruction.
        let tokens = Tensor::cat(&[&read, &(&seen + self.places(1000, self.history, words))], 1);
        let mask = Tensor::cat(&[&present, &present.new_ones([n, self.history], (Kind::Float, present.device()))], 1);
        let tokens = self.norm.forward(&tokens);
        let tokens = self.fusion.iter().fold(tokens, |tokens, layer| layer.forward(&tokens, &bias(&mask), kind, train));
        tokens.select(1, -1) + seen.select(1, -1)
    }

    /// Sines and cosines of the places from `first` on, [count, width].
    fn places(&self, first: i64, count: i64, like: &Tensor) -> Tensor {
        let half = self.width / 2;
        let device = (Kind::Float, like.device());
        let rates = (Tensor::arange(half, device) * (-(1e4f64.ln()) / half as f64)).exp();
        let angles = (Tensor::arange(count, device) + first as f64).unsqueeze(1) * rates.unsqueeze(0);
        Tensor::cat(&[angles.sin(), angles.cos()], 1) / (self.width as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use tch::Device;

    use super::*;

    #[test]
    fn attention_computes_as_wide_as_it_is_told_and_its_tokens_keep_32_bits() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(4);
        let store = nn::VarStore::new(Device::Cpu);
        let layer = AttentionLayer::new(
            &store.root(),
            8,
            &AttentionSpec { vocabulary_size: 9, layers: 1, heads: 2, feedforward: 16 },
            0.0,
        );
        let (tokens, bias) = (Tensor::randn([3, 5, 8], (Kind::Float, Device::Cpu)), Tensor::from(0.0f32));
        let [full, mixed] = [Kind::Float, Kind::BFloat16].map(|kind| layer.forward(&tokens, &bias, kind, false));
        assert_eq!([full.kind(), mixed.kind()], [Kind::Float, Kind::Float]);
        let apart = (&full - &mixed).abs().max().double_value(&[]);
        assert!(0.0 < apart && apart < 0.1, "{apart}");
    }
}
