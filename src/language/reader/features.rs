//! What the model sees of a unit of text: its words, who does what to whom, and what was named before.

use super::clauses::{Chunk, Clause, chunks};
use super::lexicon::lexicon;
use super::shape::is_lamp;
use super::tokens::Token;
use crate::domain::Class;

/// What is known before a unit is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Before {
    /// The thing that was last named.
    pub object: Option<Class>,
    /// Where it was put.
    pub place: Option<Class>,
}

/// The FNV-1a hash of a feature's name.
pub fn hash(name: &str) -> u32 {
    name.bytes().fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// The features of a unit, each once.
pub fn features(clauses: &[Clause], before: Before) -> Vec<u32> {
    let mut out = Features { seen: Vec::with_capacity(160) };
    out.words(clauses);
    out.structure(clauses, before);
    out.seen.sort_unstable();
    out.seen.dedup();
    out.seen
}

struct Features {
    seen: Vec<u32>,
}

pub(super) const CHANGING: [&str; 9] = ["take", "put", "slice", "turn", "wash", "heat", "chill", "look", "make"];

impl Features {
    fn add(&mut self, kind: &str, value: &str) {
        self.seen.push(hash(&format!("{kind}:{value}")));
    }

    fn words(&mut self, clauses: &[Clause]) {
        let words = &lexicon().words;
        let skipped = |text: &str| words.determiners.contains(text) && text != "another" && text != "other";
        let mut last = "^";
        let tokens = clauses.iter().flat_map(|clause| &clause.tokens);
        for token in tokens.filter(|token| !token.unknown && !skipped(&token.text)) {
            self.add("w", &token.text);
            if token.many {
                self.add("u", "");
                self.add("u", &token.text);
                self.add("ub", last);
            }
            self.add("b", &format!("{last} {}", token.text));
            last = &token.text;
        }
        self.add("b", &format!("{last} $"));
    }

    fn structure(&mut self, clauses: &[Clause], before: Before) {
        let lemmas: Vec<&str> = clauses.iter().map(|clause| clause.lemma).collect();
        let mut steps: Vec<&str> = lemmas.iter().copied().filter(|lemma| CHANGING.contains(lemma)).collect();
        self.add("q", &lemmas.join(","));
        self.add("s", &steps.join(","));
        self.add("n", &steps.len().to_string());
        steps.dedup();
        let all = in_pieces(clauses);
        let mut names: Vec<&str> = Vec::new();
        for (lemma, pieces) in &all {
            for (at, chunk) in pieces.iter().enumerate() {
                let Some(head) = chunk.head() else { continue };
                if chunk.is_pronoun() {
                    self.add("p", &format!("{lemma} {}", chunk.lead));
                    continue;
                }
                self.add("x", &format!("{lemma} {} {}", chunk.lead, head.text));
                self.add("k", &format!("{lemma} {at} {}", head.text));
                self.add("l", &format!("{} {}", chunk.lead, head.text));
                if head.is_name() && !names.contains(&head.text.as_str()) {
                    names.push(&head.text);
                }
            }
        }
        self.add("m", &names.len().to_string());
        for (at, name) in names.iter().enumerate().take(4) {
            self.add("a", &format!("{at} {name}"));
        }
        if let Some(name) = names.last() {
            self.add("z", name);
        }
        self.kinds(&all, before);
        if let Some((lemma, pieces)) = main(&all) {
            self.thing("d", direct(lemma, pieces), before);
            self.add("v", lemma);
        }
        if let Some((lemma, pieces)) = putting(&all) {
            self.thing("e", direct(lemma, pieces), before);
            let mut places = places(pieces);
            self.place("r", places.next());
            self.place("t", places.next());
        }
        match (before.object, before.place) {
            (None, _) => self.add("c", "none"),
            (Some(object), place) => {
                self.add("co", object.name());
                self.add("cp", place.map_or("none", Class::name));
            }
        }
    }

    /// The kinds of things that are named, in order, and what leads to them: whether one is put into another one that is put
    /// somewhere does not hang on which they are.
    fn kinds(&mut self, all: &[Pieces], before: Before) {
        let mut said = String::new();
        for (lemma, pieces) in all.iter().filter(|(lemma, _)| CHANGING.contains(lemma)) {
            said.push_str(lemma);
            for chunk in pieces {
                let kind = if chunk.is_pronoun() { "it" } else { chunk.head().map_or("?", kind) };
                said.push_str(&format!(" {} {kind}", chunk.lead));
            }
            said.push('.');
        }
        self.add("y", &said);
        self.add("y", &format!("{} {said}", before.object.is_some()));
    }

    fn thing(&mut self, kind: &str, chunk: Option<&Chunk>, before: Before) {
        match chunk {
            None => {
                self.add(kind, "none");
                let object = before.object.map_or("none", Class::name);
                self.add(kind, &format!("none {object}"));
            }
            Some(chunk) if chunk.is_pronoun() => {
                let object = before.object.map_or("none", Class::name);
                self.add(kind, &format!("it {object}"));
                self.add(kind, &format!("it {object} {}", before.place.map_or("none", Class::name)));
            }
            Some(chunk) => {
                let Some(head) = chunk.head() else { return };
                self.add(kind, &head.text);
                if head.many {
                    self.add(kind, "many");
                }
                for class in head.classes {
                    self.add(kind, &format!("= {}", class.name()));
                    if before.object == Some(*class) {
                        self.add(kind, &format!("again {}", class.name()));
                    }
                }
                for word in chunk.words.iter().filter(|word| *word != head) {
                    self.add(kind, &format!("{} {}", word.text, head.text));
                }
            }
        }
    }

    fn place(&mut self, kind: &str, chunk: Option<&Chunk>) {
        let Some((chunk, head)) = chunk.and_then(|chunk| Some((chunk, chunk.head()?))) else {
            self.add(kind, "none");
            return;
        };
        self.add(kind, &head.text);
        self.add(kind, &format!("{} {}", chunk.lead, head.text));
        for class in head.classes {
            self.add(kind, &format!("= {}", class.name()));
        }
        for word in chunk.words.iter().filter(|word| *word != head) {
            self.add(kind, &format!("{} {}", word.text, head.text));
        }
    }
}

/// What kind of thing a name stands for.
fn kind(head: &Token) -> &'static str {
    let all = |may: fn(&Class) -> bool| head.is_name() && head.classes.iter().all(may);
    if all(|class| is_lamp(*class)) {
        "lamp"
    } else if all(|class| class.info().pickupable && class.info().receptacle) {
        "holder"
    } else if all(|class| class.info().pickupable) {
        "thing"
    } else if all(|class| !class.info().pickupable) {
        "furniture"
    } else {
        "?"
    }
}

