//! A recording resolved against its scene: names become instances, skills get their roles.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use super::fixtures::Inventory;
use super::names::{Name, NamedPart};
use super::recording::{Planned, RecordedStep, Recording};
use crate::domain::skill::{Literal, Original};
use crate::domain::task::SceneRef;
use crate::domain::world::{Instance, Object, Parent, World};
use crate::domain::{Action, ActionType, Role, Scene, SkillKind, Subtask, Trajectory};

/// Turns a recording into a trajectory of `scene`, with the initial parents of its objects.
///
/// # Errors
/// When something it names does not exist; the text says which field.
pub(crate) fn resolve(
    recording: &Recording,
    scene: &Scene,
    inventory: &Inventory,
    parents: &[Parent],
) -> Result<Trajectory, String> {
    let start = start(recording, scene, parents);
    let mut slices: BTreeMap<u16, Slices> = BTreeMap::new();
    let mut count = start.objects.len() as u16;
    let mut actions = Vec::with_capacity(recording.steps.len());
    let mut boxes = Vec::new();
    for (index, step) in recording.steps.iter().enumerate() {
        let missing = |name: Name| format!("plan.low_actions[{index}]: {} does not exist then", name.text());
        let target = match step.target {
            None => None,
            Some(name) => {
                let original = original(recording, inventory, name).ok_or_else(|| missing(name))?;
                Some(present(original, &slices).ok_or_else(|| missing(name))?)
            }
        };
        if let (ActionType::Slice, Some(Instance::Object(whole))) = (step.kind, target)
            && let Entry::Vacant(cut) = slices.entry(whole)
        {
            let parts = scene_slices(&start, whole);
            cut.insert(Slices { first: count, parts });
            count = count.saturating_add(parts.into());
        }
        if step.kind.is_interaction() {
            boxes.push(step.bounds.unwrap_or_default());
        }
        actions.push(Action { kind: step.kind, target });
    }
    let mut roles = Vec::new();
    let mut skills = Vec::with_capacity(recording.skills.len());
    for (number, planned) in recording.skills.iter().enumerate() {
        let following = recording.skills.get(number + 1);
        let steps: Vec<RecordedStep> = recording.steps.iter().copied().filter(|step| step.skill == number).collect();
        let skill = subtask(recording, inventory, &start, planned, following, &steps, &mut roles);
        skills.push(skill.ok_or_else(|| format!("plan: skill {number} names something that does not exist"))?);
    }
    let skill_starts = (0..skills.len()).map(|skill| recording.steps.partition_point(|step| step.skill < skill) as u32);
    Ok(Trajectory {
        id: recording.id.clone(),
        split: recording.split.clone(),
        scene: SceneRef::Named(scene.name.clone()),
        skill_starts: skill_starts.collect(),
        start,
        actions,
        roles,
        skills,
        goal: Some(recording.goal.clone()),
        annotations: recording.annotations.clone(),
        boxes,
        choices: Vec::new(),
    })
}

/// The world before the first action: all closed and off, except lids of laptops and boxes, and lamps said to shine.
fn start(recording: &Recording, scene: &Scene, parents: &[Parent]) -> World {
    let setting = &recording.setting;
    let objects = setting.objects.iter().zip(parents).map(|(placed, &parent)| Object {
        class: placed.class,
        mesh: scene.meshes.iter().position(|mesh| mesh.name == placed.mesh).map(|mesh| mesh as u16),
        at: placed.at,
        turn: placed.turn,
        parent,
        open: placed.class.info().openable,
        ..Object::default()
    });
    let mut world = World::new(scene, setting.agent, objects.collect());
    for (state, fixture) in world.fixtures.iter_mut().zip(&scene.fixtures) {
        state.on = setting.lit.contains(&fixture.class);
    }
    world
}

fn scene_slices(start: &World, whole: u16) -> u8 {
    start.object(whole).map_or(0, |object| object.class.info().slices)
}

