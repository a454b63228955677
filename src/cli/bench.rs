//! `sprint bench`: how fast the program is on this machine.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::exit_status::ExitStatus;
use super::{checkpoint, streams};
use crate::analysis::bench::{self, Baselines, BenchOptions, BenchReport, Part};

/// Measures the simulator, an agent, the sentence encoder and a training.
#[derive(Args)]
pub(crate) struct Bench {
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// What is measured [default: all]
    #[arg(long, value_enum, value_delimiter = ',')]
    only: Vec<PartName>,
    /// The trained agent whose decisions are timed: its folder, its name among checkpoints/, or ORG/NAME[@REVISION] on the
    /// Hub [default: the shipped one]
    #[arg(long, value_name = "DIR|NAME")]
    checkpoint: Option<PathBuf>,
    /// The preset whose updates are timed
    #[arg(long, value_name = "NAME|FILE", default_value = "l-bc")]
    preset: String,
    /// Compare with the times of this file, which --store wrote [default: those that come with the program]
    #[arg(long, value_name = "FILE")]
    baselines: Option<PathBuf>,
    /// Store the times in this file
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
}

/// A part, as the command line names it.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum PartName {
    Sim,
    Policy,
    Encoder,
    Train,
}

impl PartName {
    fn part(self) -> Part {
        match self {
            PartName::Sim => Part::Simulator,
            PartName::Policy => Part::Policy,
            PartName::Encoder => Part::Encoder,
            PartName::Train => Part::Training,
        }
    }
}

impl Bench {
    /// Prints the figures.
    ///
    /// # Errors
    /// When something that was asked for cannot be opened, or a file of baselines be read or written.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let parts = match self.only.as_slice() {
            [] => Part::ALL.to_vec(),
            only => only.iter().map(|name| name.part()).collect(),
        };
        let baselines = self.baselines.as_deref().map_or_else(Baselines::shipped, Baselines::read)?;
        let options = BenchOptions {
            parts,
            checkpoint: self.checkpoint.as_deref().map(checkpoint::folder).transpose()?,
            preset: self.preset,
            baselines,
        };
        let report = bench::run(options, &|part| streams::say(&format!("measuring {part}")))?;
        if let Some(path) = &self.store {
            Baselines::store(&report.baselines, path)?;
        }
        let mut out = streams::out();
        if self.json {
            writeln!(out, "{}", serde_json::to_string(&report)?)?;
        } else {
            write!(out, "{}", in_words(&report))?;
        }
        Ok(ExitStatus::Ok)
    }
}

fn in_words(report: &BenchReport) -> String {
    let mut lines = Vec::new();
    if let Some(sim) = &report.sim {
        lines.push(format!("frames of 300 x 300, one core      {:>12.0} /s", sim.frames_per_s));
        lines.push(format!("steps by chance, one core          {:>12.0} /s", sim.steps_per_s));
        lines.push(format!("going back to an episode's start   {:>12.1} us", sim.reset_us));
    }
    if let Some(policy) = &report.policy {
        let (each, longest) = (policy.decision_ms, policy.longest_ms);
        lines.push(format!("a decision of {:<20} {each:>12.1} ms, at most {longest:.1}", policy.name));
    }
    if let Some(encoder) = &report.encoder {
        lines.push(format!("one short sentence, one core       {:>12.1} ms", encoder.sentence_ms));
    }
    if let Some(train) = &report.train {
        let (steps, samples) = (train.steps_per_s, train.samples_per_s);
        let with = format!("updates with {}", train.preset);
        lines.push(format!("{with:<34} {steps:>12.2} /s, {samples:.0} samples/s, threads: {}", train.threads));
    }
    lines.push(String::new());
    lines.push(format!("in copies of a mebibyte ({:.3} ms here), and times as long as stored:", report.copy_ms));
    for one in &report.baselines {
        let ratio = one.ratio.map_or_else(|| "nothing stored".to_owned(), |ratio| format!("{ratio:.2}"));
        lines.push(format!("  {:<40} {:>12.1}  {ratio}", one.name, one.copies));
    }
    lines.join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_has_a_name_and_what_was_not_measured_is_not_told() {
        let named: Vec<Part> = PartName::value_variants().iter().map(|name| name.part()).collect();
        assert_eq!(named, Part::ALL);
        let options = BenchOptions {
            parts: Vec::new(),
            checkpoint: None,
            preset: "l-bc".into(),
            baselines: Baselines::shipped().unwrap(),
        };
        let report = bench::run(options, &|_| {}).unwrap();
        let words = in_words(&report);
        assert!(words.contains("copies of a mebibyte") && !words.contains("frames"), "{words}");
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json.as_object().unwrap().keys().collect::<Vec<_>>(), ["baselines", "copy_ms"]);
    }
}
