//! `config.json` of a sentence encoder's folder.

use std::path::Path;

use anyhow::{Context, ensure};
use serde::Deserialize;

use crate::data::text_file;

/// The architecture's sizes, as `config.json` publishes them.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct TransformerConfig {
    pub(super) model_type: String,
    pub(super) hidden_size: i64,
    pub(super) intermediate_size: i64,
    pub(super) num_attention_heads: i64,
    pub(super) num_hidden_layers: i64,
    pub(super) max_position_embeddings: i64,
    pub(super) vocab_size: i64,
    #[serde(default = "two")]
    pub(super) type_vocab_size: i64,
    #[serde(default = "thirty_two")]
    pub(super) relative_attention_num_buckets: i64,
    #[serde(default)]
    pub(super) pad_token_id: Option<i64>,
    #[serde(default)]
    hidden_act: Option<String>,
    #[serde(default)]
    position_embedding_type: Option<String>,
    pub(super) layer_norm_eps: f64,
}

fn two() -> i64 {
    2
}

fn thirty_two() -> i64 {
    32
}

impl TransformerConfig {
    pub(super) fn read(path: &Path) -> anyhow::Result<TransformerConfig> {
        let text = text_file::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
        let config: TransformerConfig = serde_json::from_str(&text).with_context(|| format!("{}", path.display()))?;
        config.check().with_context(|| format!("{}", path.display()))?;
        Ok(config)
    }

    /// Refuses what is not built here, and sizes that no model has, before anything is allocated by them.
    fn check(&self) -> anyhow::Result<()> {
        let sizes = [
            ("hidden_size", self.hidden_size),
            ("intermediate_size", self.intermediate_size),
            ("num_attention_heads", self.num_attention_heads),
            ("num_hidden_layers", self.num_hidden_layers),
            ("max_position_embeddings", self.max_position_embeddings),
            ("vocab_size", self.vocab_size),
            ("type_vocab_size", self.type_vocab_size),
            ("relative_attention_num_buckets", self.relative_attention_num_buckets),
        ];
        for (name, size) in sizes {
            ensure!((1..10_000_000).contains(&size), "{name} is {size}");
        }
        ensure!(self.num_hidden_layers <= 1000, "num_hidden_layers is {}", self.num_hidden_layers);
        ensure!(
            self.hidden_size % self.num_attention_heads == 0,
            "hidden_size {} is no multiple of num_attention_heads {}",
            self.hidden_size,
            self.num_attention_heads
        );
        ensure!(self.relative_attention_num_buckets >= 4, "relative_attention_num_buckets is less than 4");
        ensure!((0..self.vocab_size).contains(&self.padding()), "pad_token_id is {}", self.padding());
        let activation = self.hidden_act.as_deref().unwrap_or("gelu");
        ensure!(activation == "gelu", "hidden_act {activation:?} is not supported (gelu is)");
        let positions = self.position_embedding_type.as_deref().unwrap_or("absolute");
        ensure!(positions == "absolute", "position_embedding_type {positions:?} is not supported (absolute is)");
        Ok(())
    }

    /// The id of the padding token; where the file is silent, the architecture's default.
    pub(super) fn padding(&self) -> i64 {
        self.pad_token_id.unwrap_or(i64::from(self.model_type == "mpnet"))
    }

    /// The longest text in tokens that the position embeddings serve.
    pub(super) fn longest(&self) -> i64 {
        match self.model_type.as_str() {
            // Positions are counted from one after the padding token's id.
            "mpnet" => self.max_position_embeddings - self.padding() - 1,
            _ => self.max_position_embeddings,
        }
    }
}
