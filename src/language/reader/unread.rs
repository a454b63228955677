//! What a reading does not use of a text: clauses that are not understood, unknown words, things that it leaves out, and numbers
//! that it does not keep to.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::clauses::{Chunk, Clause, chunks};
use super::features::{CHANGING, direct, places};
use super::lexicon::lexicon;
use super::reading::ReadSubtask;
use super::tokens::Token;
use crate::domain::Class;
use crate::domain::class::FixtureEffect;
use crate::domain::skill::SkillKind;

/// How much of the probability stays when a word is not understood.
const UNKNOWN: f32 = 0.6;
/// When what a verb is about, or where something goes, is called by no name, or left out.
const LEFT_OUT: f32 = 0.5;
/// When a thing is left out that only says where another one is: readings that leave it out are right as often as others.
const LANDMARK: f32 = 1.0;

/// Which clauses a part of the reading was made of, and which of its subtasks it is.
pub(super) type Part = (Range<usize>, Range<usize>);

/// Whether a clause begins with something that is not understood, or asks for what no subtask can do.
pub(super) fn is_foreign(clause: &Clause) -> bool {
    let mut before = clause.tokens.iter().take_while(|token| !token.is_name());
    let says = |words: &[&str]| clause.tokens.iter().any(|token| words.contains(&token.text.as_str()));
    let turned =
        clause.lemma == "turn" && !says(&["on", "lamp", "light", "floor_lamp", "desk_lamp"]) && !says_nothing(clause);
    turned || switches_the_unknown(clause) || clause.lemma == "off" || clause.lemma.is_empty() && before.any(is_strange)
}

/// Whether something is to be switched on that the reader knows no name for.
fn switches_the_unknown(clause: &Clause) -> bool {
    let pieces = chunks(clause);
    let about = direct(clause.lemma, &pieces).filter(|_| clause.lemma == "turn");
    about.is_some_and(|chunk| has_no_name(chunk) && chunk.head().is_some_and(|head| head.text != "water"))
        && !clause.tokens.iter().any(Token::is_name)
}

/// Whether nothing is made of a word.
fn is_strange(token: &Token) -> bool {
    token.unknown || lexicon().words.foreign.contains(&token.text) && !token.is_name()
}

/// Whether a clause is about nothing: "turn around".
pub(super) fn says_nothing(clause: &Clause) -> bool {
    let words = &lexicon().words;
    let mut rest = clause.tokens.iter().filter(|token| token.lemma() != Some(clause.lemma));
    matches!(clause.lemma, "turn" | "look")
        && rest.all(|token| {
            let word = &token.text;
            token.is_mark()
                || words.prepositions.contains(word) && word != "on"
                || words.determiners.contains(word)
                || words.places.contains(word)
                || words.plain.contains(word)
                || words.particles.contains(word)
                || words.breaks.contains(word)
        })
}

/// The words that were not used, as they were typed, and how much of the probability they leave.
pub(super) fn unread(wanted: &[Token], clauses: &[Clause], parts: &[Part], read: &[ReadSubtask]) -> (Vec<String>, f32) {
    let mut found = Found::default();
    for (at, token) in wanted.iter().enumerate() {
        let then = wanted.get(at + 1).map_or("", |then| then.text.as_str());
        // A condition; "if you can" is none.
        let condition = matches!(token.text.as_str(), "if" | "unless") && !matches!(then, "you" | "possible");
        if is_strange(token) || condition {
            found.add(token, UNKNOWN);
        }
    }
    let everything = Used::of(read);
    for (some, steps) in parts {
        let (some, steps) = (&clauses[some.clone()], &read[steps.clone()]);
        if steps.is_empty() {
            some.iter().for_each(|clause| found.passed_over(clause, &everything));
        } else {
            found.used(some, &Used::of(steps));
        }
    }
    for subtask in read {
        found.words.retain(|_, (token, _)| token.unknown || !subtask.looks.contains(&token.text));
    }
    found.numbers(wanted, read);
    let left = found.words.values().map(|(_, left)| left).product();
    let mut said = BTreeSet::new();
    let words = found.words.into_values().map(|(token, _)| token.typed);
    (words.filter(|word| said.insert(word.clone())).collect(), left)
}

