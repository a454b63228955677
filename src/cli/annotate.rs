//! `sprint annotate`: people say in a sentence what is done in spans of demonstrations.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;

use anyhow::{Context, bail, ensure};
use clap::Args;

use super::exit_status::ExitStatus;
use super::explore::{GraphicsName, settings};
use super::logging;
use super::streams::{self, Printable, say};
use super::tasks::TaskLengths;
use crate::data::Dataset;
use crate::episode::scenes::Scenes;
use crate::explore::annotation::agreement::agreement;
use crate::explore::annotation::export::{self, Exported, everybody};
use crate::explore::annotation::plain;
use crate::explore::annotation::session::AnnotationSession;
use crate::explore::annotation::spans::{SpanSelection, draw};
use crate::language::count::counted;
use crate::tui::annotate::{self, AnnotateScreen};
use crate::tui::update::ExitReason;

/// Asks a person, or tells and exports what people wrote.
#[derive(Args)]
pub(crate) struct Annotate {
    /// The dataset folder
    data: PathBuf,
    /// Who annotates; everybody has a file of their own in DATA/annotations [default: the user's name]
    #[arg(long = "as", value_name = "NAME")]
    person: Option<String>,
    /// Skills of a span; of several lengths (2,3 or 2-5) there are as many spans each, as far as there are any
    #[arg(long, value_name = "N|N,N|N-N", default_value = "2-5")]
    length: TaskLengths,
    /// Spans to ask about; with a larger number more come after the same first ones
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    count: u32,
    /// The same seed asks everybody about the same spans
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Spans of this split
    #[arg(long, value_name = "NAME", default_value = "train")]
    split: String,
    /// How to show pictures
    #[arg(long, value_enum, default_value = "auto")]
    graphics: GraphicsName,
    /// The most that a frame of the film may cost on the wire; pictures get coarser to keep to it
    #[arg(long, value_name = "KB")]
    bandwidth: Option<u32>,
    /// Films wait for a key
    #[arg(long)]
    paused: bool,
    /// No screen: steps on standard output, a sentence a line on standard input
    #[arg(long)]
    plain: bool,
    #[command(flatten)]
    written: Written,
}

/// What becomes of what people wrote, in place of asking.
#[derive(Args)]
struct Written {
    /// Say how far people agree
    #[arg(long, conflicts_with_all = ["labels", "tasks"])]
    agreement: bool,
    /// Add the sentences to the dataset's labels.jsonl, as those of the source `people`
    #[arg(long, conflicts_with = "tasks")]
    labels: bool,
    /// Write the spans as a task set, each told by its sentence
    #[arg(long, value_name = "FILE")]
    tasks: Option<PathBuf>,
    /// Replace a task set that is there
    #[arg(long, requires = "tasks")]
    force: bool,
    /// Print the agreement as JSON
    #[arg(long, requires = "agreement")]
    json: bool,
}

impl Annotate {
    /// Asks, tells, or exports.
    ///
    /// # Errors
    /// When the dataset cannot be read, the person's file not be written, or there is no terminal.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        match &self.written {
            Written { agreement: true, json, .. } => self.tell(*json),
            Written { labels: true, .. } => {
                let Exported { sentences, new, stale } = export::labels(&self.data)?;
                let file = self.data.join("labels.jsonl");
                say(&format!(
                    "{}: {}, {new} of them new{}",
                    file.display(),
                    counted(sentences, "label"),
                    left_out(stale)
                ));
                Ok(ExitStatus::Ok)
            }
            Written { tasks: Some(file), force, .. } => {
                ensure!(*force || !file.exists(), "{} exists; --force replaces it", file.display());
                let Exported { sentences, stale, .. } = export::tasks(&self.data, file)?;
                say(&format!("{}: {}{}", file.display(), counted(sentences, "task"), left_out(stale)));
                Ok(ExitStatus::Ok)
            }
            _ => self.ask(),
        }
    }

    fn tell(&self, json: bool) -> anyhow::Result<ExitStatus> {
        Dataset::open(&self.data)?;
        let found = agreement(&everybody(&self.data)?);
        let mut out = streams::out();
        if json {
            serde_json::to_writer_pretty(&mut out, &found)?;
            writeln!(out)?;
            return Ok(ExitStatus::Ok);
        }
        if found.people.is_empty() {
            writeln!(out, "nobody has annotated {} yet", self.data.display())?;
        }
        for line in found.lines() {
            writeln!(out, "{line}")?;
        }
        for span in &found.spans {
            let [first, end] = span.span.skills;
            writeln!(out, "\n{:.2}  {}, skills {} to {end}", span.words, span.span.trajectory, first + 1)?;
            for (name, text) in &span.sentences {
                writeln!(out, "      {name}: {text}")?;
            }
        }
        Ok(ExitStatus::Ok)
    }

    fn ask(self) -> anyhow::Result<ExitStatus> {
        let is_terminal = std::io::stdout().is_terminal() && std::io::stdin().is_terminal();
        if !self.plain && !is_terminal {
            bail!("annotating needs a terminal; with --plain it reads a sentence a line from standard input");
        }
        let named = || ["USER", "LOGNAME"].iter().find_map(|name| std::env::var(name).ok());
        let person = self.person.or_else(named).context("the annotator has no name: give one by --as NAME")?;
        let dataset = Dataset::open(&self.data)?;
        let count = self.count as usize;
        let selection = SpanSelection { lengths: self.length.0, count, split: self.split, seed: self.seed };
        let spans = draw(&dataset, &selection)?;
        let mut session = AnnotationSession::open(&self.data, &person, spans)?;
        if self.plain {
            let (input, out) = (std::io::stdin().lock(), Printable::new(streams::StandardOutput::lock()));
            plain::run(&mut session, input, out)?;
            return Ok(ExitStatus::Ok);
        }
        let kilobytes = self.bandwidth.filter(|&kilobytes| kilobytes > 0);
        let screen = AnnotateScreen {
            protocol: self.graphics.protocol(),
            scheme: settings()?.scheme,
            bandwidth: kilobytes.map(|kilobytes| 1000 * u64::from(kilobytes)),
            paused: self.paused,
            memory: Some(logging::path().with_file_name("terminals.json")),
            log: logging::open().ok(),
            dataset: self.data.clone(),
        };
        let scenes = Scenes::in_folder(Some(self.data.join("scenes")));
        match annotate::run(screen, session, scenes)? {
            ExitReason::Signal(_) => Ok(ExitStatus::Interrupted),
            ExitReason::Asked | ExitReason::ToList | ExitReason::WorkerGone => Ok(ExitStatus::Ok),
        }
    }
}

/// What is said of spans that could not be exported.
fn left_out(stale: usize) -> String {
    match stale {
        0 => String::new(),
        stale => {
            format!("; left out: {}, which the dataset no longer holds as it was described", counted(stale, "span"))
        }
    }
}
