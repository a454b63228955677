//! Strict grading: the released reward code taken literally, for comparison with published numbers.

use super::grader::{GradedStep, Grader, Pending, SubtaskVerdict};
use crate::domain::class::FixtureEffect;
use crate::domain::skill::{Literal, Original, SkillKind, Subtask};
use crate::domain::world::Instance;
use crate::domain::{ActionType, World};

/// The instance that a recording names, once it exists: slices only do after the cut.
pub(super) fn resolve(world: &World, original: Original) -> Option<Instance> {
    let Some(part) = original.slice else { return Some(original.instance) };
    let Instance::Object(whole) = original.instance else { return None };
    let slice = world.objects.iter().position(|object| object.slice_of == Some((whole, part)))?;
    Some(Instance::Object(slice as u16))
}

/// What a slice was cut from, or the thing itself: the released code cuts ids at "Sliced" for some comparisons.
fn root(world: &World, index: u16) -> u16 {
    world.object(index).and_then(|object| object.slice_of).map_or(index, |(whole, _)| whole)
}

/// The actions after which a skill is looked at, besides the five of navigation.
fn own_interactions(skill: SkillKind) -> &'static [ActionType] {
    use ActionType::{Close, Open, Pickup, Put, Slice, ToggleOff, ToggleOn};
    match skill {
        SkillKind::Pickup => &[Pickup, Open, Close],
        SkillKind::Put => &[Put, Open, Close],
        SkillKind::Slice => &[Slice, Open, Close],
        SkillKind::Toggle => &[ToggleOn, ToggleOff],
        SkillKind::Clean => &[Put, Pickup, ToggleOn, ToggleOff],
        SkillKind::Heat => &[Open, Close, Put, Pickup, ToggleOn, ToggleOff],
        SkillKind::Cool => &[Open, Close, Put, Pickup],
    }
}

/// Grades one step of the current subtask.
pub(super) fn grade(grader: &Grader, subtask: &Subtask, literal: &Literal, step: GradedStep<'_>) -> SubtaskVerdict {
    let kind = step.action.kind;
    if kind.is_interaction() && !own_interactions(subtask.skill).contains(&kind) {
        return SubtaskVerdict::Unchanged;
    }
    let world = step.world;
    let object = resolve(world, literal.object);
    let held = world.held;
    let in_hand = held.is_some() && object == held.map(Instance::Object);
    let met = match subtask.skill {
        SkillKind::Pickup => held.is_some_and(|held| literal.object.instance == Instance::Object(root(world, held))),
        SkillKind::Put => {
            let looked_at = step.did(ActionType::Put) || grader.pending.is_some();
            looked_at && object.zip(receptacle(grader, subtask, world)).is_some_and(|(a, b)| world.is_in(a, b))
        }
        SkillKind::Slice => is(world, object, |object| object.sliced),
        SkillKind::Toggle => object.is_some_and(|lamp| world.is_on(lamp)),
        SkillKind::Clean => step.did(ActionType::Pickup) && any_part_clean(world, literal.object.instance),
        SkillKind::Heat => step.did(ActionType::Close) && in_hand && is(world, object, |object| object.hot),
        SkillKind::Cool => {
            step.did(ActionType::Close)
                && in_hand
                && first_fridge_closed(step)
                && is(world, object, |object| object.cold)
        }
    };
    let two_halves = matches!(subtask.skill, SkillKind::Pickup | SkillKind::Put | SkillKind::Slice);
    if !met || !literal.needs_close || !two_halves {
        return if met { SubtaskVerdict::Complete } else { SubtaskVerdict::Unchanged };
    }
    let shut = literal.last_target.and_then(|target| resolve(world, target));
    match grader.pending {
        None => SubtaskVerdict::Half(Pending { shut }),
        Some(_) if step.did(ActionType::Close) && shut.is_none_or(|shut| !world.is_open(shut)) => {
            SubtaskVerdict::Complete
        }
        Some(_) => SubtaskVerdict::Unchanged,
    }
}

fn receptacle(grader: &Grader, subtask: &Subtask, world: &World) -> Option<Instance> {
    let role = subtask.receptacle?;
    let named = grader.roles.get(usize::from(role)).and_then(|role| role.expert);
    named.and_then(|named| resolve(world, named)).or_else(|| grader.binding(role))
}

fn is(world: &World, instance: Option<Instance>, property: impl Fn(&crate::domain::Object) -> bool) -> bool {
    matches!(instance, Some(Instance::Object(index)) if world.object(index).is_some_and(property))
}

/// The released code records what was rinsed by the id of the whole thing.
fn any_part_clean(world: &World, whole: Instance) -> bool {
    (0u16..).zip(&world.objects).any(|(index, object)| object.clean && Instance::Object(root(world, index)) == whole)
}

fn first_fridge_closed(step: GradedStep<'_>) -> bool {
    let fridge =
        step.scene.fixtures.iter().position(|fixture| fixture.class.info().effect == Some(FixtureEffect::Cool));
    fridge.is_none_or(|index| !step.world.is_open(Instance::Fixture(index as u16)))
}
