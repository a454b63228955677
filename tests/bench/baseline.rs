//! Figures beside their baselines, as `sprint bench` compares them; `SPRINT_RECORD_BASELINES=1 make bench` stores what it measures.

// Each bench is a program of its own and uses a part of this.
#![allow(dead_code, clippy::print_stdout)]

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::Context;
use sprint_explorer::analysis::bench::Baselines;

pub(crate) struct CriterionBaselines {
    path: PathBuf,
    baselines: Baselines,
    begun: SystemTime,
    record: bool,
}

impl CriterionBaselines {
    pub(crate) fn open() -> anyhow::Result<CriterionBaselines> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/bench_baselines.json");
        let baselines = Baselines::read(&path)?;
        let record = std::env::var_os("SPRINT_RECORD_BASELINES").is_some();
        Ok(CriterionBaselines { path, baselines, begun: SystemTime::now(), record })
    }

    /// Prints how long something takes in copies of a mebibyte, beside its baseline.
    pub(crate) fn compare(&mut self, name: &str, least: Duration) -> anyhow::Result<()> {
        let comparison = self.baselines.compare(name, least).clone();
        let beside = match comparison.ratio {
            Some(ratio) => format!("{ratio:.2} times the baseline"),
            None => "no baseline".to_owned(),
        };
        println!("{name}: {:.3} copies of 1 MiB; {beside}", comparison.copies);
        if self.record {
            Baselines::store(&[comparison], &self.path)?;
        }
        Ok(())
    }

    /// The same for what criterion has measured since this was opened.
    pub(crate) fn compare_criterion(&mut self, names: &[&str]) -> anyhow::Result<()> {
        for name in names {
            // Criterion names a folder after each part, spaces and all.
            let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("criterion").join(name);
            let path = folder.join("new/sample.json");
            let Ok(about) = std::fs::metadata(&path) else { continue };
            if about.modified()? < self.begun {
                continue;
            }
            let sample: Sample = serde_json::from_slice(&std::fs::read(&path)?)
                .with_context(|| format!("{} is not a sample of criterion's", path.display()))?;
            let each = sample.times.iter().zip(&sample.iters).map(|(time, count)| time / count);
            let least = each.fold(f64::INFINITY, f64::min);
            self.compare(name, Duration::from_secs_f64(least / 1e9))?;
        }
        Ok(())
    }
}

/// What criterion stores of a benchmark: nanoseconds and iterations of each measurement.
#[derive(serde::Deserialize)]
struct Sample {
    iters: Vec<f64>,
    times: Vec<f64>,
}
