//! Whether a scene or a world that was read from a file is one that the simulator can hold.
//!
//! The rules index without asking; these checks are what makes that safe for files that others wrote.

use std::collections::BTreeSet;

use crate::domain::place::Rect;
use crate::domain::world::{Instance, Object, Parent, World};
use crate::domain::{Class, Point, Pose, Scene};

/// The farthest from the origin that anything may be, in millimetres: a house is never near this size, and sums stay far from overflow.
pub(crate) const FARTHEST: i32 = 100_000;
/// The longest side of a surface, in millimetres; putting something down tries every point of a raster on it.
pub(crate) const LONGEST_SURFACE: i32 = 20_000;
/// The most objects a world may hold; a drawn frame can tell this many apart and the slices that they fall into.
pub(crate) const MOST_OBJECTS: usize = 2_000;
/// The most fixtures a scene may hold.
pub(crate) const MOST_FIXTURES: usize = 4_000;

/// What does not fit: the field and the reason.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {problem}")]
pub struct Misfit {
    /// The path of the field, as in the file: `objects[3].parent`.
    pub(crate) field: String,
    /// The message, without the field.
    pub(crate) problem: String,
}

impl Misfit {
    /// `field` as a path, such as `fixtures[3].body[0]`.
    pub(crate) fn new(field: impl Into<String>, problem: impl Into<String>) -> Misfit {
        Misfit { field: field.into(), problem: problem.into() }
    }

    /// The same misfit seen from the file that holds the value under `prefix`.
    pub(crate) fn under(self, prefix: &str) -> Misfit {
        Misfit { field: format!("{prefix}.{}", self.field), problem: self.problem }
    }
}

fn require(holds: bool, field: impl FnOnce() -> String, problem: impl FnOnce() -> String) -> Result<(), Misfit> {
    if holds { Ok(()) } else { Err(Misfit { field: field(), problem: problem() }) }
}

fn near(point: Point) -> bool {
    [point.x, point.y, point.z].iter().all(|v| (-FARTHEST..=FARTHEST).contains(v))
}

fn no_farther() -> String {
    format!("farther than {} m from the origin", FARTHEST / 1000)
}

/// Checks a scene.
///
/// # Errors
/// Names the first field that the simulator could not live with.
pub(crate) fn scene(scene: &Scene) -> Result<(), Misfit> {
    let version = scene.format_version;
    require(version == Scene::FORMAT, || "format_version".into(), || format!("{version} is not {}", Scene::FORMAT))?;
    require(!scene.cells.is_empty(), || "cells".into(), || "there is no cell to stand on".into())?;
    let sorted = scene.cells.windows(2).all(|pair| pair[0] < pair[1]);
    require(sorted, || "cells".into(), || "not sorted, or one is there twice".into())?;
    for (i, cell) in scene.cells.iter().enumerate() {
        require(near(cell.centre(0)), || format!("cells[{i}]"), no_farther)?;
    }
    require(near(Point::new(0, scene.agent_y, 0)), || "agent_y".into(), no_farther)?;
    let count = scene.fixtures.len();
    require(count <= MOST_FIXTURES, || "fixtures".into(), || format!("{count} are more than {MOST_FIXTURES}"))?;
    let mut ids = BTreeSet::new();
    for (i, fixture) in scene.fixtures.iter().enumerate() {
        let field = |rest: &str| format!("fixtures[{i}].{rest}");
        require(ids.insert(&fixture.id), || field("id"), || format!("{:?} is there twice", fixture.id))?;
        require(fixture.class != Class::NONE, || field("class"), || "a fixture has a class".into())?;
        require(near(fixture.pivot), || field("pivot"), no_farther)?;
        for (j, part) in fixture.body.iter().enumerate() {
            cuboid(part.min, part.max).map_err(|misfit| misfit.under(&field(&format!("body[{j}]"))))?;
        }
        for (j, surface) in fixture.surfaces.iter().enumerate() {
            let field = |rest: &str| field(&format!("surfaces[{j}].{rest}"));
            require(near(Point::new(0, surface.height, 0)), || field("height"), no_farther)?;
            for (k, area) in surface.areas.iter().enumerate() {
                require(small(area), || field(&format!("areas[{k}]")), || "min above max, or a side too long".into())?;
            }
        }
        if let Some(pose) = fixture.stand {
            // The recorded place need not be a cell of this layout: it is a hint that the expert may ignore.
            horizon(pose).map_err(|misfit| misfit.under(&field("stand")))?;
        }
    }
    for (i, wall) in scene.walls.iter().enumerate() {
        cuboid(wall.min, wall.max).map_err(|misfit| misfit.under(&format!("walls[{i}]")))?;
    }
    for (i, mesh) in scene.meshes.iter().enumerate() {
        let positive = mesh.size.iter().all(|side| (1..=LONGEST_SURFACE).contains(side));
        require(positive, || format!("meshes[{i}].size"), || "a side is not positive, or too long".into())?;
        let [x, y, z] = mesh.offset;
        require(near(Point::new(x, y, z)), || format!("meshes[{i}].offset"), no_farther)?;
    }
    Ok(())
}

