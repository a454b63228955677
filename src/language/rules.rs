//! Summaries by rules: what a person would say of a run of skills in one short sentence, in the annotator's own nouns.

use std::cell::RefCell;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::grammar::grammar;
use super::nouns::{Noun, Number};
use super::outcome::{Outcome, outcomes};
use super::passage::{Passage, Summarizer};
use super::phrases::Story;
use crate::domain::skill::SkillKind;

/// No summary has more words.
pub const LONGEST: usize = 29;

/// Sums up by rules.
pub struct Rules;

impl Summarizer for Rules {
    fn source(&self) -> &'static str {
        "rules"
    }

    fn version(&self) -> u32 {
        1
    }

    fn summaries(&self, passages: &[Passage<'_>]) -> anyhow::Result<Vec<String>> {
        Ok(passages.par_iter().map(summary).collect())
    }
}

/// A passage in a sentence. The same passage always gives the same one.
pub fn summary(passage: &Passage<'_>) -> String {
    let digest = u64::from_str_radix(&passage.digest(), 16).unwrap_or_default();
    // Each manner is shorter than the one before.
    let mut sentence = String::new();
    for manner in [Manner::Full, Manner::Plain, Manner::Last] {
        let telling = Telling::new(passage, manner, ChaCha8Rng::seed_from_u64(digest));
        sentence = finish(&telling.tell());
        if sentence.split(' ').count() <= LONGEST {
            break;
        }
    }
    sentence
}

/// How much is told.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Manner {
    Full,
    /// Without words of looks.
    Plain,
    /// Only what comes about last.
    Last,
}

struct Telling<'a> {
    story: Story<'a>,
    nouns: Vec<Noun>,
    manner: Manner,
    rng: RefCell<ChaCha8Rng>,
}

