//! Two sources of labels side by side: what each keeps and leaves out of the same passages.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

use anyhow::ensure;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::markdown_table::{percent, table};
use crate::data::Dataset;
use crate::data::summaries::{self, SpanSummary};
use crate::domain::{Class, Trajectory};
use crate::language::count::counted;
use crate::language::instruction::normalise;
use crate::language::maker::Maker;
use crate::language::passage::Passage;
use crate::language::{nouns, prompt};

/// Two sources on the passages that both labelled.
#[derive(Debug, Serialize)]
pub(crate) struct LabelComparison {
    /// How many passages both labelled.
    pub(crate) passages: usize,
    /// On how many of those both say the same.
    pub(crate) same: usize,
    pub(crate) first: LabelCounts,
    pub(crate) second: LabelCounts,
    /// Some passages by chance, for a person to judge.
    pub(crate) examples: Vec<LabelExample>,
}

/// What a source's labels are like, over the passages that both labelled.
#[derive(Debug, Serialize)]
pub(crate) struct LabelCounts {
    pub(crate) source: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) maker: Option<Maker>,
    /// All its passages, those that the other did not label too.
    pub(crate) labelled: usize,
    /// Answers without a summary; they are left out of all that follows.
    pub(crate) malformed: usize,
    /// The mean and the most words of a label.
    pub(crate) words: f64,
    pub(crate) most_words: usize,
    /// The share of the things and places that a passage is about, which its label names.
    pub(crate) nouns_kept: f64,
    /// The share of steps whose target (what is put where: the place; otherwise the thing) the label does not name.
    pub(crate) steps_skipped: f64,
    /// The share of labels that are one of their passage's sentences.
    pub(crate) copies_of_a_step: f64,
    /// The share of labels that are a summary of the prompt's examples.
    pub(crate) copies_of_an_example: f64,
    /// The share of labels that say three words in a row twice.
    pub(crate) repeats: f64,
    /// How many different texts there are.
    pub(crate) different: usize,
}

/// A passage with both labels; an answer without a summary is empty.
#[derive(Debug, Serialize)]
pub(crate) struct LabelExample {
    pub(crate) trajectory: String,
    pub(crate) skills: [u8; 2],
    pub(crate) steps: Vec<String>,
    pub(crate) first: String,
    pub(crate) second: String,
}

impl LabelComparison {
    /// Compares two sources of a dataset, with so many examples that the seed chooses.
    ///
    /// # Errors
    /// When the dataset has no labels of one of them, or no passage has both.
    pub(crate) fn of(
        folder: &Path,
        [first, second]: [&str; 2],
        examples: usize,
        seed: u64,
    ) -> anyhow::Result<LabelComparison> {
        let dataset = Dataset::open(folder)?;
        let lines = summaries::lines(folder)?;
        let sources: BTreeSet<&str> = lines.iter().map(|line| line.source.as_str()).collect();
        for source in [first, second] {
            let there = sources.iter().copied().collect::<Vec<_>>().join(", ");
            ensure!(
                sources.contains(source),
                "{} has no labels of {source}; it has those of: {there}",
                folder.display()
            );
        }
        let of = |source: &str| -> BTreeMap<&str, &SpanSummary> {
            lines.iter().filter(|line| line.source == source).map(|line| (line.input.as_str(), line)).collect()
        };
        let (firsts, seconds) = (of(first), of(second));
        let both: Vec<(&SpanSummary, &SpanSummary)> =
            firsts.iter().filter_map(|(input, line)| Some((*line, *seconds.get(input)?))).collect();
        ensure!(!both.is_empty(), "no passage has labels of both {first} and {second}");
        let trajectories = dataset.trajectories()?.collect::<anyhow::Result<Vec<_>>>()?;
        let by_name: HashMap<&str, &Trajectory> =
            trajectories.iter().map(|trajectory| (trajectory.id.as_str(), trajectory)).collect();
        let passage = |line: &SpanSummary| {
            let trajectory = *by_name.get(line.trajectory.as_str())?;
            let annotation = trajectory.annotations.get(line.annotator as usize)?;
            let [from, to] = line.skills.map(usize::from);
            Passage::of(trajectory, annotation, from..to).filter(|passage| passage.digest() == line.input)
        };
        let told: Vec<_> = both.iter().filter_map(|&(a, b)| Some((passage(a)?, a, b))).collect();
        ensure!(!told.is_empty(), "the labels of {first} and {second} are of other trajectories than the dataset's");
        let chosen =
            rand::seq::index::sample(&mut ChaCha8Rng::seed_from_u64(seed), told.len(), examples.min(told.len()));
        let example = |index: usize| {
            let (passage, a, b) = &told[index];
            LabelExample {
                trajectory: a.trajectory.clone(),
                skills: a.skills,
                steps: passage.sentences.iter().map(|sentence| normalise(sentence)).collect(),
                first: a.text.clone(),
                second: b.text.clone(),
            }
        };
        Ok(LabelComparison {
            passages: told.len(),
            same: told.iter().filter(|(_, a, b)| a.text == b.text).count(),
            first: LabelCounts::of(first, firsts.len(), told.iter().map(|(passage, a, _)| (passage, *a))),
            second: LabelCounts::of(second, seconds.len(), told.iter().map(|(passage, _, b)| (passage, *b))),
            examples: chosen.into_iter().map(example).collect(),
        })
    }

