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
use crate::language::passage::{Passage, Summarizer, Summary};

/// Counts of a relabelling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Relabelled {
    /// Spans, once for each aligned annotation.
    pub(crate) spans: usize,
    /// Of those, how many had this source's label already.
    pub(crate) known: usize,
    /// How many passages the summarizer was asked for.
    pub(crate) asked: usize,
    /// In how many of its answers there was no summary.
    pub(crate) malformed: usize,
    /// Whether it was stopped before the end.
    pub(crate) stopped: bool,
}

/// A run of two or more skills of a trajectory, in the words of one annotator.
struct CompositeSpan<'a> {
    trajectory: &'a Trajectory,
    annotator: usize,
    skills: Range<usize>,
}

/// A passage and the spans that say the same, which share its summary.
struct PassageSpans<'a> {
    passage: Passage<'a>,
    digest: String,
    /// Those that have no label yet.
    missing: Vec<CompositeSpan<'a>>,
    /// How many there are.
    spans: usize,
}

/// Writes the labels that are missing. A passage that the same source and version summed up before, here or in an earlier run, is not
/// asked for again: each answer is kept as soon as it is there. With a `sample` only so many passages are labelled, those whose digests come
/// first: chance decides which, every time the same, and a larger sample holds a smaller one.
///
/// # Errors
/// When the dataset cannot be read, its labels not be written, another maker wrote labels under the same name, or the summarizer fails; what
/// was labelled until then stays.
pub(crate) fn relabel(
    folder: &Path,
    summarizer: &dyn Summarizer,
    sample: Option<usize>,
    logger: &mut dyn ProgressLogger,
    stop: &AtomicBool,
) -> anyhow::Result<Relabelled> {
    let dataset = Dataset::open(folder)?;
    let trajectories = dataset.trajectories()?.collect::<anyhow::Result<Vec<_>>>()?;
    let (mut ledger, lines) = Ledger::open(folder)?;
    let mut kept = KeptLabels::of(lines, summarizer)?;
    let mut passages = passages(&trajectories, &dataset.manifest().held_out);
    if let Some(sample) = sample {
        passages.sort_by(|a, b| a.digest.cmp(&b.digest));
        passages.truncate(sample);
    }
    let mut found = Relabelled { spans: passages.iter().map(|passage| passage.spans).sum(), ..Relabelled::default() };
    for passage in &mut passages {
        let digest = &passage.digest;
        passage.missing.retain(|span| !kept.labelled.contains(&span.key(digest)));
    }
    passages.retain(|passage| !passage.missing.is_empty());
    found.known = found.spans - passages.iter().map(|passage| passage.missing.len()).sum::<usize>();
    let mut done = found.known;
    let mut write = |passage: &PassageSpans<'_>, summary: &Summary| -> anyhow::Result<()> {
        ledger
            .append(&passage.missing.iter().map(|span| span.line(passage, summary, summarizer)).collect::<Vec<_>>())?;
        done += passage.missing.len();
        logger.log(&Scalars::new("labels", done as u64, found.spans as u64))
    };
    let mut asked = Vec::new();
    for passage in passages {
        match kept.summaries.remove(&passage.digest) {
            Some(summary) => write(&passage, &summary)?,
            None => asked.push(passage),
        }
    }
    for lot in asked.chunks(summarizer.together().max(1)) {
        if stop.load(Ordering::Relaxed) {
            found.stopped = true;
            break;
        }
        let mut missing = lot.len();
        let passages: Vec<Passage<'_>> = lot.iter().map(|passage| passage.passage).collect();
        summarizer.summaries(&passages, &mut |index, summary| {
            missing -= 1;
            found.asked += 1;
            found.malformed += usize::from(matches!(summary, Summary::Malformed(_)));
            write(&lot[index], &summary)
        })?;
        found.stopped = missing > 0 && stop.load(Ordering::Relaxed);
        anyhow::ensure!(missing == 0 || found.stopped, "{} gave too few summaries", summarizer.source());
    }
    Ok(found)
}

/// What a label is of: trajectory, annotator, skills, and the passage's digest.
type LabelKey = (String, u32, [u8; 2], String);

