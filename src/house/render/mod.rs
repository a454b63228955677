//! Draws what the agent sees: colour, depth and instances in one pass, on one core.

pub(crate) mod draw;
pub(crate) mod furniture;
pub(crate) mod looks;
pub(crate) mod objects;
pub(crate) mod raster;
pub(crate) mod resolve;
pub(crate) mod scene_bodies;
pub(crate) mod solid;

use draw::Brush;
use raster::Raster;
use scene_bodies::{Figure, SceneBodies};

use super::camera::Camera;
use super::view::{self, Frame, View};
use crate::domain::world::{Instance, World};
use crate::domain::{Point, Scene};

/// Draws frames of one size. What it keeps between frames only saves work: a frame depends on the scene and the world alone.
pub struct Renderer {
    frame: Frame,
    raster: Raster,
    bodies: SceneBodies,
}

impl Renderer {
    /// A renderer of square frames with `size` pixels a side.
    pub fn new(size: usize) -> Renderer {
        let pixels = size * size;
        let frame = Frame {
            width: size,
            height: size,
            rgb: vec![0; 3 * pixels],
            depth: vec![0.0; pixels],
            ids: vec![0; pixels],
        };
        Renderer { frame, raster: Raster::new(size), bodies: SceneBodies::default() }
    }

    /// The frame that was drawn last.
    pub(crate) fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Draws what the agent sees. What is shut in, sliced up or in the hand is not in the scene; the held object is shown
    /// small in the lower right corner, as no instance.
    pub fn draw(&mut self, scene: &Scene, world: &World) -> &Frame {
        self.cover(scene, world);
        resolve::resolve(&self.raster, &mut self.frame);
        &self.frame
    }

    /// What would be seen in the drawn frame, without colouring it.
    pub(crate) fn look(&mut self, scene: &Scene, world: &World) -> View {
        self.cover(scene, world);
        let (size, materials) = (self.raster.size(), self.raster.materials());
        let id = |shows: f32| materials[raster::unmark(shows)].id;
        let row = |row: usize| self.raster.row(row).1.iter().flat_map(|group| group.to_array()).take(size).map(id);
        View::of_rows(size, (0..size).map(row))
    }

    /// Decides for every pixel what is in front.
    fn cover(&mut self, scene: &Scene, world: &World) {
        let camera = Camera::of(scene, world.agent);
        let metres = |height: i32| Point::new(0, height, 0).metres().y;
        let ceiling = scene.walls.iter().map(|wall| wall.max.y).max().map(metres);
        self.bodies.update(scene, world);
        self.raster.clear();
        resolve::backdrop(&mut self.raster, &camera, scene.room, metres(scene.floor()), ceiling);
        let mut brush = Brush::new(&mut self.raster, camera);
        for wall in &self.bodies.walls.solids {
            brush.solid(wall, 0);
        }
        for (index, figure) in (0u16..).zip(&self.bodies.fixtures) {
            figure.draw(&mut brush, view::code(Instance::Fixture(index)));
        }
        for ((index, object), figure) in (0u16..).zip(&world.objects).zip(&self.bodies.things) {
            let instance = Instance::Object(index);
            let gone = object.sliced || !figure.is_in_view(&brush);
            if !gone && !world.in_hand(index) && world.shut_in(scene, instance).is_none() {
                figure.draw(&mut brush, view::code(instance));
            }
        }
        if let Some(held) = world.held.and_then(|held| self.bodies.things.get(usize::from(held))) {
            brush.bring_forward(camera.eye(), 0.0);
            for (solid, (centre, axes)) in held.solids.iter().zip(objects::held(&held.solids, held.radius)) {
                brush.local(solid, centre, axes, 0);
            }
        }
    }
}

impl Figure {
    fn is_in_view(&self, brush: &Brush) -> bool {
        !self.solids.is_empty() && brush.sees(self.centre, self.radius)
    }

