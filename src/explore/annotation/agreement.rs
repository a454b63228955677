//! How far people agree: on what is worth a sentence, and on its words.

use std::collections::{BTreeMap, HashMap};

use serde::Serialize;

use super::session::Answer;
use crate::data::annotations::SpanKey;
use crate::language::instruction::normalise;

/// Everybody's answers, by name.
pub(crate) type Answers = BTreeMap<String, HashMap<SpanKey, Answer>>;

/// How far people agree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Agreement {
    pub(crate) people: Vec<PersonCounts>,
    /// Every two who answered a span in common.
    pub(crate) pairs: Vec<PairAgreement>,
    /// The spans that several wrote a sentence of, those with the least in common first.
    pub(crate) spans: Vec<SpanAgreement>,
}

/// What a person did.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct PersonCounts {
    pub(crate) name: String,
    pub(crate) sentences: usize,
    pub(crate) skipped: usize,
}

/// How far two people agree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct PairAgreement {
    pub(crate) people: [String; 2],
    /// Spans that both answered; of those, how many both wrote a sentence of, and both skipped.
    pub(crate) spans: usize,
    pub(crate) both_wrote: usize,
    pub(crate) both_skipped: usize,
    /// Cohen's kappa of writing or skipping; none where chance alone would agree wholly.
    pub(crate) kappa: Option<f64>,
    /// The mean share of words in common (F1) of two sentences of one span.
    pub(crate) words: Option<f64>,
    /// The same of two sentences of different spans: what is in common by chance.
    pub(crate) words_by_chance: Option<f64>,
}

/// What several people wrote of a span.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct SpanAgreement {
    pub(crate) span: SpanKey,
    /// Name and sentence.
    pub(crate) sentences: Vec<(String, String)>,
    /// The mean share of words in common of every two.
    pub(crate) words: f64,
}

/// Holds everybody's answers against one another.
pub(crate) fn agreement(answers: &Answers) -> Agreement {
    let people = answers.iter().map(|(name, of)| {
        let sentences = of.values().filter(|answer| matches!(answer, Answer::Sentence(_))).count();
        PersonCounts { name: name.clone(), sentences, skipped: of.len() - sentences }
    });
    let names: Vec<&String> = answers.keys().collect();
    let pairs = names.iter().enumerate().flat_map(|(at, one)| names[at + 1..].iter().map(move |other| (*one, *other)));
    let pairs = pairs.filter_map(|(one, other)| pair([one, other], &answers[one], &answers[other]));
    let mut spans: Vec<SpanAgreement> = by_span(answers)
        .into_iter()
        .filter_map(|(span, told)| {
            let sentences: Vec<(String, String)> =
                told.sentences.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect();
            let words = mean(every_two(&told.sentences).map(|((_, one), (_, other))| words_in_common(one, other)))?;
            Some(SpanAgreement { span: span.clone(), sentences, words })
        })
        .collect();
    spans.sort_by(|a, b| a.words.total_cmp(&b.words).then_with(|| a.span.cmp(&b.span)));
    Agreement { people: people.collect(), pairs: pairs.collect(), spans }
}

/// What was answered of a span.
#[derive(Default)]
pub(crate) struct SpanAnswers<'a> {
    /// Name and sentence.
    pub(crate) sentences: Vec<(&'a str, &'a str)>,
    pub(crate) skipped: usize,
}

/// Everybody's answers, by span.
pub(crate) fn by_span(answers: &Answers) -> BTreeMap<&SpanKey, SpanAnswers<'_>> {
    let mut spans: BTreeMap<&SpanKey, SpanAnswers<'_>> = BTreeMap::new();
    for (name, of) in answers {
        for (span, answer) in of {
            let told = spans.entry(span).or_default();
            match answer {
                Answer::Sentence(text) => told.sentences.push((name, text)),
                Answer::Skipped => told.skipped += 1,
            }
        }
    }
    spans
}

impl SpanAnswers<'_> {
    /// The sentence that has most in common with the others', and who wrote it; nothing where more people skipped the span than wrote
    /// one.
    pub(crate) fn agreed(&self) -> Option<(&str, &str)> {
        if self.skipped > self.sentences.len() {
            return None;
        }
        let shared = |at: usize| -> f64 {
            let others = self.sentences.iter().enumerate().filter(|(other, _)| *other != at);
            others.map(|(_, (_, text))| words_in_common(self.sentences[at].1, text)).sum()
        };
        // The first name where several have as much.
        let best = (0..self.sentences.len()).reduce(|best, at| if shared(at) > shared(best) { at } else { best })?;
        Some(self.sentences[best])
    }
}

fn pair(
    people: [&String; 2],
    one: &HashMap<SpanKey, Answer>,
    other: &HashMap<SpanKey, Answer>,
) -> Option<PairAgreement> {
    let common: BTreeMap<&SpanKey, (&Answer, &Answer)> =
        one.iter().filter_map(|(span, answer)| Some((span, (answer, other.get(span)?)))).collect();
    if common.is_empty() {
        return None;
    }
    let skipped = |answer: &Answer| *answer == Answer::Skipped;
    let both_skipped = common.values().filter(|(a, b)| skipped(a) && skipped(b)).count();
    let texts: Vec<(&str, &str)> = common
        .values()
        .filter_map(|pair| match pair {
            (Answer::Sentence(a), Answer::Sentence(b)) => Some((a.as_str(), b.as_str())),
            _ => None,
        })
        .collect();
    let count = common.len() as f64;
    let a = common.values().filter(|pair| skipped(pair.0)).count() as f64 / count;
    let b = common.values().filter(|pair| skipped(pair.1)).count() as f64 / count;
    let by_chance = a * b + (1.0 - a) * (1.0 - b);
    let observed = (both_skipped + texts.len()) as f64 / count;
    let apart = texts.iter().enumerate().flat_map(|(at, (one, _))| {
        let others = texts.iter().enumerate().filter(move |(other, _)| *other != at);
        others.map(move |(_, (_, other))| words_in_common(one, other))
    });
    Some(PairAgreement {
        people: people.map(Clone::clone),
        spans: common.len(),
        both_wrote: texts.len(),
        both_skipped,
        kappa: (by_chance < 1.0).then(|| (observed - by_chance) / (1.0 - by_chance)),
        words: mean(texts.iter().map(|(one, other)| words_in_common(one, other))),
        words_by_chance: mean(apart),
    })
}

