//! Grading by class: a subtask asks for classes, and what the agent chose is bound to the role it plays.

use super::grader::{GradedStep, Grader, Pending, SubtaskVerdict};
use crate::domain::class::FixtureEffect;
use crate::domain::skill::{SkillKind, Subtask};
use crate::domain::world::Instance;
use crate::domain::{ActionType, Scene, World};

/// The openable fixture around an instance, at any depth.
pub(super) fn shell(scene: &Scene, world: &World, instance: Instance) -> Option<Instance> {
    world.containers_of(instance).find(|&holder| openable_fixture(scene, holder))
}

fn openable_fixture(scene: &Scene, instance: Instance) -> bool {
    matches!(instance, Instance::Fixture(index)
        if scene.fixture(index).is_some_and(|fixture| fixture.class.info().openable))
}

/// Whether `instance` may play `role`: see [`Grader::fits`].
pub(super) fn fits(grader: &Grader, scene: &Scene, world: &World, role: u8, instance: Instance) -> bool {
    let Some(asked) = grader.roles.get(usize::from(role)) else { return false };
    if let Some(bound) = grader.binding(role) {
        return bound == instance;
    }
    let slice_of = match instance {
        Instance::Object(index) => world.object(index).and_then(|object| object.slice_of),
        Instance::Fixture(_) => None,
    };
    world.class_of(scene, instance) == Some(asked.class)
        && asked.slice == slice_of.is_some()
        && (is_furniture(scene, instance) || !grader.bindings.contains(&Some(instance)))
        && slice_of.is_none_or(|(whole, _)| may_be_cut_from(grader, asked.class, Instance::Object(whole)))
}

/// Furniture may take what several roles ask a place for.
fn is_furniture(scene: &Scene, instance: Instance) -> bool {
    matches!(instance, Instance::Fixture(index)
        if scene.fixture(index).is_some_and(|fixture| fixture.class.info().receptacle))
}

/// Where the task has something of the class sliced, a slice of another one will not do.
fn may_be_cut_from(grader: &Grader, class: crate::domain::Class, whole: Instance) -> bool {
    let sliced = grader.subtasks.iter().filter(|subtask| subtask.skill == SkillKind::Slice);
    let wholes = sliced.filter(|subtask| {
        grader.roles.get(usize::from(subtask.object)).is_some_and(|role| role.class == class && !role.slice)
    });
    let mut wholes = wholes.filter_map(|subtask| grader.binding(subtask.object)).peekable();
    wholes.peek().is_none() || wholes.any(|bound| bound == whole)
}

/// Grades one step of the current subtask.
pub(super) fn grade(grader: &mut Grader, subtask: &Subtask, step: GradedStep<'_>) -> SubtaskVerdict {
    if let Some(pending) = grader.pending {
        return second_half(grader, subtask, pending, step);
    }
    match subtask.skill {
        SkillKind::Pickup => pickup(grader, subtask, step),
        SkillKind::Put => put(grader, subtask, step),
        SkillKind::Slice => slice(grader, subtask, step),
        SkillKind::Toggle => toggle(grader, subtask, step),
        SkillKind::Clean if step.did(ActionType::Pickup) => holds_changed(grader, subtask, step),
        SkillKind::Heat | SkillKind::Cool
            if step.did(ActionType::Close) || !subtask.closes && step.did(ActionType::Pickup) =>
        {
            holds_changed(grader, subtask, step)
        }
        SkillKind::Clean | SkillKind::Heat | SkillKind::Cool => SubtaskVerdict::Unchanged,
    }
}

fn bind(grader: &mut Grader, role: u8, instance: Instance) {
    if let Some(slot) = grader.bindings.get_mut(usize::from(role)) {
        *slot = Some(instance);
    }
}

/// The object in the hand, if it may play the role.
fn held(grader: &Grader, role: u8, step: GradedStep<'_>) -> Option<Instance> {
    let held = Instance::Object(step.world.held?);
    fits(grader, step.scene, step.world, role, held).then_some(held)
}

/// Complete, or half done while something still has to be closed.
fn complete_or_close(subtask: &Subtask, shut: Option<Instance>, step: GradedStep<'_>) -> SubtaskVerdict {
    match shut.filter(|&shut| subtask.closes && step.world.is_open(shut)) {
        Some(shut) => SubtaskVerdict::Half(Pending { shut: Some(shut) }),
        None => SubtaskVerdict::Complete,
    }
}

fn pickup(grader: &mut Grader, subtask: &Subtask, step: GradedStep<'_>) -> SubtaskVerdict {
    let may = step.did(ActionType::Pickup) || subtask.closes && step.did(ActionType::Close);
    let Some(held) = held(grader, subtask.object, step).filter(|_| may) else { return SubtaskVerdict::Unchanged };
    bind(grader, subtask.object, held);
    let shut = step.did(ActionType::Pickup).then(|| came_from(grader, held)).flatten();
    complete_or_close(subtask, shut, step)
}

/// The openable fixture out of which an object was just taken.
fn came_from(grader: &Grader, taken: Instance) -> Option<Instance> {
    let Instance::Object(index) = taken else { return None };
    grader.before.inside.get(usize::from(index)).copied().flatten()
}

