//! `chains.jsonl`: pairs of instructions, the second of which a language model finds likely after the first, with its text for both. Its
//! first line after the header says how they were ranked.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{bail, ensure};
use serde::{Deserialize, Serialize};

use super::line_log::{self, LineLog};
use crate::language::count::counted;
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
    /// What no plan says.
    fn misfit(&self) -> Option<String> {
        match () {
            () if self.batch_size == 0 => Some("batch_size: 0".to_owned()),
            () if !(self.keep > 0.0 && self.keep <= 1.0) => Some(format!("keep: {} is no share", self.keep)),
            () => None,
        }
    }

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
    Ok(apart(&path, line_log::read(&path, FORMAT)?.0)?.1)
}

/// The plan and the pairs that were ranked by it.
fn apart(path: &Path, lines: Vec<ChainLine>) -> anyhow::Result<(Option<ChainPlan>, Vec<RankedPair>)> {
    let (mut plan, mut pairs) = (None, Vec::new());
    let mut in_batch: BTreeMap<u64, usize> = BTreeMap::new();
    // The first line is the header.
    for (number, line) in (2..).zip(lines) {
        let misfit = match (line, &plan) {
            (ChainLine::Plan(_), Some(_)) => Some("another plan; a file holds the pairs of one".to_owned()),
            (ChainLine::Plan(first), None) => {
                let misfit = first.misfit();
                plan = Some(first);
                misfit
            }
            (ChainLine::Pair(_), None) => Some("a pair before the plan that it was ranked by".to_owned()),
            (ChainLine::Pair(pair), Some(plan)) => {
                let kept = in_batch.entry(pair.batch).or_default();
                *kept += 1;
                let misfit = (*kept > plan.kept()).then(|| {
                    format!("batch {}: its plan keeps {} of a batch", pair.batch, counted(plan.kept(), "pair"))
                });
                pairs.push(pair);
                misfit
            }
        };
        if let Some(misfit) = misfit {
            bail!("{}, line {number}: {misfit}: move the file away, and rank anew", path.display());
        }
    }
    Ok((plan, pairs))
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
        let (held, pairs) = apart(&path, lines)?;
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

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::language::maker::Sampling;

    #[test]
    fn lines_that_contradict_one_another_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let maker = Maker { model: "m".into(), files: None, prompt: "p".into(), sampling: Sampling::PAPER };
        let maker = serde_json::to_value(maker).unwrap();
        let plan = |keep: f64| {
            json!({"plan": {"maker": maker, "labels": null, "batch_size": 4, "keep": keep, "seed": 1}}).to_string()
        };
        let pair = |score: f64| {
            json!({"pair": {"batch": 0, "first": "a", "second": "b", "score": score, "text": "c"}}).to_string()
        };
        let read = |lines: &[String]| {
            let text = format!("{{\"format_version\":1}}\n{}\n", lines.join("\n"));
            std::fs::write(path(folder.path()), text).unwrap();
            read(folder.path()).map(|pairs| pairs.len()).map_err(|error| error.to_string())
        };
        assert_eq!(read(&[plan(0.5), pair(-1.0), pair(-2.0)]), Ok(2));
        for (lines, told) in [
            (vec![plan(0.5), pair(-1.0), plan(0.5)], "line 4: another plan"),
            (vec![pair(-1.0)], "line 2: a pair before the plan"),
            (vec![plan(2.0)], "line 2: keep: 2"),
            (vec![plan(0.25), pair(-1.0), pair(-2.0)], "line 4: batch 0: its plan keeps 1 pair"),
        ] {
            let error = read(&lines).unwrap_err();
            assert!(error.contains("chains.jsonl") && error.contains(told), "{told}: {error}");
        }
    }
}
