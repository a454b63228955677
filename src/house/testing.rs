//! For tests: a small kitchen made by hand, and a house in it. Things are named by class and number: `Mug`, `Mug2`.

use std::sync::Arc;

use serde::Deserialize;

use super::House;
use super::expert::Expert;
use super::grading::Grader;
use crate::domain::skill::{Role, SkillKind, Subtask};
use crate::domain::world::Instance;
use crate::domain::{Action, ActionType, Class, Scene, World};

#[derive(Deserialize)]
struct Kitchen {
    scene: Scene,
    world: World,
}

/// The kitchen of `tests/scenarios/kitchen.json`.
pub(crate) fn kitchen() -> (Arc<Scene>, World) {
    let text = include_str!("../../tests/scenarios/kitchen.json");
    let kitchen: Kitchen = serde_json::from_str(text).unwrap();
    (Arc::new(kitchen.scene), kitchen.world)
}

pub(crate) fn kitchen_house() -> House {
    let (scene, world) = kitchen();
    House::new(scene, world)
}

/// The thing of that name: a class, with a number from 2 on for further ones. Objects come before fixtures.
pub(crate) fn named(scene: &Scene, world: &World, name: &str) -> Instance {
    let class = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let nth = name[class.len()..].parse::<usize>().unwrap_or(1) - 1;
    let class = Class::named(class).unwrap_or_else(|| panic!("no class {class}"));
    let objects = (0u16..).zip(&world.objects).filter(|(_, object)| object.class == class && object.slice_of.is_none());
    let fixtures = (0u16..).zip(&scene.fixtures).filter(|(_, fixture)| fixture.class == class);
    let all = objects.map(|(i, _)| Instance::Object(i)).chain(fixtures.map(|(i, _)| Instance::Fixture(i)));
    all.collect::<Vec<_>>().get(nth).copied().unwrap_or_else(|| panic!("no {name}"))
}

/// A role for a class.
pub(crate) fn role(class: &str) -> Role {
    Role { class: Class::named(class).unwrap(), slice: false, bound: None, expert: None }
}

/// A role for a slice of a class.
pub(crate) fn slice_role(class: &str) -> Role {
    Role { slice: true, ..role(class) }
}

/// A subtask about one role.
pub(crate) fn subtask(skill: SkillKind, object: u8) -> Subtask {
    Subtask { skill, object, receptacle: None, closes: false, literal: None }
}

pub(crate) fn put_subtask(object: u8, receptacle: u8) -> Subtask {
    Subtask { receptacle: Some(receptacle), ..subtask(SkillKind::Put, object) }
}

/// The same subtask, ending with a close.
pub(crate) fn closing(subtask: Subtask) -> Subtask {
    Subtask { closes: true, ..subtask }
}

/// Lets the expert do a task; the actions it took, or why it could not go on.
pub(crate) fn demonstrate(house: &mut House, grader: &mut Grader, limit: usize) -> Result<Vec<Action>, String> {
    let mut expert = Expert::new();
    let mut actions = Vec::new();
    while !grader.is_done() {
        let action = expert.next(house, grader).map_err(|no_way| format!("{no_way}; after {actions:?}"))?;
        let outcome = house.step(action);
        actions.push(action);
        if !outcome.is_done() {
            return Err(format!("{outcome}, after {actions:?}"));
        }
        let (scene, world) = (house.scene().clone(), house.world().clone());
        grader.observe(&scene, &world, action, outcome);
        if actions.len() > limit {
            return Err(format!("not done after {actions:?}; {}", grader.waits_for(&scene, &world)));
        }
    }
    Ok(actions)
}

/// The interactions among actions, by kind.
pub(crate) fn interactions(actions: &[Action]) -> Vec<ActionType> {
    actions.iter().map(|action| action.kind).filter(|kind| kind.is_interaction()).collect()
}