    /// The page that people read.
    pub(crate) fn markdown(&self) -> String {
        let (a, b) = (&self.first, &self.second);
        let row = |name: &str, of: &dyn Fn(&LabelCounts) -> String| [name.to_owned(), of(a), of(b)];
        let share = |share: fn(&LabelCounts) -> f64| move |counts: &LabelCounts| percent(share(counts));
        let rows = [
            row("passages labelled in all", &|counts| counts.labelled.to_string()),
            row("answers without a summary", &|counts| counts.malformed.to_string()),
            row("words, mean", &|counts| format!("{:.1}", counts.words)),
            row("words, most", &|counts| counts.most_words.to_string()),
            row("nouns kept", &share(|counts| counts.nouns_kept)),
            row("steps skipped", &share(|counts| counts.steps_skipped)),
            row("copies of a step", &share(|counts| counts.copies_of_a_step)),
            row("copies of an example", &share(|counts| counts.copies_of_an_example)),
            row("three words said twice", &share(|counts| counts.repeats)),
            row("different texts", &|counts| counts.different.to_string()),
        ];
        let mut page = table(["", &a.source, &b.source], rows);
        page += &format!(
            "\n{} with both labels, {} of them the same text.\n",
            counted(self.passages, "passage"),
            self.same
        );
        for counts in [a, b] {
            if let Some(maker) = &counts.maker {
                page += &format!("{}: {maker}.\n", counts.source);
            }
        }
        for example in &self.examples {
            let [from, to] = example.skills;
            page += &format!("\n{} {from}..{to}: {}\n", example.trajectory, example.steps.join(" "));
            page += &format!("  {}: {}\n  {}: {}\n", a.source, example.first, b.source, example.second);
        }
        page
    }
}

impl LabelCounts {
    fn of<'a>(
        source: &str,
        labelled: usize,
        labels: impl Iterator<Item = (&'a Passage<'a>, &'a SpanSummary)>,
    ) -> LabelCounts {
        let (labels, malformed): (Vec<_>, Vec<_>) = labels.partition(|(_, line)| line.malformed.is_none());
        let share = |part: usize, all: usize| part as f64 / all.max(1) as f64;
        let count = |holds: &dyn Fn(&Passage<'_>, &str) -> bool| {
            share(labels.iter().filter(|(passage, line)| holds(passage, &line.text)).count(), labels.len())
        };
        let examples: BTreeSet<String> = prompt::example_summaries().map(normalise).collect();
        let words = |line: &SpanSummary| line.text.split_whitespace().count();
        let (mut nouns, mut kept, mut steps, mut skipped) = (0, 0, 0, 0);
        for (passage, line) in &labels {
            let about = classes(passage);
            nouns += about.len();
            kept += about.iter().filter(|&&class| nouns::names(&line.text, class)).count();
            steps += passage.subtasks.len();
            skipped += targets(passage).filter(|&class| !nouns::names(&line.text, class)).count();
        }
        LabelCounts {
            source: source.to_owned(),
            maker: labels.iter().find_map(|(_, line)| line.maker.clone()),
            labelled,
            malformed: malformed.len(),
            words: share(labels.iter().map(|(_, line)| words(line)).sum(), labels.len()),
            most_words: labels.iter().map(|(_, line)| words(line)).max().unwrap_or(0),
            nouns_kept: share(kept, nouns),
            steps_skipped: share(skipped, steps),
            copies_of_a_step: count(&|passage, text| passage.sentences.iter().any(|step| normalise(step) == text)),
            copies_of_an_example: count(&|_, text| examples.contains(text)),
            repeats: count(&|_, text| repeats(text)),
            different: labels.iter().map(|(_, line)| line.text.as_str()).collect::<BTreeSet<_>>().len(),
        }
    }
}

fn class(passage: &Passage<'_>, role: u8) -> Class {
    passage.roles.get(usize::from(role)).map_or(Class::NONE, |role| role.class)
}

/// The things and places that a passage is about.
fn classes(passage: &Passage<'_>) -> BTreeSet<Class> {
    let roles = passage.subtasks.iter().flat_map(|step| std::iter::once(step.object).chain(step.receptacle));
    roles.map(|role| class(passage, role)).collect()
}

