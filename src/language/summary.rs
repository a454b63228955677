//! Summaries: what a chain of subtasks comes to, in the short form that people prefer.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::grammar::{Slots, grammar, with_article};
use super::phrases::{Story, destination_slots};
use crate::domain::skill::{SkillKind, Subtask};

/// What is different in the end.
#[derive(Clone, Debug, PartialEq)]
enum Outcome {
    /// Things lie somewhere: which, what lies in the first of them, and where.
    Placed { things: Vec<u8>, content: Option<u8>, place: u8 },
    /// Something is in the hand.
    Held(u8),
    /// Something is cut, and no slice of it is used.
    Cut(u8),
    /// A lamp shines, on what is in the hand.
    Lit { lamp: u8, held: Option<u8> },
}

/// The chain's outcomes, told together.
pub(super) fn summary(story: &Story<'_>, rng: &mut ChaCha8Rng) -> String {
    let outcomes = outcomes(story);
    let mut text = String::new();
    for (index, outcome) in outcomes.iter().enumerate() {
        if index > 0 {
            let joint = if index + 1 == outcomes.len() { "last" } else { "then" };
            text.push_str(&grammar().say(joint, &Slots::new(), rng));
        }
        text.push_str(&tell(story, outcome, rng));
    }
    text
}

fn outcomes(story: &Story<'_>) -> Vec<Outcome> {
    let mut found: Vec<Outcome> = Vec::new();
    for (step, subtask) in story.subtasks.iter().enumerate() {
        match (subtask.skill, subtask.receptacle) {
            (SkillKind::Put, Some(place)) => put(story, &mut found, subtask.object, place),
            (SkillKind::Slice, _) if !uses_slice(story, &story.subtasks[step..], subtask.object) => {
                found.push(Outcome::Cut(subtask.object));
            }
            (SkillKind::Toggle, _) => {
                let held = story.holds_before(step).then(|| story.subtasks[step - 1].object);
                found.push(Outcome::Lit { lamp: subtask.object, held });
            }
            _ => {}
        }
    }
    // What is still in the hand at the end, unless a lamp was lit to look at it.
    if let Some(last) = story.subtasks.last()
        && story.holds_before(story.subtasks.len())
    {
        found.push(Outcome::Held(last.object));
    }
    found
}

/// Whether a slice of what was cut appears later.
fn uses_slice(story: &Story<'_>, later: &[Subtask], whole: u8) -> bool {
    let class = story.class(whole);
    later.iter().any(|subtask| story.class(subtask.object) == class && story.is_slice(subtask.object))
}

fn put(story: &Story<'_>, found: &mut Vec<Outcome>, thing: u8, place: u8) {
    for outcome in found.iter_mut() {
        if let Outcome::Placed { things, content, place: at } = outcome {
            // What it is put into was filled before: the two go together.
            if *at == thing {
                (*content, *things, *at) = (things.first().copied(), vec![thing], place);
                return;
            }
            let like = things.first().is_some_and(|&first| story.alike(first, thing));
            if *at == place && like && content.is_none() {
                things.push(thing);
                return;
            }
        }
    }
    found.push(Outcome::Placed { things: vec![thing], content: None, place });
}

fn tell(story: &Story<'_>, outcome: &Outcome, rng: &mut ChaCha8Rng) -> String {
    let mut slots = Slots::new();
    match outcome {
        Outcome::Placed { things, content, place } => {
            slots.extend(destination_slots(story.class(*place), rng));
            let (rule, object) = match (things.as_slice(), content) {
                ([thing], Some(content)) => ("place_one", with_content(story, *thing, *content, rng)),
                ([thing], None) => ("place_one", described(story, *thing, rng)),
                _ => ("place_two", several(story, things, rng)),
            };
            slots.insert("object", object);
            grammar().say(rule, &slots, rng)
        }
        Outcome::Held(thing) => {
            slots.insert("object", described(story, *thing, rng));
            grammar().say("keep", &slots, rng)
        }
        Outcome::Cut(thing) => {
            slots.insert("object", story.thing(*thing, 0, rng));
            slots.insert("tool", "a knife".into());
            grammar().say("slice", &slots, rng)
        }
        Outcome::Lit { lamp, held } => {
            slots.insert("object", story.thing(*lamp, 0, rng));
            match held {
                Some(held) => {
                    slots.insert("held", described(story, *held, rng));
                    grammar().say("toggle_with", &slots, rng)
                }
                None => grammar().say("toggle", &slots, rng),
            }
        }
    }
}

/// A thing with what was done to it: "a clean mug", "a slice of chilled tomato".
fn described(story: &Story<'_>, thing: u8, rng: &mut ChaCha8Rng) -> String {
    let words = states(story, thing, rng);
    let class = story.class(thing);
    if words.is_empty() {
        return story.thing(thing, 0, rng);
    }
    let name = class.spoken();
    if story.is_slice(thing) {
        return match rng.random_range(0..3) {
            0 => with_article(&format!("{words} slice of {name}")),
            1 => format!("a slice of {words} {name}"),
            _ => format!("the {words} {name} slice"),
        };
    }
    if rng.random_bool(0.4) {
        return format!("the {words} {name}");
    }
    let one = grammar().one(class);
    let noun = one.strip_prefix("an ").or_else(|| one.strip_prefix("a ")).unwrap_or(&one);
    with_article(&format!("{words} {noun}"))
}

/// "two mugs", "the apple and the other apple".
fn several(story: &Story<'_>, things: &[u8], rng: &mut ChaCha8Rng) -> String {
    let Some(&first) = things.first() else { return String::new() };
    let class = story.class(first);
    let number = match things.len() {
        2 => ["two", "two", "a pair of", "a couple of"][rng.random_range(0..4u32) as usize],
        3 => "three",
        _ => "several",
    };
    let words = states(story, first, rng);
    let words = if words.is_empty() { words } else { format!("{words} ") };
    if story.is_slice(first) {
        return format!("{number} {words}slices of {}", class.spoken());
    }
    format!("{number} {words}{}", grammar().plural(class))
}

/// "a bowl with a slice of apple in it".
fn with_content(story: &Story<'_>, holder: u8, content: u8, rng: &mut ChaCha8Rng) -> String {
    let (outer, inner) = (described(story, holder, rng), described(story, content, rng));
    match rng.random_range(0..4) {
        0 => format!("{outer} holding {inner}"),
        1 => format!("{outer} that has {inner} in it"),
        2 => format!("{outer} containing {inner}"),
        _ => format!("{outer} with {inner} in it"),
    }
}

/// What was done to a thing, as an adjective; empty when nothing was.
fn states(story: &Story<'_>, thing: u8, rng: &mut ChaCha8Rng) -> String {
    let mut words = Vec::new();
    for (skill, rule) in
        [(SkillKind::Clean, "clean_word"), (SkillKind::Heat, "hot_word"), (SkillKind::Cool, "cold_word")]
    {
        if story.subtasks.iter().any(|subtask| subtask.skill == skill && subtask.object == thing) {
            words.push(grammar().say(rule, &Slots::new(), rng));
        }
    }
    words.join(", ")
}
