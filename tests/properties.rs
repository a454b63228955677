//! Properties of the rules under random actions in random worlds.

use proptest::prelude::*;
use sprint_explorer::domain::world::Instance;
use sprint_explorer::domain::{Action, ActionType, Heading, Parent, Pose, Scene, World};
use sprint_explorer::house::rules;

use super::scenarios::kitchen;

/// Any action, also one that makes no sense: without a target, or with one that does not exist.
fn any_action() -> impl Strategy<Value = Action> {
    let target = prop_oneof![
        1 => Just(None),
        8 => (0u16..16).prop_map(|i| Some(Instance::Fixture(i))),
        14 => (0u16..40).prop_map(|i| Some(Instance::Object(i))),
    ];
    // Interactions outnumber moves, so that much happens.
    (prop_oneof![1 => 0usize..5, 4 => 5usize..12], target)
        .prop_map(|(kind, target)| Action { kind: ActionType::from_index(kind).unwrap(), target })
}

/// The kitchen, with the agent anywhere, some doors open and some things missing.
fn any_world() -> impl Strategy<Value = World> {
    let (scene, world) = kitchen();
    let (cells, fixtures) = (scene.cells.clone(), scene.fixtures.len());
    let pose = (0..cells.len(), 0i32..4, 0i16..7);
    let states = proptest::collection::vec(any::<(bool, bool)>(), fixtures);
    (pose, states, any::<bool>()).prop_map(move |((cell, quarters, look), states, knife)| {
        let mut world = world.clone();
        let heading = Heading::from_quarters(quarters);
        world.agent = Pose { cell: cells[cell], heading, horizon: Pose::UP + Pose::LOOK * look };
        for ((state, fixture), (open, on)) in world.fixtures.iter_mut().zip(&scene.fixtures).zip(states) {
            let info = fixture.class.info();
            // What is open cannot run.
            state.open = open && info.openable && fixture.class.name() != "Drawer";
            state.on = on && info.toggleable && !state.open;
        }
        if knife {
            let held = world.objects.iter().position(|object| object.class.is_knife()).unwrap();
            world.objects[held].parent = Parent::Hand;
            world.held = Some(held as u16);
        }
        world
    })
}

/// Nothing is lost, doubled, or held by two.
fn is_sound(scene: &Scene, before: &World, after: &World) -> Result<(), TestCaseError> {
    prop_assert!(after.objects.len() >= before.objects.len());
    for (old, new) in before.objects.iter().zip(&after.objects) {
        prop_assert_eq!((old.class, old.slice_of), (new.class, new.slice_of));
    }
    for (index, object) in (0u16..).zip(&after.objects) {
        prop_assert_eq!(object.parent == Parent::Hand, after.held == Some(index));
        let chain = after.containers_of(Instance::Object(index)).count();
        prop_assert!(chain <= after.objects.len(), "object {index} contains itself");
        if let Parent::In(holder) = object.parent {
            let class = after.class_of(scene, holder);
            prop_assert!(class.is_some_and(|class| class.info().receptacle), "object {index} is in {holder:?}");
        }
        let parts = after.objects.iter().filter(|part| part.slice_of.is_some_and(|(whole, _)| whole == index));
        let expected = if object.sliced { usize::from(object.class.info().slices) } else { 0 };
        prop_assert_eq!(parts.count(), expected);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn random_actions_lose_and_double_nothing(world in any_world(), actions in proptest::collection::vec(any_action(), 1..120)) {
        let (scene, _) = kitchen();
        let mut world = world;
        for action in actions {
            let before = world.clone();
            let outcome = rules::apply(&scene, &mut world, action);
            if !outcome.is_done() {
                prop_assert_eq!(&world, &before, "an impossible action changed the world");
                prop_assert!(!outcome.to_string().is_empty());
            }
            is_sound(&scene, &before, &world)?;
        }
    }

    #[test]
    fn undo_by_snapshot_is_exact(world in any_world(), actions in proptest::collection::vec(any_action(), 1..60)) {
        let (scene, _) = kitchen();
        let play = |world: &World| {
            let mut world = world.clone();
            let outcomes: Vec<_> = actions.iter().map(|&action| rules::apply(&scene, &mut world, action)).collect();
            (world, outcomes)
        };
        let snapshot = world.clone();
        let first = play(&world);
        prop_assert_eq!(&world, &snapshot);
        let again = play(&snapshot);
        prop_assert_eq!(first.0.digest(), again.0.digest());
        prop_assert_eq!(first, again);
    }

    #[test]
    fn a_world_survives_writing_and_reading(world in any_world(), actions in proptest::collection::vec(any_action(), 0..60)) {
        let (scene, _) = kitchen();
        let mut world = world;
        for action in actions {
            rules::apply(&scene, &mut world, action);
        }
        let text = serde_json::to_string(&world).unwrap();
        let read: World = serde_json::from_str(&text).unwrap();
        prop_assert_eq!(read.digest(), world.digest());
        prop_assert_eq!(read, world);
    }
}

#[test]
fn the_digest_of_a_world_is_the_same_in_every_build() {
    let (_, world) = kitchen();
    assert_eq!(world.digest(), "b0c9272c685a102c");
}
