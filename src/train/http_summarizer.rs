//! Summaries by a language model on a server.

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use serde::Deserialize;
use serde_json::json;

use super::ranked_chains::ChainModel;
use crate::language::instruction::visible;
use crate::language::maker::{Maker, Sampling};
use crate::language::passage::{Passage, Summarizer, Summary, TakeSummary};
use crate::language::prompt;
use crate::nets::completion_server::{Completion, CompletionServer};

/// A model on a server that sums passages up.
pub(crate) struct HttpSummarizer {
    server: CompletionServer,
    name: String,
    maker: Maker,
    /// Whether an answer had the form of a completion: before that, one that has not is a wrong server's.
    has_completed: AtomicBool,
}

/// A completion that repeats the prompt with how likely each of its tokens was.
#[derive(Deserialize)]
struct Scored {
    choices: Vec<ScoredChoice>,
}

#[derive(Deserialize)]
struct ScoredChoice {
    logprobs: Option<TokenLogprobs>,
}

#[derive(Deserialize)]
struct TokenLogprobs {
    /// Where each token begins in prompt and answer.
    text_offset: Vec<i64>,
    /// Nothing of the first one.
    token_logprobs: Vec<Option<f64>>,
}

impl HttpSummarizer {
    /// Asks `server` for a model by its name; `name` is what its labels are called, where it is another.
    pub(crate) fn new(
        server: CompletionServer,
        model: &str,
        name: Option<String>,
        sampling: Sampling,
    ) -> HttpSummarizer {
        let maker = Maker { model: model.into(), files: None, prompt: prompt::digest(), sampling };
        let name = name.unwrap_or_else(|| model.to_owned());
        HttpSummarizer { server, name, maker, has_completed: AtomicBool::new(false) }
    }

    /// A passage's summary, or nothing when the work was stopped before.
    fn summary(&self, passage: &Passage<'_>) -> anyhow::Result<Option<Summary>> {
        let Sampling { temperature, top_p, most_tokens } = self.maker.sampling;
        let request = json!({
            "model": self.maker.model,
            "prompt": prompt::summarise(passage.sentences),
            "max_tokens": most_tokens,
            "temperature": temperature,
            "top_p": top_p,
            // Some servers keep it in 32 bits with a sign.
            "seed": passage.seed() >> 33,
            // The summary is the first sentence: nothing is paid for after it.
            "stop": ["\n", "."],
        });
        let Some(body) = self.server.ask(&request)? else { return Ok(None) };
        let choice = Completion::first_of(&body);
        if choice.is_some() {
            self.has_completed.store(true, Ordering::Relaxed);
        }
        let said = || visible(&String::from_utf8_lossy(&body)).chars().take(300).collect::<String>();
        Ok(Some(match choice {
            Some(choice) => prompt::summary(&choice.text, choice.finish_reason.as_deref() != Some("length")),
            None if self.has_completed.load(Ordering::Relaxed) => Summary::Malformed(said()),
            None => anyhow::bail!("the server's answer is no completion: {}", said()),
        }))
    }
}

impl HttpSummarizer {
    /// The mean log-probability of a second step's tokens after the first, or nothing when the work was stopped before.
    fn log_probability(&self, first: &str, second: &str) -> anyhow::Result<Option<f64>> {
        let (before, step) = prompt::follow(first, second);
        let request = json!({
            "model": self.maker.model,
            "prompt": format!("{before}{step}"),
            // Some servers refuse to draw nothing at all.
            "max_tokens": 1,
            "temperature": 0.0,
            "echo": true,
            "logprobs": 1,
        });
        let Some(body) = self.server.ask(&request)? else { return Ok(None) };
        let scored: Scored = serde_json::from_slice(&body).with_context(|| {
            let said: String = visible(&String::from_utf8_lossy(&body)).chars().take(300).collect();
            format!("the server's answer has no log-probabilities: {said}")
        })?;
        let told = scored.choices.into_iter().next().and_then(|choice| choice.logprobs);
        let (from, to) = (before.chars().count() as i64, (before.chars().count() + step.chars().count()) as i64);
        let likely: Vec<f64> = told
            .into_iter()
            .flat_map(|told| told.text_offset.into_iter().zip(told.token_logprobs))
            .filter(|(at, _)| (from..to).contains(at))
            .filter_map(|(_, likely)| likely)
            .collect();
        anyhow::ensure!(
            !likely.is_empty(),
            "the server gives no log-probabilities of a prompt (`echo` with `logprobs`), which ranking needs; vLLM and \
             llama-cpp-python do, or use --with opt"
        );
        Ok(Some(likely.iter().sum::<f64>() / likely.len() as f64))
    }
}

impl Summarizer for HttpSummarizer {
    fn source(&self) -> &str {
        &self.name
    }

    fn version(&self) -> u32 {
        1
    }

    fn maker(&self) -> Option<&Maker> {
        Some(&self.maker)
    }

    /// All: it stops between two requests.
    fn together(&self) -> usize {
        usize::MAX
    }

    fn summaries(&self, passages: &[Passage<'_>], take: &mut TakeSummary<'_>) -> anyhow::Result<()> {
        self.server.each(passages.len(), &|index| self.summary(&passages[index]), take)
    }
}

impl ChainModel for HttpSummarizer {
    fn log_probabilities(&self, steps: &[(String, String)]) -> anyhow::Result<Option<Vec<f64>>> {
        let mut found = vec![None; steps.len()];
        let ask = |index: usize| self.log_probability(&steps[index].0, &steps[index].1);
        self.server.each(steps.len(), &ask, &mut |index, likely| {
            found[index] = Some(likely);
            Ok(())
        })?;
        Ok(found.into_iter().collect())
    }

    fn chain_maker(&self) -> Maker {
        self.maker.clone()
    }
}
