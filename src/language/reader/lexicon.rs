//! The reader's words: what stands for what, which words are verbs or lead to a place, and every name of a class.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;
use std::sync::OnceLock;

use serde::Deserialize;

use crate::domain::Class;
use crate::language::{grammar::grammar, nouns};

/// `assets/reader/words.toml`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    same: BTreeMap<String, String>,
    verbs: BTreeMap<String, Vec<String>>,
    counts: BTreeMap<String, usize>,
    grammar: Words,
}

/// Words by what they do in a sentence.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Words {
    /// Words after which a verb counts as one.
    pub before_verb: BTreeSet<String>,
    /// Words that lead to a place or a tool.
    pub prepositions: BTreeSet<String>,
    /// Articles and the like.
    pub determiners: BTreeSet<String>,
    /// Words that stand for what was named before.
    pub pronouns: BTreeSet<String>,
    /// Words that end a noun.
    pub breaks: BTreeSet<String>,
    /// Words that belong to a verb.
    pub particles: BTreeSet<String>,
    /// Parts of a piece of furniture.
    pub places: BTreeSet<String>,
    /// Words that carry nothing to be read.
    pub plain: BTreeSet<String>,
    /// Nouns that follow a verb and are no things.
    pub nameless: BTreeSet<String>,
    /// Words that are matched one by one.
    pub other: BTreeSet<String>,
    /// Words that are spelt right and not understood.
    pub foreign: BTreeSet<String>,
}

/// A phrase, word by word, and the words that it stands for.
type Phrase = (Vec<String>, Vec<String>);

/// Everything that is known of words before anything is learned.
#[derive(Debug, Default)]
pub struct Lexicon {
    /// Phrases and what they stand for, by their first word; the longest first.
    same: HashMap<String, Vec<Phrase>>,
    /// Verbs by form.
    verbs: HashMap<String, &'static str>,
    /// How many things a word says there are.
    counts: BTreeMap<String, usize>,
    /// Names of classes, as words, by their first word; the longest first.
    names: HashMap<String, Vec<Name>>,
    /// Every class's usual name, as one word.
    usual: BTreeMap<Class, String>,
    /// Words by what they do.
    pub words: Words,
    /// Every single word above.
    all: BTreeSet<String>,
}

/// One name, in the singular or plural.
#[derive(Clone, Debug)]
struct Name {
    words: Vec<String>,
    singular: String,
    many: bool,
    classes: Vec<Class>,
}

const LEMMAS: [&str; 14] =
    ["take", "put", "slice", "turn", "wash", "heat", "chill", "look", "open", "close", "go", "wait", "find", "make"];

/// The lexicon that is part of the program.
pub fn lexicon() -> &'static Lexicon {
    static LEXICON: OnceLock<Lexicon> = OnceLock::new();
    LEXICON.get_or_init(|| {
        // A test parses the table, so the default cannot be reached in a build that passed.
        let table: Table = toml::from_str(include_str!("../../../assets/reader/words.toml")).unwrap_or_default();
        Lexicon::of(table)
    })
}

fn split(text: &str) -> Vec<String> {
    text.to_lowercase().split(' ').map(str::to_string).collect()
}

impl Lexicon {
    fn of(table: Table) -> Lexicon {
        let mut lexicon = Lexicon { words: table.grammar, counts: table.counts, ..Lexicon::default() };
        lexicon.all.extend(lexicon.counts.keys().cloned());
        for (from, to) in &table.same {
            let (from, to) = (split(from), split(to));
            lexicon.all.extend(from.iter().chain(&to).cloned());
            lexicon.same.entry(from[0].clone()).or_default().push((from, to));
        }
        for same in lexicon.same.values_mut() {
            same.sort_by_key(|(from, _)| std::cmp::Reverse(from.len()));
        }
        for lemma in LEMMAS {
            for form in table.verbs.get(lemma).into_iter().flatten() {
                lexicon.verbs.insert(form.clone(), lemma);
                lexicon.all.insert(form.clone());
            }
        }
        let words = &lexicon.words;
        let lists = [&words.before_verb, &words.prepositions, &words.determiners, &words.pronouns];
        let more = [&words.breaks, &words.particles, &words.places, &words.plain];
        let rest = [&words.nameless, &words.other, &words.foreign];
        lexicon.all.extend(lists.into_iter().chain(more).chain(rest).flatten().cloned());
        lexicon.add_names();
        lexicon
    }

