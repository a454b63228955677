//! What people wrote, as labels that a training reads and as tasks that an evaluation plays.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, ensure};

use super::agreement::{Answers, by_span};
use super::session::answers;
use super::spans::AnnotationSpan;
use crate::data::alfred::span_task::span_task;
use crate::data::annotations::{self, SpanKey};
use crate::data::summaries::{Ledger, SpanSummary};
use crate::data::{Dataset, folder, taskset};
use crate::domain::task::SceneRef;
use crate::domain::{Task, TaskSet};
use crate::episode::scenes::Scenes;
use crate::eval::tasks::scene_folder::relative;

/// Whose labels these are, in `labels.jsonl`.
pub(crate) const SOURCE: &str = "people";
/// The version of that source.
const VERSION: u32 = 1;

/// Everybody's answers, of which the last counts.
///
/// # Errors
/// When a file cannot be read or is malformed.
pub(crate) fn everybody(dataset: &Path) -> anyhow::Result<Answers> {
    Ok(annotations::read_all(dataset)?.into_iter().map(|(name, lines)| (name, answers(lines))).collect())
}

/// A span with the sentence that speaks for all who wrote one, and who wrote that.
struct Agreed {
    span: AnnotationSpan,
    person: String,
    text: String,
}

/// Which span a label is of: trajectory, annotator, skills, input.
type LabelKey = (String, u32, [u8; 2], String);

/// What came of an export.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Exported {
    /// Spans with a sentence.
    pub(crate) sentences: usize,
    /// Labels that were not in the file yet.
    pub(crate) new: usize,
    /// Spans that the dataset does not hold any more as they were told, or that cannot be played.
    pub(crate) stale: usize,
}

/// A span, with who wrote what of it.
type AgreedText<'a> = (&'a SpanKey, (&'a str, &'a str));

/// The spans that people agreed on, in the dataset's order, and how many it does not hold any more.
fn agreed(dataset: &Dataset, answers: &Answers) -> anyhow::Result<(Vec<Agreed>, usize)> {
    let mut wanted: HashMap<&str, Vec<AgreedText<'_>>> = HashMap::new();
    let spans = by_span(answers);
    for (&key, told) in &spans {
        if let Some(best) = told.agreed() {
            wanted.entry(&key.trajectory).or_default().push((key, best));
        }
    }
    let all: usize = wanted.values().map(Vec::len).sum();
    let mut found = Vec::new();
    for trajectory in dataset.trajectories()? {
        let trajectory = trajectory?;
        let Some(of) = wanted.get(trajectory.id.as_str()) else { continue };
        let trajectory = Arc::new(trajectory);
        found.extend(of.iter().filter_map(|&(key, (person, text))| {
            let span = AnnotationSpan::named(&trajectory, key)?;
            Some(Agreed { span, person: person.into(), text: text.into() })
        }));
    }
    let stale = all - found.len();
    Ok((found, stale))
}

/// Adds the sentences to the dataset's `labels.jsonl`, with source `people`: one a span, those that are not there yet.
///
/// # Errors
/// When the dataset cannot be read, or its labels not be written.
pub(crate) fn labels(folder: &Path) -> anyhow::Result<Exported> {
    let dataset = Dataset::open(folder)?;
    let (agreed, stale) = agreed(&dataset, &everybody(folder)?)?;
    let (mut ledger, lines) = Ledger::open(folder)?;
    let ours = lines.into_iter().filter(|line| line.source == SOURCE && line.version == VERSION);
    let mut known: HashMap<LabelKey, String> =
        ours.map(|line| ((line.trajectory, line.annotator, line.skills, line.input), line.text)).collect();
    let label = |(trajectory, annotator, skills, input): LabelKey, text: String, person: Option<String>| SpanSummary {
        trajectory,
        annotator,
        skills,
        text,
        source: SOURCE.into(),
        version: VERSION,
        input,
        maker: None,
        person,
        malformed: None,
    };
    let mut new = Vec::new();
    for Agreed { span, text, person } in &agreed {
        let SpanKey { trajectory, annotator, skills, input } = span.key.clone();
        let key = (trajectory, annotator, skills, input);
        if known.remove(&key).as_ref() != Some(text) {
            new.push(label(key, text.clone(), Some(person.clone())));
        }
    }
    let added = new.len();
    // What nobody stands by any more is taken back.
    new.extend(known.into_iter().filter(|(_, text)| !text.is_empty()).map(|(key, _)| label(key, String::new(), None)));
    ledger.append(&new)?;
    Ok(Exported { sentences: agreed.len(), new: added, stale })
}

