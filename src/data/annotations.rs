//! What people wrote of a dataset's spans: `annotations/NAME.jsonl`, a file a person, so that several can write at once.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};

use super::line_log::{self, LineLog};
use crate::language::instruction::{LONGEST, visible};

/// The format version this program reads and writes.
const FORMAT: u32 = 1;
/// The folder in a dataset's folder.
const FOLDER: &str = "annotations";
/// The most characters that a person's name may have.
const LONGEST_NAME: usize = 40;

/// A run of adjacent skills of a trajectory, as one of its annotators told them.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpanKey {
    /// The trajectory's name.
    pub(crate) trajectory: String,
    /// Which of its annotations was read.
    pub(crate) annotator: u32,
    /// The span's first skill, and the one after its last.
    pub(crate) skills: [u8; 2],
    /// The digest of the skills and sentences that were read; see [`crate::language::passage::Passage::digest`].
    pub(crate) input: String,
}

/// A line: what a person wrote of a span. The last line counts where there are several of one span.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpanAnnotation {
    /// The span.
    pub(crate) span: SpanKey,
    /// The sentence; nothing where the person skipped the span.
    pub(crate) text: Option<String>,
}

/// Whether somebody may be called that: the name becomes a file's.
///
/// # Errors
/// Says what a name may be.
pub(crate) fn check_name(name: &str) -> anyhow::Result<()> {
    let plain = |c: char| c.is_alphanumeric() || "-_.".contains(c);
    let good = !name.starts_with('.') && name.chars().all(plain) && (1..=LONGEST_NAME).contains(&name.chars().count());
    ensure!(good, "{name:?} is no annotator's name: up to {LONGEST_NAME} letters, digits, and - _ . within");
    Ok(())
}

fn path(dataset: &Path, name: &str) -> PathBuf {
    dataset.join(FOLDER).join(format!("{name}.jsonl"))
}

/// Opens or begins a person's file; returns what that person wrote until now, oldest first.
///
/// # Errors
/// When the name is none, or the file is malformed, in use, or cannot be written to.
pub fn open(dataset: &Path, name: &str) -> anyhow::Result<(LineLog, Vec<SpanAnnotation>)> {
    check_name(name)?;
    let path = path(dataset, name);
    let (log, lines) = LineLog::open(&path, FORMAT)?;
    check(&path, &lines)?;
    Ok((log, lines))
}

/// Whether the lines say what somebody could have typed of a span.
fn check(path: &Path, lines: &[SpanAnnotation]) -> anyhow::Result<()> {
    for (number, line) in lines.iter().enumerate() {
        // The first line is the header.
        let place = || format!("{}, line {}", path.display(), number + 2);
        let [first, end] = line.span.skills;
        ensure!(first < end, "{}: span.skills: [{first}, {end}] is no run of skills", place());
        if let Some(text) = &line.text {
            let written = check_sentence(text).with_context(|| format!("{}: text", place()))?;
            ensure!(written == *text, "{}: text: holds control characters, or spaces around it: remove them", place());
        }
    }
    Ok(())
}

/// A sentence as it is kept.
///
/// # Errors
/// When it says nothing or too much.
pub(crate) fn check_sentence(text: &str) -> anyhow::Result<String> {
    let text = visible(text);
    ensure!(text.chars().any(char::is_alphanumeric), "type one sentence, or skip this one");
    let length = text.chars().count();
    ensure!(length <= LONGEST, "{length} characters, {LONGEST} are the most: shorten it");
    Ok(text)
}

/// What everybody wrote, by name, the names sorted.
///
/// # Errors
/// When a file cannot be read or is malformed.
pub fn read_all(dataset: &Path) -> anyhow::Result<Vec<(String, Vec<SpanAnnotation>)>> {
    let folder = dataset.join(FOLDER);
    let entries = match std::fs::read_dir(&folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error).with_context(|| format!("{} cannot be read", folder.display())),
    };
    let mut all = Vec::new();
    for entry in entries {
        let path = entry.with_context(|| folder.display().to_string())?.path();
        let name = path.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if path.extension().is_some_and(|extension| extension == "jsonl") && check_name(&name).is_ok() {
            let lines = line_log::read(&path, FORMAT)?.0;
            check(&path, &lines)?;
            all.push((name, lines));
        }
    }
    all.sort_by(|(a, _), (b, _)| a.cmp(b));
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everybody_writes_in_a_file_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        assert!(read_all(folder.path()).unwrap().is_empty());
        let span = SpanKey { trajectory: "t".into(), annotator: 0, skills: [0, 2], input: "d".into() };
        let wrote = |text: Option<&str>| SpanAnnotation { span: span.clone(), text: text.map(str::to_owned) };
        let (mut bob, _) = open(folder.path(), "bob").unwrap();
        let (mut ann, _) = open(folder.path(), "ann").unwrap();
        bob.append(&[wrote(None)]).unwrap();
        ann.append(&[wrote(Some("Set the table."))]).unwrap();
        let all = read_all(folder.path()).unwrap();
        assert_eq!(all, [("ann".into(), vec![wrote(Some("Set the table."))]), ("bob".into(), vec![wrote(None)])]);
        assert!(open(folder.path(), "ann").is_err(), "one sitting a person");
    }

    #[test]
    fn a_line_that_nobody_could_have_typed_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let span = SpanKey { trajectory: "t".into(), annotator: 0, skills: [0, 2], input: "d".into() };
        for (skills, text) in [([2, 0], "Go."), ([0, 2], ""), ([0, 2], "\u{1b}[2JGo."), ([0, 2], &"a".repeat(2001))] {
            let _ = std::fs::remove_dir_all(folder.path().join(FOLDER));
            let line = SpanAnnotation { span: SpanKey { skills, ..span.clone() }, text: Some(text.into()) };
            open(folder.path(), "ann").unwrap().0.append(&[line]).unwrap();
            for error in [read_all(folder.path()).unwrap_err(), open(folder.path(), "ann").err().unwrap()] {
                assert!(format!("{error:#}").contains("ann.jsonl, line 2: "), "{error:#}");
            }
        }
    }

    #[test]
    fn a_name_is_a_plain_one() {
        for good in ["ann", "Jörg", "rater-1", "a.b_c"] {
            check_name(good).unwrap();
        }
        for bad in ["", ".ann", "../ann", "a b", "a/b", "x\u{1b}", &"a".repeat(41)] {
            assert!(check_name(bad).is_err(), "{bad:?}");
        }
    }
}
