//! For tests: a small kitchen made by hand, and a house in it. Things are named by class and number: `Mug`, `Mug2`.

use std::sync::Arc;

use serde::Deserialize;

use super::House;
use crate::domain::world::Instance;
use crate::domain::{Class, Scene, World};

#[derive(Deserialize)]
struct Kitchen {
    scene: Scene,
    world: World,
}

/// The kitchen of `tests/scenarios/kitchen.json`.
pub fn kitchen() -> (Arc<Scene>, World) {
    let text = include_str!("../../tests/scenarios/kitchen.json");
    let kitchen: Kitchen = serde_json::from_str(text).unwrap();
    (Arc::new(kitchen.scene), kitchen.world)
}

/// A house in that kitchen.
pub fn kitchen_house() -> House {
    let (scene, world) = kitchen();
    House::new(scene, world)
}

/// The thing of that name: a class, with a number from 2 on for further ones. Objects come before fixtures.
pub fn named(scene: &Scene, world: &World, name: &str) -> Instance {
    let class = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let nth = name[class.len()..].parse::<usize>().unwrap_or(1) - 1;
    let class = Class::named(class).unwrap_or_else(|| panic!("no class {class}"));
    let objects = (0u16..).zip(&world.objects).filter(|(_, object)| object.class == class && object.slice_of.is_none());
    let fixtures = (0u16..).zip(&scene.fixtures).filter(|(_, fixture)| fixture.class == class);
    let all = objects.map(|(i, _)| Instance::Object(i)).chain(fixtures.map(|(i, _)| Instance::Fixture(i)));
    all.collect::<Vec<_>>().get(nth).copied().unwrap_or_else(|| panic!("no {name}"))
}