fn cuboid(min: Point, max: Point) -> Result<(), Misfit> {
    require(near(min), || "min".into(), no_farther)?;
    require(near(max), || "max".into(), no_farther)?;
    require(min.x <= max.x && min.y <= max.y && min.z <= max.z, || "min".into(), || "above max".into())
}

fn small(area: &Rect) -> bool {
    (0..2).all(|axis| {
        let (min, max) = (area.min[axis], area.max[axis]);
        min <= max && min >= -FARTHEST && max <= FARTHEST && max - min <= LONGEST_SURFACE
    })
}

fn horizon(pose: Pose) -> Result<(), Misfit> {
    let degrees = pose.horizon;
    let fits = (Pose::UP..=Pose::DOWN).contains(&degrees) && degrees % Pose::LOOK == 0;
    require(fits, || "horizon".into(), || format!("{degrees} is not -30 to 60 degrees in steps of 15"))
}

/// Checks that a world fits its scene.
///
/// # Errors
/// Names the first field that does not.
pub fn world(scene: &Scene, world: &World) -> Result<(), Misfit> {
    let (states, fixtures) = (world.fixtures.len(), scene.fixtures.len());
    let uneven = || format!("{states} states, but scene {} has {fixtures} fixtures", scene.name);
    require(states == fixtures, || "fixtures".into(), uneven)?;
    let cell = world.agent.cell;
    let off = || format!("({}, {}) is no cell of scene {}", cell.x, cell.z, scene.name);
    require(scene.has_cell(cell), || "agent.cell".into(), off)?;
    horizon(world.agent).map_err(|misfit| misfit.under("agent"))?;
    for (i, (state, fixture)) in world.fixtures.iter().zip(&scene.fixtures).enumerate() {
        let (class, info) = (fixture.class, fixture.class.info());
        let field = |rest: &str| format!("fixtures[{i}].{rest}");
        require(!state.open || info.openable, || field("open"), || format!("a {class} cannot be open"))?;
        require(!state.on || info.toggleable, || field("on"), || format!("a {class} has no switch"))?;
    }
    let count = world.objects.len();
    require(count <= MOST_OBJECTS, || "objects".into(), || format!("{count} are more than {MOST_OBJECTS}"))?;
    for (i, thing) in world.objects.iter().enumerate() {
        object(scene, world, i, thing).map_err(|misfit| misfit.under(&format!("objects[{i}]")))?;
    }
    let in_hand: Vec<usize> = (0..count).filter(|&i| world.objects[i].parent == Parent::Hand).collect();
    let agrees = in_hand == Vec::from_iter(world.held.map(usize::from));
    require(agrees, || "held".into(), || "not the one object whose parent is the hand".into())
}

