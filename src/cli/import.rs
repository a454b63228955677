//! `sprint import`: makes a dataset folder of data as others publish it.

use std::path::PathBuf;
use std::sync::Mutex;

use clap::{Args, Subcommand};

use super::exit_status::ExitStatus;
use super::progress;
use super::streams::say;
use crate::data::alfred::{self, ImportProgress};
use crate::language::count::counted;

/// Makes a dataset folder.
#[derive(Args)]
pub(crate) struct Import {
    #[command(subcommand)]
    from: From,
}

#[derive(Subcommand)]
enum From {
    /// From an ALFRED checkout: floor plans, demonstrations and the three official task sets
    Alfred(Alfred),
}

/// From an ALFRED checkout.
#[derive(Args)]
struct Alfred {
    /// The checkout: the folder with data/ and gen/layouts/
    source: PathBuf,
    /// The dataset folder to write
    out: PathBuf,
    /// A folder with the authors' eval_{instruct,length,scene}_ann_human.json
    #[arg(long, value_name = "DIR")]
    eval_lists: Option<PathBuf>,
}

impl Import {
    /// Imports, and tells what was skipped.
    ///
    /// # Errors
    /// When nothing can be imported or the folder cannot be written.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let From::Alfred(alfred) = self.from;
        alfred.run()
    }
}

impl Alfred {
    fn run(self) -> anyhow::Result<ExitStatus> {
        let display = Mutex::new(progress::Progress::new());
        let show = |progress: ImportProgress| {
            let (what, done, total) = match progress {
                ImportProgress::Reading(done, total) => ("reading", done, total),
                ImportProgress::Building(done, total) => ("building scenes", done, total),
                ImportProgress::Writing(done, total) => ("writing", done, total),
            };
            if let Ok(mut display) = display.lock() {
                display.show(what, done, total, "");
            }
        };
        let options = alfred::ImportOptions { eval_lists: self.eval_lists };
        let summary = alfred::import(&self.source, &self.out, &options, &show);
        if let Ok(display) = display.lock() {
            display.end();
        }
        let summary = summary?;
        let manifest = &summary.manifest;
        for skip in &manifest.skipped {
            say(&format!("skipped: {}: {}", skip.file, skip.reason));
        }
        for (split, counts) in &manifest.counts {
            say(&format!(
                "{split}: {}, {} ({} aligned), {} ({} to train on)",
                counted(counts.trajectories, "trajectory"),
                counted(counts.annotated_primitives, "annotated skill"),
                counts.aligned_primitives,
                counted(counts.spans, "longer span"),
                counts.spans_after_holdout
            ));
        }
        for set in &summary.sets {
            match &set.tasks {
                Ok(tasks) => say(&format!("{}: {}", set.name, counted(*tasks, "task"))),
                Err(reason) => say(&format!("{}: left out: {reason}", set.name)),
            }
        }
        let skipped = manifest.skipped.len();
        let (scenes, files) = (counted(manifest.scenes, "scene"), counted(skipped, "file"));
        say(&format!("{scenes} in {}; {files} skipped", self.out.display()));
        Ok(if skipped == 0 { ExitStatus::Ok } else { ExitStatus::SomeFailed })
    }
}
