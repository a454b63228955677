//! Nouns: what a person called a thing, found in the sentence that tells what was done with it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

use serde::Deserialize;

use super::grammar::{grammar, with_article};
use crate::domain::Class;

/// `assets/nouns.toml`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct NounTable {
    heads: BTreeMap<Class, Vec<String>>,
    words: Words,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Words {
    modifiers: BTreeSet<String>,
    mass: BTreeSet<String>,
    many: BTreeSet<String>,
    after: BTreeSet<String>,
}

fn table() -> &'static NounTable {
    static TABLE: OnceLock<NounTable> = OnceLock::new();
    // A test parses the table, so the default cannot be reached in a build that passed.
    TABLE.get_or_init(|| toml::from_str(include_str!("../../assets/nouns.toml")).unwrap_or_default())
}

/// A noun with what was said of its looks, without an article: "small black table".
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Noun {
    /// Words of looks, in order; at most two.
    pub(crate) modifiers: Vec<String>,
    /// The name.
    pub(crate) head: String,
}

/// How a noun is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Number {
    /// "a mug".
    One,
    /// "soap".
    Mass,
    /// "keys".
    Many,
}

/// Every name of a class that counts as naming it.
pub(crate) fn heads(class: Class) -> impl Iterator<Item = &'static str> {
    let known = table().heads.get(&class).into_iter().flatten().map(String::as_str);
    std::iter::once(class.spoken()).chain(grammar().names(class)).chain(known)
}

/// Whether a text calls something by one of a class's names, in the singular or plural.
pub(crate) fn names(text: &str, class: Class) -> bool {
    let words = words(text);
    let plural = |head: &str| plural_of(head).unwrap_or_else(|| grammar().plural(class));
    heads(class).any(|head| {
        [head.to_lowercase(), plural(head).to_lowercase()].iter().any(|name| {
            let name: Vec<&str> = name.split(' ').collect();
            words.windows(name.len()).any(|window| window.iter().eq(name.iter()))
        })
    })
}

/// Words in lower case; punctuation marks are words of their own.
fn words(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut inside = false;
    for c in text.to_lowercase().chars() {
        let letter = c.is_alphanumeric() || c == '\'' || c == '-';
        match words.last_mut().filter(|_| letter && inside) {
            Some(word) => word.push(c),
            None if letter || !c.is_whitespace() => words.push(c.to_string()),
            None => {}
        }
        inside = letter;
    }
    words
}

impl Noun {
    /// A class by its usual name.
    pub(crate) fn usual(class: Class) -> Noun {
        Noun { modifiers: Vec::new(), head: class.spoken().to_string() }
    }

    /// What a sentence calls a thing of that class: its longest name, with the words of looks before it. The first one with an
    /// article counts, or for a place the first one that something is put "in" or "on".
    pub(crate) fn find(class: Class, sentence: &str, is_place: bool) -> Option<Noun> {
        let words = words(sentence);
        let ends = |at: usize| words.get(at).is_none_or(|word| is_mark(word) || table().words.after.contains(word));
        let mut found: Option<(usize, usize)> = None;
        for head in heads(class) {
            let name = head.to_lowercase();
            let name: Vec<&str> = name.split(' ').collect();
            for (at, window) in words.windows(name.len()).enumerate() {
                if !window.iter().eq(name.iter()) || !ends(at + name.len()) {
                    continue;
                }
                let better = match found {
                    None => true,
                    // A longer name that takes the shorter one in.
                    Some((from, to)) if at <= from && to <= at + name.len() => name.len() > to - from,
                    Some((from, to)) if from <= at && at + name.len() <= to => false,
                    Some((from, _)) => {
                        let rank = |at: usize| {
                            let led_in = if is_place { is_entered(&words, at) } else { is_determined(&words, at) };
                            (!led_in, at)
                        };
                        rank(at) < rank(from)
                    }
                };
                if better {
                    found = Some((at, at + name.len()));
                }
            }
        }
        let (from, to) = found?;
        let looks =
            words[..from].iter().rev().take_while(|word| table().words.modifiers.contains(*word)).count().min(2);
        let modifiers = words[from - looks..from].to_vec();
        let head = words[from..to].join(" ");
        Some(Noun { modifiers: modifiers.into_iter().filter(|word| !head.contains(word.as_str())).collect(), head })
    }

    /// How it is counted.
    pub(crate) fn number(&self) -> Number {
        if table().words.mass.contains(&self.head) {
            Number::Mass
        } else if table().words.many.contains(&self.head) {
            Number::Many
        } else {
            Number::One
        }
    }

    /// "small black table".
    pub(crate) fn text(&self) -> String {
        self.with(&[], &self.head)
    }

    /// Words before it and another head in its place.
    fn with(&self, states: &[String], head: &str) -> String {
        let words = states.iter().map(String::as_str).chain(self.modifiers.iter().map(String::as_str));
        words.chain(std::iter::once(head)).collect::<Vec<_>>().join(" ")
    }

    /// "a rinsed mug", "the keys", "some soap": one that was not spoken of before.
    pub(crate) fn one(&self, states: &[String]) -> String {
        let text = self.with(states, &self.head);
        match self.number() {
            Number::One => with_article(&text),
            Number::Mass => format!("some {text}"),
            Number::Many => format!("the {text}"),
        }
    }

