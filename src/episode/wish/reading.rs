//! How a wish is read where it is told: with the house, the hand and the wishes before it.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::record::{Wish, WishGrading};
use super::served_reader::ServedReader;
use crate::domain::skill::SkillKind;
use crate::domain::{Class, Scene, World};
use crate::house::House;
use crate::house::expert::demonstrate;
use crate::house::grading::{Grader, Grading};
use crate::language::reader::{Context, ReadSubtask, Reader, WishReading, lying};

/// What is made of typed wishes.
#[derive(Clone, Debug, Default)]
pub(crate) enum Expect {
    /// Each is read, and graded as it was read.
    #[default]
    Read,
    /// The same, by a language model first.
    ReadBy(Arc<ServedReader>),
    /// Nothing: a person alone judges.
    None,
}

/// Below this confidence a reading is a guess, by which nothing is graded.
const LEAST: f32 = 0.3;
/// How likely another reading must be to be offered.
const OFFERED: f32 = 0.03;
/// The most steps that the expert is given.
const EXPERT: usize = 1000;

/// The classes of everything in a house.
fn classes_of(scene: &Scene, world: &World) -> BTreeSet<Class> {
    let fixtures = scene.fixtures.iter().map(|fixture| fixture.class);
    fixtures.chain(world.objects.iter().map(|object| object.class)).collect()
}

/// The same by a language model, where that can: what the program makes of it is then offered as another reading.
pub(crate) fn read_by(
    served: &ServedReader,
    text: &str,
    began: u32,
    earlier: &[&str],
    scene: &Arc<Scene>,
    world: &World,
) -> Wish {
    let own = read(text, began, earlier.iter().copied(), scene, world);
    let mut asked = match served.read(text, earlier, Some(&classes_of(scene, world))) {
        Ok(asked) => asked,
        Err(why) => return Wish { unasked: Some(why), ..own },
    };
    // What both make of it is as sure as the program is.
    match own.readings.first() {
        Some(first) if first.steps() == asked.steps() => {
            asked = WishReading { read_by: asked.read_by, ..first.clone() }
        }
        _ => {}
    }
    let others = own.readings.into_iter().filter(|other| other.steps() != asked.steps() && !other.subtasks.is_empty());
    let readings: Vec<WishReading> = std::iter::once(asked.clone()).chain(others).collect();
    of_reading(text, began, readings, (0, false), scene, world)
}

/// Reads words in the state in which they are told, `began` steps into the episode; `earlier` are the instructions before.
pub(crate) fn read<'a>(
    text: &str,
    began: u32,
    earlier: impl Iterator<Item = &'a str>,
    scene: &Arc<Scene>,
    world: &World,
) -> Wish {
    let reader = match Reader::shipped() {
        Ok(reader) => reader,
        Err(error) => return Wish::ungraded(text, began, &error.to_string()),
    };
    // The capital that instructions begin with is not the person's.
    let said = text.to_lowercase();
    let house = classes_of(scene, world);
    let before = before(reader, earlier, &house, world);
    let lies = lying(scene, world);
    let best = reader.read(&said, &Context { before: &before, house: Some(&house), lies: &lies });
    let best = with_the_held(reader, &said, &house, world, &best).unwrap_or(best);
    let best = remote(reader, &said, &before, &house, &best).unwrap_or(best);
    let mut readings = vec![best];
    let others = readings[0].alternatives().into_iter().filter(|other| other.confidence >= OFFERED);
    readings.extend(others.collect::<Vec<_>>());
    of_reading(text, began, readings, (0, false), scene, world)
}