impl<'a> Telling<'a> {
    fn new(passage: &Passage<'a>, manner: Manner, rng: ChaCha8Rng) -> Telling<'a> {
        let story = Story { roles: passage.roles, subtasks: passage.subtasks, origins: &[] };
        let mut telling = Telling { story, nouns: Vec::new(), manner, rng: RefCell::new(rng) };
        telling.nouns = (0..passage.roles.len() as u8).map(|role| telling.noun(passage, role)).collect();
        telling
    }

    fn chance(&self, probability: f64) -> bool {
        self.rng.borrow_mut().random_bool(probability)
    }

    fn one_of<'t>(&self, texts: &[&'t str]) -> &'t str {
        texts[self.rng.borrow_mut().random_range(0..texts.len() as u32) as usize]
    }

    /// What the annotator calls a role: mostly as first named, at times as named later.
    fn noun(&self, passage: &Passage<'_>, role: u8) -> Noun {
        let class = self.story.class(role);
        let steps = passage.subtasks.iter().zip(passage.sentences);
        let mut found = steps.flat_map(|(subtask, sentence)| {
            let object = (subtask.object == role).then(|| Noun::find(class, sentence, false));
            let place = (subtask.receptacle == Some(role)).then(|| Noun::find(class, sentence, true));
            [object.flatten(), place.flatten()]
        });
        let first = found.by_ref().flatten().next();
        let later = found.flatten().next();
        let chosen = if self.chance(0.3) { later.or(first) } else { first };
        let mut noun = chosen.unwrap_or_else(|| Noun::usual(class));
        if self.manner != Manner::Full || self.chance(0.35) {
            noun.modifiers.clear();
        }
        if self.story.is_slice(role) {
            // "a slice of a head of lettuce" is of lettuce.
            let base = noun.head.rsplit(" of ").next().unwrap_or_default().to_string();
            noun.head = if ["fruit", "loaf", "bread loaf", "lettuce head"].contains(&base.as_str()) {
                class.spoken().into()
            } else {
                base
            };
        }
        noun
    }

    fn named(&self, role: u8) -> Noun {
        self.nouns.get(usize::from(role)).cloned().unwrap_or_else(|| Noun::usual(self.story.class(role)))
    }

    /// Whether the passage begins with the thing in the hand.
    fn is_known(&self, role: u8) -> bool {
        let first = self.story.subtasks.iter().find(|subtask| subtask.object == role);
        first.is_some_and(|subtask| subtask.skill != SkillKind::Pickup && subtask.skill != SkillKind::Slice)
    }

    /// The thing with what was done to it: "a rinsed mug", "the chilled slice of apple".
    fn thing(&self, role: u8, states: &[String]) -> String {
        let definite = self.is_known(role) || self.chance(0.4);
        if self.story.is_slice(role) {
            return self.slice(role, states, definite);
        }
        let noun = self.named(role);
        match (definite || noun.number() == Number::Mass && !states.is_empty(), noun.number()) {
            (false, _) => noun.one(states),
            (true, _) => noun.the(states),
        }
    }

    fn slice(&self, role: u8, states: &[String], definite: bool) -> String {
        let base = self.named(role);
        let whole = |text: String| Noun { modifiers: Vec::new(), head: text };
        let cut = self.one_of(&["slice", "slice", "slice", "piece"]);
        let (noun, states) = match self.one_of(&["of", "of", "before", "within"]) {
            "before" => (whole(format!("{} {cut}", base.text())), states),
            "within" if !states.is_empty() => {
                let all: Vec<&str> = states.iter().map(String::as_str).chain([base.head.as_str()]).collect();
                (whole(format!("{cut} of {}", all.join(" "))), &[][..])
            }
            _ => (whole(format!("{cut} of {}", base.text())), states),
        };
        if definite { noun.the(states) } else { noun.one(states) }
    }

    /// "two rinsed mugs".
    fn several(&self, things: &[u8]) -> String {
        let Some(&first) = things.first() else { return String::new() };
        let class = self.story.class(first);
        let mut noun = self.named(first);
        if things.iter().any(|&thing| self.named(thing).modifiers != noun.modifiers) {
            noun.modifiers.clear();
        }
        let number = match things.len() {
            2 => self.one_of(&["two", "two", "two", "both"]),
            3 => "three",
            _ => "several",
        };
        let states = self.states(first);
        if self.story.is_slice(first) {
            let cut = self.one_of(&["slices", "slices", "pieces"]);
            let states: String = states.iter().map(|state| format!("{state} ")).collect();
            return format!("{number} {states}{cut} of {}", noun.text());
        }
        format!("{number} {}", noun.plural(&states, class))
    }

    /// Where something is put: "in the cabinet".
    fn place(&self, role: u8) -> String {
        let (class, noun) = (self.story.class(role), self.named(role));
        let last = noun.head.rsplit(' ').next().unwrap_or_default();
        let at = match last {
            "rack" | "shelf" | "stand" | "table" | "island" | "lid" | "seat" | "tank" | "holder" | "hanger"
            | "counter" | "top" => "on",
            "basin" | "tub" | "cabinet" | "cupboard" | "basket" | "bin" | "can" => "in",
            _ => class.preposition(),
        };
        // Of some things a room has only one.
        let alone = ["Fridge", "Microwave", "Sink", "Bathtub", "Toilet", "CoffeeMachine", "Bed", "StoveBurner"];
        let any = match class.info().pickupable {
            true => 0.5,
            false if alone.contains(&class.name()) => 0.0,
            false => 0.15,
        };
        let known = self.is_known(role);
        format!("{at} {}", if !known && self.chance(any) { noun.one(&[]) } else { noun.the(&[]) })
    }

    /// What was done to a thing, as adjectives.
    fn states(&self, thing: u8) -> Vec<String> {
        let done = |skill| self.story.subtasks.iter().any(|subtask| subtask.skill == skill && subtask.object == thing);
        let is_food = self.story.class(thing).info().tags.iter().any(|tag| tag == "food");
        let mut states = Vec::new();
        if done(SkillKind::Clean) {
            states.push(self.one_of(&["clean", "clean", "rinsed", "washed"]).to_string());
        }
        if done(SkillKind::Heat) {
            let words: &[&str] =
                if is_food { &["heated", "cooked", "warm", "hot", "microwaved"] } else { &["heated", "warm", "hot"] };
            states.push(self.one_of(words).to_string());
        }
        if done(SkillKind::Cool) {
            states.push(self.one_of(&["chilled", "chilled", "cold", "cooled"]).to_string());
        }
        states
    }

    /// "rinse a mug in the sink", for what was last done to a thing.
    fn change(&self, skill: SkillKind, object: &str, with_place: bool) -> String {
        let (verbs, place): (&[&str], &str) = match skill {
            SkillKind::Clean => (&["rinse", "wash", "clean"], " in the sink"),
            SkillKind::Heat => (&["heat", "warm up", "microwave"], " in the microwave"),
            _ => (&["chill", "cool", "cool down"], " in the fridge"),
        };
        let verb = self.one_of(verbs);
        let place = if with_place && verb != "microwave" { place } else { "" };
        format!("{verb} {object}{place}")
    }

    /// The only state that was changed, of a thing that was whole and alone.
    fn only_change(&self, thing: u8) -> Option<SkillKind> {
        let changes = [SkillKind::Clean, SkillKind::Heat, SkillKind::Cool];
        let mut done = self.story.subtasks.iter().filter(|step| changes.contains(&step.skill) && step.object == thing);
        done.next().map(|step| step.skill).filter(|_| done.next().is_none())
    }

    fn cuts(&self) -> bool {
        self.story.subtasks.iter().any(|step| step.skill == SkillKind::Slice)
    }

    /// The knife that cut is put somewhere: nobody mentions that, unless it is all that is left to say.
    fn is_aside(&self, outcome: &Outcome) -> bool {
        match outcome {
            Outcome::Placed { things, .. } => {
                self.cuts() && things.iter().all(|&thing| self.story.class(thing).is_knife())
            }
            _ => false,
        }
    }

    fn tell(&self) -> String {
        let mut told = outcomes(&self.story);
        let last = told.len().saturating_sub(1);
        let mut position = 0;
        told.retain(|outcome| {
            position += 1;
            position > last
                || self.manner != Manner::Last && (!self.is_aside(outcome) || last == 1 && self.chance(0.15))
        });
        let mut clauses: Vec<String> = Vec::new();
        for (number, outcome) in told.iter().enumerate() {
            let clause = self.clause(outcome);
            let again = number > 0
                && ["put ", "place "]
                    .iter()
                    .any(|verb| clauses[number - 1].starts_with(verb) && clause.starts_with(verb))
                && !clauses[number - 1].contains(" and ")
                && !clause.contains(" and ")
                && self.chance(0.6);
            clauses.push(if again {
                clause.split_once(' ').map_or(String::new(), |(_, rest)| rest.into())
            } else {
                clause
            });
        }
        match clauses.as_slice() {
            [first, second] if !first.contains(" and ") => {
                format!("{first}{}{second}", self.one_of(&[" and ", " and ", " and ", ", then "]))
            }
            [first, second] => format!("{first}, then {second}"),
            [] => self.last_resort(),
            [others @ .., last] if !others.is_empty() => format!("{}, and {last}", others.join(", ")),
            _ => clauses.concat(),
        }
    }

    /// For chains that come to nothing that has a name.
    fn last_resort(&self) -> String {
        let last = self.story.subtasks.last().map_or(0, |step| step.receptacle.unwrap_or(step.object));
        format!("use {}", self.named(last).the(&[]))
    }

    fn clause(&self, outcome: &Outcome) -> String {
        match outcome {
            Outcome::Placed { things, content, place } => match (things.as_slice(), content) {
                ([thing], Some(content)) => self.filled(*thing, *content, *place),
                ([thing], None) => self.placed(*thing, *place),
                _ => {
                    format!("{} {} {}", self.one_of(&["put", "put", "place"]), self.several(things), self.place(*place))
                }
            },
            Outcome::Held { thing, content } => self.held(*thing, *content),
            Outcome::Cut(thing) => {
                let verb = self.one_of(&["slice", "slice", "cut", "cut up"]);
                let tool =
                    self.story.subtasks.iter().map(|step| step.object).find(|&role| self.story.class(role).is_knife());
                match tool.filter(|_| self.chance(0.3)) {
                    Some(knife) => format!("{verb} {} with {}", self.thing(*thing, &[]), self.named(knife).one(&[])),
                    None => format!("{verb} {}", self.thing(*thing, &[])),
                }
            }
            Outcome::Lit { lamp, held } => self.lit(*lamp, *held),
        }
    }

    fn placed(&self, thing: u8, place: u8) -> String {
        let verb = match self.place(place) {
            place if place.starts_with("on") => self.one_of(&["put", "put", "put", "place", "place", "set"]),
            _ => self.one_of(&["put", "put", "put", "place", "place"]),
        };
        let change = self.only_change(thing).filter(|_| self.chance(0.35));
        let cut = self.story.is_slice(thing) && self.cuts() && self.chance(0.2);
        let place_text = self.place(place);
        match (cut, change) {
            (true, _) => {
                let whole = Noun { modifiers: Vec::new(), ..self.named(thing) };
                let whole = match whole.number() {
                    Number::One => whole.one(&[]),
                    _ => whole.the(&[]),
                };
                let middle =
                    self.only_change(thing).map(|skill| format!("{}, and", self.change(skill, "a slice", false)));
                match middle {
                    Some(middle) => format!("slice {whole}, {middle} {verb} it {place_text}"),
                    None => format!("slice {whole} and {verb} a slice {place_text}"),
                }
            }
            (false, Some(skill)) => {
                format!("{} and {verb} it {place_text}", self.change(skill, &self.thing(thing, &[]), false))
            }
            (false, None) => format!("{verb} {} {place_text}", self.thing(thing, &self.states(thing))),
        }
    }

    /// "put a bowl with a slice of apple in the fridge".
    fn filled(&self, holder: u8, content: u8, place: u8) -> String {
        let verb = self.one_of(&["put", "put", "place"]);
        let inner = self.thing(content, &self.states(content));
        if self.only_change(holder).is_none() && self.chance(0.35) {
            let it = if self.chance(0.5) {
                "it".to_string()
            } else {
                Noun { modifiers: Vec::new(), ..self.named(holder) }.the(&[])
            };
            let on = self.place(holder);
            return format!("put {inner} {on} and {verb} {it} {}", self.place(place));
        }
        format!("{verb} {} {}", self.with_content(holder, &inner), self.place(place))
    }

    fn with_content(&self, holder: u8, inner: &str) -> String {
        let outer = self.thing(holder, &self.states(holder));
        match (self.story.class(holder).preposition(), self.one_of(&["with", "with", "containing", "in it"])) {
            ("in", "containing") => format!("{outer} containing {inner}"),
            (at, "in it") => format!("{outer} with {inner} {at} it"),
            _ => format!("{outer} with {inner}"),
        }
    }

    fn held(&self, thing: u8, content: Option<u8>) -> String {
        if let Some(content) = content {
            let inner = self.thing(content, &self.states(content));
            return format!("{} {}", self.one_of(&["pick up", "pick up", "get"]), self.with_content(thing, &inner));
        }
        let change = self.story.subtasks.last().map(|step| step.skill).filter(|&skill| skill != SkillKind::Pickup);
        if let Some(skill) = change.filter(|_| self.only_change(thing).is_some() && self.chance(0.85)) {
            let with_place = self.story.subtasks.iter().all(|step| step.receptacle.is_none()) && self.chance(0.5);
            return self.change(skill, &self.thing(thing, &[]), with_place);
        }
        if self.story.is_slice(thing) && self.cuts() && self.chance(0.35) {
            let whole = Noun { modifiers: Vec::new(), ..self.named(thing) };
            let verb = self.one_of(&["slice", "cut", "cut up"]);
            let whole = if whole.number() == Number::One { whole.one(&[]) } else { whole.the(&[]) };
            return format!(
                "{verb} {whole} and {} a {}",
                self.one_of(&["pick up", "take"]),
                self.one_of(&["slice", "slice", "piece"])
            );
        }
        let verb = self.one_of(&["pick up", "pick up", "get", "take", "grab"]);
        let mut before = self.story.subtasks.iter().map(|step| step.object).take_while(|&role| role != thing);
        if !self.story.is_slice(thing) && before.any(|role| self.story.alike(role, thing)) {
            let noun = Noun { modifiers: Vec::new(), ..self.named(thing) };
            return match noun.number() {
                Number::One => format!("{verb} {} {}", self.one_of(&["another", "another", "a second"]), noun.head),
                _ => {
                    let one = grammar().one(self.story.class(thing));
                    format!("{verb} another {}", one.split_once(' ').map_or(one.as_str(), |(_, noun)| noun))
                }
            };
        }
        format!("{verb} {}", self.thing(thing, &self.states(thing)))
    }

    fn lit(&self, lamp: u8, held: Option<u8>) -> String {
        let noun = self.named(lamp);
        let the_lamp = if self.chance(0.8) { noun.the(&[]) } else { noun.one(&[]) };
        let Some(held) = held else { return format!("turn on {the_lamp}") };
        let thing = self.thing(held, &self.states(held));
        let shines = noun.head.ends_with("light");
        match self.rng.borrow_mut().random_range(0..if shines { 5 } else { 8 }) {
            0 => format!("look at {thing} under {the_lamp}"),
            1 => format!("examine {thing} under {the_lamp}"),
            2 => format!("hold {thing} and turn on {the_lamp}"),
            3 => format!("turn on {the_lamp} to look at {thing}"),
            4 => format!("take {thing} to {the_lamp} and turn it on"),
            5 => format!("examine {thing} by the light of {the_lamp}"),
            6 => format!("look at {thing} by the light of {the_lamp}"),
            _ => format!("examine {thing} in the light of {the_lamp}"),
        }
    }
}

