//! Sentences that a person would type for a subtask or a chain of them. The same random numbers give the same sentence.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::grammar::{Slots, grammar, with_article};
use super::summary;
use crate::domain::skill::{Role, SkillKind, Subtask};
use crate::domain::{Class, Instance, Parent, Scene, World};

/// What is known of a task when it is put into words.
#[derive(Clone, Copy, Debug)]
pub struct Story<'a> {
    /// The parts that instances play.
    pub roles: &'a [Role],
    /// The steps, in order.
    pub subtasks: &'a [Subtask],
    /// For each role, the class of the receptacle in which its instance lies at the start; may be shorter than the roles.
    pub origins: &'a [Option<Class>],
}

/// An instruction for a whole chain.
pub fn instruction(roles: &[Role], subtasks: &[Subtask], rng: &mut ChaCha8Rng) -> String {
    Story { roles, subtasks, origins: &[] }.instruction(rng)
}

/// A sentence for one subtask.
pub fn sentence(roles: &[Role], subtask: &Subtask, rng: &mut ChaCha8Rng) -> String {
    let story = Story { roles, subtasks: std::slice::from_ref(subtask), origins: &[] };
    finish(story.clause(0, false, rng), rng)
}

/// What each role's instance lies in at the start, by class, from the expert's instances; nothing for slices and fixtures.
pub fn origins(scene: &Scene, world: &World, roles: &[Role]) -> Vec<Option<Class>> {
    let origin = |role: &Role| {
        let original = role.expert.filter(|original| original.slice.is_none())?;
        let Instance::Object(index) = original.instance else { return None };
        match world.object(index)?.parent {
            Parent::In(holder) => world.class_of(scene, holder).filter(|class| class.in_vocabulary()),
            _ => None,
        }
    };
    roles.iter().map(origin).collect()
}

impl Story<'_> {
    /// An instruction for the whole chain: a summary of what it comes to, or its steps one after another.
    pub fn instruction(&self, rng: &mut ChaCha8Rng) -> String {
        let text = match self.subtasks.len() {
            0 => String::new(),
            1 => self.clause(0, false, rng),
            _ if rng.random_bool(0.5) => summary::summary(self, rng),
            _ => self.sequence(rng),
        };
        finish(text, rng)
    }

    /// A sentence for each subtask.
    pub fn sentences(&self, rng: &mut ChaCha8Rng) -> Vec<String> {
        let steps = 0..self.subtasks.len();
        steps.map(|step| finish(self.clause(step, false, rng), rng)).collect()
    }

    /// The steps one after another; what was named just before is "it".
    fn sequence(&self, rng: &mut ChaCha8Rng) -> String {
        let mut text = String::new();
        let count = self.subtasks.len();
        for step in 0..count {
            let joint = match step {
                0 => "",
                _ if step + 1 == count => "last",
                _ => "then",
            };
            if !joint.is_empty() {
                text.push_str(&grammar().say(joint, &Slots::new(), rng));
            }
            let same = step > 0 && self.subtasks[step].object == self.subtasks[step - 1].object;
            let named_last = step > 0 && self.subtasks[step - 1].receptacle.is_none();
            text.push_str(&self.clause(step, same && named_last && rng.random_bool(0.7), rng));
        }
        text
    }

    /// The role's class.
    pub(super) fn class(&self, role: u8) -> Class {
        self.roles.get(usize::from(role)).map_or(Class::NONE, |role| role.class)
    }

    /// The thing with an article: "the mug", "a slice of bread".
    pub(super) fn thing(&self, role: u8, rng: &mut ChaCha8Rng) -> String {
        let class = self.class(role);
        let is_slice = self.roles.get(usize::from(role)).is_some_and(|role| role.slice);
        if is_slice {
            let name = class.spoken();
            return match rng.random_range(0..6) {
                0 => format!("the {name} slice"),
                1 => format!("a {name} slice").replace("a apple", "an apple"),
                2 => format!("a piece of {name}"),
                3 => format!("the slice of {name}"),
                _ => format!("a slice of {name}"),
            };
        }
        // Only what can be carried comes in such numbers that any one will do.
        if class.info().pickupable && rng.random_bool(0.25) {
            return grammar().one(class);
        }
        format!("the {}", grammar().name(class, rng))
    }

    /// A clause for one step, without a capital or a full stop.
    fn clause(&self, step: usize, as_it: bool, rng: &mut ChaCha8Rng) -> String {
        let subtask = &self.subtasks[step];
        let mut slots = Slots::new();
        let object = if as_it { "it".to_string() } else { self.thing(subtask.object, rng) };
        slots.insert("object", object);
        let origin = self.origins.get(usize::from(subtask.object)).copied().flatten();
        let untouched = !self.subtasks[..step].iter().any(|earlier| earlier.object == subtask.object);
        if let Some(origin) = origin.filter(|_| untouched && !as_it) {
            slots.extend(origin_slots(origin, rng));
        }
        if let Some(receptacle) = subtask.receptacle {
            slots.extend(destination_slots(self.class(receptacle), rng));
        }
        match subtask.skill {
            SkillKind::Slice => {
                slots.insert("tool", self.knife(step, rng));
            }
            SkillKind::Toggle if step > 0 && self.holds_before(step) => {
                let held = self.subtasks[step - 1].object;
                slots.insert("held", if rng.random_bool(0.5) { "it".into() } else { self.thing(held, rng) });
                return grammar().say("toggle_with", &slots, rng);
            }
            _ => {}
        }
        grammar().say(rule(subtask.skill), &slots, rng)
    }

    /// The knife in the hand at a step.
    fn knife(&self, step: usize, rng: &mut ChaCha8Rng) -> String {
        let before = self.subtasks[..step].iter().rev().map(|subtask| subtask.object);
        let bound = (0..self.roles.len() as u8).rev().filter(|&role| self.roles[usize::from(role)].bound.is_some());
        let knife = before.chain(bound).find(|&role| self.class(role).is_knife());
        knife.map_or("a knife".into(), |role| {
            let name = self.class(role).spoken();
            if rng.random_bool(0.4) { with_article(name) } else { format!("the {name}") }
        })
    }

    /// Whether the step before leaves its object in the hand.
    pub(super) fn holds_before(&self, step: usize) -> bool {
        let holding = [SkillKind::Pickup, SkillKind::Clean, SkillKind::Heat, SkillKind::Cool];
        step > 0 && holding.contains(&self.subtasks[step - 1].skill)
    }
}

