//! Outcomes as clauses, one each.

use rand::Rng;

use super::SummaryBuilder;
use crate::domain::skill::SkillKind;
use crate::language::grammar::grammar;
use crate::language::nouns::{Noun, Number};
use crate::language::outcome::ChainOutcome;

impl SummaryBuilder<'_> {
    /// "rinse a mug in the sink", for what was last done to a thing.
    pub(super) fn change(&self, skill: SkillKind, object: &str, with_place: bool) -> String {
        let (verbs, place): (&[&str], &str) = match skill {
            SkillKind::Clean => (&["rinse", "wash", "clean"], " in the sink"),
            SkillKind::Heat => (&["heat", "warm up", "microwave"], " in the microwave"),
            _ => (&["chill", "cool", "cool down"], " in the fridge"),
        };
        let verb = self.one_of(verbs);
        let place = if with_place && verb != "microwave" { place } else { "" };
        format!("{verb} {object}{place}")
    }

    pub(super) fn clause(&self, outcome: &ChainOutcome) -> String {
        match outcome {
            ChainOutcome::Placed { things, content, place } => match (things.as_slice(), content) {
                ([thing], Some(content)) => self.filled(*thing, *content, *place),
                ([thing], None) => self.placed(*thing, *place),
                _ => {
                    format!("{} {} {}", self.one_of(&["put", "put", "place"]), self.several(things), self.place(*place))
                }
            },
            ChainOutcome::Held { thing, content } => self.held(*thing, *content),
            ChainOutcome::Cut(thing) => {
                let verb = self.one_of(&["slice", "slice", "cut", "cut up"]);
                let tool =
                    self.story.subtasks.iter().map(|step| step.object).find(|&role| self.story.class(role).is_knife());
                match tool.filter(|_| self.chance(0.3)) {
                    Some(knife) => format!("{verb} {} with {}", self.thing(*thing, &[]), self.named(knife).one(&[])),
                    None => format!("{verb} {}", self.thing(*thing, &[])),
                }
            }
            ChainOutcome::Lit { lamp, held } => self.lit(*lamp, *held),
        }
    }

    pub(super) fn placed(&self, thing: u8, place: u8) -> String {
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
    pub(super) fn filled(&self, holder: u8, content: u8, place: u8) -> String {
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

    pub(super) fn with_content(&self, holder: u8, inner: &str) -> String {
        let outer = self.thing(holder, &self.states(holder));
        match (self.story.class(holder).preposition(), self.one_of(&["with", "with", "containing", "in it"])) {
            ("in", "containing") => format!("{outer} containing {inner}"),
            (at, "in it") => format!("{outer} with {inner} {at} it"),
            _ => format!("{outer} with {inner}"),
        }
    }

    pub(super) fn held(&self, thing: u8, content: Option<u8>) -> String {
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

    pub(super) fn lit(&self, lamp: u8, held: Option<u8>) -> String {
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
