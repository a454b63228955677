//! Outcomes: what a chain of subtasks comes to.

use super::task_wording::TaskWording;
use crate::domain::skill::SkillKind;

/// What is different in the end.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum ChainOutcome {
    /// Things lie somewhere: which, what lies in the first of them, and where.
    Placed { things: Vec<u8>, content: Option<u8>, place: u8 },
    /// Something is in the hand, and something in that.
    Held { thing: u8, content: Option<u8> },
    /// Something is cut, and no slice of it is used.
    Cut(u8),
    /// A lamp shines, on what is in the hand.
    Lit { lamp: u8, held: Option<u8> },
}

/// The outcomes in the order in which they come about.
pub(super) fn outcomes(story: &TaskWording<'_>) -> Vec<ChainOutcome> {
    let mut found: Vec<ChainOutcome> = Vec::new();
    for (step, subtask) in story.subtasks.iter().enumerate() {
        match (subtask.skill, subtask.receptacle) {
            (SkillKind::Put, Some(place)) => put(story, &mut found, subtask.object, place),
            (SkillKind::Slice, _) if !uses_slice(story, step, subtask.object) => {
                found.push(ChainOutcome::Cut(subtask.object));
            }
            (SkillKind::Toggle, _) => {
                let held = story.holds_before(step).then(|| story.subtasks[step - 1].object);
                found.push(ChainOutcome::Lit { lamp: subtask.object, held });
            }
            _ => {}
        }
    }
    // What is still in the hand at the end, unless a lamp was lit to look at it.
    if let Some(last) = story.subtasks.last()
        && story.holds_before(story.subtasks.len())
    {
        let content = take_content(&mut found, last.object);
        found.push(ChainOutcome::Held { thing: last.object, content });
    }
    found
}

/// Whether a slice of what was cut at a step appears later.
fn uses_slice(story: &TaskWording<'_>, step: usize, whole: u8) -> bool {
    let class = story.class(whole);
    let mut later = story.subtasks[step..].iter();
    later.any(|subtask| story.class(subtask.object) == class && story.is_slice(subtask.object))
}

fn put(story: &TaskWording<'_>, found: &mut Vec<ChainOutcome>, thing: u8, place: u8) {
    // What it holds was put into it before: the two go together.
    let content = take_content(found, thing);
    let joins = |outcome: &ChainOutcome| match outcome {
        ChainOutcome::Placed { things, content: None, place: at } => {
            *at == place && things.first().is_some_and(|&first| story.alike(first, thing))
        }
        _ => false,
    };
    let mut things = vec![thing];
    if let Some(position) = found.iter().position(joins).filter(|_| content.is_none())
        && let ChainOutcome::Placed { things: earlier, .. } = found.remove(position)
    {
        things.splice(0..0, earlier);
    }
    found.push(ChainOutcome::Placed { things, content, place });
}

/// What was last put into a thing; from then on it is mentioned with the thing, and a knife that also lies there is not.
fn take_content(found: &mut Vec<ChainOutcome>, holder: u8) -> Option<u8> {
    let mut content = None;
    found.retain(|outcome| match outcome {
        ChainOutcome::Placed { things, place, .. } if *place == holder => {
            content = things.first().copied();
            false
        }
        _ => true,
    });
    content
}