fn rule(skill: SkillKind) -> &'static str {
    match skill {
        SkillKind::Pickup => "pickup",
        SkillKind::Put => "put",
        SkillKind::Slice => "slice",
        SkillKind::Toggle => "toggle",
        SkillKind::Clean => "clean",
        SkillKind::Heat => "heat",
        SkillKind::Cool => "cool",
    }
}

/// "the counter" and what goes with it, for where a thing is.
fn origin_slots(origin: Class, rng: &mut ChaCha8Rng) -> Vec<(&'static str, String)> {
    let place = format!("the {}", grammar().name(origin, rng));
    let at = origin.preposition();
    let from = match (at, rng.random_bool(0.5)) {
        ("in", true) => "out of",
        ("on", true) => "off",
        _ => "from",
    };
    let mut slots = vec![("from", format!("{from} {place}")), ("at", format!("{at} {place}"))];
    if origin.info().openable {
        slots.push(("shut", place.clone()));
    }
    slots.push(("place", place));
    slots
}

/// "the counter" and what goes with it, for where a thing goes.
pub(super) fn destination_slots(class: Class, rng: &mut ChaCha8Rng) -> Vec<(&'static str, String)> {
    let dest = format!(
        "{} {}",
        if class.info().pickupable && rng.random_bool(0.3) { "a" } else { "the" },
        grammar().name(class, rng)
    );
    let mut slots = vec![("to", format!("{} {dest}", class.preposition()))];
    if class.info().openable && !class.info().pickupable {
        slots.push(("inside", dest.clone()));
    }
    slots.push(("dest", dest));
    slots
}

/// Manners, capitals and full stops as people type them.
fn finish(clause: String, rng: &mut ChaCha8Rng) -> String {
    if clause.is_empty() {
        return clause;
    }
    let states =
        clause.starts_with("i ") || clause.contains("? ") || clause.starts_with("the ") || clause.starts_with("a ");
    let manners = if states { String::new() } else { grammar().say("manners", &Slots::new(), rng) };
    let thanks = if manners.is_empty() { grammar().say("thanks", &Slots::new(), rng) } else { String::new() };
    let asks = manners.starts_with("could")
        || manners.starts_with("would")
        || manners.starts_with("can")
        || thanks.ends_with("you");
    let text = format!("{manners}{clause}{thanks}");
    match rng.random_range(0..20) {
        // Hasty.
        0..=5 => text,
        // Loud.
        6 => format!("{}!", text.to_uppercase()),
        7 => format!("{}!", sentence_case(&text)),
        _ => format!("{}{}", sentence_case(&text), if asks { "?" } else { "." }),
    }
}

/// Capitals at the start of each sentence, and for "I".
fn sentence_case(text: &str) -> String {
    let mut starts = true;
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if starts && c.is_alphabetic() {
            out.extend(c.to_uppercase());
            starts = false;
        } else {
            out.push(c);
            starts |= matches!(c, '.' | '?' | '!');
        }
    }
    out.replace(" i ", " I ").replace(" i'd ", " I'd ")
}