/// The labels that a summarizer wrote before.
struct KeptLabels {
    labelled: HashSet<LabelKey>,
    summaries: HashMap<String, Summary>,
}

impl KeptLabels {
    fn of(lines: Vec<SpanSummary>, summarizer: &dyn Summarizer) -> anyhow::Result<KeptLabels> {
        let mut kept = KeptLabels { labelled: HashSet::new(), summaries: HashMap::new() };
        for line in lines {
            if line.source != summarizer.source() || line.version != summarizer.version() {
                continue;
            }
            anyhow::ensure!(
                line.maker.as_ref() == summarizer.maker(),
                "{} has labels already that were made otherwise ({}): give these another name with --name",
                line.source,
                line.maker.as_ref().map_or_else(|| "by no model".into(), |maker| maker.to_string())
            );
            let summary = line.malformed.map_or(Summary::Sentence(line.text), Summary::Malformed);
            kept.summaries.insert(line.input.clone(), summary);
            kept.labelled.insert((line.trajectory, line.annotator, line.skills, line.input));
        }
        Ok(kept)
    }
}

/// The passages of all composite spans, once for each aligned annotation, in the order in which they first occur.
fn passages<'a>(trajectories: &'a [Trajectory], held_out: &[String]) -> Vec<PassageSpans<'a>> {
    let mut found: Vec<PassageSpans<'a>> = Vec::new();
    let mut places: HashMap<String, usize> = HashMap::new();
    for trajectory in trajectories {
        for (annotator, annotation) in trajectory.annotations.iter().enumerate() {
            for skills in composites(trajectory, held_out) {
                let Some(passage) = Passage::of(trajectory, annotation, skills.clone()) else { continue };
                let digest = passage.digest();
                let place = *places.entry(digest.clone()).or_insert(found.len());
                if place == found.len() {
                    found.push(PassageSpans { passage, digest, missing: Vec::new(), spans: 0 });
                }
                found[place].missing.push(CompositeSpan { trajectory, annotator, skills });
                found[place].spans += 1;
            }
        }
    }
    found
}

impl CompositeSpan<'_> {
    fn numbers(&self) -> [u8; 2] {
        [self.skills.start as u8, self.skills.end as u8]
    }

    fn key(&self, digest: &str) -> LabelKey {
        (self.trajectory.id.clone(), self.annotator as u32, self.numbers(), digest.to_owned())
    }

    fn line(&self, passage: &PassageSpans<'_>, summary: &Summary, summarizer: &dyn Summarizer) -> SpanSummary {
        let (text, malformed) = match summary {
            Summary::Sentence(text) => (text.clone(), None),
            Summary::Malformed(said) => (String::new(), Some(said.clone())),
        };
        SpanSummary {
            trajectory: self.trajectory.id.clone(),
            annotator: self.annotator as u32,
            skills: self.numbers(),
            text,
            source: summarizer.source().to_string(),
            version: summarizer.version(),
            input: passage.digest.clone(),
            maker: summarizer.maker().cloned(),
            malformed,
            person: None,
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
    use crate::language::passage::{Concatenation, TakeSummary};
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

        fn together(&self) -> usize {
            2
        }

        fn summaries(&self, passages: &[Passage<'_>], take: &mut TakeSummary<'_>) -> anyhow::Result<()> {
            self.0.fetch_add(passages.len(), Ordering::Relaxed);
            let told = passages.iter().map(|passage| Summary::Sentence(format!("{} steps", passage.sentences.len())));
            told.enumerate().try_for_each(|(index, text)| take(index, text))
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
        relabel(folder, summarizer, None, &mut Silent, &AtomicBool::new(false)).unwrap()
    }

    #[test]
    fn every_span_gets_a_label_and_nothing_is_asked_twice() {
        let folder = dataset();
        let counting = Counting(AtomicUsize::new(0));
        let first = run(folder.path(), &counting);
        assert_eq!(first, Relabelled { spans: 16, known: 0, asked: 3, malformed: 0, stopped: false });
        let second = run(folder.path(), &counting);
        assert_eq!(second, Relabelled { spans: 16, known: 16, asked: 0, malformed: 0, stopped: false });
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
