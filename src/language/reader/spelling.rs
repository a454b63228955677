//! Spelling: the known word that a misspelt one is nearest to.

use std::collections::HashMap;

use super::lexicon::lexicon;

/// Longer words are not corrected.
const LONGEST: usize = 24;

/// The words that count as spelt right, the more frequent ones first.
#[derive(Debug, Default)]
pub struct Spelling {
    rank: HashMap<String, u32>,
    by_length: Vec<Vec<(Vec<char>, u32)>>,
}

impl Spelling {
    /// Of a list of words, the most frequent first; the lexicon's words are known as well.
    pub fn of(words: impl IntoIterator<Item = String>) -> Spelling {
        let mut spelling = Spelling { rank: HashMap::new(), by_length: vec![Vec::new(); LONGEST + 1] };
        let known = lexicon().all().map(str::to_string);
        for (rank, word) in (0u32..).zip(words.into_iter().chain(known)) {
            if spelling.rank.contains_key(&word) {
                continue;
            }
            let letters: Vec<char> = word.chars().collect();
            if letters.len() <= LONGEST {
                spelling.by_length[letters.len()].push((letters, rank));
            }
            spelling.rank.insert(word, rank);
        }
        spelling
    }

    /// Whether the word counts as spelt right.
    pub fn knows(&self, word: &str) -> bool {
        self.rank.contains_key(word)
    }

    /// The nearest known word: one slip away, or two in a long word; a slip in the first letter counts twice. In words of three
    /// letters only two that changed places are put right.
    pub fn correct(&self, word: &str) -> Option<&str> {
        let letters: Vec<char> = word.chars().collect();
        if letters.len() < 3 || letters.len() > LONGEST || letters.iter().any(char::is_ascii_digit) {
            return None;
        }
        let most = if letters.len() >= 7 { 2 } else { 1 };
        let lengths = letters.len() - most..=(letters.len() + most).min(LONGEST);
        let candidates = lengths.flat_map(|length| &self.by_length[length]);
        let scored = candidates.filter(|(known, _)| known.len() > 2).filter_map(|(known, rank)| {
            if letters.len() == 3 && sorted(known) != sorted(&letters) {
                return None;
            }
            let slips = slips(&letters, known, most)?;
            let first = usize::from(known[0] != letters[0]);
            (slips + first <= most).then_some(((slips + first, *rank), known))
        });
        let (_, best) = scored.min_by_key(|&(score, _)| score)?;
        self.rank.get_key_value(&best.iter().collect::<String>()).map(|(word, _)| word.as_str())
    }
}

fn sorted(letters: &[char]) -> Vec<char> {
    let mut letters = letters.to_vec();
    letters.sort_unstable();
    letters
}

/// How many letters were left out, added, changed or swapped with the next; `None` when more than `most`.
fn slips(a: &[char], b: &[char], most: usize) -> Option<usize> {
    let width = b.len() + 1;
    let (mut older, mut old): (Vec<usize>, Vec<usize>) = (vec![0; width], (0..width).collect());
    for i in 1..=a.len() {
        let mut new = vec![i; width];
        for j in 1..width {
            let same = a[i - 1] == b[j - 1];
            new[j] = (old[j - 1] + usize::from(!same)).min(old[j] + 1).min(new[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                new[j] = new[j].min(older[j - 2] + 1);
            }
        }
        if new.iter().all(|&slips| slips > most) {
            return None;
        }
        (older, old) = (old, new);
    }
    Some(old[b.len()]).filter(|&slips| slips <= most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_of_the_finger_are_put_right() {
        let spelling = Spelling::of(["lettuce", "microwave", "potato"].map(str::to_string));
        for (wrong, right) in
            [("letuce", "lettuce"), ("mircowave", "microwave"), ("poatto", "potato"), ("mgu", "mug"), ("mgx", "")]
        {
            assert_eq!(spelling.correct(wrong).unwrap_or_default(), right);
        }
    }

    #[test]
    fn a_word_that_is_like_no_other_stays() {
        assert_eq!(Spelling::of(["mug".to_string()]).correct("xylophone"), None);
    }
}
