//! `sprint critic`: whether a critic's values tell what can be done next from what cannot.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;

use super::exit_status::ExitStatus;
use super::{checkpoint, streams};
use crate::agent::checkpoint::Networks;
use crate::agent::config::CheckpointConfig;
use crate::agent::sentence_encoders;
use crate::data::Dataset;
use crate::data::items::{ItemSource, Items};
use crate::data::selection::{Composites, DataSelection};
use crate::data::summaries::Summaries;
use crate::nets::device::best_device;
use crate::train::chaining_value::{Judge, RelationValues};
use crate::train::frame_store::FrameStore;

/// Measures a critic.
#[derive(Args)]
pub(crate) struct CriticArgs {
    /// A dataset's folder
    data: PathBuf,
    /// The agent whose critic is measured: its folder, or its name among checkpoints/
    #[arg(long, value_name = "DIR|NAME")]
    checkpoint: PathBuf,
    /// Pairs of each kind
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pairs: u32,
    /// Drives the choice of pairs
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Only demonstrations of this split
    #[arg(long, value_name = "NAME")]
    split: Option<String>,
    /// Runs of skills under their labels, too, not single skills alone
    #[arg(long)]
    composites: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl CriticArgs {
    /// Measures V of the states that skills end in, for instructions that can follow and for others.
    ///
    /// # Errors
    /// When data or checkpoint cannot be read, or there is no critic.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let folder = checkpoint::folder(&self.checkpoint)?;
        let config = CheckpointConfig::read(&folder)?;
        let device = best_device();
        let networks = Networks::load(&folder, &config, device)?;
        let sentences = sentence_encoders::open_for(&folder, device)?;
        let sentences = sentences.with_context(|| format!("{}: the agent reads no sentences", folder.display()))?;
        let datasets = [Dataset::open(&self.data)?];
        if let Some(split) = &self.split {
            datasets[0].check_split(split)?;
        }
        let frames = FrameStore::open(&datasets)?;
        let composites = if self.composites { Composites::Labels } else { Composites::None };
        let summaries = match self.composites {
            true => Summaries::read(&[Path::new(&self.data)], None)?,
            false => Summaries::default(),
        };
        let is_other = |split: &str| self.split.as_deref().is_some_and(|only| only != split);
        let apart: Vec<bool> = frames.trajectories.iter().map(|trajectory| is_other(&trajectory.split)).collect();
        let source = ItemSource {
            trajectories: &frames.trajectories,
            apart: &apart,
            held_out: &frames.held_out,
            summaries: &summaries,
        };
        let items = Items::of(&source, frames.labels()?, &DataSelection::of(composites))?;
        let judge = Judge { config: &config, networks: &networks, sentences: &sentences };
        let count = (self.pairs as usize, self.seed);
        let measured = judge.measure(&frames, &items, &items.training, count)?;
        print(&measured, self.json)?;
        Ok(ExitStatus::Ok)
    }
}

fn print(measured: &[RelationValues], json: bool) -> anyhow::Result<()> {
    let mut out = streams::out();
    if json {
        writeln!(out, "{}", serde_json::json!({ "relations": measured }))?;
        return Ok(out.flush()?);
    }
    writeln!(out, "| B, after A | pairs | mean V | feasible above it (AUC) |")?;
    writeln!(out, "|---|---|---|---|")?;
    for RelationValues { relation, pairs, mean, auc, interval: [low, high] } in measured {
        let words = relation.words();
        writeln!(out, "| {words} | {pairs} | {mean:.3} | {auc:.3} ({low:.3} to {high:.3}) |")?;
    }
    Ok(out.flush()?)
}
