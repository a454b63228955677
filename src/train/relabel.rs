//! Relabelling: one summary for every composite span of a dataset, for each annotator.

use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::metrics::{ProgressLogger, Scalars};
use crate::data::Dataset;
use crate::data::items::composites;
use crate::data::summaries::{Ledger, SpanSummary};
use crate::domain::Trajectory;
use crate::language::passage::{Passage, Summarizer};

/// Spans whose labels are appended at once; after each chunk a relabelling can be stopped.
const CHUNK: usize = 4096;

/// Counts of a relabelling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Relabelled {
    /// Spans, once for each aligned annotation.
    pub(crate) spans: usize,
    /// Of those, how many had this source's label already.
    pub(crate) known: usize,
    /// How many passages the summarizer was asked for.
    pub(crate) asked: usize,
    /// Whether it was stopped before the end.
    pub(crate) stopped: bool,
}

/// A run of two or more skills of a trajectory, in the words of one annotator.
struct CompositeSpan<'a> {
    trajectory: &'a Trajectory,
    annotator: usize,
    skills: Range<usize>,
    passage: Passage<'a>,
    digest: String,
}

/// Writes the labels that are missing. A passage that the same source and version summed up before, here or in an earlier run, is not
/// asked for again.
///
/// # Errors
/// When the dataset cannot be read, its labels not be written, or the summarizer fails; what was labelled until then stays.
pub(crate) fn relabel(
    folder: &Path,
    summarizer: &dyn Summarizer,
    logger: &mut dyn ProgressLogger,
    stop: &AtomicBool,
) -> anyhow::Result<Relabelled> {
    let dataset = Dataset::open(folder)?;
    let trajectories = dataset.trajectories()?.collect::<anyhow::Result<Vec<_>>>()?;
    let (mut ledger, lines) = Ledger::open(folder)?;
    let ours = |line: &SpanSummary| line.source == summarizer.source() && line.version == summarizer.version();
    let mut texts: HashMap<String, String> = HashMap::new();
    let mut labelled = HashSet::new();
    for line in lines.into_iter().filter(ours) {
        labelled.insert((line.trajectory, line.annotator, line.skills, line.input.clone()));
        texts.insert(line.input, line.text);
    }
    let mut missing = Vec::new();
    let mut found = Relabelled::default();
    for trajectory in &trajectories {
        for span in composite_spans(trajectory, &dataset.manifest().held_out) {
            found.spans += 1;
            let line = span.line(String::new(), summarizer);
            match labelled.contains(&(line.trajectory, line.annotator, line.skills, line.input)) {
                true => found.known += 1,
                false => missing.push(span),
            }
        }
    }
    let mut done = found.known;
    for chunk in missing.chunks(CHUNK) {
        if stop.load(Ordering::Relaxed) {
            found.stopped = true;
            break;
        }
        let mut asked = HashSet::new();
        let new: Vec<&CompositeSpan> = chunk
            .iter()
            .filter(|span| !texts.contains_key(&span.digest) && asked.insert(span.digest.as_str()))
            .collect();
        let passages: Vec<Passage> = new.iter().map(|span| span.passage).collect();
        let summaries = summarizer.summaries(&passages)?;
        anyhow::ensure!(summaries.len() == new.len(), "{} gave too few summaries", summarizer.source());
        found.asked += new.len();
        texts.extend(new.iter().map(|span| span.digest.clone()).zip(summaries));
        let lines = chunk.iter().map(|span| span.line(texts[&span.digest].clone(), summarizer));
        ledger.append(&lines.collect::<Vec<_>>())?;
        done += chunk.len();
        logger.log(&Scalars::new("labels", done as u64, found.spans as u64))?;
    }
    Ok(found)
}

/// The composite spans of a trajectory, once for each aligned annotation.
fn composite_spans<'a>(trajectory: &'a Trajectory, held_out: &[String]) -> Vec<CompositeSpan<'a>> {
    let mut found = Vec::new();
    for (annotator, annotation) in trajectory.annotations.iter().enumerate() {
        for skills in composites(trajectory, held_out) {
            if let Some(passage) = Passage::of(trajectory, annotation, skills.clone()) {
                found.push(CompositeSpan { trajectory, annotator, skills, passage, digest: passage.digest() });
            }
        }
    }
    found
}

