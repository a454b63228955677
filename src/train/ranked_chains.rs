//! Pairs of instructions to chain, ranked by a language model (the paper's SPRINT with LLM-chain): of each batch of random pairs those are
//! kept whose second instruction is likeliest after the first, and the model says what both come to.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::ensure;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::metrics::{ProgressLogger, Scalars};
use crate::data::Dataset;
use crate::data::items::composites;
use crate::data::ranked_chains::{ChainLedger, ChainPlan, RankedPair};
use crate::data::summaries::Summaries;
use crate::language::instruction::normalise;
use crate::language::maker::Maker;
use crate::language::passage::{Passage, Summarizer, Summary};

/// A summarizer that also says how likely a step is after another.
pub(crate) trait ChainModel: Summarizer {
    /// The mean log-probability of each second step's tokens after the first step; nothing when the work was stopped before.
    ///
    /// # Errors
    /// When the model cannot be asked.
    fn log_probabilities(&self, steps: &[(String, String)]) -> anyhow::Result<Option<Vec<f64>>>;

    /// The model that ranks and writes.
    fn chain_maker(&self) -> Maker;
}

/// Pairs that are ranked between two looks at whether to stop.
const TOGETHER: usize = 32;

/// Counts of a ranking.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct RankedCounts {
    /// Batches that were there before.
    pub(crate) known: u64,
    /// Batches that were ranked now.
    pub(crate) ranked: u64,
    /// Pairs in the file now.
    pub(crate) pairs: usize,
    /// Of those, how many have no text.
    pub(crate) malformed: usize,
    pub(crate) stopped: bool,
}

/// Ranks batches up to the number `batches` that are not in the dataset's chains.jsonl yet. What a batch holds depends on the plan and its
/// number alone; a batch is kept when it is done.
///
/// # Errors
/// When the dataset cannot be read, its chains are of another plan, or the model cannot be asked.
pub(crate) fn rank_chains(
    folder: &Path,
    model: &dyn ChainModel,
    plan: &ChainPlan,
    batches: u64,
    logger: &mut dyn ProgressLogger,
    stop: &AtomicBool,
) -> anyhow::Result<RankedCounts> {
    let instructions = instructions(folder, plan.labels.as_deref())?;
    let (mut ledger, mut pairs) = ChainLedger::open(folder, plan)?;
    let last = pairs.last().map_or(0, |pair| pair.batch);
    // A batch whose end was lost, because the disk was full, is ranked again for what is missing.
    let mut there = pairs.iter().filter(|pair| pair.batch == last).count();
    let first = last + u64::from(there >= plan.kept());
    there %= plan.kept();
    let mut counts = RankedCounts { known: first.min(batches), ..RankedCounts::default() };
    for batch in first..batches {
        let mut rank = |done: usize| {
            let step = batch * plan.batch_size as u64 + done as u64;
            logger.log(&Scalars::new("chains", step, batches * plan.batch_size as u64))?;
            anyhow::Ok(stop.load(Ordering::Relaxed))
        };
        let Some(mut best) = best_of_batch(&instructions, model, plan, batch, &mut rank)? else {
            counts.stopped = true;
            break;
        };
        best.drain(..std::mem::take(&mut there));
        ledger.append(&best)?;
        counts.ranked += 1;
        pairs.extend(best);
    }
    counts.pairs = pairs.len();
    counts.malformed = pairs.iter().filter(|pair| pair.text.is_empty()).count();
    Ok(counts)
}

