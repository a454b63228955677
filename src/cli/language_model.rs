//! Options of the commands that ask a language model.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;

use crate::language::maker::Sampling;

/// Which model is asked, and how its tokens are drawn.
#[derive(Args)]
pub(crate) struct LanguageModelArgs {
    /// The model: an OPT folder with safetensors weights for `opt`
    #[arg(long, value_name = "DIR")]
    model: Option<PathBuf>,
    /// What its labels are called [default: the model's name]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Logits are divided by it; 0 takes the likeliest token each time
    #[arg(long, value_name = "X", default_value_t = Sampling::PAPER.temperature, value_parser = temperature)]
    temperature: f64,
    /// Draw from the likeliest tokens that together have this probability
    #[arg(long, value_name = "X", default_value_t = Sampling::PAPER.top_p, value_parser = top_p)]
    top_p: f64,
}

fn temperature(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    (0.0..=10.0).contains(&number).then_some(number).ok_or_else(|| "not within 0 to 10".into())
}

fn top_p(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    (number > 0.0 && number <= 1.0).then_some(number).ok_or_else(|| "not above 0 and at most 1".into())
}

impl LanguageModelArgs {
    pub(crate) fn sampling(&self) -> Sampling {
        Sampling { temperature: self.temperature, top_p: self.top_p, ..Sampling::PAPER }
    }

    /// The model's folder.
    pub(crate) fn folder(&self) -> anyhow::Result<&Path> {
        self.model.as_deref().context("--with opt needs --model DIR, an OPT folder with safetensors weights")
    }
}