/// A capital and a full stop.
fn finish(clause: &str) -> String {
    super::instruction::normalise(clause)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::domain::{Class, Role, Subtask};
    use crate::house::testing::{put_subtask, role, slice_role, subtask};
    use crate::language::nouns;

    /// Summaries of a passage whose sentences are told in slightly different ways, so that chance differs.
    fn ways(roles: &[Role], subtasks: &[Subtask], sentences: &[&str]) -> Vec<String> {
        let say = |way: usize| {
            let sentences: Vec<String> = sentences.iter().map(|told| format!("{told}{}", " ".repeat(way))).collect();
            summary(&Passage { roles, subtasks, sentences: &sentences })
        };
        (0..60).map(say).collect()
    }

    fn all(ways: &[String], test: impl Fn(&str) -> bool) {
        for way in ways {
            assert!(test(way), "{way}");
        }
    }

    fn any(ways: &[String], wanted: &str) {
        assert!(ways.iter().any(|way| way == wanted), "{wanted} is none of {ways:#?}");
    }

    #[test]
    fn picking_up_is_implied_and_what_was_done_to_a_thing_becomes_an_adjective() {
        let roles = [role("Cup"), role("Cabinet")];
        let subtasks = [subtask(SkillKind::Pickup, 0), subtask(SkillKind::Clean, 0), put_subtask(0, 1)];
        let told = ["Pick up the wine glass.", "Rinse the glass in the sink.", "Put it in the lower cabinet."];
        let ways = ways(&roles, &subtasks, &told);
        any(&ways, "Put a rinsed wine glass in the cabinet.");
        any(&ways, "Rinse the wine glass and put it in the lower cabinet.");
        all(&ways, |way| !way.contains("ick up") && way.contains("glass"));
    }

    #[test]
    fn nobody_mentions_the_knife_that_cut() {
        let roles = [role("ButterKnife"), role("Apple"), role("Sink"), slice_role("Apple"), role("Fridge")];
        let subtasks = [
            subtask(SkillKind::Pickup, 0),
            subtask(SkillKind::Slice, 1),
            put_subtask(0, 2),
            subtask(SkillKind::Pickup, 3),
            subtask(SkillKind::Heat, 3),
            put_subtask(3, 4),
        ];
        let told = [
            "Take the knife.",
            "Cut the apple.",
            "Leave it.",
            "Take a slice.",
            "Heat it.",
            "Put it in the refrigerator.",
        ];
        let whole = ways(&roles, &subtasks, &told);
        any(&whole, "Put a heated slice of apple in the refrigerator.");
        let quiet = whole.iter().filter(|way| !way.contains("knife") && way.contains("refrigerator")).count();
        assert!(quiet > 45, "{whole:#?}");
        any(&ways(&roles, &subtasks[..2], &told[..2]), "Slice an apple.");
        all(&ways(&roles, &subtasks[..3], &told[..3]), |way| way.contains("knife") && way.contains("sink"));
        all(&ways(&roles, &subtasks[..4], &told[..4]), |way| way.contains("apple"));
    }

    #[test]
    fn two_of_a_kind_are_told_together_and_two_kinds_are_joined() {
        let roles = [role("Mug"), role("Desk"), role("Mug"), role("Pen")];
        let take_and_put = |thing| [subtask(SkillKind::Pickup, thing), put_subtask(thing, 1)];
        let told = ["Take the red mug.", "Put it on the desk.", "Take it.", "Put it on the desk."];
        let two = ways(&roles, &[take_and_put(0), take_and_put(2)].concat(), &told);
        any(&two, "Put two mugs on the desk.");
        let mixed = ways(&roles, &[take_and_put(0), take_and_put(3)].concat(), &told);
        all(&mixed, |way| {
            way.contains("mug") && way.contains("pen") && way.contains(" and ") || way.contains(", then ")
        });
        let another = ways(&roles, &[put_subtask(0, 1), subtask(SkillKind::Pickup, 2)], &told[1..3]);
        any(&another, "Put the mug on the desk and pick up another mug.");
    }

    #[test]
    fn what_lies_in_a_thing_goes_along() {
        let roles = [role("Spoon"), role("Bowl"), role("DiningTable")];
        let subtasks = [put_subtask(0, 1), subtask(SkillKind::Pickup, 1), put_subtask(1, 2)];
        let told = ["Put the spoon in the blue bowl.", "Take the bowl.", "Put it on the table."];
        let ways = ways(&roles, &subtasks, &told);
        any(&ways, "Put the spoon in a blue bowl and put it on the table.");
        all(&ways, |way| way.contains("spoon") && way.contains("bowl") && way.contains("table"));
    }

    #[test]
    fn a_lamp_is_for_looking() {
        let roles = [role("Book"), role("FloorLamp")];
        let subtasks = [subtask(SkillKind::Pickup, 0), subtask(SkillKind::Toggle, 1)];
        let ways = ways(&roles, &subtasks, &["Take the book from the bed.", "Turn on the tall lamp."]);
        any(&ways, "Examine the book by the light of the tall lamp.");
    }

    #[test]
    fn the_same_passage_has_one_summary() {
        let roles = [role("Book"), role("Desk")];
        let subtasks = [subtask(SkillKind::Pickup, 0), put_subtask(0, 1)];
        let sentences = ["Take the book.".to_string(), "Put it down.".to_string()];
        let passage = Passage { roles: &roles, subtasks: &subtasks, sentences: &sentences };
        assert_eq!(Rules.summaries(&[passage, passage]).unwrap(), [summary(&passage), summary(&passage)]);
    }

    prop_compose! {
        /// A skill about some of eight roles, the last two of which are slices.
        fn any_step()(kind in 0..7usize, object in 0..8u8, place in 0..6u8) -> Subtask {
            match SkillKind::ALL[kind] {
                SkillKind::Put => put_subtask(object, place),
                kind @ (SkillKind::Slice | SkillKind::Toggle) => subtask(kind, object % 6),
                kind => subtask(kind, object),
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_span_gives_one_short_sentence_that_names_the_last_target(
            subtasks in proptest::collection::vec(any_step(), 2..=10),
            classes in proptest::collection::vec(1..Class::VOCABULARY, 6),
            told in "[a-z ,.é]{0,60}",
        ) {
            let mut roles: Vec<Role> = classes
                .iter()
                .filter_map(|&class| Class::from_index(class))
                .map(|class| Role { class, slice: false, bound: None, expert: None })
                .collect();
            roles.extend(["Apple", "Bread"].map(slice_role));
            let sentences = vec![told; subtasks.len()];
            let text = summary(&Passage { roles: &roles, subtasks: &subtasks, sentences: &sentences });
            let last = &subtasks[subtasks.len() - 1];
            let class = roles[usize::from(last.receptacle.unwrap_or(last.object))].class;
            prop_assert!(text.split(' ').count() <= LONGEST && text.ends_with('.'), "{}", text);
            prop_assert!(text.matches('.').count() == 1, "{}", text);
            prop_assert!(nouns::names(&text, class), "{} does not name {}", text, class);
        }
    }
}