    fn add_names(&mut self) {
        let mut found: BTreeMap<String, (String, BTreeSet<Class>)> = BTreeMap::new();
        for class in Class::all().filter(|class| class.in_vocabulary()) {
            let usual = self.replace(&split(class.spoken())).join("_");
            self.usual.insert(class, usual);
            let plural = |head: &str| nouns::Noun { modifiers: Vec::new(), head: head.into() }.plural(&[], class);
            for head in nouns::heads(class).map(str::to_lowercase) {
                // The same replacements as in the text.
                let head = self.replace(&split(&head)).join(" ");
                for form in [head.clone(), plural(&head).to_lowercase()] {
                    found.entry(form).or_insert_with(|| (head.clone(), BTreeSet::new())).1.insert(class);
                }
            }
            found
                .entry(grammar().plural(class).to_lowercase())
                .or_insert_with(|| (class.spoken().to_lowercase(), BTreeSet::new()))
                .1
                .insert(class);
        }
        for (form, (singular, classes)) in found {
            let words = split(&form);
            self.all.extend(words.iter().cloned());
            let many = form != singular;
            let name =
                Name { many, singular: singular.replace(' ', "_"), classes: classes.into_iter().collect(), words };
            self.names.entry(name.words[0].clone()).or_default().push(name);
        }
        for names in self.names.values_mut() {
            names.sort_by_key(|name| std::cmp::Reverse(name.words.len()));
        }
    }

    /// Replaces people's words by the plain ones.
    pub fn replace(&self, words: &[String]) -> Vec<String> {
        self.replace_marked(words).into_iter().map(|(word, _)| word).collect()
    }

    /// The same; each word with the positions of the words that it stands for.
    pub fn replace_marked(&self, words: &[String]) -> Vec<(String, Range<usize>)> {
        let mut out = Vec::with_capacity(words.len());
        let mut at = 0;
        while at < words.len() {
            let fits = |(from, _): &&(Vec<String>, Vec<String>)| words[at..].starts_with(from);
            match self.same.get(&words[at]).and_then(|same| same.iter().find(fits)) {
                Some((from, to)) => {
                    out.extend(to.iter().map(|word| (word.clone(), at..at + from.len())));
                    at += from.len();
                }
                None => {
                    out.push((words[at].clone(), at..at + 1));
                    at += 1;
                }
            }
        }
        out
    }