fn object(scene: &Scene, world: &World, index: usize, object: &Object) -> Result<(), Misfit> {
    let (class, info) = (object.class, object.class.info());
    require(info.pickupable, || "class".into(), || format!("a {class} is not a movable object"))?;
    require(near(object.at), || "at".into(), no_farther)?;
    let mesh = object.mesh.is_none_or(|mesh| usize::from(mesh) < scene.meshes.len());
    require(mesh, || "mesh".into(), || format!("scene {} has {} meshes", scene.name, scene.meshes.len()))?;
    require(!object.open || info.openable, || "open".into(), || format!("a {class} cannot be open"))?;
    require(!object.sliced || info.slices > 0, || "sliced".into(), || format!("a {class} cannot be sliced"))?;
    if let Parent::In(holder) = object.parent {
        let field = || "parent".to_owned();
        let holder_class = world.class_of(scene, holder);
        let Some(holder_class) = holder_class else { return Err(Misfit::new("parent", "there is no such receptacle")) };
        let holds = holder_class.info().receptacle;
        require(holds, field, || format!("a {holder_class} holds nothing"))?;
        let cyclic = world.is_in(Instance::Object(index as u16), Instance::Object(index as u16));
        require(!cyclic, field, || "it lies in itself".into())?;
    }
    if let Some((whole, part)) = object.slice_of {
        let field = || "slice_of".to_owned();
        let cut = world.object(whole).filter(|whole| whole.class == class && whole.slice_of.is_none());
        require(cut.is_some_and(|cut| cut.sliced), field, || format!("object {whole} is no {class} that was sliced"))?;
        require((1..=info.slices).contains(&part), field, || format!("a {class} falls into {} slices", info.slices))?;
        require(!object.sliced, || "sliced".into(), || "a slice cannot be sliced again".into())?;
    }
    Ok(())
}