/// The wish of a reading, by its place and whether a person picked it; the others are kept, so that a person may pick one.
fn of_reading(
    text: &str,
    began: u32,
    readings: Vec<WishReading>,
    (picked, is_sure): (usize, bool),
    scene: &Arc<Scene>,
    world: &World,
) -> Wish {
    let Some(reading) = readings.get(picked) else { return Wish::ungraded(text, began, "nothing was understood") };
    let wish = Wish {
        instruction: text.into(),
        began,
        understood: reading.words(),
        // How sure a language model may be that differs from the program is not known.
        confidence: Some(reading.confidence).filter(|&sure| reading.read_by.is_none() || sure > 0.0),
        read_by: reading.read_by.clone(),
        unread: reading.unread.clone(),
        absent: reading.absent.clone(),
        ..Wish::default()
    };
    let (roles, subtasks) = match graded(reading, is_sure) {
        Ok(task) => task,
        Err(why) => return Wish { ungraded: Some(why), readings, picked, ..wish },
    };
    let mut grader = Grader::new(Grading::Class, &roles, &subtasks, None, (scene, world));
    let already = grader.settle(scene, world) as u32;
    let mut steps = 0;
    let mut house = House::new(scene.clone(), world.clone());
    let done = demonstrate(&mut house, &mut grader, EXPERT, &mut |_| steps += 1);
    let expert_steps = done.is_ok().then_some(steps);
    let grading = WishGrading::Read;
    Wish { grading, roles, subtasks, already, completed: already, expert_steps, readings, picked, ..wish }
}

/// The same words by another of their readings, told in another state.
pub(crate) fn repick(wish: &Wish, picked: usize, began: u32, scene: &Arc<Scene>, world: &World) -> Wish {
    of_reading(&wish.instruction, began, wish.readings.clone(), (picked, true), scene, world)
}

/// The parts and steps of a reading that is fit to be graded by; else why it is not. A person who picked it is sure.
fn graded(
    reading: &WishReading,
    is_picked: bool,
) -> Result<(Vec<crate::domain::Role>, Vec<crate::domain::Subtask>), String> {
    if reading.subtasks.is_empty() {
        return Err(match reading.unread.as_slice() {
            [] => "it asks for walking or doors alone".into(),
            words => format!("not understood: {}", words.join(" ")),
        });
    }
    if !reading.absent.is_empty() {
        let names: Vec<&str> = reading.absent.iter().map(|class| class.spoken()).collect();
        return Err(format!("this house has no {}", names.join(", no ")));
    }
    let open = reading.subtasks.iter().find_map(|subtask| match subtask {
        ReadSubtask { object: None, .. } => Some("it does not say what thing is meant"),
        ReadSubtask { skill: SkillKind::Put, receptacle: None, .. } => Some("it does not say where to put it"),
        _ => None,
    });
    if let Some(open) = open {
        return Err(open.into());
    }
    if reading.confidence < LEAST && reading.read_by.is_none() && !is_picked {
        return Err(format!("only {:.0} % sure that it means: {}", 100.0 * reading.confidence, reading.words()));
    }
    reading.task().ok_or_else(|| "it was not read to the end".into())
}

/// What "it" may stand for: the last wish before that could be read, and what is in the hand.
fn before<'a>(
    reader: &Reader,
    earlier: impl Iterator<Item = &'a str>,
    house: &BTreeSet<Class>,
    world: &World,
) -> Vec<ReadSubtask> {
    let mut known: Vec<ReadSubtask> = Vec::new();
    for text in earlier {
        let reading = reader.read(text, &Context { before: &known, house: Some(house), ..Context::default() });
        if reading.confidence >= LEAST {
            known = reading.subtasks;
        }
    }
    let held = world.held.and_then(|held| world.object(held));
    known.extend(held.map(|object| ReadSubtask {
        skill: SkillKind::Pickup,
        object: Some(object.class),
        receptacle: None,
        slice: object.slice_of.is_some(),
        looks: Vec::new(),
        place: None,
        alternatives: Vec::new(),
    }));
    known
}