/// The best pairs of a batch with the model's texts; nothing when it was stopped.
fn best_of_batch(
    instructions: &[String],
    model: &dyn ChainModel,
    plan: &ChainPlan,
    batch: u64,
    at: &mut dyn FnMut(usize) -> anyhow::Result<bool>,
) -> anyhow::Result<Option<Vec<RankedPair>>> {
    let mut rng = ChaCha8Rng::seed_from_u64(plan.seed);
    rng.set_stream(batch + 1);
    let mut draw = || instructions[rng.random_range(0..instructions.len())].clone();
    let candidates: Vec<(String, String)> = (0..plan.batch_size).map(|_| (draw(), draw())).collect();
    let mut scores: Vec<f64> = Vec::with_capacity(candidates.len());
    for chunk in candidates.chunks(TOGETHER) {
        if at(scores.len())? {
            return Ok(None);
        }
        let Some(likely) = model.log_probabilities(chunk)? else { return Ok(None) };
        ensure!(likely.len() == chunk.len(), "{} ranked too few pairs", model.source());
        scores.extend(likely);
    }
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]));
    order.truncate(plan.kept());
    let sentences: Vec<[String; 2]> = order.iter().map(|&index| candidates[index].clone().into()).collect();
    let passage = |sentences| Passage { roles: &[], subtasks: &[], sentences };
    let passages: Vec<Passage<'_>> = sentences.iter().map(|both| passage(both)).collect();
    let mut texts: Vec<Option<String>> = vec![None; passages.len()];
    model.summaries(&passages, &mut |index, summary| {
        texts[index] = Some(match summary {
            Summary::Sentence(text) => text,
            Summary::Malformed(_) => String::new(),
        });
        Ok(())
    })?;
    let Some(texts) = texts.into_iter().collect::<Option<Vec<String>>>() else { return Ok(None) };
    let pair = |((index, [first, second]), text): ((usize, [String; 2]), String)| RankedPair {
        batch,
        first,
        second,
        score: scores[index],
        text,
    };
    Ok(Some(order.into_iter().zip(sentences).zip(texts).map(pair).collect()))
}

