//! `config.json` of an OPT folder, with the defaults that its authors' library has where a field is left out.

use std::path::Path;

use anyhow::{Context, ensure};
use serde::Deserialize;

use crate::data::text_file;

/// The architecture's sizes and switches.
#[derive(Clone, Debug, Deserialize)]
#[serde(default)]
pub(super) struct OptConfig {
    pub(super) vocab_size: i64,
    pub(super) hidden_size: i64,
    pub(super) num_hidden_layers: i64,
    pub(super) ffn_dim: i64,
    pub(super) num_attention_heads: i64,
    pub(super) max_position_embeddings: i64,
    /// The width of word embeddings, which are projected where it is another than the layers'.
    word_embed_proj_dim: Option<i64>,
    /// Whether a layer normalises what it reads, or what it wrote.
    pub(super) do_layer_norm_before: bool,
    #[serde(rename = "_remove_final_layer_norm")]
    remove_final_layer_norm: bool,
    activation_function: String,
    pub(super) enable_bias: bool,
    pub(super) layer_norm_elementwise_affine: bool,
    pub(super) tie_word_embeddings: bool,
    pub(super) bos_token_id: Option<u32>,
    pub(super) eos_token_id: Option<u32>,
}

impl Default for OptConfig {
    fn default() -> OptConfig {
        OptConfig {
            vocab_size: 50_272,
            hidden_size: 768,
            num_hidden_layers: 12,
            ffn_dim: 3072,
            num_attention_heads: 12,
            max_position_embeddings: 2048,
            word_embed_proj_dim: None,
            do_layer_norm_before: true,
            remove_final_layer_norm: false,
            activation_function: "relu".into(),
            enable_bias: true,
            layer_norm_elementwise_affine: true,
            tie_word_embeddings: true,
            bos_token_id: Some(2),
            eos_token_id: Some(2),
        }
    }
}

/// The function between a layer's two dense ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Activation {
    Relu,
    Gelu,
    /// GELU by its approximation with tanh.
    GeluTanh,
    /// GELU by its approximation with a sigmoid.
    GeluSigmoid,
    Silu,
}

/// What is read before all else.
#[derive(Deserialize)]
struct Kind {
    #[serde(default)]
    model_type: Option<String>,
}

impl OptConfig {
    /// Reads a folder's `config.json`.
    ///
    /// # Errors
    /// In one sentence where the folder holds another model or none.
    pub(super) fn read(folder: &Path) -> anyhow::Result<OptConfig> {
        let path = folder.join("config.json");
        ensure!(path.is_file(), "{} is no folder of an OPT model: it holds no config.json", folder.display());
        let text = text_file::read(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        let context = || path.display().to_string();
        let kind: Kind = serde_json::from_str(&text).with_context(context)?;
        let kind = kind.model_type.unwrap_or_else(|| "none".into());
        ensure!(
            kind == "opt",
            "{} is no OPT model: its config.json says model_type {kind:?}; serve it and use --with http",
            folder.display()
        );
        let config: OptConfig = serde_json::from_str(&text).with_context(context)?;
        config.check().with_context(context)?;
        Ok(config)
    }

    /// Refuses sizes that no model has, before anything is allocated by them.
    fn check(&self) -> anyhow::Result<()> {
        let sizes = [
            ("vocab_size", self.vocab_size),
            ("hidden_size", self.hidden_size),
            ("num_hidden_layers", self.num_hidden_layers),
            ("ffn_dim", self.ffn_dim),
            ("num_attention_heads", self.num_attention_heads),
            ("max_position_embeddings", self.max_position_embeddings),
            ("word_embed_proj_dim", self.word_width()),
        ];
        for (name, size) in sizes {
            ensure!((1..10_000_000).contains(&size), "{name} is {size}");
        }
        ensure!(self.num_hidden_layers <= 1000, "num_hidden_layers is {}", self.num_hidden_layers);
        let (hidden, heads) = (self.hidden_size, self.num_attention_heads);
        ensure!(hidden % heads == 0, "hidden_size {hidden} is no multiple of num_attention_heads {heads}");
        self.activation()?;
        Ok(())
    }

    pub(super) fn word_width(&self) -> i64 {
        self.word_embed_proj_dim.unwrap_or(self.hidden_size)
    }

    pub(super) fn projects_words(&self) -> bool {
        self.word_width() != self.hidden_size
    }

    pub(super) fn has_final_norm(&self) -> bool {
        self.do_layer_norm_before && !self.remove_final_layer_norm
    }

    pub(super) fn activation(&self) -> anyhow::Result<Activation> {
        Ok(match self.activation_function.as_str() {
            "relu" => Activation::Relu,
            "gelu" => Activation::Gelu,
            "gelu_new" | "gelu_fast" | "gelu_pytorch_tanh" => Activation::GeluTanh,
            "quick_gelu" => Activation::GeluSigmoid,
            "silu" | "swish" => Activation::Silu,
            other => anyhow::bail!(
                "activation_function {other:?} is not supported (relu, gelu, gelu_new, gelu_fast, gelu_pytorch_tanh, \
                 quick_gelu and silu are)"
            ),
        })
    }
}
