//! `sprint chains`: pairs of instructions to chain, ranked by a language model.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::exit_status::ExitStatus;
use super::language_model::LanguageModelArgs;
use super::progress::Progress;
use super::stop;
use super::streams::say;
use crate::data::ranked_chains::ChainPlan;
use crate::language::count::counted;
use crate::nets::device::best_device;
use crate::train::http_summarizer::HttpSummarizer;
use crate::train::opt_summarizer::OptSummarizer;
use crate::train::ranked_chains::{ChainModel, rank_chains};

/// Ranks pairs of instructions to chain.
#[derive(Args)]
pub(crate) struct Chains {
    /// The dataset folder
    data: PathBuf,
    /// Who ranks them
    #[arg(long)]
    with: With,
    #[command(flatten)]
    language_model: LanguageModelArgs,
    /// The share of each batch that is kept, the likeliest
    #[arg(long, value_name = "X", default_value_t = 0.01, value_parser = share)]
    keep: f64,
    /// How many batches of pairs are ranked
    #[arg(long, value_name = "N", default_value_t = 100)]
    batches: u64,
    /// Random pairs in a batch
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..))]
    batch_size: u32,
    /// Pair runs of skills too, under the labels of this source [default: single skills alone]
    #[arg(long, value_name = "SOURCE")]
    labels: Option<String>,
    /// Drives which instructions are paired
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

#[derive(Clone, Copy, ValueEnum)]
enum With {
    /// An OPT model in this process
    Opt,
    /// A model on an OpenAI-compatible server that tells log-probabilities of prompts (vLLM, llama-cpp-python)
    Http,
}

fn share(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    (number > 0.0 && number <= 1.0).then_some(number).ok_or_else(|| "not above 0 and at most 1".into())
}

impl Chains {
    /// Writes the batches that are missing in the dataset's chains.jsonl.
    ///
    /// # Errors
    /// When the dataset cannot be read, its chains are of another plan, or the model cannot be asked.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let stop = stop::on_signals()?;
        let of = &self.language_model;
        let (name, sampling) = (of.name.clone(), of.sampling());
        let model: Box<dyn ChainModel> = match self.with {
            With::Opt => Box::new(OptSummarizer::open(of.folder()?, name, sampling, best_device())?),
            With::Http => {
                let (server, model) = of.server(&stop)?;
                Box::new(HttpSummarizer::new(server, model, name, sampling))
            }
        };
        let plan = ChainPlan {
            maker: model.chain_maker(),
            labels: self.labels,
            batch_size: self.batch_size as usize,
            keep: self.keep,
            seed: self.seed,
        };
        let mut progress = Progress::new();
        let found = rank_chains(&self.data, model.as_ref(), &plan, self.batches, &mut progress, &stop)?;
        progress.end();
        if found.stopped {
            say("stopped; the same command goes on from here");
            return Ok(ExitStatus::Interrupted);
        }
        let malformed = match found.malformed {
            0 => String::new(),
            count => format!(", {count} of them without a text"),
        };
        say(&format!(
            "{}: {} ranked before, {} now, {}{malformed}",
            self.data.join("chains.jsonl").display(),
            counted(found.known, "batch"),
            found.ranked,
            counted(found.pairs, "pair")
        ));
        Ok(ExitStatus::Ok)
    }
}