/// What the words mean where "it" is what the hand holds, if that makes them plainer.
fn with_the_held(
    reader: &Reader,
    text: &str,
    house: &BTreeSet<Class>,
    world: &World,
    here: &WishReading,
) -> Option<WishReading> {
    let held = world.held.and_then(|held| world.object(held)).filter(|_| here.confidence < LEAST)?;
    let thing = if held.slice_of.is_some() { "the slice of" } else { "the" };
    let words = text.split(' ').map(|word| match word.trim_end_matches(['.', ',', '!', '?']) {
        it @ ("it" | "this" | "that") => word.replacen(it, &format!("{thing} {}", held.class.spoken()), 1),
        _ => word.to_string(),
    });
    let said: Vec<String> = words.collect();
    let reading = reader.read(&said.join(" "), &Context { house: Some(house), ..Context::default() });
    (reading.confidence > here.confidence).then_some(reading)
}

/// What the words mean where any thing may be meant, if that is plain and only this house lacks it.
fn remote(
    reader: &Reader,
    text: &str,
    before: &[ReadSubtask],
    house: &BTreeSet<Class>,
    here: &WishReading,
) -> Option<WishReading> {
    if here.confidence >= LEAST {
        return None;
    }
    let mut reading = reader.read(text, &Context { before, ..Context::default() });
    let asked = reading.subtasks.iter().flat_map(|subtask| subtask.object.into_iter().chain(subtask.receptacle));
    let absent: BTreeSet<Class> = asked.filter(|class| !house.contains(class)).collect();
    if reading.confidence < LEAST.max(here.confidence) || absent.is_empty() {
        return None;
    }
    reading.absent = absent.into_iter().collect();
    Some(reading)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::house::testing::kitchen;

    fn told(text: &str) -> Wish {
        let (scene, world) = kitchen();
        read(text, 3, std::iter::empty(), &scene, &world)
    }

    #[test]
    fn a_plain_wish_is_graded_with_the_experts_steps() {
        let wish = told("Pick up the mug.");
        assert_eq!((wish.grading, wish.subtasks_in_words()), (WishGrading::Read, vec!["pick up the mug".to_string()]));
        assert!(wish.expert_steps.is_some_and(|steps| steps > 0) && wish.limit().is_some_and(|limit| limit >= 60));
        assert_eq!((wish.began, wish.understood.as_str()), (3, "pick up a mug"));
    }

    #[test]
    fn what_cannot_be_graded_says_why() {
        for (text, why) in
            [("Dance.", "not understood: dance"), ("Pick up the laptop from the sofa and slice the unicorn.", "")]
        {
            let wish = told(text);
            if !why.is_empty() {
                assert_eq!((wish.grading, wish.ungraded.as_deref()), (WishGrading::Nobody, Some(why)));
            }
        }
        let lacking = told("Pick up the baseball bat.");
        assert_eq!(lacking.ungraded.as_deref(), Some("this house has no baseball bat"));
    }

    #[test]
    fn a_guess_is_said_and_graded_once_a_person_says_that_it_is_meant() {
        let (scene, world) = kitchen();
        let guess = WishReading { confidence: 0.2, ..told("Pick up the mug.").readings.remove(0) };
        let wish = of_reading("Do the mug.", 3, vec![guess], (0, false), &scene, &world);
        assert_eq!(wish.ungraded.as_deref(), Some("only 20 % sure that it means: pick up a mug"));
        assert!(wish.is_unsure());
        let meant = repick(&wish, 0, 3, &scene, &world);
        assert_eq!((meant.grading, meant.is_unsure()), (WishGrading::Read, false));
        assert!(!told("Dance.").is_unsure());
    }

    #[test]
    fn it_is_what_the_hand_holds() {
        let (scene, mut world) = kitchen();
        let mug = world.objects.iter().position(|object| object.class.name() == "Mug").unwrap() as u16;
        world.held = Some(mug);
        let wish = read("Put it in the sink.", 0, std::iter::empty(), &scene, &world);
        assert_eq!(wish.subtasks_in_words(), ["put the mug in the sink"], "{wish:?}");
    }
}