fn put(grader: &mut Grader, subtask: &Subtask, step: GradedStep<'_>) -> SubtaskVerdict {
    let Some(receptacle_role) = subtask.receptacle.filter(|_| step.did(ActionType::Put)) else {
        return SubtaskVerdict::Unchanged;
    };
    let Some(object) = put_object(grader, subtask.object, step) else { return SubtaskVerdict::Unchanged };
    let mut holders = step.world.containers_of(object);
    let Some(holder) = holders.find(|&holder| fits(grader, step.scene, step.world, receptacle_role, holder)) else {
        return SubtaskVerdict::Unchanged;
    };
    bind(grader, subtask.object, object);
    bind(grader, receptacle_role, holder);
    complete_or_close(subtask, shell_or_self(step, holder), step)
}

/// The openable fixture that a receptacle is, or is in.
fn shell_or_self(step: GradedStep<'_>, receptacle: Instance) -> Option<Instance> {
    if openable_fixture(step.scene, receptacle) {
        return Some(receptacle);
    }
    shell(step.scene, step.world, receptacle)
}

/// What plays the role of the thing put down: the bound object, else what the hand has just let go.
fn put_object(grader: &Grader, role: u8, step: GradedStep<'_>) -> Option<Instance> {
    if let Some(bound) = grader.binding(role) {
        return Some(bound);
    }
    let fitting = |instance: &Instance| fits(grader, step.scene, step.world, role, *instance);
    grader.before.held.map(Instance::Object).filter(fitting)
}

fn slice(grader: &mut Grader, subtask: &Subtask, step: GradedStep<'_>) -> SubtaskVerdict {
    let is_cut = |instance: &Instance| {
        matches!(instance, Instance::Object(index) if step.world.object(*index).is_some_and(|object| object.sliced))
            && fits(grader, step.scene, step.world, subtask.object, *instance)
    };
    let just_cut = step.action.target.filter(|_| step.did(ActionType::Slice));
    let all = (0..step.world.objects.len() as u16).map(Instance::Object);
    let Some(cut) = just_cut.into_iter().chain(all).find(is_cut) else { return SubtaskVerdict::Unchanged };
    bind(grader, subtask.object, cut);
    let shut = shell(step.scene, step.world, cut);
    complete_or_close(subtask, shut, step)
}

fn toggle(grader: &mut Grader, subtask: &Subtask, step: GradedStep<'_>) -> SubtaskVerdict {
    let shines =
        |lamp: &Instance| step.world.is_on(*lamp) && fits(grader, step.scene, step.world, subtask.object, *lamp);
    let just_lit = step.action.target.filter(|_| step.did(ActionType::ToggleOn));
    let all = (0..step.scene.fixtures.len() as u16).map(Instance::Fixture);
    let Some(lamp) = just_lit.into_iter().chain(all).find(shines) else { return SubtaskVerdict::Unchanged };
    bind(grader, subtask.object, lamp);
    SubtaskVerdict::Complete
}

fn holds_changed(grader: &mut Grader, subtask: &Subtask, step: GradedStep<'_>) -> SubtaskVerdict {
    let Some(held) = held(grader, subtask.object, step) else { return SubtaskVerdict::Unchanged };
    let Some(object) = step.world.held.and_then(|index| step.world.object(index)) else {
        return SubtaskVerdict::Unchanged;
    };
    let changed = match subtask.skill {
        SkillKind::Clean => object.clean,
        SkillKind::Heat => object.hot,
        _ => object.cold && !(subtask.closes && a_fridge_is_open(step)),
    };
    if !changed {
        return SubtaskVerdict::Unchanged;
    }
    bind(grader, subtask.object, held);
    SubtaskVerdict::Complete
}

fn a_fridge_is_open(step: GradedStep<'_>) -> bool {
    let fixtures = (0u16..).zip(&step.scene.fixtures);
    let mut fridges = fixtures.filter(|(_, fixture)| fixture.class.info().effect == Some(FixtureEffect::Cool));
    fridges.any(|(index, _)| step.world.is_open(Instance::Fixture(index)))
}

/// After the first half: still so, and now closed.
fn second_half(grader: &Grader, subtask: &Subtask, pending: Pending, step: GradedStep<'_>) -> SubtaskVerdict {
    let (world, object) = (step.world, grader.binding(subtask.object));
    let still = match subtask.skill {
        SkillKind::Pickup => object.is_some() && world.held.map(Instance::Object) == object,
        SkillKind::Put => {
            let receptacle = subtask.receptacle.and_then(|role| grader.binding(role));
            object.zip(receptacle).is_some_and(|(object, receptacle)| world.is_in(object, receptacle))
        }
        _ => true,
    };
    if !still {
        return SubtaskVerdict::Undone;
    }
    let closed = pending.shut.is_none_or(|shut| !world.is_open(shut));
    if step.did(ActionType::Close) && closed { SubtaskVerdict::Complete } else { SubtaskVerdict::Unchanged }
}
