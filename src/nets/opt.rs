//! OPT (Zhang et al. 2022): a causal transformer whose keys and values are kept, those of what all rows begin with once.

use tch::{Device, Kind, Tensor};

use super::opt_config::{Activation, OptConfig};
use super::opt_weights::HEAD;
use super::weights::Tensors;

/// Positions are counted from here on in the table of position embeddings.
const FIRST_POSITION: i64 = 2;

/// A score that leaves nothing of a token after the softmax, and that 16-bit floats hold.
const HIDDEN: f64 = -3e4;

/// A fully connected layer, with or without bias.
struct Dense {
    weight: Tensor,
    bias: Option<Tensor>,
}

impl Dense {
    fn forward(&self, input: &Tensor) -> Tensor {
        input.linear(&self.weight, self.bias.as_ref())
    }
}

/// A layer normalisation, with or without weights.
struct Norm {
    size: i64,
    weights: Option<(Tensor, Tensor)>,
}

impl Norm {
    fn forward(&self, input: &Tensor) -> Tensor {
        let (weight, bias) = self.weights.as_ref().map(|(weight, bias)| (weight, bias)).unzip();
        input.layer_norm([self.size], weight, bias, 1e-5, false)
    }
}

struct Layer {
    query: Dense,
    key: Dense,
    value: Dense,
    output: Dense,
    attention_norm: Norm,
    inner: Dense,
    outer: Dense,
    norm: Norm,
}

/// The decoder with its output layer.
pub(super) struct Opt {
    words: Tensor,
    positions: Tensor,
    project_in: Option<Dense>,
    project_out: Option<Dense>,
    layers: Vec<Layer>,
    final_norm: Option<Norm>,
    head: Tensor,
    heads: i64,
    norm_first: bool,
    activation: Activation,
}

/// Keys and values of tokens that were read, `[rows, heads, tokens, size]`, by layer.
pub(super) struct KeyValues(Vec<(Tensor, Tensor)>);

impl KeyValues {
    /// Those of no layer.
    pub(super) fn none() -> KeyValues {
        KeyValues(Vec::new())
    }

    /// Those of the first tokens alone, which know nothing of what comes after them.
    pub(super) fn first(&self, tokens: i64) -> KeyValues {
        let cut = |of: &Tensor| of.narrow(2, 0, tokens);
        KeyValues(self.0.iter().map(|(key, value)| (cut(key), cut(value))).collect())
    }

    /// Those of some rows.
    pub(super) fn rows(&self, rows: &Tensor) -> KeyValues {
        let of = |tensor: &Tensor| tensor.index_select(0, rows);
        KeyValues(self.0.iter().map(|(key, value)| (of(key), of(value))).collect())
    }

    fn tokens(&self) -> i64 {
        self.0.first().map_or(0, |(key, _)| key.size()[2])
    }
}

/// Rows of tokens to read after a common beginning.
pub(super) struct Rows<'a> {
    /// `[rows, tokens]`.
    pub(super) ids: &'a Tensor,
    /// Each token's place in its text, counted from 0, `[rows, tokens]`.
    pub(super) places: &'a Tensor,
    /// Which of the own tokens, kept and new, a token must not see, `[rows, 1, tokens, all own]`: true where hidden.
    pub(super) hidden: &'a Tensor,
}

impl Opt {
    /// Takes the tensors, which were checked against the configuration.
    pub(super) fn of(tensors: &Tensors, config: &OptConfig) -> anyhow::Result<Opt> {
        let tensor = |name: &str| {
            let found = tensors.get(name).map(Tensor::shallow_clone);
            found.ok_or_else(|| anyhow::anyhow!("the tensor {name} is missing"))
        };
        let dense = |name: &str| {
            let bias = config.enable_bias.then(|| tensor(&format!("{name}.bias"))).transpose()?;
            anyhow::Ok(Dense { weight: tensor(&format!("{name}.weight"))?, bias })
        };
        let norm = |name: &str| {
            let both = || anyhow::Ok((tensor(&format!("{name}.weight"))?, tensor(&format!("{name}.bias"))?));
            let weights = config.layer_norm_elementwise_affine.then(both).transpose()?;
            anyhow::Ok(Norm { size: config.hidden_size, weights })
        };
        let projection = |name: &str| {
            let dense = || anyhow::Ok(Dense { weight: tensor(&format!("{name}.weight"))?, bias: None });
            config.projects_words().then(dense).transpose()
        };
        let layer = |layer: i64| {
            let at = |part: &str| format!("layers.{layer}.{part}");
            anyhow::Ok(Layer {
                query: dense(&at("self_attn.q_proj"))?,
                key: dense(&at("self_attn.k_proj"))?,
                value: dense(&at("self_attn.v_proj"))?,
                output: dense(&at("self_attn.out_proj"))?,
                attention_norm: norm(&at("self_attn_layer_norm"))?,
                inner: dense(&at("fc1"))?,
                outer: dense(&at("fc2"))?,
                norm: norm(&at("final_layer_norm"))?,
            })
        };
        let words = tensor("embed_tokens.weight")?;
        Ok(Opt {
            head: if config.tie_word_embeddings { words.shallow_clone() } else { tensor(HEAD)? },
            words,
            positions: tensor("embed_positions.weight")?,
            project_in: projection("project_in")?,
            project_out: projection("project_out")?,
            layers: (0..config.num_hidden_layers).map(layer).collect::<anyhow::Result<_>>()?,
            final_norm: config.has_final_norm().then(|| norm("final_layer_norm")).transpose()?,
            heads: config.num_attention_heads,
            norm_first: config.do_layer_norm_before,
            activation: config.activation()?,
        })
    }

