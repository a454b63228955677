//! `sprint relabel`: what runs of skills are called.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::{Args, ValueEnum};

use super::exit_status::ExitStatus;
use super::language_model::LanguageModelArgs;
use super::progress::Progress;
use super::stop;
use super::streams::say;
use crate::language::count::counted;
use crate::language::passage::{Concatenation, Summarizer};
use crate::language::rules::Rules;
use crate::nets::device::best_device;
use crate::train::http_summarizer::HttpSummarizer;
use crate::train::opt_summarizer::OptSummarizer;
use crate::train::relabel::relabel;

/// Labels runs of skills.
#[derive(Args)]
pub(crate) struct Relabel {
    /// The dataset folder
    data: PathBuf,
    /// Who writes the labels
    #[arg(long)]
    with: With,
    #[command(flatten)]
    language_model: LanguageModelArgs,
    /// Label only so many passages, chosen by chance; a larger sample holds a smaller one
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    sample: Option<u32>,
}

#[derive(Clone, Copy, ValueEnum)]
enum With {
    /// A short summary, from the skills and the annotator's own words
    Rules,
    /// The annotator's sentences one after the other
    Concat,
    /// An OPT model in this process
    Opt,
    /// A model on an OpenAI-compatible server (llama.cpp, vLLM, Ollama)
    Http,
}

impl Relabel {
    /// Writes the labels that are missing in the dataset's labels.jsonl.
    ///
    /// # Errors
    /// When the dataset cannot be read, its folder not be written to, or the model not be asked.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let stop = stop::on_signals()?;
        let summarizer = self.summarizer(&stop)?;
        let mut progress = Progress::new();
        let found =
            relabel(&self.data, summarizer.as_ref(), self.sample.map(|sample| sample as usize), &mut progress, &stop)?;
        progress.end();
        let malformed = match found.malformed {
            0 => String::new(),
            count => format!(", {} without a summary", counted(count, "answer")),
        };
        if found.stopped {
            say(&format!(
                "stopped after {}{malformed}; the same command goes on from here",
                counted(found.asked, "text")
            ));
            return Ok(ExitStatus::Interrupted);
        }
        let (source, version) = (summarizer.source(), summarizer.version());
        say(&format!(
            "{}: {}, {} labelled before, {} written by {source} {version}{malformed}",
            self.data.join("labels.jsonl").display(),
            counted(found.spans, "span"),
            found.known,
            counted(found.asked, "text")
        ));
        Ok(ExitStatus::Ok)
    }

    fn summarizer(&self, stop: &Arc<AtomicBool>) -> anyhow::Result<Box<dyn Summarizer>> {
        let model = &self.language_model;
        Ok(match self.with {
            With::Rules => Box::new(Rules),
            With::Concat => Box::new(Concatenation),
            With::Opt => {
                Box::new(OptSummarizer::open(model.folder()?, model.name.clone(), model.sampling(), best_device())?)
            }
            With::Http => {
                let (server, name) = model.server(stop)?;
                Box::new(HttpSummarizer::new(server, name, model.name.clone(), model.sampling()))
            }
        })
    }
}
