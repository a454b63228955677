//! ALFRED's seven goal conditions: names are matched by their parts, and containment is transitive.

use super::render::Renderer;
use super::session::House;
use super::view;
use crate::domain::skill::{Goal, GoalKind, Role};
use crate::domain::world::{Instance, Object};
use crate::domain::{Class, Scene, World};

/// Whether the goal of a whole trajectory is met in this world.
pub(crate) fn goal_met(goal: &Goal, scene: &Scene, world: &World) -> bool {
    let is_in = |content: u16, holder: Instance| world.is_in(Instance::Object(content), holder);
    let placed = |content: u16| receptacles(goal.receptacle, scene, world).any(|holder| is_in(content, holder));
    let mut targets = objects(goal, world);
    match goal.kind {
        GoalKind::LookAtObjInLight => {
            let lamps = (0u16..).zip(&scene.fixtures).filter(|(_, fixture)| names(goal.lamp, fixture.class));
            let lamps = lamps.map(|(index, _)| Instance::Fixture(index));
            let lit: Vec<Instance> = lamps.filter(|&lamp| world.is_on(lamp)).collect();
            targets.any(|(index, _)| world.held == Some(index)) && any_in_view(scene, world, &lit)
        }
        GoalKind::PickAndPlaceSimple => targets.any(|(index, _)| placed(index)),
        GoalKind::PickCleanThenPlaceInRecep => targets.any(|(index, object)| object.clean && placed(index)),
        GoalKind::PickCoolThenPlaceInRecep => targets.any(|(index, object)| object.cold && placed(index)),
        GoalKind::PickHeatThenPlaceInRecep => targets.any(|(index, object)| object.hot && placed(index)),
        GoalKind::PickAndPlaceWithMovableRecep => {
            let carries = |movable: u16, content: u16| is_in(content, Instance::Object(movable)) && placed(movable);
            targets.any(|(content, _)| movables(goal.movable, world).any(|movable| carries(movable, content)))
        }
        GoalKind::PickTwoObjAndPlace => {
            let targets: Vec<u16> = targets.map(|(index, _)| index).collect();
            let inside = |holder: Instance| targets.iter().filter(|&&index| is_in(index, holder)).count();
            receptacles(goal.receptacle, scene, world).any(|holder| inside(holder) >= 2)
        }
    }
}

/// Whether the agent sees one of these, near enough for ALFRED's simulator to call it visible.
fn any_in_view(scene: &Scene, world: &World, wanted: &[Instance]) -> bool {
    if wanted.is_empty() {
        return false;
    }
    let view = Renderer::new(House::FRAME).look(scene, world);
    wanted.iter().any(|&instance| view::reachable(scene, world, &view, instance).is_ok())
}

/// Whether `wanted`'s name is part of `class`'s, as ALFRED matches: a "Knife" is also a "ButterKnife".
fn names(wanted: Option<Class>, class: Class) -> bool {
    wanted.is_some_and(|wanted| class.name().contains(wanted.name()))
}

/// Whether the goal asks that things like this one end up together in one receptacle like that one: only that of two objects does.
pub(crate) fn asks_for_one_receptacle(goal: &Goal, object: &Role, receptacle: &Role) -> bool {
    goal.kind == GoalKind::PickTwoObjAndPlace
        && names(Some(goal.object), object.class)
        && (!goal.sliced || object.slice)
        && names(goal.receptacle, receptacle.class)
}

/// The objects that the goal is about: those that can be picked up, and only slices where slices are meant.
fn objects<'a>(goal: &'a Goal, world: &'a World) -> impl Iterator<Item = (u16, &'a Object)> {
    (0u16..).zip(&world.objects).filter(|(_, object)| {
        names(Some(goal.object), object.class) && !object.sliced && (!goal.sliced || object.slice_of.is_some())
    })
}

fn receptacles(wanted: Option<Class>, scene: &Scene, world: &World) -> impl Iterator<Item = Instance> {
    let fits = move |class: Class| names(wanted, class) && class.info().receptacle;
    let fixtures = (0u16..).zip(&scene.fixtures).filter(move |(_, fixture)| fits(fixture.class));
    let movable = (0u16..).zip(&world.objects).filter(move |(_, object)| fits(object.class));
    fixtures.map(|(index, _)| Instance::Fixture(index)).chain(movable.map(|(index, _)| Instance::Object(index)))
}