/// What some subtasks are about.
struct Used {
    classes: BTreeSet<Class>,
    kinds: Vec<SkillKind>,
}

impl Used {
    fn of(read: &[ReadSubtask]) -> Used {
        let classes = read.iter().flat_map(|one| [one.object, one.receptacle, one.place]).flatten().collect();
        Used { classes, kinds: read.iter().map(|one| one.skill).collect() }
    }

    /// Whether a name stands for one of them, or for what such a subtask is done with.
    fn has(&self, token: &Token) -> bool {
        token
            .classes
            .iter()
            .any(|class| self.classes.contains(class) || self.kinds.iter().any(|kind| is_means(*kind, *class)))
    }
}

/// Whether a skill is done with something of that class.
pub(super) fn is_means(kind: SkillKind, class: Class) -> bool {
    let info = class.info();
    match kind {
        SkillKind::Heat => info.effect == Some(FixtureEffect::Heat),
        SkillKind::Cool => info.effect == Some(FixtureEffect::Cool),
        SkillKind::Clean => info.effect == Some(FixtureEffect::Rinse) || info.basin,
        SkillKind::Slice => class.is_knife(),
        _ => false,
    }
}

/// The tokens found, by where they stand.
#[derive(Default)]
struct Found {
    words: BTreeMap<usize, (Token, f32)>,
}

impl Found {
    fn add(&mut self, token: &Token, left: f32) {
        if !token.typed.is_empty() {
            let found = self.words.entry(token.at).or_insert_with(|| (token.clone(), left));
            found.1 = found.1.min(left);
        }
    }

    /// A clause that no subtask was made of.
    fn passed_over(&mut self, clause: &Clause, everything: &Used) {
        let words = &lexicon().words;
        if is_foreign(clause) {
            let carries = |token: &&Token| {
                let link = words.plain.contains(&token.text) || words.prepositions.contains(&token.text);
                let off = clause.lemma == "off" && matches!(token.text.as_str(), "off" | "out" | "down");
                !(token.is_mark() || words.determiners.contains(&token.text) || words.breaks.contains(&token.text))
                    && (!link || off)
            };
            clause.tokens.iter().filter(carries).for_each(|token| self.add(token, UNKNOWN));
        } else if is_aside(clause) {
            self.aside(clause, everything);
        } else if !says_nothing(clause) {
            let names = clause.tokens.iter().filter(|token| token.is_name() && !everything.has(token));
            names.for_each(|token| self.add(token, LEFT_OUT));
        }
    }

    /// Clauses that subtasks were made of.
    fn used(&mut self, clauses: &[Clause], used: &Used) {
        for clause in clauses {
            if is_aside(clause) {
                self.aside(clause, used);
                continue;
            }
            let pieces = chunks(clause);
            let about = direct(clause.lemma, &pieces);
            let goes = places(&pieces).next().filter(|_| clause.lemma == "put");
            for chunk in &pieces {
                let is_main = Some(chunk) == about || Some(chunk) == goes;
                let is_goal = chunk.lead == "to";
                if (is_main || is_goal) && CHANGING.contains(&clause.lemma) && has_no_name(chunk) {
                    chunk.head().into_iter().for_each(|head| self.add(head, LEFT_OUT));
                }
                let says_where = lexicon().words.prepositions.contains(&chunk.lead) && chunk.lead != "with";
                let left = if says_where && !is_main { LANDMARK } else { LEFT_OUT };
                for name in chunk.words.iter().filter(|word| word.is_name() && !used.has(word)) {
                    self.add(name, left);
                }
            }
            self.left_out_of_several(clause, used);
        }
    }