/// What each step is for: where something is put, or what is done something with.
fn targets<'a>(passage: &'a Passage<'a>) -> impl Iterator<Item = Class> + 'a {
    passage.subtasks.iter().map(|step| class(passage, step.receptacle.unwrap_or(step.object)))
}

/// Whether a text says three words in a row twice.
fn repeats(text: &str) -> bool {
    let words: Vec<String> = text.split_whitespace().map(|word| word.trim_matches(['.', ',']).to_lowercase()).collect();
    let runs: Vec<&[String]> = words.windows(3).collect();
    runs.iter().collect::<BTreeSet<_>>().len() < runs.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::dataset::{self, DatasetWriter};
    use crate::data::summaries::Ledger;
    use crate::domain::trajectory::{self, Annotation};
    use crate::domain::{Action, ActionType, SkillKind};
    use crate::house::testing::{put_subtask, role, subtask};

    /// A trajectory of three skills, with labels of two sources for its runs of two.
    fn labelled() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = DatasetWriter::new(folder.path()).unwrap();
        let steps = ["Take the red mug.", "Wash it.", "Put it on the desk."].map(str::to_owned).to_vec();
        let trajectory = Trajectory {
            actions: vec![Action::navigate(ActionType::MoveAhead); 3],
            roles: vec![role("Mug"), role("Desk")],
            skills: vec![subtask(SkillKind::Pickup, 0), subtask(SkillKind::Clean, 0), put_subtask(0, 1)],
            skill_starts: vec![0, 1, 2],
            annotations: vec![Annotation { goal: "g".into(), steps }],
            ..trajectory::testing::empty("a", "s")
        };
        writer.trajectory(&trajectory).unwrap();
        writer.finish(&dataset::testing::manifest(0, &[])).unwrap();
        let line = |skills: [u8; 2], text: &str, source: &str| {
            let [from, to] = skills.map(usize::from);
            let passage = Passage::of(&trajectory, &trajectory.annotations[0], from..to).unwrap();
            let malformed = text.is_empty().then(|| "...".to_owned());
            SpanSummary {
                trajectory: "a".into(),
                annotator: 0,
                skills,
                text: text.into(),
                source: source.into(),
                version: 1,
                input: passage.digest(),
                maker: None,
                malformed,
                person: None,
            }
        };
        let lines = [
            line([0, 2], "Wash the mug.", "one"),
            line([1, 3], "Put a clean mug on the desk.", "one"),
            line([0, 3], "Put a clean mug away.", "one"),
            line([0, 2], "Take the red mug.", "two"),
            line([1, 3], "Look at the vase under the light.", "two"),
            line([0, 3], "", "two"),
            line([0, 2], "Go.", "three"),
        ];
        Ledger::open(folder.path()).unwrap().0.append(&lines).unwrap();
        folder
    }

    #[test]
    fn two_sources_are_counted_over_the_passages_that_both_labelled() {
        let folder = labelled();
        let found = LabelComparison::of(folder.path(), ["one", "two"], 20, 1).unwrap();
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} is not {b}");
        assert_eq!((found.passages, found.same, found.examples.len()), (3, 0, 3));
        let one = &found.first;
        assert_eq!((one.labelled, one.malformed, one.most_words, one.different), (3, 0, 7, 3));
        close(one.words, (3.0 + 7.0 + 5.0) / 3.0);
        // A mug; a mug and a desk, twice: the last label lacks the desk, which one of its steps is for.
        close(one.nouns_kept, 4.0 / 5.0);
        close(one.steps_skipped, 1.0 / 7.0);
        let two = &found.second;
        assert_eq!(two.malformed, 1);
        close(two.copies_of_a_step, 0.5);
        close(two.copies_of_an_example, 0.5);
        close(two.nouns_kept, 1.0 / 3.0);
        let page = found.markdown();
        assert!(page.contains("| answers without a summary") && page.contains("3 passages with both labels"), "{page}");
        assert!(page.contains("a 0..2: Take the red mug. Wash it.\n  one: Wash the mug.\n  two: Take the red mug.\n"));
        assert_eq!(LabelComparison::of(folder.path(), ["one", "three"], 0, 1).unwrap().passages, 1);
        let error = LabelComparison::of(folder.path(), ["one", "four"], 0, 1).unwrap_err().to_string();
        assert!(error.ends_with("has no labels of four; it has those of: one, three, two"), "{error}");
    }

    #[test]
    fn a_label_repeats_where_three_words_come_twice() {
        assert!(repeats("Put the mug on, put the mug on the desk."));
        assert!(!repeats("Put the mug on the desk and the pen on the bed."));
    }
}