fn movables(wanted: Option<Class>, world: &World) -> impl Iterator<Item = u16> {
    let carriers = (0u16..).zip(&world.objects).filter(move |(_, object)| names(wanted, object.class));
    carriers.filter(|(_, object)| object.class.info().receptacle).map(|(index, _)| index)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{kitchen, named};
    use super::*;
    use crate::domain::{Heading, Parent, Pose};

    fn goal(kind: GoalKind, object: &str, receptacle: &str) -> Goal {
        let (object, receptacle) = (Class::named(object).unwrap(), Class::named(receptacle));
        Goal { kind, object, sliced: false, receptacle, movable: None, lamp: None }
    }

    #[test]
    fn a_goal_matches_by_part_of_a_name_and_through_what_carries_it() {
        let (scene, world) = kitchen();
        let simple =
            |object, receptacle| goal_met(&goal(GoalKind::PickAndPlaceSimple, object, receptacle), &scene, &world);
        assert!(simple("Knife", "Drawer"), "the butter knife is a knife");
        assert!(simple("Spoon", "DiningTable"), "on a plate on the table");
        assert!(!simple("Spoon", "Fridge"));
    }

    #[test]
    fn a_thing_is_looked_at_only_while_the_lamp_that_shines_on_it_is_in_view() {
        let (scene, mut world) = kitchen();
        let lamp = Class::named("FloorLamp");
        let goal = Goal { lamp, ..goal(GoalKind::LookAtObjInLight, "Mug", "FloorLamp") };
        let (Instance::Object(mug), Instance::Fixture(light)) =
            (named(&scene, &world, "Mug"), named(&scene, &world, "FloorLamp"))
        else {
            panic!("no mug, no lamp")
        };
        world.held = Some(mug);
        world.objects[usize::from(mug)].parent = Parent::Hand;
        let met = |world: &World| goal_met(&goal, &scene, world);
        let mut poses = Vec::new();
        for &cell in &scene.cells {
            for heading in Heading::ALL {
                world.agent = Pose { cell, heading, horizon: 0 };
                world.fixtures[usize::from(light)].on = false;
                assert!(!met(&world), "it is dark");
                world.fixtures[usize::from(light)].on = true;
                poses.push((world.agent, met(&world)));
            }
        }
        let near = poses.iter().filter(|(_, met)| *met).count();
        assert!(near > 0 && near < poses.len() / 2, "{near} of {}", poses.len());
        let turned = |pose: Pose| Pose { heading: pose.heading.left().left(), ..pose };
        assert!(poses.iter().filter(|(_, met)| *met).all(|(pose, _)| poses.contains(&(turned(*pose), false))));
    }

    #[test]
    fn two_things_must_be_in_the_same_receptacle() {
        let (scene, mut world) = kitchen();
        let two = goal(GoalKind::PickTwoObjAndPlace, "Mug", "DiningTable");
        assert!(!goal_met(&two, &scene, &world));
        let Instance::Object(second) = named(&scene, &world, "Mug2") else { panic!("no mug") };
        world.objects[usize::from(second)].parent = Parent::In(named(&scene, &world, "DiningTable"));
        assert!(goal_met(&two, &scene, &world));
    }

    #[test]
    fn the_changed_thing_itself_must_be_in_place() {
        let (scene, mut world) = kitchen();
        let cool = goal(GoalKind::PickCoolThenPlaceInRecep, "Mug", "DiningTable");
        let Instance::Object(second) = named(&scene, &world, "Mug2") else { panic!("no mug") };
        world.objects[usize::from(second)].cold = true;
        assert!(!goal_met(&cool, &scene, &world), "the cold mug is in the cabinet");
        let Instance::Object(first) = named(&scene, &world, "Mug") else { panic!("no mug") };
        world.objects[usize::from(first)].cold = true;
        assert!(goal_met(&cool, &scene, &world));
    }
}
