//! `sprint replay`: re-runs recorded demonstrations in the simulator.

use std::io::Write;
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;

use super::exit_status::ExitStatus;
use super::progress::Counter;
use super::streams;
use super::streams::say;
use crate::data::{Dataset, folder};
use crate::eval::replay::{MissCount, ReplayOptions, ReplayReport, replay};
use crate::language::count::counted;

/// How many failures of each kind are listed.
const LISTED: usize = 500;
/// How many kinds of interactions out of view or reach are listed.
const MISSES: usize = 40;

/// Re-runs recorded demonstrations.
#[derive(Args)]
pub(crate) struct ReplayArgs {
    /// The dataset folder
    data: PathBuf,
    /// Only this split (train, valid_seen, ...)
    #[arg(long)]
    split: Option<String>,
    /// Compare where targets are projected with where they were recorded
    #[arg(long)]
    boxes: bool,
    /// Ask whether an agent there would have seen and reached what was acted on
    #[arg(long)]
    sight: bool,
    /// With --sight, a folder for a picture of each interaction whose target was out of view or reach
    #[arg(long, value_name = "DIR", requires = "sight")]
    pictures: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl ReplayArgs {
    /// Replays and prints what came of it.
    ///
    /// # Errors
    /// When the dataset cannot be read, or holds nothing of the split.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let dataset = Dataset::open(&self.data)?;
        let counts = &dataset.manifest().counts;
        let of = |split: &String| counts.get(split).map_or(0, |counts| counts.trajectories);
        let total = self.split.as_ref().map_or_else(|| counts.keys().map(of).sum(), of);
        if let Some(split) = &self.split {
            dataset.check_split(split)?;
        }
        let counter = Counter::new("replaying", total);
        let options =
            ReplayOptions { split: self.split, boxes: self.boxes, sight: self.sight, pictures: self.pictures };
        if let Some(folder) = &options.pictures {
            folder::make(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        }
        let report = replay(&dataset, &options, &|done| counter.add(done));
        counter.end();
        let report = report?;
        list_failures(&report);
        let mut out = streams::out();
        if self.json {
            writeln!(out, "{}", serde_json::to_string(&report)?)?;
        } else {
            print(&report, &mut out)?;
        }
        Ok(ExitStatus::Ok)
    }
}

fn list_failures(report: &ReplayReport) {
    for (what, count) in &report.failures {
        for failure in report.failed.iter().filter(|failure| failure.what == *what).take(LISTED) {
            say(&format!("{what}: {}: {}", failure.id, failure.reason));
        }
        if *count > LISTED {
            say(&format!("{what}: ... and {} more", count - LISTED));
        }
    }
}

fn print(report: &ReplayReport, out: &mut impl Write) -> std::io::Result<()> {
    writeln!(out, "trajectories        {}", report.trajectories)?;
    for (what, share) in [
        ("actions possible", report.legal),
        ("goals met", report.goals),
        ("skills, class", report.skills_class),
        ("skills, strict", report.skills_strict),
    ] {
        writeln!(out, "{what:<20}{:.2} %", share * 100.0)?;
    }
    if let Some(seen) = report.seen {
        writeln!(out, "seen and reached    {:.2} %", seen * 100.0)?;
        for MissCount { miss, count } in report.misses.iter().take(MISSES) {
            let from = miss.receptacle.map_or_else(String::new, |class| format!(" from {class}"));
            writeln!(out, "  {count:>4}  {} {}{from}: {}", miss.action, miss.object, miss.cause)?;
        }
    }
    for (name, set) in &report.task_sets {
        writeln!(out, "{name:<20}{}, {} by class, {} strict", counted(set.tasks, "task"), set.class, set.strict)?;
    }
    if let Some(boxes) = &report.boxes {
        writeln!(
            out,
            "boxes               {} compared; median overlap {:.3} of pickups, {:.3} of puts",
            boxes.n, boxes.pickup_median_iou, boxes.put_median_iou
        )?;
        for (class, boxes) in &boxes.per_class {
            writeln!(out, "  {class:<28}{:>6} {:.3}", boxes.n, boxes.median_iou)?;
        }
    }
    Ok(())
}
