//! Summaries: what a chain of subtasks comes to, in the short form that people prefer.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::grammar::{Slots, grammar, with_article};
use super::outcome::{ChainOutcome, outcomes};
use super::place_slots::destination_slots;
use super::task_wording::TaskWording;
use crate::domain::skill::SkillKind;

/// The chain's outcomes in one sentence.
pub(super) fn summary(story: &TaskWording<'_>, rng: &mut ChaCha8Rng) -> String {
    let outcomes = outcomes(story);
    let mut text = String::new();
    for (index, outcome) in outcomes.iter().enumerate() {
        if index > 0 {
            let joint = if index + 1 == outcomes.len() { "last" } else { "then" };
            text.push_str(&grammar().say(joint, &Slots::new(), rng));
        }
        text.push_str(&outcome_clause(story, outcome, rng));
    }
    text
}

fn outcome_clause(story: &TaskWording<'_>, outcome: &ChainOutcome, rng: &mut ChaCha8Rng) -> String {
    let mut slots = Slots::new();
    match outcome {
        ChainOutcome::Placed { things, content, place } => {
            slots.extend(destination_slots(story.class(*place), rng));
            let (rule, object) = match (things.as_slice(), content) {
                ([thing], Some(content)) => ("place_one", with_content(story, *thing, *content, rng)),
                ([thing], None) => ("place_one", described(story, *thing, rng)),
                _ => ("place_two", several(story, things, rng)),
            };
            slots.insert("object", object);
            grammar().say(rule, &slots, rng)
        }
        ChainOutcome::Held { thing, content } => {
            let object = match content {
                Some(content) => with_content(story, *thing, *content, rng),
                None => described(story, *thing, rng),
            };
            slots.insert("object", object);
            grammar().say("keep", &slots, rng)
        }
        ChainOutcome::Cut(thing) => {
            slots.insert("object", story.thing(*thing, 0, rng));
            slots.insert("tool", "a knife".into());
            grammar().say("slice", &slots, rng)
        }
        ChainOutcome::Lit { lamp, held } => {
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
fn described(story: &TaskWording<'_>, thing: u8, rng: &mut ChaCha8Rng) -> String {
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
fn several(story: &TaskWording<'_>, things: &[u8], rng: &mut ChaCha8Rng) -> String {
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
fn with_content(story: &TaskWording<'_>, holder: u8, content: u8, rng: &mut ChaCha8Rng) -> String {
    let (outer, inner) = (described(story, holder, rng), described(story, content, rng));
    match rng.random_range(0..4) {
        0 => format!("{outer} holding {inner}"),
        1 => format!("{outer} that has {inner} in it"),
        2 => format!("{outer} containing {inner}"),
        _ => format!("{outer} with {inner} in it"),
    }
}

/// What was done to a thing, as an adjective; empty when nothing was.
fn states(story: &TaskWording<'_>, thing: u8, rng: &mut ChaCha8Rng) -> String {
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