impl CompositeSpan<'_> {
    fn line(&self, text: String, summarizer: &dyn Summarizer) -> SpanSummary {
        SpanSummary {
            trajectory: self.trajectory.id.clone(),
            annotator: self.annotator as u32,
            skills: [self.skills.start as u8, self.skills.end as u8],
            text,
            source: summarizer.source().to_string(),
            version: summarizer.version(),
            input: self.digest.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use super::*;
    use crate::data::dataset;
    use crate::data::dataset::DatasetWriter;
    use crate::data::items::{ActionLabel, ItemSource, Items};
    use crate::data::selection::{Composites, DataSelection};
    use crate::data::summaries::Summaries;
    use crate::domain::trajectory;
    use crate::domain::trajectory::Annotation;
    use crate::domain::{Action, ActionType, SkillKind};
    use crate::house::testing::{put_subtask, role, subtask};
    use crate::language::passage::Concatenation;
    use crate::language::rules::Rules;

    /// Counts what it is asked.
    struct Counting(AtomicUsize);

    impl Summarizer for Counting {
        fn source(&self) -> &'static str {
            "counting"
        }

        fn version(&self) -> u32 {
            1
        }

        fn summaries(&self, passages: &[Passage<'_>]) -> anyhow::Result<Vec<String>> {
            self.0.fetch_add(passages.len(), Ordering::Relaxed);
            Ok(passages.iter().map(|passage| format!("{} steps", passage.sentences.len())).collect())
        }
    }

    struct Silent;

    impl ProgressLogger for Silent {
        fn log(&mut self, _: &Scalars) -> anyhow::Result<()> {
            Ok(())
        }
    }

    /// Two trajectories of three skills that two people tell alike, and a third one whose whole is held out.
    fn dataset() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = DatasetWriter::new(folder.path()).unwrap();
        let annotation = Annotation {
            goal: "put a clean mug on the desk".into(),
            steps: ["Take the red mug.", "Wash it.", "Put it on the desk."].map(str::to_owned).to_vec(),
        };
        for id in ["a", "b", "held"] {
            let trajectory = Trajectory {
                actions: vec![Action::navigate(ActionType::MoveAhead); 3],
                roles: vec![role("Mug"), role("Desk")],
                skills: vec![subtask(SkillKind::Pickup, 0), subtask(SkillKind::Clean, 0), put_subtask(0, 1)],
                skill_starts: vec![0, 1, 2],
                annotations: vec![annotation.clone(); 2],
                ..trajectory::testing::empty(id, "s")
            };
            writer.trajectory(&trajectory).unwrap();
        }
        writer.finish(&dataset::testing::manifest(0, &["held"])).unwrap();
        folder
    }

    fn run(folder: &Path, summarizer: &dyn Summarizer) -> Relabelled {
        relabel(folder, summarizer, &mut Silent, &AtomicBool::new(false)).unwrap()
    }

    #[test]
    fn every_span_gets_a_label_and_nothing_is_asked_twice() {
        let folder = dataset();
        let counting = Counting(AtomicUsize::new(0));
        let first = run(folder.path(), &counting);
        assert_eq!(first, Relabelled { spans: 16, known: 0, asked: 3, stopped: false });
        let second = run(folder.path(), &counting);
        assert_eq!(second, Relabelled { spans: 16, known: 16, asked: 0, stopped: false });
        assert_eq!(counting.0.load(Ordering::Relaxed), 3);
    }

    #[test]
    fn a_relabelling_that_was_cut_off_goes_on_where_it_was() {
        let folder = dataset();
        run(folder.path(), &Rules);
        let path = folder.path().join("labels.jsonl");
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
        let again = run(folder.path(), &Rules);
        assert!(again.known > 0 && again.known < 16, "{again:?}");
        assert_eq!(std::fs::read(&path).unwrap(), whole);
    }

    #[test]
    fn labels_become_the_texts_of_items() {
        let folder = dataset();
        run(folder.path(), &Rules);
        run(folder.path(), &Concatenation);
        let dataset = Dataset::open(folder.path()).unwrap();
        let trajectories: Vec<Trajectory> = dataset.trajectories().unwrap().map(Result::unwrap).collect();
        let texts = |source| {
            let summaries = Summaries::read(&[folder.path()], Some(source)).unwrap();
            let selection =
                DataSelection { label_source: Some(source.into()), ..DataSelection::of(Composites::Labels) };
            let source = ItemSource {
                apart: &[],
                trajectories: &trajectories,
                held_out: &dataset.manifest().held_out,
                summaries: &summaries,
            };
            let frames = trajectories.iter().map(|trajectory| trajectory.actions.len() + 1).sum();
            let labels = vec![Some(ActionLabel { action: 0, object: 0, executed: true }); frames];
            let items = Items::of(&source, labels, &selection).unwrap();
            (items.training.len(), items.texts)
        };
        let (spans, of_rules) = texts("rules");
        assert_eq!(spans, 34);
        let whole = of_rules.iter().find(|text| text.contains("desk") && !text.contains("Put it")).unwrap();
        assert!(whole.contains("mug"), "{whole}");
        assert!(texts("concat").1.iter().any(|text| text == "Take the red mug. wash it. put it on the desk."));
    }
}
