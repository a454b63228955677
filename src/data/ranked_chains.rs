//! `chains.jsonl`: pairs of instructions, the second of which a language model finds likely after the first, with its text for both. Its
//! first line after the header says how they were ranked.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use serde::{Deserialize, Serialize};

use super::line_log::{self, LineLog};
use crate::language::maker::Maker;

/// A pair that was kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RankedPair {
    /// The batch that it was among the best of.
    pub(crate) batch: u64,
    pub(crate) first: String,
    pub(crate) second: String,
    /// The mean log-probability of the second's tokens after the first.
    pub(crate) score: f64,
    /// What the model calls both together; empty where its answer held no summary.
    pub(crate) text: String,
}

/// What the pairs of a file are made of, and by whom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ChainPlan {
    /// Who ranks and writes.
    pub(crate) maker: Maker,
    /// Whose labels the runs of skills among the instructions bear; without them there are single skills alone.
    pub(crate) labels: Option<String>,
    /// Candidates in a batch.
    pub(crate) batch_size: usize,
    /// The share of a batch that is kept.
    pub(crate) keep: f64,
    /// Drives which instructions are paired.
    pub(crate) seed: u64,
}

impl ChainPlan {
    /// How many pairs of a batch are kept.
    pub(crate) fn kept(&self) -> usize {
        ((self.keep * self.batch_size as f64).round() as usize).clamp(1, self.batch_size.max(1))
    }
}

/// A line of the file.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum ChainLine {
    Plan(ChainPlan),
    Pair(RankedPair),
}

/// The format version this program reads and writes.
const FORMAT: u32 = 1;

fn path(folder: &Path) -> PathBuf {
    folder.join("chains.jsonl")
}

/// The pairs of a dataset's folder.
///
/// # Errors
/// When it has none, or the file is malformed.
pub(crate) fn read(folder: &Path) -> anyhow::Result<Vec<RankedPair>> {
    let path = path(folder);
    ensure!(path.exists(), "{} is not there; `sprint chains` writes it", path.display());
    Ok(apart(line_log::read(&path, FORMAT)?.0).1)
}

fn apart(lines: Vec<ChainLine>) -> (Option<ChainPlan>, Vec<RankedPair>) {
    let (mut plan, mut pairs) = (None, Vec::new());
    for line in lines {
        match line {
            ChainLine::Plan(first) => plan = Some(first),
            ChainLine::Pair(pair) => pairs.push(pair),
        }
    }
    (plan, pairs)
}

/// A dataset's file of pairs, opened to be added to.
pub(crate) struct ChainLedger(LineLog);

impl ChainLedger {
    /// Opens or begins the file for a plan, and returns the pairs that are there.
    ///
    /// # Errors
    /// When the pairs there are of another plan, or the file is in use or cannot be written to.
    pub(crate) fn open(folder: &Path, plan: &ChainPlan) -> anyhow::Result<(ChainLedger, Vec<RankedPair>)> {
        let path = path(folder);
        let (mut file, lines) = LineLog::open(&path, FORMAT)?;
        let (held, pairs) = apart(lines);
        match held {
            None => file.append(&[ChainLine::Plan(plan.clone())])?,
            Some(held) => ensure!(
                held == *plan,
                "{} holds pairs that were ranked otherwise (by {}; batches of {}, {} kept, seed {}, labels of {}): move it away",
                path.display(),
                held.maker,
                held.batch_size,
                held.keep,
                held.seed,
                held.labels.as_deref().unwrap_or("none")
            ),
        }
        Ok((ChainLedger(file), pairs))
    }

    /// Adds a batch's pairs in one write.
    ///
    /// # Errors
    /// When the disk is full.
    pub(crate) fn append(&mut self, pairs: &[RankedPair]) -> anyhow::Result<()> {
        self.0.append(&pairs.iter().cloned().map(ChainLine::Pair).collect::<Vec<_>>())
    }
}