    /// Where it computes.
    pub(super) fn device(&self) -> Device {
        self.words.device()
    }

    /// No tokens, of so many rows.
    pub(super) fn nothing_read(&self, rows: i64) -> KeyValues {
        let size = self.positions.size()[1] / self.heads;
        let none = || Tensor::zeros([rows, self.heads, 0, size], (self.words.kind(), self.device()));
        KeyValues(self.layers.iter().map(|_| (none(), none())).collect())
    }

    /// Reads tokens that come after `beginning`, which is one row for all, and after what is `kept` of each row; they are kept too.
    /// Their states `[rows, tokens, width]`.
    pub(super) fn read(&self, rows: &Rows<'_>, beginning: &KeyValues, kept: &mut KeyValues) -> Tensor {
        debug_assert_eq!(rows.hidden.size()[3], kept.tokens() + rows.ids.size()[1]);
        let words = Tensor::embedding(&self.words, rows.ids, -1, false, false);
        let words = self.project_in.as_ref().map(|dense| dense.forward(&words)).unwrap_or(words);
        let places = Tensor::embedding(&self.positions, &(rows.places + FIRST_POSITION), -1, false, false);
        let bias = rows.hidden.to_kind(words.kind()) * HIDDEN;
        let mut states = words + places;
        for ((layer, beginning), kept) in self.layers.iter().zip(&beginning.0).zip(&mut kept.0) {
            let read = if self.norm_first { layer.attention_norm.forward(&states) } else { states.shallow_clone() };
            states += self.attend(layer, &read, beginning, kept, &bias);
            if !self.norm_first {
                states = layer.attention_norm.forward(&states);
            }
            let read = if self.norm_first { layer.norm.forward(&states) } else { states.shallow_clone() };
            states += layer.outer.forward(&self.activation.of(&layer.inner.forward(&read)));
            if !self.norm_first {
                states = layer.norm.forward(&states);
            }
        }
        let states = self.final_norm.as_ref().map(|norm| norm.forward(&states)).unwrap_or(states);
        self.project_out.as_ref().map(|dense| dense.forward(&states)).unwrap_or(states)
    }

    /// The logits of the tokens after states, in 32 bits.
    pub(super) fn logits(&self, states: &Tensor) -> Tensor {
        states.linear(&self.head, None::<&Tensor>).to_kind(Kind::Float)
    }

    /// Self-attention. The scores of the common beginning are one product for all rows, so that it is neither read nor kept again
    /// for each of them.
    fn attend(
        &self,
        layer: &Layer,
        states: &Tensor,
        (first_key, first_value): &(Tensor, Tensor),
        (own_key, own_value): &mut (Tensor, Tensor),
        bias: &Tensor,
    ) -> Tensor {
        let (rows, tokens, width) = (states.size()[0], states.size()[1], states.size()[2]);
        let (heads, size) = (self.heads, width / self.heads);
        let split = |of: Tensor| of.view([rows, tokens, heads, size]).transpose(1, 2);
        let query = split(layer.query.forward(states) * (size as f64).powf(-0.5));
        *own_key = Tensor::cat(&[&*own_key, &split(layer.key.forward(states))], 2);
        *own_value = Tensor::cat(&[&*own_value, &split(layer.value.forward(states))], 2);
        let beginning = first_key.size()[2];
        let all_rows = |of: &Tensor| of.transpose(0, 1).reshape([heads, rows * tokens, -1]);
        let by_row = |of: Tensor, last: i64| of.view([heads, rows, tokens, last]).transpose(0, 1);
        let own = query.matmul(&own_key.transpose(2, 3)) + bias;
        if beginning == 0 {
            let attended = own.softmax(-1, Kind::Float).to_kind(states.kind()).matmul(own_value);
            return layer.output.forward(&attended.transpose(1, 2).reshape([rows, tokens, width]));
        }
        let first = by_row(all_rows(&query).matmul(&first_key.get(0).transpose(1, 2)), beginning);
        let shares = Tensor::cat(&[first, own], -1).softmax(-1, Kind::Float).to_kind(states.kind());
        let (first, own) = (shares.narrow(3, 0, beginning), shares.narrow(3, beginning, own_key.size()[2]));
        let attended = by_row(all_rows(&first).matmul(&first_value.get(0)), size) + own.matmul(own_value);
        layer.output.forward(&attended.transpose(1, 2).reshape([rows, tokens, width]))
    }
}

impl Activation {
    fn of(self, input: &Tensor) -> Tensor {
        match self {
            Activation::Relu => input.relu(),
            Activation::Gelu => input.gelu("none"),
            Activation::GeluTanh => input.gelu("tanh"),
            Activation::GeluSigmoid => (input * 1.702).sigmoid() * input,
            Activation::Silu => input.silu(),
        }
    }
}