    fn draw(&self, brush: &mut Brush, id: u16) {
        if self.is_in_view(brush) {
            brush.bring_forward(self.centre, self.forward);
            for solid in &self.solids {
                brush.solid(solid, id);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::domain::place::{Cell, Cuboid, Rect};
    use crate::domain::scene::{Fixture, Surface};
    use crate::domain::world::{Object, Parent};
    use crate::domain::{Class, Heading, Pose, Room};
    use crate::house::bounds::projected_bounds;
    use crate::house::generate;
    use crate::house::view::View;

    /// A piece of furniture that looks south, between two corners.
    fn fixture(class: &str, min: [i32; 3], max: [i32; 3]) -> Fixture {
        let body = Cuboid { min: min.into(), max: max.into() };
        let id = format!("{class} {min:?}");
        let class = Class::named(class).unwrap();
        Fixture {
            id,
            class,
            pivot: body.centre(),
            facing: Heading::South,
            body: vec![body],
            surfaces: vec![],
            stand: None,
        }
    }

    fn scene(fixtures: Vec<Fixture>) -> Scene {
        let (name, format_version) = ("test".to_string(), Scene::FORMAT);
        let (cells, walls, meshes) = (vec![Cell::new(0, 0)], vec![], vec![]);
        Scene { format_version, name, room: Room::Kitchen, agent_y: 900, cells, fixtures, walls, meshes }
    }

    /// The agent at the origin looks north and level; its eye is at y = 1575 mm.
    fn world(scene: &Scene, objects: Vec<Object>) -> World {
        World::new(scene, Pose { cell: Cell::new(0, 0), heading: Heading::North, horizon: 0 }, objects)
    }

    fn object(class: &str, at: [i32; 3]) -> Object {
        Object { class: Class::named(class).unwrap(), at: at.into(), ..Object::default() }
    }

    fn seen(scene: &Scene, world: &World, instance: Instance) -> Option<[u16; 4]> {
        View::of(Renderer::new(300).draw(scene, world)).sighting(instance).map(|sighting| sighting.bounds)
    }

    #[test]
    fn a_box_straight_ahead_covers_the_pixels_worked_out_by_hand() {
        // Front face 1 m away, 0.4 m wide and 0.2 m high: 259.81 px a metre, so columns 98.04 to 201.96, rows 124.02 to 175.98.
        let scene = scene(vec![fixture("Shelf", [-200, 1475, 1000], [200, 1675, 1400])]);
        let world = world(&scene, vec![]);
        assert_eq!(seen(&scene, &world, Instance::Fixture(0)), Some([98, 124, 201, 175]));
        let edges = projected_bounds(&scene, &world, world.agent, Instance::Fixture(0)).unwrap();
        for (edge, expected) in edges.into_iter().zip([98.04, 124.02, 201.96, 175.98]) {
            assert!((edge - expected).abs() < 0.01, "{edges:?}");
        }
        let mut renderer = Renderer::new(300);
        let frame = renderer.draw(&scene, &world);
        assert_eq!(frame.ids[150 * 300 + 97], 0);
        assert!((frame.depth[150 * 300 + 150] - 1.0).abs() < 1e-4);
    }

    #[test]
    fn ids_and_depths_agree_on_what_is_where() {
        let scene = scene(vec![fixture("Shelf", [-200, 1475, 1000], [200, 1675, 1400])]);
        let world = world(&scene, vec![]);
        let mut renderer = Renderer::new(300);
        let frame = renderer.draw(&scene, &world);
        for (pixel, (&id, &depth)) in frame.ids.iter().zip(&frame.depth).enumerate() {
            let below = (pixel / 300) as f32 + 0.5 - 150.0;
            match id {
                0 if below < 0.0 => assert!(depth.is_infinite()),
                // The floor is 1.575 m below the eye.
                0 => assert!((depth - 1.575 * 259.8076 / below).abs() < 1e-3 * depth || depth.is_infinite()),
                _ => assert!((1.0..1.4).contains(&(depth + 1e-4)), "{depth}"),
            }
        }
    }

    #[test]
    fn what_is_nearer_hides_what_is_farther_in_any_order() {
        let near = fixture("Shelf", [-200, 1475, 1000], [200, 1675, 1100]);
        let far = fixture("Shelf", [-100, 1525, 2000], [100, 1625, 2100]);
        for fixtures in [vec![near.clone(), far.clone()], vec![far.clone(), near.clone()]] {
            let behind = fixtures.iter().position(|fixture| *fixture == far).unwrap();
            let scene = scene(fixtures);
            let world = world(&scene, vec![]);
            assert_eq!(seen(&scene, &world, Instance::Fixture(behind as u16)), None);
            assert!(seen(&scene, &world, Instance::Fixture(1 - behind as u16)).is_some());
        }
    }

    #[test]
    fn a_slab_hides_nothing_that_lies_on_it_wherever_its_middle_is() {
        // Its middle is a hand's breadth before the agent, the knife a metre ahead.
        let slab = fixture("CounterTop", [-1500, 850, -1200], [1500, 900, 1500]);
        let scene = scene(vec![slab]);
        let knife = Object { parent: Parent::In(Instance::Fixture(0)), ..object("Knife", [0, 905, 1000]) };
        let mut world = world(&scene, vec![knife]);
        world.agent.horizon = 30;
        let alone = World { objects: world.objects.clone(), ..World::new(&self::scene(vec![]), world.agent, vec![]) };
        let pixels = |scene: &Scene, world: &World| {
            let mut renderer = Renderer::new(300);
            let shown = view::code(Instance::Object(0));
            renderer.draw(scene, world).ids.iter().filter(|&&id| id == shown).count()
        };
        let (on, free) = (pixels(&scene, &world), pixels(&self::scene(vec![]), &alone));
        assert!(free > 50 && on > free / 2, "{on} of {free} pixels");
    }

    #[test]
    fn an_open_drawer_is_drawn_nearer() {
        let scene = scene(vec![fixture("Drawer", [-200, 1300, 1000], [200, 1450, 1320])]);
        let mut world = world(&scene, vec![]);
        let drawer = Instance::Fixture(0);
        let depth = |world: &World| {
            let mut renderer = Renderer::new(300);
            let frame = renderer.draw(&scene, world);
            let shown = frame.ids.iter().zip(&frame.depth).filter(|(id, _)| **id == view::code(drawer));
            shown.map(|(_, depth)| *depth).fold(f32::INFINITY, f32::min)
        };
        let closed = depth(&world);
        world.fixtures[0].open = true;
        assert!((closed - depth(&world) - 0.17).abs() < 0.01);
    }

    #[test]
    fn a_closed_fridge_hides_its_contents_and_an_open_one_shows_them() {
        let mut fridge = fixture("Fridge", [-350, 0, 1000], [350, 1800, 1650]);
        fridge.surfaces = vec![Surface { height: 1400, areas: vec![Rect { min: [-300, 1100], max: [300, 1600] }] }];
        let scene = scene(vec![fridge]);
        let egg = Object { parent: Parent::In(Instance::Fixture(0)), ..object("Egg", [50, 1438, 1200]) };
        let mut world = world(&scene, vec![egg]);
        assert_eq!(seen(&scene, &world, Instance::Object(0)), None);
        world.fixtures[0].open = true;
        assert!(seen(&scene, &world, Instance::Object(0)).is_some());
    }

    #[test]
    fn what_is_held_or_sliced_is_no_instance_in_the_scene() {
        let scene = scene(vec![]);
        let mut world = world(&scene, vec![object("Apple", [0, 1575, 1000])]);
        let apple = Instance::Object(0);
        assert!(seen(&scene, &world, apple).is_some());
        world.objects[0].sliced = true;
        assert_eq!(seen(&scene, &world, apple), None);
        world.objects[0].sliced = false;
        let empty = Renderer::new(300).draw(&scene, &World { objects: vec![], ..world.clone() }).clone();
        (world.held, world.objects[0].parent) = (Some(0), Parent::Hand);
        let held = Renderer::new(300).draw(&scene, &world).clone();
        assert!(held.ids.iter().all(|&id| id == 0));
        // A person sees it in the lower right corner.
        let changed: Vec<usize> = (0..90_000).filter(|&i| held.rgb[3 * i..][..3] != empty.rgb[3 * i..][..3]).collect();
        assert!(changed.len() > 200 && changed.iter().all(|i| i % 300 > 180 && i / 300 > 180), "{}", changed.len());
    }

    #[test]
    fn every_movable_class_fills_most_of_its_measured_bounds() {
        for class in Class::all().filter(|class| class.info().pickupable) {
            let scene = scene(vec![]);
            let mut world = world(&scene, vec![object(class.name(), [0, 900, 800])]);
            world.agent.horizon = 45;
            let apple = Instance::Object(0);
            let [left, top, right, bottom] = projected_bounds(&scene, &world, world.agent, apple).unwrap();
            let [l, t, r, b] =
                seen(&scene, &world, apple).unwrap_or_else(|| panic!("{class} is not seen")).map(f32::from);
            let share = (r + 1.0 - l) * (b + 1.0 - t) / ((right - left).max(1.0) * (bottom - top).max(1.0));
            assert!(share > 0.55, "{class}: {share}");
        }
    }

    /// A random house whose doors are moved and whose agent is somewhere.
    fn random_world(rng: &mut ChaCha8Rng) -> (Scene, World) {
        let (scene, mut world) = generate::house(Room::ALL[rng.random_range(0..4)], rng.random_range(0..1000));
        world.agent.cell = scene.cells[rng.random_range(0..scene.cells.len())];
        world.agent.heading = Heading::from_quarters(rng.random_range(0..4));
        world.agent.horizon = 15 * rng.random_range(-2..=4);
        for index in 0..scene.fixtures.len() {
            if scene.fixtures[index].class.info().openable && rng.random_bool(0.2) {
                world.fixtures[index].open = true;
            }
        }
        for object in &mut world.objects {
            object.turn = [0, rng.random_range(0..3600), 0];
        }
        (scene, world)
    }

    #[test]
    fn what_is_drawn_of_an_instance_lies_in_its_bounds() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut renderer = Renderer::new(300);
        for _ in 0..60 {
            let (scene, world) = random_world(&mut rng);
            for sighting in View::of(renderer.draw(&scene, &world)).sightings {
                let name = world.class_of(&scene, sighting.instance).unwrap();
                let edges = projected_bounds(&scene, &world, world.agent, sighting.instance).unwrap();
                let [left, top, right, bottom] = sighting.bounds.map(f32::from);
                let out = [edges[0] - left, edges[1] - top, right + 1.0 - edges[2], bottom + 1.0 - edges[3]];
                // Bodies of several parts stick out a little of the round body that was measured.
                let slack = 2.0 + 0.15 * (edges[2] - edges[0]).max(edges[3] - edges[1]);
                assert!(out.iter().all(|&out| out <= slack), "{name}: drawn {:?}, bounds {edges:?}", sighting.bounds);
            }
        }
    }

    #[test]
    fn a_frame_depends_on_nothing_that_was_drawn_before() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut used = Renderer::new(300);
        let mut before = None;
        for _ in 0..12 {
            let (scene, mut world) = random_world(&mut rng);
            used.draw(&scene, &world);
            for state in &mut world.fixtures {
                state.open = !state.open && rng.random_bool(0.3);
            }
            let fresh = Renderer::new(300).draw(&scene, &world).clone();
            assert_eq!(*used.draw(&scene, &world), fresh);
            assert_ne!(before.replace(fresh), Some(used.frame().clone()));
        }
    }

    #[test]
    fn other_sizes_show_the_same() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (scene, world) = random_world(&mut rng);
        let (mut small, mut large) = (Renderer::new(75), Renderer::new(300));
        let (small, large) = (small.draw(&scene, &world), large.draw(&scene, &world));
        let same = (0..75 * 75).filter(|i| small.ids[*i] == large.ids[i / 75 * 4 * 300 + 600 + i % 75 * 4 + 2]);
        assert!(same.count() > 75 * 75 * 9 / 10);
    }
}
