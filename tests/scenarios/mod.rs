//! The rules told as small stories: each is a file beside this one, played in the kitchen of `kitchen.json`.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use serde::Deserialize;
use sprint_explorer::domain::world::Instance;
use sprint_explorer::domain::{Action, ActionType, Class, Pose, Scene, World};
use sprint_explorer::house::House;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Scenario {
    step: Vec<Step>,
}

/// A step of a story: where the agent is put, what it does, what that gives, and what holds afterwards.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Step {
    at: Option<Pose>,
    r#do: Option<ActionType>,
    to: Option<String>,
    gives: Option<String>,
    sees: Vec<String>,
    hides: Vec<String>,
    clean: Vec<String>,
    hot: Vec<String>,
    cold: Vec<String>,
    open: Vec<String>,
    closed: Vec<String>,
    on: Vec<String>,
    off: Vec<String>,
    holds: Option<String>,
    within: BTreeMap<String, String>,
    slices: BTreeMap<String, usize>,
}

/// The kitchen.
pub(crate) fn kitchen() -> (Arc<Scene>, World) {
    #[derive(Deserialize)]
    struct Kitchen {
        scene: Scene,
        world: World,
    }
    let kitchen: Kitchen = serde_json::from_str(include_str!("kitchen.json")).unwrap();
    (Arc::new(kitchen.scene), kitchen.world)
}

/// The thing of that name: a class, with a number from 2 on for further ones.
fn named(house: &House, name: &str) -> Instance {
    let letters = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let nth = name[letters.len()..].parse::<usize>().unwrap_or(1) - 1;
    let class = Class::named(letters).unwrap_or_else(|| panic!("no class {letters}"));
    let objects = (0u16..).zip(&house.world().objects);
    let objects = objects.filter(|(_, object)| object.class == class && object.slice_of.is_none());
    let fixtures = (0u16..).zip(&house.scene().fixtures).filter(|(_, fixture)| fixture.class == class);
    let all = objects.map(|(i, _)| Instance::Object(i)).chain(fixtures.map(|(i, _)| Instance::Fixture(i)));
    all.collect::<Vec<_>>().get(nth).copied().unwrap_or_else(|| panic!("no {name}"))
}

fn check(name: &str) {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenarios")).join(format!("{name}.toml"));
    let scenario: Scenario = toml::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    let (scene, world) = kitchen();
    let mut house = House::new(scene, world);
    for (number, step) in scenario.step.iter().enumerate() {
        let place = format!("{name}, step {}", number + 1);
        if let Some(pose) = step.at {
            let mut world = house.world().clone();
            world.agent = pose;
            house.restore(world);
        }
        if let Some(kind) = step.r#do {
            let target = step.to.as_ref().map(|name| named(&house, name));
            let before = house.world().clone();
            let outcome = house.step(Action { kind, target });
            assert_eq!(outcome.to_string(), step.gives.as_deref().unwrap_or("ok"), "{place}");
            assert!(outcome.is_done() || *house.world() == before, "{place}: an impossible action changed the world");
        }
        holds(&mut house, step, &place);
    }
}

fn holds(house: &mut House, step: &Step, place: &str) {
    let object = |house: &House, name: &str| match named(house, name) {
        Instance::Object(index) => house.world().objects[usize::from(index)].clone(),
        Instance::Fixture(_) => panic!("{place}: {name} is furniture"),
    };
    for (names, seen) in [(&step.sees, true), (&step.hides, false)] {
        for name in names {
            let instance = named(house, name);
            assert_eq!(house.view().sighting(instance).is_some(), seen, "{place}: whether the {name} is seen");
        }
    }
    step.clean.iter().for_each(|name| assert!(object(house, name).clean, "{place}: {name} is clean"));
    step.hot.iter().for_each(|name| assert!(object(house, name).hot, "{place}: {name} is hot"));
    step.cold.iter().for_each(|name| assert!(object(house, name).cold, "{place}: {name} is cold"));
    for (names, open) in [(&step.open, true), (&step.closed, false)] {
        let is = |name: &String| house.world().is_open(named(house, name));
        names.iter().for_each(|name| assert_eq!(is(name), open, "{place}: whether the {name} is open"));
    }
    for (names, on) in [(&step.on, true), (&step.off, false)] {
        let is = |name: &String| house.world().is_on(named(house, name));
        names.iter().for_each(|name| assert_eq!(is(name), on, "{place}: whether the {name} is on"));
    }
    if let Some(name) = &step.holds {
        assert_eq!(house.world().held.map(Instance::Object), Some(named(house, name)), "{place}: the hand");
    }
    for (content, holder) in &step.within {
        let (content_at, holder_at) = (named(house, content), named(house, holder));
        assert!(house.world().is_in(content_at, holder_at), "{place}: {content} is in {holder}");
    }
    for (whole, &count) in &step.slices {
        let Instance::Object(index) = named(house, whole) else { panic!("{place}: {whole} is furniture") };
        let parts = house.world().objects.iter().filter(|part| part.slice_of.is_some_and(|(of, _)| of == index));
        assert_eq!(parts.count(), count, "{place}: slices of {whole}");
    }
}

macro_rules! scenarios {
    ($($name:ident)*) => {
        $(#[test] fn $name() { check(stringify!($name)); })*

        #[test]
        fn every_scenario_file_is_played() {
            let played = [$(stringify!($name)),*];
            let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenarios");
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                let stem = path.file_stem().unwrap().to_str().unwrap();
                assert!(path.extension().is_none_or(|kind| kind != "toml") || played.contains(&stem), "{stem}");
            }
        }
    };
}

scenarios! {
    a_closed_fridge_hides_its_contents
    a_closed_fridge_cools_what_is_in_it
    a_plate_carries_what_lies_on_it
    slicing_needs_a_knife
    a_faucet_cleans_what_lies_in_the_nearest_basin
    heating_needs_a_closed_door
    an_unreachable_object_is_refused_with_its_distance
    a_drawer_brings_its_contents_along
    the_agent_has_one_hand
    furniture_and_walls_are_in_the_way
    the_camera_tilts_only_so_far
    a_lamp_is_switched_on_and_off
    what_is_behind_the_agent_cannot_be_used
}
