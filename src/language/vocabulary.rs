//! A vocabulary of words, for networks that read words instead of a sentence embedding.

use std::collections::{BTreeMap, HashMap};

/// Known words. Their numbers start at 2; 0 is padding, 1 any unknown word.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Vocabulary {
    words: Vec<String>,
    numbers: HashMap<String, i64>,
}

impl Vocabulary {
    /// What fills a text up to a length.
    pub(crate) const PADDING: i64 = 0;
    /// The number of an unknown word.
    pub(crate) const UNKNOWN: i64 = 1;
    const FIRST: usize = 2;

    /// A vocabulary of these words, in this order.
    pub(crate) fn new(words: Vec<String>) -> Vocabulary {
        let numbers =
            words.iter().enumerate().map(|(i, word)| (word.clone(), (i + Vocabulary::FIRST) as i64)).collect();
        Vocabulary { words, numbers }
    }

    /// How many words a table of so many `entries` has numbers for.
    pub(crate) fn most(entries: i64) -> usize {
        usize::try_from(entries).unwrap_or(0).saturating_sub(Vocabulary::FIRST)
    }

    /// The most frequent words of texts, so many that all numbers lie below `entries`.
    pub(crate) fn of<'a>(texts: impl Iterator<Item = &'a str>, entries: i64) -> Vocabulary {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        texts.flat_map(split).for_each(|word| *counts.entry(word).or_default() += 1);
        let mut words: Vec<(String, usize)> = counts.into_iter().collect();
        // A stable sort: words of one frequency stay in the order of the alphabet.
        words.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        words.truncate(Vocabulary::most(entries));
        Vocabulary::new(words.into_iter().map(|(word, _)| word).collect())
    }

    /// The words, in the order of their numbers.
    pub(crate) fn words(&self) -> &[String] {
        &self.words
    }

    /// The numbers of a text's words; of a text without words, that of an unknown one.
    pub(crate) fn numbers(&self, text: &str) -> Vec<i64> {
        let number = |word: String| self.numbers.get(&word).copied().unwrap_or(Vocabulary::UNKNOWN);
        let numbers: Vec<i64> = split(text).map(number).collect();
        if numbers.is_empty() { vec![Vocabulary::UNKNOWN] } else { numbers }
    }
}

fn split(text: &str) -> impl Iterator<Item = String> {
    let words = text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_lowercase).collect::<Vec<_>>().into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequent_words_come_first_and_the_rest_is_unknown() {
        let vocabulary = Vocabulary::of(["Take the mug.", "take the cup, the red cup"].into_iter(), 5);
        assert_eq!(vocabulary.words(), ["the", "cup", "take"]);
        assert_eq!(vocabulary.numbers("Take the MUG!"), [4, 2, 1]);
        assert_eq!(vocabulary.numbers("..."), [1]);
        assert_eq!(Vocabulary::new(vocabulary.words().to_vec()), vocabulary);
    }
}