/// Writes the spans as a task set, each told by its sentence.
///
/// # Errors
/// When the dataset cannot be read, nobody wrote a sentence, or the file cannot be written.
pub(crate) fn tasks(folder: &Path, file: &Path) -> anyhow::Result<Exported> {
    let dataset = Dataset::open(folder)?;
    let (agreed, mut stale) = agreed(&dataset, &everybody(folder)?)?;
    let scenes = Scenes::in_folder(Some(folder.join("scenes")));
    let mut tasks: Vec<Task> = Vec::new();
    for Agreed { span, person, text } in &agreed {
        let (scene, _) = scenes.scene(&span.trajectory.scene)?;
        let [first, end] = span.key.skills;
        let id = format!("{}-{first}-{end}-{}-{person}", span.trajectory.id, span.key.annotator);
        match span_task(id, &span.trajectory, &scene, span.skills()) {
            Ok(task) => {
                let sentences = span.sentences().to_vec();
                tasks.push(Task { instruction: text.clone(), sentences, ..task });
            }
            Err(problem) => {
                tracing::info!("{}: {problem}", span.trajectory.id);
                stale += 1;
            }
        }
    }
    ensure!(!tasks.is_empty(), "{}: no annotation can become a task", folder.display());
    let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    folder::make(parent).with_context(|| format!("cannot make {}", parent.display()))?;
    let named = tasks.iter().any(|task| matches!(task.scene, SceneRef::Named(_)));
    let name = file.file_stem().map_or_else(|| "people".into(), |stem| stem.to_string_lossy().into_owned());
    let scenes = named.then(|| relative(&folder.join("scenes"), parent)).transpose()?;
    let sentences = tasks.len();
    taskset::write(file, &TaskSet { format_version: TaskSet::FORMAT, name, scenes, tasks })?;
    Ok(Exported { sentences, new: sentences, stale })
}

#[cfg(test)]
mod tests {
    use super::super::session::AnnotationSession;
    use super::super::testing;
    use super::*;
    use crate::data::summaries::Summaries;
    use crate::language::passage::Passage;

    fn annotated() -> (tempfile::TempDir, Vec<AnnotationSpan>) {
        let folder = testing::dataset(&["a"], &[]);
        let spans = testing::spans(folder.path());
        for (person, texts) in [("ann", ["Wash the mug.", "Clean a cup."]), ("bob", ["Wash a mug.", ""])] {
            let mut session = AnnotationSession::open(folder.path(), person, spans.clone()).unwrap();
            for text in texts {
                if text.is_empty() { session.skip() } else { session.write(text) }.unwrap();
            }
        }
        (folder, spans)
    }

    #[test]
    fn sentences_become_labels_once_and_a_training_finds_them() {
        let (folder, spans) = annotated();
        assert_eq!(labels(folder.path()).unwrap(), Exported { sentences: 2, new: 2, stale: 0 });
        assert_eq!(labels(folder.path()).unwrap(), Exported { sentences: 2, new: 0, stale: 0 });
        let mut session = AnnotationSession::open(folder.path(), "ann", spans.clone()).unwrap();
        (0..2).for_each(|_| session.back());
        session.write("Rinse the mug.").unwrap();
        // Ann's and Bob's have as much in common with each other: the first name's counts.
        assert_eq!(labels(folder.path()).unwrap().new, 1);
        let summaries = Summaries::read(&[folder.path()], Some(SOURCE)).unwrap();
        let annotation = &spans[0].trajectory.annotations[spans[0].key.annotator as usize];
        let passage = Passage::of(&spans[0].trajectory, annotation, spans[0].skills()).unwrap();
        assert_eq!(summaries.find(&passage), Some("Rinse the mug."));
        session.back();
        session.skip().unwrap();
        drop(session);
        let mut bob = AnnotationSession::open(folder.path(), "bob", spans.clone()).unwrap();
        (0..2).for_each(|_| bob.back());
        bob.skip().unwrap();
        labels(folder.path()).unwrap();
        let summaries = Summaries::read(&[folder.path()], Some(SOURCE)).unwrap();
        assert_eq!(summaries.find(&passage), Some(""), "nothing is learned under what nobody stands by");
    }

    #[test]
    fn sentences_become_tasks_from_where_their_spans_begin() {
        let (folder, spans) = annotated();
        let file = folder.path().join("sets/people.json");
        assert_eq!(tasks(folder.path(), &file).unwrap().sentences, 2);
        let set = taskset::read(&file).unwrap().value;
        Scenes::of(&file, &set).check(&set.tasks).unwrap();
        let task = set.tasks.iter().find(|task| task.subtasks.len() == 2).unwrap();
        assert_eq!(task.sentences, spans[0].sentences());
        assert!(task.instruction.ends_with("mug."));
        let empty = testing::dataset(&["a"], &[]);
        assert!(tasks(empty.path(), &file).unwrap_err().to_string().contains("no annotation can become a task"));
    }

    #[test]
    fn an_annotation_of_other_words_is_stale() {
        let (folder, _) = annotated();
        let kept = folder.path().join("annotations");
        let other = testing::dataset(&["b"], &[]);
        std::fs::rename(kept, other.path().join("annotations")).unwrap();
        assert_eq!(labels(other.path()).unwrap(), Exported { sentences: 0, new: 0, stale: 2 });
    }
}
