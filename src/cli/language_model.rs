//! Options of the commands that ask a language model.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::Context;
use clap::Args;

use crate::language::maker::Sampling;
use crate::nets::completion_server::{CompletionServer, Pace};

/// Where a server's key is looked for: options can be read by whoever lists processes.
pub(super) const KEY: &str = "SPRINT_API_KEY";

/// Which model is asked, and how its tokens are drawn.
#[derive(Args)]
pub(crate) struct LanguageModelArgs {
    /// `opt`: an OPT folder with safetensors weights; `http`: the model's name on the server
    #[arg(long, value_name = "DIR|NAME")]
    model: Option<String>,
    /// `http`: the address of an OpenAI-compatible server, as http://127.0.0.1:8080/v1; its key, if it needs one, is read from the
    /// environment variable SPRINT_API_KEY
    #[arg(long)]
    url: Option<String>,
    /// What its labels are called [default: the model's name]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Logits are divided by it; 0 takes the likeliest token each time
    #[arg(long, value_name = "X", default_value_t = Sampling::PAPER.temperature, value_parser = temperature)]
    temperature: f64,
    /// Draw from the likeliest tokens that together have this probability
    #[arg(long, value_name = "X", default_value_t = Sampling::PAPER.top_p, value_parser = top_p)]
    top_p: f64,
    /// `http`: requests under way at once
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..))]
    jobs: u16,
    /// `http`: requests in a minute at most
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    per_minute: Option<u32>,
    /// `http`: seconds that an answer may take
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = clap::value_parser!(u64).range(1..))]
    timeout: u64,
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

    /// The folder of a model in this process.
    pub(crate) fn folder(&self) -> anyhow::Result<&Path> {
        let folder =
            self.model.as_deref().context("--with opt needs --model DIR, an OPT folder with safetensors weights")?;
        anyhow::ensure!(self.url.is_none(), "--with opt computes in this process: --url is for --with http");
        Ok(Path::new(folder))
    }

    /// A server, and the model's name there.
    pub(crate) fn server(&self, stop: &Arc<AtomicBool>) -> anyhow::Result<(CompletionServer, &str)> {
        let url =
            self.url.as_deref().context("--with http needs --url URL, the address of an OpenAI-compatible server")?;
        let model = self.model.as_deref().context("--with http needs --model NAME, the model's name on the server")?;
        let key = std::env::var(KEY).ok().filter(|key| !key.is_empty());
        let pace = Pace {
            at_once: self.jobs.into(),
            per_minute: self.per_minute,
            tries: 8,
            first_wait: Duration::from_secs(1),
            timeout: Duration::from_secs(self.timeout),
        };
        Ok((CompletionServer::new(url, key, pace, stop.clone())?, model))
    }
}