    /// "the rinsed mug".
    pub(crate) fn the(&self, states: &[String]) -> String {
        format!("the {}", self.with(states, &self.head))
    }

    /// "small mugs"; `class` says what there are many of where the noun is not counted.
    pub(crate) fn plural(&self, states: &[String], class: Class) -> String {
        let head = match self.number() {
            Number::One => plural_of(&self.head),
            _ => None,
        };
        self.with(states, &head.unwrap_or_else(|| grammar().plural(class)))
    }
}

/// Whether the words before lead into a place: "in the", "onto a small".
fn is_entered(words: &[String], at: usize) -> bool {
    let skip = |word: &&String| {
        [
            "the", "a", "an", "your", "of", "same", "left", "right", "front", "back", "side", "edge", "middle",
            "center", "other",
        ]
        .contains(&word.as_str())
            || table().words.modifiers.contains(*word)
    };
    let before = words[..at].iter().rev().find(|word| !skip(word));
    before.is_some_and(|word| ["in", "on", "into", "onto", "inside", "to", "within", "atop"].contains(&word.as_str()))
}

/// Whether an article or the like leads to the name: in "light the lamp", it leads to the lamp.
fn is_determined(words: &[String], at: usize) -> bool {
    let before = words[..at].iter().rev().find(|word| !table().words.modifiers.contains(*word));
    let determiners = [
        "the", "a", "an", "your", "another", "other", "second", "one", "two", "this", "that", "first", "clean", "dirty",
    ];
    before.is_some_and(|word| determiners.contains(&word.as_str()))
}

fn is_mark(word: &str) -> bool {
    !word.chars().all(|c| c.is_alphanumeric() || c == '\'' || c == '-')
}

/// The plural of a name that is counted: "bars of soap", "knives"; nothing for names that are not.
fn plural_of(head: &str) -> Option<String> {
    let (first, rest) = match head.split_once(" of ") {
        Some((first, rest)) => (first, format!(" of {rest}")),
        None => (head, String::new()),
    };
    if table().words.mass.contains(head) || table().words.many.contains(head) {
        return None;
    }
    let cut = |count: usize| &first[..first.len() - count];
    let plural = match first {
        _ if first.ends_with("knife") => format!("{}ves", cut(2)),
        _ if first.ends_with("loaf") || first.ends_with("shelf") => format!("{}ves", cut(1)),
        _ if first.ends_with("tomato") || first.ends_with("potato") => format!("{first}es"),
        _ if ["s", "x", "ch", "sh"].iter().any(|end| first.ends_with(end)) => format!("{first}es"),
        _ => format!("{first}s"),
    };
    Some(plural + &rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(class: &str, sentence: &str, is_place: bool) -> String {
        Noun::find(Class::named(class).unwrap(), sentence, is_place).map_or(String::new(), |noun| noun.text())
    }

    #[test]
    fn the_table_of_nouns_parses() {
        let table: NounTable = toml::from_str(include_str!("../../assets/nouns.toml")).unwrap();
        assert!(table.heads.len() > 75 && !table.words.after.is_empty());
    }

    #[test]
    fn the_longest_name_and_its_looks_are_found() {
        assert_eq!(found("SoapBar", "Pick up the pink bar of soap from the tub.", false), "pink bar of soap");
        assert_eq!(found("SideTable", "Place it on the small black night stand.", true), "small black night stand");
        assert_eq!(found("KeyChain", "take the keys", false), "keys");
        assert_eq!(found("Mug", "Grab the dirty white coffee mug, then turn", false), "white coffee mug");
    }

    #[test]
    fn a_name_inside_another_thing_does_not_count() {
        assert_eq!(found("Toilet", "Pick up the toilet paper", true), "");
        assert_eq!(found("Toilet", "Put the toilet paper on the toilet.", true), "toilet");
        assert_eq!(found("Cup", "take the glass bowl", false), "");
    }

    #[test]
    fn of_two_tables_the_one_that_something_is_put_on_is_meant() {
        assert_eq!(found("SideTable", "Walk past the white table and put it on the black table.", true), "black table");
        assert_eq!(found("Bowl", "Put the bowl on the counter", false), "bowl");
        assert_eq!(found("FloorLamp", "Light the floor lamp.", false), "floor lamp");
    }

    #[test]
    fn nouns_take_articles_states_and_plurals() {
        let noun = |head: &str| Noun { modifiers: vec!["small".into()], head: head.into() };
        let clean = ["clean".to_string()];
        assert_eq!(noun("bar of soap").one(&clean), "a clean small bar of soap");
        assert_eq!(noun("soap").one(&[]), "some small soap");
        assert_eq!(noun("keys").one(&[]), "the small keys");
        let of = |class: &str, head: &str| noun(head).plural(&[], Class::named(class).unwrap());
        assert_eq!(of("SoapBar", "bar of soap"), "small bars of soap");
        assert_eq!(of("SoapBar", "soap"), "small bars of soap");
        assert_eq!(of("Knife", "knife"), "small knives");
        assert_eq!(of("Cup", "glass"), "small glasses");
    }

    #[test]
    fn a_text_names_a_class_in_any_number() {
        let class = |name| Class::named(name).unwrap();
        assert!(names("Put two bars of soap away.", class("SoapBar")));
        assert!(names("Put it in the refrigerator.", class("Fridge")));
        assert!(!names("Put it in the refrigerator.", class("Sink")));
    }
}