    /// A clause about walking, doors and waiting asks for nothing, unless it is about something movable.
    fn aside(&mut self, clause: &Clause, used: &Used) {
        let movable = |token: &&Token| token.classes.iter().any(|class| class.info().pickupable) && !used.has(token);
        let pieces = chunks(clause);
        let about = direct(clause.lemma, &pieces).filter(|chunk| chunk.lead.is_empty() || clause.lemma == "wait");
        for name in about.into_iter().flat_map(|chunk| &chunk.words).filter(movable) {
            self.add(name, LEFT_OUT);
        }
    }

    /// Of things that are named side by side, as many are left out as there are more names than classes used: "the fork or the
    /// spoon".
    fn left_out_of_several(&mut self, clause: &Clause, used: &Used) {
        let names: Vec<&Token> = clause.tokens.iter().filter(|token| token.is_name()).collect();
        for two in names.windows(2) {
            let between = clause.tokens.iter().skip_while(|token| *token != two[0]).skip(1);
            let between: Vec<&str> =
                between.take_while(|token| *token != two[1]).map(|token| token.text.as_str()).collect();
            let words = &lexicon().words;
            let joins = |text: &&str| matches!(*text, "and" | "," | "or");
            let side_by_side = between.iter().any(joins)
                && between.iter().all(|text| joins(text) || words.determiners.contains(*text));
            let covered = |token: &Token| token.classes.iter().filter(|class| used.classes.contains(class)).count();
            let both: BTreeSet<Class> = two
                .iter()
                .flat_map(|token| token.classes)
                .filter(|class| used.classes.contains(class))
                .copied()
                .collect();
            let either = between.contains(&"or");
            let again = two[0].text == two[1].text && (between.contains(&",") || used.kinds.len() > 1);
            if side_by_side && !again && (either || both.len() < 2) && covered(two[1]) > 0 {
                self.add(two[1], LEFT_OUT);
            }
        }
    }

    /// Numbers of things that are not those of the subtasks.
    fn numbers(&mut self, wanted: &[Token], read: &[ReadSubtask]) {
        for (at, token) in wanted.iter().enumerate() {
            let Some(count) = lexicon().count(&token.text).filter(|count| *count > 1) else { continue };
            let goes_on = |token: &&Token| {
                let leads = lexicon().words.prepositions.contains(&token.text) && token.text != "of";
                !(token.is_mark() || leads || lexicon().words.breaks.contains(&token.text) || token.lemma().is_some())
            };
            let mut after = wanted[at + 1..].iter().take_while(goes_on).skip_while(|token| !token.is_name());
            let Some(name) = after.next() else { continue };
            // "both the fork and the knife"
            let joined = wanted[at + 1..].iter().skip_while(|token| *token != name).nth(1);
            if token.text == "both" && joined.is_some_and(|then| matches!(then.text.as_str(), "and" | ",")) {
                continue;
            }
            let of = |kind: SkillKind| {
                let same = |one: &&ReadSubtask| {
                    one.skill == kind && one.object.is_some_and(|class| name.classes.contains(&class))
                };
                read.iter().filter(same).count()
            };
            if !read.iter().any(|one| of(one.skill) == count) {
                self.add(token, LEFT_OUT);
            }
        }
    }
}

fn is_aside(clause: &Clause) -> bool {
    matches!(clause.lemma, "go" | "wait" | "open" | "close")
}

/// Whether a piece stands for a thing that the reader has no name for.
fn has_no_name(chunk: &Chunk) -> bool {
    let words = &lexicon().words;
    let Some(head) = chunk.head().filter(|head| !head.is_name() && !chunk.is_pronoun()) else { return false };
    let text = &head.text;
    !(words.plain.contains(text)
        || words.places.contains(text)
        || words.nameless.contains(text)
        || words.determiners.contains(text)
        || lexicon().count(text).is_some()
        || head.lemma().is_some())
}