/// Checks that an instance exists.
///
/// # Errors
/// Says which one does not; the field is the caller's.
pub(crate) fn instance(scene: &Scene, world: &World, instance: Instance, field: &str) -> Result<(), Misfit> {
    let known = world.class_of(scene, instance).is_some();
    require(known, || field.into(), || format!("there is no such thing in the scene: {instance:?}"))
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::domain::place::{Cell, Cuboid, Heading};
    use crate::domain::scene::{Fixture, Surface};
    use crate::domain::{ActionType, Room, action::Action};
    use crate::house::rules;

    fn class(name: &str) -> Class {
        Class::named(name).unwrap()
    }

    /// A room of 3 x 3 cells with a fridge and a table; an apple in the fridge, a bowl on the table with an egg in it.
    pub(crate) fn small_scene() -> (Scene, World) {
        let fixture = |id: &str, name: &str, x: i32| Fixture {
            id: id.into(),
            class: class(name),
            pivot: Point::new(x, 0, 1000),
            facing: Heading::South,
            body: vec![Cuboid::between(Point::new(x - 200, 0, 800), Point::new(x + 200, 700, 1200))],
            surfaces: vec![Surface { height: 700, areas: vec![Rect { min: [x - 150, 850], max: [x + 150, 1150] }] }],
            stand: None,
        };
        let scene = Scene {
            format_version: Scene::FORMAT,
            name: "small".into(),
            room: Room::Kitchen,
            agent_y: 900,
            cells: (0..3).flat_map(|x| (0..3).map(move |z| Cell::new(x, z))).collect(),
            fixtures: vec![fixture("fridge", "Fridge", 0), fixture("table", "DiningTable", 500)],
            walls: vec![],
            meshes: vec![],
        };
        let object = |name: &str, parent| Object { class: class(name), parent, ..Object::default() };
        let objects = vec![
            object("Apple", Parent::In(Instance::Fixture(0))),
            object("Bowl", Parent::In(Instance::Fixture(1))),
            object("Egg", Parent::In(Instance::Object(1))),
            object("Knife", Parent::In(Instance::Fixture(1))),
        ];
        let world = World::new(&scene, Pose::default(), objects);
        (scene, world)
    }

    fn field_of(change: impl FnOnce(&mut Scene, &mut World)) -> String {
        let (mut plan, mut state) = small_scene();
        change(&mut plan, &mut state);
        let found = scene(&plan).and_then(|()| world(&plan, &state));
        found.err().map_or_else(|| "fits".into(), |misfit| misfit.field)
    }

    #[test]
    fn a_sound_scene_and_world_fit() {
        assert_eq!(field_of(|_, _| ()), "fits");
    }

    #[test]
    fn a_scene_that_cannot_be_lived_in_is_refused() {
        assert_eq!(field_of(|scene, _| scene.cells.clear()), "cells");
        assert_eq!(field_of(|scene, _| scene.cells.reverse()), "cells");
        assert_eq!(field_of(|scene, _| scene.agent_y = i32::MAX), "agent_y");
        assert_eq!(field_of(|scene, _| scene.fixtures[1].id = "fridge".into()), "fixtures[1].id");
        assert_eq!(
            field_of(|scene, _| scene.fixtures[0].surfaces[0].areas[0].max = [90_000, 1150]),
            "fixtures[0].surfaces[0].areas[0]"
        );
        assert_eq!(field_of(|scene, _| scene.fixtures[0].body[0].min.y = 701), "fixtures[0].body[0].min");
    }

    #[test]
    fn a_world_that_does_not_fit_its_scene_is_refused_by_field() {
        assert_eq!(field_of(|_, world| world.fixtures.truncate(1)), "fixtures");
        assert_eq!(field_of(|_, world| world.agent.cell = Cell::new(9, 9)), "agent.cell");
        assert_eq!(field_of(|_, world| world.agent.horizon = 10), "agent.horizon");
        assert_eq!(field_of(|_, world| world.fixtures[1].open = true), "fixtures[1].open");
        assert_eq!(field_of(|_, world| world.objects[0].class = Class::NONE), "objects[0].class");
        assert_eq!(
            field_of(|_, world| world.objects[0].parent = Parent::In(Instance::Fixture(2))),
            "objects[0].parent"
        );
        assert_eq!(field_of(|_, world| world.objects[0].slice_of = Some((0, 1))), "objects[0].slice_of");
        assert_eq!(field_of(|_, world| world.objects[0].mesh = Some(0)), "objects[0].mesh");
        assert_eq!(field_of(|_, world| world.held = Some(0)), "held");
        assert_eq!(field_of(|_, world| world.held = Some(400)), "held");
    }

    #[test]
    fn containment_in_a_circle_is_refused() {
        let circle = |_: &mut Scene, world: &mut World| {
            world.objects[1].parent = Parent::In(Instance::Object(4));
            let bowl = Object { parent: Parent::In(Instance::Object(1)), ..world.objects[1].clone() };
            world.objects.push(bowl);
        };
        assert_eq!(field_of(circle), "objects[1].parent");
        let itself = |_: &mut Scene, world: &mut World| world.objects[1].parent = Parent::In(Instance::Object(1));
        assert_eq!(field_of(itself), "objects[1].parent");
    }

    proptest! {
        #[test]
        fn whatever_actions_do_to_a_world_it_still_fits(steps in proptest::collection::vec((0usize..12, 0u16..8, any::<bool>()), 0..60)) {
            let (plan, mut state) = small_scene();
            for (kind, number, fixture) in steps {
                let kind = ActionType::ALL[kind];
                let target = if fixture { Instance::Fixture(number % 2) } else { Instance::Object(number) };
                let action = if kind.is_interaction() { Action::interact(kind, target) } else { Action::navigate(kind) };
                rules::apply(&plan, &mut state, action);
                prop_assert_eq!(world(&plan, &state), Ok(()));
            }
        }
    }
}
