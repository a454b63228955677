//! The phrase grammar: `assets/phrases.toml`, and how a rule is turned into text.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;

use crate::domain::Class;

/// Rules deeper than this are taken for a circle.
const DEEPEST: usize = 8;

/// The phrase table.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Grammar {
    rules: BTreeMap<String, Vec<String>>,
    names: BTreeMap<Class, Vec<String>>,
    plurals: BTreeMap<Class, String>,
    one: BTreeMap<Class, String>,
    phrasal: Phrasal,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Phrasal {
    verbs: Vec<String>,
}

/// What the program fills into a phrase.
pub(crate) type Slots<'a> = BTreeMap<&'a str, String>;

/// The table that is part of the program.
pub(crate) fn grammar() -> &'static Grammar {
    static GRAMMAR: OnceLock<Grammar> = OnceLock::new();
    // A test parses the table, so the default cannot be reached in a build that passed.
    GRAMMAR.get_or_init(|| toml::from_str(include_str!("../../assets/phrases.toml")).unwrap_or_default())
}

/// The pieces of an alternative: text, and the names in braces.
fn pieces(alternative: &str) -> impl Iterator<Item = (bool, &str)> {
    alternative.split(['{', '}']).enumerate().map(|(index, piece)| (index % 2 == 1, piece))
}

impl Grammar {
    /// How many alternatives a rule has.
    #[cfg(test)]
    pub(crate) fn count(&self, rule: &str) -> usize {
        self.rules.get(rule).map_or(0, Vec::len)
    }

    /// A random alternative of a rule, filled in; empty when none can be filled.
    pub(crate) fn say(&self, rule: &str, slots: &Slots<'_>, rng: &mut ChaCha8Rng) -> String {
        let mut out = String::new();
        self.expand(rule, slots, rng, &mut out, 0);
        self.phrasal.verbs.iter().fold(out, |text, verb| match verb.split_once(' ') {
            Some((verb, particle)) => put_between(&text, verb, particle),
            None => text,
        })
    }

    fn expand(&self, rule: &str, slots: &Slots<'_>, rng: &mut ChaCha8Rng, out: &mut String, depth: usize) {
        let Some(alternatives) = self.rules.get(rule).filter(|_| depth < DEEPEST) else { return };
        let usable: Vec<&String> = alternatives.iter().filter(|text| self.can_fill(text, slots)).collect();
        if usable.is_empty() {
            return;
        }
        let chosen = usable[rng.random_range(0..usable.len() as u32) as usize];
        for (named, piece) in pieces(chosen) {
            match slots.get(piece).filter(|_| named) {
                Some(filled) => out.push_str(filled),
                None if named => self.expand(piece, slots, rng, out, depth + 1),
                None => out.push_str(piece),
            }
        }
    }

    /// Whether every name in an alternative is a filled slot or a rule.
    fn can_fill(&self, alternative: &str, slots: &Slots<'_>) -> bool {
        pieces(alternative).all(|(named, piece)| !named || slots.contains_key(piece) || self.rules.contains_key(piece))
    }

    /// Every name of a class; the first is the usual one.
    pub(crate) fn names(&self, class: Class) -> impl Iterator<Item = &str> {
        std::iter::once(class.spoken()).chain(self.names.get(&class).into_iter().flatten().map(String::as_str))
    }

    /// One of a class's names; mostly the usual one.
    pub(crate) fn name(&self, class: Class, rng: &mut ChaCha8Rng) -> &str {
        let other = self.names.get(&class).filter(|_| rng.random_bool(0.3));
        other.map_or(class.spoken(), |names| names[rng.random_range(0..names.len() as u32) as usize].as_str())
    }

    /// "a mug", "an egg", "a loaf of bread".
    pub(crate) fn one(&self, class: Class) -> String {
        self.one.get(&class).cloned().unwrap_or_else(|| with_article(class.spoken()))
    }

    /// "mugs", "loaves of bread".
    pub(crate) fn plural(&self, class: Class) -> String {
        self.plurals.get(&class).cloned().unwrap_or_else(|| format!("{}s", class.spoken()))
    }
}

/// "pick up it" as "pick it up".
fn put_between(text: &str, verb: &str, particle: &str) -> String {
    let (wrong, right) = (format!("{verb} {particle} it"), format!("{verb} it {particle}"));
    let Some(start) = text.find(&wrong) else { return text.into() };
    let rest = &text[start + wrong.len()..];
    if rest.starts_with(char::is_alphanumeric) { text.into() } else { format!("{}{right}{rest}", &text[..start]) }
}

/// A noun with "a" or "an".
pub(crate) fn with_article(noun: &str) -> String {
    let vowel = noun.starts_with(['a', 'e', 'i', 'o', 'u', 'A', 'E', 'I', 'O']);
    format!("{} {noun}", if vowel { "an" } else { "a" })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOTS: [&str; 11] = ["object", "food", "place", "from", "at", "shut", "dest", "to", "inside", "tool", "held"];

    #[test]
    fn every_name_in_the_phrase_table_is_a_rule_or_a_slot() {
        let grammar: Grammar = toml::from_str(include_str!("../../assets/phrases.toml")).unwrap();
        for (rule, alternatives) in &grammar.rules {
            for alternative in alternatives {
                assert_eq!(alternative.matches('{').count(), alternative.matches('}').count(), "{rule}: {alternative}");
                for (_, piece) in pieces(alternative).filter(|(named, _)| *named) {
                    assert!(SLOTS.contains(&piece) || grammar.rules.contains_key(piece), "{rule}: {piece}");
                }
            }
        }
    }

    #[test]
    fn it_goes_between_verb_and_particle() {
        assert_eq!(put_between("find the mug and pick up it.", "pick", "up"), "find the mug and pick it up.");
        assert_eq!(put_between("pick up items", "pick", "up"), "pick up items");
    }

    #[test]
    fn every_skill_has_at_least_twenty_phrasings() {
        for rule in ["pickup", "put", "slice", "toggle", "clean", "heat", "cool"] {
            assert!(grammar().count(rule) >= 20, "{rule}");
        }
    }
}
