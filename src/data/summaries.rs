//! `labels.jsonl`: what composite spans are called, a line a label with where it comes from, appended as they are made.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use anyhow::bail;
use serde::{Deserialize, Serialize};

use super::line_log::{self, LineLog};
use crate::language::maker::Maker;
use crate::language::passage::Passage;

/// A line: the label of one span of one annotator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpanSummary {
    /// The trajectory's name.
    pub trajectory: String,
    /// Which of its annotations.
    pub annotator: u32,
    /// The span's first skill, and the one after its last.
    pub skills: [u8; 2],
    /// The summary, as an instruction; empty where there is none, so that nothing is learned under it.
    pub text: String,
    /// Who made it: `rules`, `concat`, a model.
    pub source: String,
    /// The version of that source.
    pub version: u32,
    /// The digest of what it was made of; see [`Passage::digest`].
    pub input: String,
    /// The model that wrote it, where one did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maker: Option<Maker>,
    /// The person who wrote it, where one did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub person: Option<String>,
    /// What the model said where that holds no summary.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub malformed: Option<String>,
}

/// The format version this program reads and writes.
const FORMAT: u32 = 1;

/// The file's name in a dataset's folder.
const NAME: &str = "labels.jsonl";

/// All labels in a dataset's folder, as they were added.
///
/// # Errors
/// When the file is malformed; the line is named.
pub(crate) fn lines(folder: &Path) -> anyhow::Result<Vec<SpanSummary>> {
    Ok(line_log::read(&folder.join(NAME), FORMAT)?.0)
}

/// The labels of datasets, to be looked up.
#[derive(Clone, Debug, Default)]
pub struct Summaries {
    by_input: HashMap<String, String>,
}

impl Summaries {
    /// Reads the labels of some datasets' folders: those of one source, which has to be named when a file has several. Of several
    /// that are named (`people,rules`) the first that has a label counts. The last line counts where one source labelled the same
    /// twice; under one without a text nothing is learned.
    ///
    /// # Errors
    /// When a file cannot be read, or it is not clear whose labels are meant.
    pub fn read(folders: &[&Path], source: Option<&str>) -> anyhow::Result<Summaries> {
        let mut by_input = HashMap::new();
        for folder in folders {
            let path = folder.join(NAME);
            let lines = lines(folder)?;
            let sources: BTreeSet<String> = lines.iter().map(|line| line.source.clone()).collect();
            let listed = || sources.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
            let wanted: Vec<&str> = match (source, sources.first()) {
                // Single skills need none; a run of skills that lacks its own is named where it is looked up.
                (_, None) => continue,
                (Some(named), _) => {
                    let named: Vec<&str> = named.split(',').map(str::trim).collect();
                    if !named.iter().any(|name| sources.contains(*name)) {
                        bail!("{} has labels of {}, none of {}", path.display(), listed(), named.join(", "));
                    }
                    named
                }
                (None, Some(only)) if sources.len() == 1 => vec![only],
                (None, _) => {
                    bail!("{} has labels of {}: name one as data.label_source in the preset", path.display(), listed())
                }
            };
            let mut of_source: HashMap<String, HashMap<String, String>> = HashMap::new();
            for line in lines {
                of_source.entry(line.source).or_default().insert(line.input, line.text);
            }
            for name in wanted.iter().rev() {
                let labels = of_source.remove(*name).unwrap_or_default();
                for (input, text) in labels {
                    // Where one source has no text for a passage, the next one's counts.
                    if !text.is_empty() || !by_input.contains_key(&input) {
                        by_input.insert(input, text);
                    }
                }
            }
        }
        Ok(Summaries { by_input })
    }

    /// The label of a passage.
    pub(crate) fn find(&self, passage: &Passage<'_>) -> Option<&str> {
        self.by_input.get(&passage.digest()).map(String::as_str)
    }

    /// How many different passages have a label.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.by_input.len()
    }
}

/// A dataset's label file, opened to be added to. One process at a time.
pub struct Ledger(LineLog);

impl Ledger {
    /// Opens or begins the file, mends a torn last line, and returns what it holds.
    ///
    /// # Errors
    /// When it is malformed, in use, or cannot be written to.
    pub fn open(folder: &Path) -> anyhow::Result<(Ledger, Vec<SpanSummary>)> {
        let (log, lines) = LineLog::open(&folder.join(NAME), FORMAT)?;
        Ok((Ledger(log), lines))
    }

    /// Adds labels in one write.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn append(&mut self, labels: &[SpanSummary]) -> anyhow::Result<()> {
        self.0.append(labels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn summary(input: &str, text: &str, source: &str) -> SpanSummary {
        SpanSummary {
            trajectory: "t".into(),
            annotator: 0,
            skills: [0, 2],
            text: text.into(),
            source: source.into(),
            version: 1,
            input: input.into(),
            maker: None,
            person: None,
            malformed: None,
        }
    }

    #[test]
    fn labels_are_added_and_a_torn_line_is_mended() {
        let folder = tempfile::tempdir().unwrap();
        Ledger::open(folder.path()).unwrap().0.append(&[summary("a", "One.", "rules")]).unwrap();
        let path = folder.path().join(NAME);
        let mut bytes = std::fs::read(&path).unwrap();
        bytes.extend(b"{\"trajectory\":\"t\",\"annot");
        std::fs::write(&path, bytes).unwrap();
        let (mut ledger, lines) = Ledger::open(folder.path()).unwrap();
        assert_eq!(lines, [summary("a", "One.", "rules")]);
        ledger.append(&[summary("b", "Two.", "rules")]).unwrap();
        assert_eq!(super::lines(folder.path()).unwrap().len(), 2);
        let summaries = Summaries::read(&[folder.path()], None).unwrap();
        assert_eq!((summaries.len(), summaries.by_input["b"].as_str()), (2, "Two."));
    }

    #[test]
    fn one_process_writes_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let _held = Ledger::open(folder.path()).unwrap();
        assert!(Ledger::open(folder.path()).err().unwrap().to_string().contains("another process"));
    }

    #[test]
    fn of_several_sources_one_has_to_be_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = |source| Summaries::read(&[folder.path()], source).unwrap_err().to_string();
        assert_eq!(Summaries::read(&[folder.path()], None).unwrap().len(), 0, "of nothing, none");
        let labels = [summary("a", "One.", "rules"), summary("a", "Eins.", "concat"), summary("a", "Uno.", "rules")];
        Ledger::open(folder.path()).unwrap().0.append(&labels).unwrap();
        assert!(error(None).contains("concat, rules"));
        assert!(error(Some("lm")).contains("none of lm"));
        let found = |source| Summaries::read(&[folder.path()], Some(source)).unwrap().by_input["a"].clone();
        assert_eq!([found("rules"), found("concat")], ["Uno.", "Eins."]);
        assert_eq!([found("people, rules"), found("concat,rules")], ["Uno.", "Eins."]);
        assert!(error(Some("lm,people")).contains("none of lm, people"));
        let mut ledger = Ledger::open(folder.path()).unwrap().0;
        ledger.append(&[summary("a", "", "concat")]).unwrap();
        assert_eq!(found("concat,rules"), "Uno.", "a label that was taken back");
    }

    #[test]
    fn a_damaged_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(NAME), "{\"format_version\":1}\n{\"colour\":3}\n").unwrap();
        let error = format!("{:#}", Ledger::open(folder.path()).err().unwrap());
        assert!(error.contains("line 2") && error.contains("colour"), "{error}");
    }
}