/// A clause's verb and its pieces.
pub(super) type Pieces = (&'static str, Vec<Chunk>);

pub(super) fn in_pieces(clauses: &[Clause]) -> Vec<Pieces> {
    clauses.iter().map(|clause| (clause.lemma, chunks(clause))).collect()
}

/// The first clause that changes something.
pub(super) fn main(all: &[Pieces]) -> Option<&Pieces> {
    all.iter().find(|(lemma, _)| CHANGING.contains(lemma)).or(all.first())
}

/// The last clause that puts something.
pub(super) fn putting(all: &[Pieces]) -> Option<&Pieces> {
    all.iter().rev().find(|(lemma, _)| *lemma == "put").or(all.last())
}

pub(super) fn places(pieces: &[Chunk]) -> impl Iterator<Item = &Chunk> {
    pieces.iter().filter(|chunk| {
        let lead = chunk.lead.as_str();
        matches!(lead, "in" | "on" | "into" | "onto" | "inside" | "to" | "at" | "atop" | "upon" | "by" | "under")
            || matches!(lead, "within" | "next" | "near" | "above" | "over" | "below")
    })
}

/// The classes that a unit calls by their usual names: of the thing, and of the place.
pub fn named_outright(clauses: &[Clause]) -> [Option<Class>; 2] {
    let all = in_pieces(clauses);
    let usual = |chunk: Option<&Chunk>| {
        let head = chunk?.head()?;
        head.classes.iter().copied().find(|class| lexicon().usual(*class) == Some(head.text.as_str()))
    };
    let thing = main(&all).and_then(|(lemma, pieces)| direct(lemma, pieces));
    let place = putting(&all).and_then(|(_, pieces)| places(pieces).next());
    [usual(thing), usual(place)]
}

/// Whether the clauses are about different things that do not go together: none is a knife, and the one is not put into the
/// other.
pub fn are_about_different_things(clauses: &[Clause]) -> bool {
    let all = in_pieces(clauses);
    let about = all.iter().filter(|(lemma, _)| CHANGING.contains(lemma) && *lemma != "turn");
    let movable = |class: &&Class| class.info().pickupable && !class.is_knife();
    let things: Vec<(bool, Vec<Class>)> = about
        .filter_map(|(lemma, pieces)| Some((matches!(*lemma, "put" | "take"), direct(lemma, pieces)?.head()?)))
        .map(|(carries, head)| (carries, head.classes.iter().filter(movable).copied().collect()))
        .filter(|(_, classes): &(bool, Vec<Class>)| !classes.is_empty())
        .collect();
    let carried: Vec<Vec<Class>> =
        things.iter().filter(|(carries, _)| *carries).map(|(_, classes)| classes.clone()).collect();
    let differ = |a: &[Class], b: &[Class]| !a.iter().any(|class| b.contains(class));
    let changed = things.iter().filter(|(carries, _)| !carries);
    do_not_mix(&carried) || changed.into_iter().any(|(_, one)| things.iter().any(|(_, other)| differ(one, other)))
}

/// Whether something is put somewhere, and whether a thing besides a lamp is spoken of.
pub fn speaks_of(clauses: &[Clause]) -> (bool, bool) {
    let all = in_pieces(clauses);
    let tokens = || clauses.iter().flat_map(|clause| &clause.tokens);
    let furniture = |class: &Class| class.info().receptacle && !class.info().pickupable;
    let place = all.iter().any(|(_, pieces)| places(pieces).next().is_some())
        || tokens().any(|token| {
            token.lemma() == Some("put") || token.lemma().is_none() && token.classes.iter().any(furniture)
        });
    let is_lamp = |chunk: &Chunk| {
        chunk.head().is_some_and(|head| head.is_name() && head.classes.iter().all(|class| is_lamp(*class)))
    };
    let thing = tokens().any(|token| token.classes.iter().any(|class| class.info().pickupable))
        || all.iter().any(|(lemma, pieces)| {
            pieces.iter().any(Chunk::is_pronoun)
                || !pieces.iter().any(is_lamp)
                || *lemma != "turn" && !pieces.iter().all(is_lamp)
        });
    (place, thing)
}

/// Whether something is put on a piece of furniture before something else is put on another one: then the one is not put into the
/// other.
pub fn are_in_two_places(clauses: &[Clause]) -> bool {
    let furniture = |token: &&Token| {
        token.is_name() && token.classes.iter().all(|class| class.info().receptacle && !class.info().pickupable)
    };
    let puts = clauses.iter().filter(|clause| clause.lemma == "put").map(chunks);
    let named: Vec<Token> = puts
        .flat_map(|pieces| places(&pieces).filter_map(Chunk::head).filter(furniture).cloned().collect::<Vec<_>>())
        .collect();
    named.windows(2).any(|two| !two[0].classes.iter().any(|class| two[1].classes.contains(class)))
}

/// Whether two of some things have no class in common, and none of them holds the other.
pub fn do_not_mix(things: &[Vec<Class>]) -> bool {
    let holds = |classes: &[Class]| classes.iter().any(|class| class.info().receptacle);
    things.iter().enumerate().any(|(at, one)| {
        things[..at].iter().any(|other| !one.iter().any(|class| other.contains(class)) && !holds(one) && !holds(other))
    })
}

/// What a verb is about: what follows it at once; a switch may have its particle in between, a slice is of something.
pub fn direct<'a>(lemma: &str, pieces: &'a [Chunk]) -> Option<&'a Chunk> {
    let first = pieces.first()?;
    let sliced = |chunk: &Chunk| {
        chunk.words.last().is_some_and(|word| {
            matches!(word.text.as_str(), "slice" | "slices" | "piece" | "pieces" | "pair" | "couple" | "half")
        })
    };
    if sliced(first)
        && let Some(second) = pieces.get(1).filter(|second| second.lead == "of")
    {
        return Some(second);
    }
    (first.lead.is_empty() || first.lead == "off" || matches!(lemma, "turn" | "look" | "")).then_some(first)
}
