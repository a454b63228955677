//! What things and places are called: the annotator's nouns, and what was done to a thing as adjectives.

use super::{DetailLevel, SummaryBuilder};
use crate::domain::skill::SkillKind;
use crate::language::nouns::{Noun, Number};
use crate::language::passage::Passage;

impl SummaryBuilder<'_> {
    /// What the annotator calls a role: mostly as first named, at times as named later.
    pub(super) fn noun(&self, passage: &Passage<'_>, role: u8) -> Noun {
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
        if self.manner != DetailLevel::Full || self.chance(0.35) {
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

    pub(super) fn named(&self, role: u8) -> Noun {
        self.nouns.get(usize::from(role)).cloned().unwrap_or_else(|| Noun::usual(self.story.class(role)))
    }

    /// Whether the passage begins with the thing in the hand.
    pub(super) fn is_known(&self, role: u8) -> bool {
        let first = self.story.subtasks.iter().find(|subtask| subtask.object == role);
        first.is_some_and(|subtask| subtask.skill != SkillKind::Pickup && subtask.skill != SkillKind::Slice)
    }

    /// The thing with what was done to it: "a rinsed mug", "the chilled slice of apple".
    pub(super) fn thing(&self, role: u8, states: &[String]) -> String {
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

    pub(super) fn slice(&self, role: u8, states: &[String], definite: bool) -> String {
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
    pub(super) fn several(&self, things: &[u8]) -> String {
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
    pub(super) fn place(&self, role: u8) -> String {
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
    pub(super) fn states(&self, thing: u8) -> Vec<String> {
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
}