/// What a name means at the start: an instance, or a slice that will be cut from one.
fn original(recording: &Recording, inventory: &Inventory, name: Name) -> Option<Original> {
    let slice = match name.part {
        NamedPart::Slice(number) => Some(number),
        NamedPart::Whole | NamedPart::Basin => None,
    };
    let fixture = inventory.number(name).map(Instance::Fixture);
    let instance = fixture.or_else(|| recording.object(name.whole(), None).map(Instance::Object))?;
    Some(Original { instance, slice })
}

/// The slices of an object: the first one's number, and how many there are.
struct Slices {
    first: u16,
    parts: u8,
}

/// The instance that an original is once objects are cut. A recording may name a later slice than the class falls into here;
/// slices are alike, and the last one stands for it.
fn present(original: Original, cut: &BTreeMap<u16, Slices>) -> Option<Instance> {
    match (original.instance, original.slice) {
        (instance, None) => Some(instance),
        (Instance::Object(whole), Some(slice)) => {
            let Slices { first, parts } = cut.get(&whole)?;
            Some(Instance::Object(first.checked_add(slice.min(*parts).checked_sub(1)?.into())?))
        }
        (Instance::Fixture(_), Some(_)) => None,
    }
}

fn subtask(
    recording: &Recording,
    inventory: &Inventory,
    start: &World,
    planned: &Planned,
    following: Option<&Planned>,
    steps: &[RecordedStep],
    roles: &mut Vec<Role>,
) -> Option<Subtask> {
    let find = |name: Name| original(recording, inventory, name);
    let taken = steps.iter().rev().find(|step| step.kind == ActionType::Pickup).and_then(|step| step.target);
    let name = match planned.kind {
        SkillKind::Pickup | SkillKind::Put | SkillKind::Slice | SkillKind::Toggle => planned.object,
        SkillKind::Clean | SkillKind::Heat | SkillKind::Cool => taken.or(planned.cleaned)?,
    };
    let object = find(name)?;
    let read = match planned.kind {
        SkillKind::Clean => planned.cleaned,
        SkillKind::Heat | SkillKind::Cool => following.map(|following| following.object),
        _ => None,
    };
    let mut role = |name: Name| -> Option<u8> {
        let expert = find(name)?;
        let number = roles.iter().position(|role| role.expert == Some(expert)).unwrap_or_else(|| {
            let slice = expert.slice.is_some();
            // A fixture that two spellings name has one class: its own.
            let class = match expert.instance {
                Instance::Fixture(number) => inventory.found[usize::from(number)].name.class,
                Instance::Object(number) => start.objects[usize::from(number)].class,
            };
            roles.push(Role { class, slice, bound: None, expert: Some(expert) });
            roles.len() - 1
        });
        u8::try_from(number).ok()
    };
    let object_role = role(name)?;
    let receptacle = match planned.receptacle.filter(|_| planned.kind == SkillKind::Put) {
        Some(receptacle) => Some(role(receptacle)?),
        None => None,
    };
    Some(Subtask {
        skill: planned.kind,
        object: object_role,
        receptacle,
        closes: steps.last().is_some_and(|step| step.kind == ActionType::Close),
        literal: Some(Literal {
            needs_close: steps.iter().any(|step| step.kind == ActionType::Close),
            object: read.and_then(find).unwrap_or(object),
            last_target: steps.last().and_then(|step| step.target).and_then(find),
        }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slice_is_one_of_its_own_whole_however_it_is_numbered() {
        let cut = BTreeMap::from([(3, Slices { first: 40, parts: 2 })]);
        let slice = |whole, number| present(Original { instance: Instance::Object(whole), slice: Some(number) }, &cut);
        assert_eq!([1, 2, 3].map(|number| slice(3, number)), [40, 41, 41].map(|i| Some(Instance::Object(i))));
        assert_eq!((slice(3, 0), slice(4, 1)), (None, None), "it begins with 1; what is whole has none");
    }
}
