//! Who made a label: which model, asked how.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A language model and how it was asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Maker {
    /// The model's name, as its folder or its server calls it.
    pub model: String,
    /// The first 16 digits of the sha256 of its files; nothing of a model on a server.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub files: Option<String>,
    /// The digest of the prompt that stands before every passage.
    pub prompt: String,
    /// How its tokens were drawn.
    pub sampling: Sampling,
}

/// How a model's tokens are drawn. What is drawn depends on the passage alone, which seeds the draw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sampling {
    /// Logits are divided by it; at 0 the likeliest token is taken.
    pub temperature: f64,
    /// Only the likeliest tokens that together have this probability are drawn from.
    pub top_p: f64,
    /// An answer that has not ended after so many tokens is none.
    pub most_tokens: u32,
}

impl Sampling {
    /// The paper's temperature and top-p.
    pub(crate) const PAPER: Sampling = Sampling { temperature: 0.8, top_p: 0.9, most_tokens: 60 };
}

impl fmt::Display for Maker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Sampling { temperature, top_p, most_tokens } = self.sampling;
        write!(f, "{}", self.model)?;
        if let Some(files) = &self.files {
            write!(f, " of files {files}")?;
        }
        write!(f, ", prompt {}, temperature {temperature}, top-p {top_p}, {most_tokens} tokens", self.prompt)
    }
}