    /// The longest name that starts here: how many words it has, its singular as one word, whether it is the plural, and the
    /// classes that bear it.
    pub fn name_at<'a>(&'a self, words: &[(String, Range<usize>)]) -> Option<(usize, &'a str, bool, &'a [Class])> {
        let fits = |name: &&Name| {
            name.words.len() <= words.len() && name.words.iter().zip(words).all(|(name, (word, _))| name == word)
        };
        let name = self.names.get(&words.first()?.0)?.iter().find(fits)?;
        Some((name.words.len(), &name.singular, name.many, &name.classes))
    }

    /// A class's usual name, as one word.
    pub fn usual(&self, class: Class) -> Option<&str> {
        self.usual.get(&class).map(String::as_str)
    }

    /// What a verb's form comes to.
    pub fn verb(&self, word: &str) -> Option<&'static str> {
        self.verbs.get(word).copied()
    }

    /// How many things a word says there are: "three", "3"; more than can be read for "several".
    pub fn count(&self, word: &str) -> Option<usize> {
        self.counts.get(word).copied().or_else(|| word.parse().ok())
    }

    /// Whether the word is one of the lexicon's.
    pub fn knows(&self, word: &str) -> bool {
        self.all.contains(word)
    }

    /// Every single word, for spelling.
    pub fn all(&self) -> impl Iterator<Item = &str> {
        self.all.iter().map(String::as_str)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::reader::spelling::Spelling;
    use crate::language::reader::tokens::tokens;

    #[test]
    fn the_table_of_words_is_sound() {
        let text = include_str!("../../../assets/reader/words.toml");
        let table: Table = toml::from_str(text).unwrap();
        assert!(table.verbs.keys().all(|lemma| LEMMAS.contains(&lemma.as_str())));
        assert_eq!(table.verbs.len(), LEMMAS.len());
        let lists: toml::Table = toml::from_str(text).unwrap();
        let lists = ["verbs", "grammar"].map(|part| lists[part].as_table().unwrap().clone());
        for (name, list) in lists.iter().flatten() {
            let list: Vec<&str> = list.as_array().unwrap().iter().map(|word| word.as_str().unwrap()).collect();
            let once: BTreeSet<&str> = list.iter().copied().collect();
            assert_eq!(once.len(), list.len(), "a word stands twice in {name}");
        }
        for (from, to) in &table.same {
            assert_ne!(from, to);
            let mut words = tokens(from, &Spelling::of([])).tokens;
            words.dedup_by_key(|token| token.at);
            let typed: Vec<&str> = words.iter().map(|token| token.typed.as_str()).collect();
            assert_eq!(typed.join(" "), *from, "no typed text comes to this key");
        }
    }

    #[test]
    fn what_is_foreign_is_nothing_else_and_a_verb_is_of_one_kind() {
        let table: Table = toml::from_str(include_str!("../../../assets/reader/words.toml")).unwrap();
        let mut forms = BTreeSet::new();
        assert!(table.verbs.values().flatten().all(|form| forms.insert(form.clone())));
        let words = &table.grammar;
        let lists = [&words.before_verb, &words.prepositions, &words.determiners, &words.pronouns, &words.breaks];
        let more = [&words.particles, &words.places, &words.plain, &words.nameless, &words.other];
        let mut known: BTreeSet<String> = lists.into_iter().chain(more).flatten().cloned().chain(forms).collect();
        known.extend(table.same.keys().chain(table.same.values()).filter(|words| !words.contains(' ')).cloned());
        known.extend(table.counts.into_keys());
        known.extend(
            lexicon().names.values().flatten().filter(|name| name.words.len() == 1).map(|name| name.words[0].clone()),
        );
        let twice: Vec<&String> = words.foreign.intersection(&known).collect();
        assert_eq!(twice, Vec::<&String>::new());
    }

    #[test]
    fn every_word_that_the_rules_match_is_known() {
        let sources = [
            include_str!("clauses.rs"),
            include_str!("corrections.rs"),
            include_str!("forbidden.rs"),
            include_str!("pronouns.rs"),
            include_str!("switching.rs"),
            include_str!("details.rs"),
            include_str!("unread.rs"),
            include_str!("features.rs"),
        ];
        // Parts of features' names, and the class that has no name.
        let others = ["again", "none", "many", "holder", "thing", "furniture", "true"];
        let rules = sources.iter().map(|source| source.split("#[cfg(test)]").next().unwrap());
        let code = rules.flat_map(str::lines).filter(|line| !line.trim_start().starts_with("//"));
        let quoted = code.flat_map(|line| line.split('"').skip(1).step_by(2));
        let is_word = |word: &&str| word.len() > 2 && word.chars().all(|c| c.is_ascii_lowercase() || c == '_');
        let words: BTreeSet<&str> = quoted.filter(is_word).filter(|word| !others.contains(word)).collect();
        assert!(words.len() > 80, "{words:?}");
        let unknown: Vec<&&str> =
            words.iter().filter(|word| !word.split('_').all(|word| lexicon().knows(word))).collect();
        assert_eq!(unknown, Vec::<&&str>::new(), "spelling would turn these into others");
    }

    #[test]
    fn every_class_that_an_action_may_name_has_a_name() {
        let lexicon = lexicon();
        let named: BTreeSet<Class> = lexicon.names.values().flatten().flat_map(|name| name.classes.clone()).collect();
        assert_eq!(named.len(), Class::VOCABULARY - 1);
    }
}