/// The share of words that two sentences have in common: F1 over their words, each counted as often as it stands.
pub(crate) fn words_in_common(one: &str, other: &str) -> f64 {
    let words = |text: &str| -> Vec<String> {
        let text = normalise(text).to_lowercase();
        text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_owned).collect()
    };
    let (one, mut other) = (words(one), words(other));
    let all = one.len() + other.len();
    let mut shared = 0;
    for word in one {
        if let Some(at) = other.iter().position(|candidate| *candidate == word) {
            other.swap_remove(at);
            shared += 1;
        }
    }
    if all == 0 { 0.0 } else { 2.0 * f64::from(shared) / all as f64 }
}

fn every_two<T>(of: &[T]) -> impl Iterator<Item = (&T, &T)> {
    of.iter().enumerate().flat_map(move |(at, one)| of[at + 1..].iter().map(move |other| (one, other)))
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

impl Agreement {
    /// In lines of plain words.
    pub(crate) fn lines(&self) -> Vec<String> {
        let mut lines: Vec<String> = self
            .people
            .iter()
            .map(|person| format!("{}: {} written, {} skipped", person.name, person.sentences, person.skipped))
            .collect();
        let number = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.2}"));
        for pair in &self.pairs {
            let [one, other] = &pair.people;
            lines.push(format!(
                "{one} and {other}: {} in common, both wrote {}, both skipped {}, kappa {}; words shared {} (by chance {})",
                pair.spans,
                pair.both_wrote,
                pair.both_skipped,
                number(pair.kappa),
                number(pair.words),
                number(pair.words_by_chance)
            ));
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(number: u8) -> SpanKey {
        SpanKey { trajectory: "t".into(), annotator: 0, skills: [0, number], input: String::new() }
    }

    /// A person's answers to spans 1, 2, ...; an empty one is a skip.
    fn of(name: &str, texts: &[&str]) -> (String, HashMap<SpanKey, Answer>) {
        let answer = |text: &&str| match *text {
            "" => Answer::Skipped,
            text => Answer::Sentence(text.into()),
        };
        (name.into(), (1..).map(key).zip(texts.iter().map(answer)).collect())
    }

    #[test]
    fn words_in_common_are_counted_whatever_their_case_and_marks() {
        assert!((words_in_common("Wash the mug.", "wash THE mug") - 1.0).abs() < 1e-9);
        assert!((words_in_common("Wash the mug.", "Heat an egg!")).abs() < 1e-9);
        assert!((words_in_common("the the cup", "the cup") - 0.8).abs() < 1e-9);
        assert!(words_in_common("", "").abs() < 1e-9);
    }

    #[test]
    fn two_people_are_held_against_each_other_and_against_chance() {
        let answers: Answers = [
            of("ann", &["Wash the mug.", "Heat an egg.", "", ""]),
            of("bob", &["wash the mug", "Heat the egg.", "", "Cut bread."]),
            of("cleo", &[]),
        ]
        .into();
        let found = agreement(&answers);
        assert_eq!(found.people[0], PersonCounts { name: "ann".into(), sentences: 2, skipped: 2 });
        let [pair] = &found.pairs[..] else { panic!("{:?}", found.pairs) };
        assert_eq!((pair.spans, pair.both_wrote, pair.both_skipped), (4, 2, 1));
        // Three of four alike, a half by chance.
        assert!((pair.kappa.unwrap() - 0.5).abs() < 1e-9);
        assert!((pair.words.unwrap() - (1.0 + 2.0 / 3.0) / 2.0).abs() < 1e-9);
        assert!(pair.words_by_chance.unwrap() < 0.34);
        assert_eq!(found.spans.iter().map(|span| span.span.skills[1]).collect::<Vec<_>>(), [2, 1]);
        assert!(found.lines().iter().any(|line| line.contains("ann and bob: 4 in common")));
    }

    #[test]
    fn the_sentence_that_has_most_in_common_speaks_for_all_unless_most_skipped() {
        let answers: Answers = [
            of("ann", &["Clean it.", "", "One."]),
            of("bob", &["Wash the mug.", "", "Two."]),
            of("cleo", &["Wash a mug.", "Three.", ""]),
        ]
        .into();
        let spans = by_span(&answers);
        let agreed = |number| spans[&key(number)].agreed();
        assert_eq!(agreed(1), Some(("bob", "Wash the mug.")));
        assert_eq!(agreed(2), None);
        assert_eq!(agreed(3), Some(("ann", "One.")));
    }

    #[test]
    fn nobody_and_people_without_a_span_in_common_agree_on_nothing() {
        assert_eq!(agreement(&Answers::new()).lines(), Vec::<String>::new());
        let all_wrote: Answers = [of("ann", &["One."]), of("bob", &["One."])].into();
        assert_eq!(agreement(&all_wrote).pairs[0].kappa, None, "nobody skipped: chance agrees wholly");
    }
}
