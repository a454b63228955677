//! Figures beside their baselines, `baselines.json`. A figure is how many times as long something takes as copying a mebibyte
//! takes in the same process, so that figures of different machines can be compared; both are the least of many measurements,
//! so that other work on the machine matters little. `SPRINT_RECORD_BASELINES=1 make bench` stores what it measures.

// Each bench is a program of its own and uses a part of this.
#![allow(dead_code, clippy::print_stdout)]

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use anyhow::Context;

const MEBIBYTE: usize = 1 << 20;

pub(crate) struct Baselines {
    path: PathBuf,
    stored: BTreeMap<String, f64>,
    copy: f64,
    begun: SystemTime,
    record: bool,
}

impl Baselines {
    pub(crate) fn open() -> anyhow::Result<Baselines> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bench/baselines.json");
        let text = std::fs::read_to_string(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        let stored = serde_json::from_str(&text).with_context(|| format!("{} is not a table", path.display()))?;
        let record = std::env::var_os("SPRINT_RECORD_BASELINES").is_some();
        Ok(Baselines { path, stored, copy: copy_seconds(), begun: SystemTime::now(), record })
    }

    /// Prints how long something takes in copies of a mebibyte, beside its baseline.
    pub(crate) fn compare(&mut self, name: &str, least: Duration) -> anyhow::Result<()> {
        let copies = least.as_secs_f64() / self.copy;
        let beside = match self.stored.get(name) {
            Some(&stored) => format!("baseline {stored:.3}, {:.2} times that", copies / stored),
            None => "no baseline".to_owned(),
        };
        println!("{name}: {copies:.3} copies of 1 MiB; {beside}");
        if self.record {
            self.stored.insert(name.to_owned(), (copies * 1e3).round() / 1e3);
            std::fs::write(&self.path, serde_json::to_string_pretty(&self.stored)? + "\n")?;
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

/// The least that copying a mebibyte takes here.
fn copy_seconds() -> f64 {
    let (from, mut to) = (vec![1u8; MEBIBYTE], vec![0u8; MEBIBYTE]);
    let mut once = || {
        let begun = Instant::now();
        to.copy_from_slice(black_box(&from));
        black_box(&mut to);
        begun.elapsed().as_secs_f64()
    };
    (0..2000).map(|_| once()).fold(f64::INFINITY, f64::min)
}