/// The instructions of all spans to learn from, each as often as spans bear it: single skills, and runs that have a label.
fn instructions(folder: &Path, labels: Option<&str>) -> anyhow::Result<Vec<String>> {
    let dataset = Dataset::open(folder)?;
    let summaries = match labels {
        Some(source) => Summaries::read(&[folder], Some(source))?,
        None => Summaries::default(),
    };
    let mut found = Vec::new();
    for trajectory in dataset.trajectories()? {
        let trajectory = trajectory?;
        for annotation in &trajectory.annotations {
            if annotation.steps.len() != trajectory.skills.len() {
                continue;
            }
            found.extend(annotation.steps.iter().map(|step| normalise(step)));
            for skills in composites(&trajectory, &dataset.manifest().held_out) {
                let passage = Passage::of(&trajectory, annotation, skills);
                found.extend(passage.and_then(|passage| summaries.find(&passage).map(normalise)));
            }
        }
    }
    found.retain(|text| !text.is_empty());
    ensure!(!found.is_empty(), "{} has no annotated skills to chain", folder.display());
    Ok(found)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use super::*;
    use crate::data::dataset::{self, DatasetWriter};
    use crate::data::ranked_chains;
    use crate::domain::trajectory::{self, Annotation};
    use crate::domain::{Action, ActionType, SkillKind, Trajectory};
    use crate::house::testing::{put_subtask, role, subtask};
    use crate::language::maker::Sampling;
    use crate::language::passage::TakeSummary;

    /// Finds a step likely that is longer than the one before, and can be told to stop.
    struct Lengths(AtomicUsize);

    impl Summarizer for Lengths {
        fn source(&self) -> &str {
            "lengths"
        }

        fn version(&self) -> u32 {
            1
        }

        fn together(&self) -> usize {
            1
        }

        fn summaries(&self, passages: &[Passage<'_>], take: &mut TakeSummary<'_>) -> anyhow::Result<()> {
            let joint = passages.iter().map(|passage| Summary::Sentence(passage.sentences.join(" + ")));
            joint.enumerate().try_for_each(|(index, text)| take(index, text))
        }
    }

    impl ChainModel for Lengths {
        fn log_probabilities(&self, steps: &[(String, String)]) -> anyhow::Result<Option<Vec<f64>>> {
            self.0.fetch_add(steps.len(), Ordering::Relaxed);
            Ok(Some(steps.iter().map(|(first, second)| second.len() as f64 - first.len() as f64).collect()))
        }

        fn chain_maker(&self) -> Maker {
            plan().maker
        }
    }

    struct Silent;

    impl ProgressLogger for Silent {
        fn log(&mut self, _: &Scalars) -> anyhow::Result<()> {
            Ok(())
        }
    }

    fn plan() -> ChainPlan {
        let maker = Maker { model: "lengths".into(), files: None, prompt: "p".into(), sampling: Sampling::PAPER };
        ChainPlan { maker, labels: None, batch_size: 100, keep: 0.03, seed: 4 }
    }

    fn dataset() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = DatasetWriter::new(folder.path()).unwrap();
        for id in ["a", "b", "c"] {
            let steps = vec![format!("take {}", id.repeat(9)), format!("put it on the desk {id}")];
            let trajectory = Trajectory {
                actions: vec![Action::navigate(ActionType::MoveAhead); 2],
                roles: vec![role("Mug"), role("Desk")],
                skills: vec![subtask(SkillKind::Pickup, 0), put_subtask(0, 1)],
                skill_starts: vec![0, 1],
                annotations: vec![Annotation { goal: "g".into(), steps }],
                ..trajectory::testing::empty(id, "s")
            };
            writer.trajectory(&trajectory).unwrap();
        }
        writer.finish(&dataset::testing::manifest(0, &[])).unwrap();
        folder
    }

    fn rank(folder: &Path, model: &Lengths, batches: u64) -> RankedCounts {
        rank_chains(folder, model, &plan(), batches, &mut Silent, &AtomicBool::new(false)).unwrap()
    }

    #[test]
    fn the_likeliest_pairs_of_each_batch_are_kept_with_the_models_text() {
        let (folder, model) = (dataset(), Lengths(AtomicUsize::new(0)));
        let counts = rank(folder.path(), &model, 2);
        assert_eq!(counts, RankedCounts { known: 0, ranked: 2, pairs: 6, malformed: 0, stopped: false });
        let pairs = ranked_chains::read(folder.path()).unwrap();
        assert_eq!(pairs.iter().map(|pair| pair.batch).collect::<Vec<_>>(), [0, 0, 0, 1, 1, 1]);
        for pair in &pairs {
            assert!(pair.first.starts_with("Take ") && pair.second.starts_with("Put it on the desk"), "{pair:?}");
            assert_eq!((pair.score, &pair.text), (6.0, &format!("{} + {}", pair.first, pair.second)));
        }
    }

    #[test]
    fn a_ranking_goes_on_after_the_last_whole_batch_and_refuses_another_plan() {
        let (folder, model) = (dataset(), Lengths(AtomicUsize::new(0)));
        rank(folder.path(), &model, 3);
        let whole = std::fs::read(folder.path().join("chains.jsonl")).unwrap();
        let other = dataset();
        rank(other.path(), &model, 1);
        let asked = model.0.load(Ordering::Relaxed);
        assert_eq!(rank(other.path(), &model, 3).known, 1);
        assert_eq!(model.0.load(Ordering::Relaxed) - asked, 200, "the first batch is not ranked again");
        assert_eq!(std::fs::read(other.path().join("chains.jsonl")).unwrap(), whole);
        let plan = ChainPlan { keep: 0.5, ..plan() };
        let again = rank_chains(folder.path(), &model, &plan, 3, &mut Silent, &AtomicBool::new(false));
        let error = again.unwrap_err().to_string();
        assert!(error.contains("ranked otherwise") && error.contains("0.03 kept"), "{error}");
    }

    #[test]
    fn a_ranking_that_is_stopped_keeps_no_half_batch() {
        let (folder, model) = (dataset(), Lengths(AtomicUsize::new(0)));
        let counts = rank_chains(folder.path(), &model, &plan(), 2, &mut Silent, &AtomicBool::new(true)).unwrap();
        assert_eq!(counts, RankedCounts { stopped: true, ..RankedCounts::default() });
        assert!(ranked_chains::read(folder.path()).unwrap().is_empty());
    }
}
