//! What stands in a scene, as bodies that are kept from frame to frame and rebuilt only where the world changed.

use glam::Vec3;

use super::furniture;
use super::objects;
use super::solid::Solid;
use crate::domain::place::Cuboid;
use crate::domain::scene::{Fixture, Mesh, Scene};
use crate::domain::world::{FixtureState, Instance, Object, Parent, World};
use crate::domain::{Point, Room};
use crate::house::extent::Extent;

/// How high the strip along the foot of walls is, in millimetres.
const SKIRTING: i32 = 90;
/// Furniture of at least this radius, in metres, lies in nothing else.
const SMALL: f32 = 0.3;

/// An instance's bodies and a ball around them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Figure {
    /// The bodies.
    pub(crate) solids: Vec<Solid>,
    /// The middle of the ball, in metres.
    pub(crate) centre: Vec3,
    pub(crate) radius: f32,
    /// How far it comes forward where it meets others, in metres.
    pub(crate) forward: f32,
}

impl Figure {
    /// Measured heights of supports and of flat things are off by some millimetres, which would bury a key in a table top:
    /// flat figures come forward a little.
    fn of(solids: Vec<Solid>) -> Figure {
        const FLAT: f32 = 0.06;
        const FORWARD: f32 = 0.025;
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for solid in &solids {
            // How far a body of these axes reaches along x, y and z at most.
            let reach = solid.axes.x_axis.abs() + solid.axes.y_axis.abs() + solid.axes.z_axis.abs();
            low = low.min(solid.centre - reach);
            high = high.max(solid.centre + reach);
        }
        if solids.is_empty() {
            return Figure::default();
        }
        Figure {
            solids,
            centre: (low + high) / 2.0,
            radius: (high - low).length() / 2.0,
            forward: if high.y - low.y < FLAT { FORWARD } else { 0.0 },
        }
    }
}

/// The bodies of a scene and of the world in it.
#[derive(Default)]
pub(crate) struct SceneBodies {
    known: Option<SceneGeometry>,
    states: Vec<FixtureState>,
    objects: Vec<Object>,
    pub(crate) walls: Figure,
    /// One for each fixture.
    pub(crate) fixtures: Vec<Figure>,
    /// One for each movable object.
    pub(crate) things: Vec<Figure>,
}

/// The parts of a scene that its bodies follow from.
#[derive(PartialEq)]
struct SceneGeometry {
    room: Room,
    agent_y: i32,
    fixtures: Vec<Fixture>,
    walls: Vec<Cuboid>,
    meshes: Vec<Mesh>,
}

impl SceneGeometry {
    fn is(&self, scene: &Scene) -> bool {
        self.room == scene.room
            && self.agent_y == scene.agent_y
            && self.walls == scene.walls
            && self.meshes == scene.meshes
            && self.fixtures == scene.fixtures
    }
}

impl SceneBodies {
    /// Brings the bodies up to date. The result depends on the scene and the world only.
    pub(crate) fn update(&mut self, scene: &Scene, world: &World) {
        if !self.known.as_ref().is_some_and(|known| known.is(scene)) {
            *self = SceneBodies {
                known: Some(SceneGeometry {
                    room: scene.room,
                    agent_y: scene.agent_y,
                    fixtures: scene.fixtures.clone(),
                    walls: scene.walls.clone(),
                    meshes: scene.meshes.clone(),
                }),
                walls: Figure::of(walls(scene)),
                ..SceneBodies::default()
            };
        }
        self.follow_fixtures(scene, &world.fixtures);
        self.follow_objects(scene, &world.objects);
    }

    fn follow_fixtures(&mut self, scene: &Scene, states: &[FixtureState]) {
        if self.states == states && self.fixtures.len() == scene.fixtures.len() {
            return;
        }
        let first = self.fixtures.len() != scene.fixtures.len();
        self.fixtures.resize(scene.fixtures.len(), Figure::default());
        let changed = |index: usize| self.states.get(index) != states.get(index);
        for (index, fixture) in scene.fixtures.iter().enumerate() {
            // A counter changes when the door of something built into it opens.
            let around = || {
                furniture::gives_way(fixture)
                    && (0..scene.fixtures.len()).any(|other| {
                        let built_in = &scene.fixtures[other];
                        changed(other)
                            && furniture::is_built_in(built_in)
                            && fixture.body.iter().any(|a| built_in.body.iter().any(|b| furniture::meet(a, b)))
                    })
            };
            if first || changed(index) || around() {
                let figure = Figure::of(furniture::build(scene, index as u16, states));
                // A burner comes out of the slab that it lies in; the slab itself must not come before what lies on it.
                let forward = if figure.radius < SMALL { figure.forward } else { 0.0 };
                self.fixtures[index] = Figure { forward, ..figure };
            }
        }
        self.states = states.to_vec();
    }

    fn follow_objects(&mut self, scene: &Scene, objects: &[Object]) {
        self.objects.truncate(objects.len());
        self.things.resize(objects.len(), Figure::default());
        for (index, object) in objects.iter().enumerate() {
            match self.objects.get_mut(index) {
                Some(known) if known == object => continue,
                Some(known) => known.clone_from(object),
                None => self.objects.push(object.clone()),
            }
            let mut figure = Figure::of(objects::build(scene, index as u16, object));
            figure.forward = figure.forward.max(buried(scene, object));
            self.things[index] = figure;
        }
    }
}

/// How far a thing must come forward because furniture that does not hold it fills the space around its middle, in metres.
/// Boxes that stand for recorded furniture overlap here and there; what lies on one must not vanish in another.
fn buried(scene: &Scene, object: &Object) -> f32 {
    /// How far sight comes from, per height that it has to pass.
    const SLANT: f32 = 1.5;
    let at = Extent::of_object(scene, object).centre;
    let around = |part: &&Cuboid| {
        let (min, max) = (part.min.metres(), part.max.metres());
        at.cmpgt(min).all() && at.cmplt(max).all()
    };
    let holder = match object.parent {
        Parent::In(Instance::Fixture(index)) => usize::from(index),
        Parent::Floor => usize::MAX,
        // What holds the holder is not known here.
        Parent::In(Instance::Object(_)) | Parent::Hand => return 0.0,
    };
    let others = scene.fixtures.iter().enumerate().filter(|(index, _)| *index != holder);
    let parts = others.flat_map(|(_, other)| &other.body).filter(around);
    parts.map(|part| (part.max.metres().y - at.y) * SLANT).fold(0.0, f32::max).min(0.5)
}

fn walls(scene: &Scene) -> Vec<Solid> {
    let colour = match scene.room {
        Room::Kitchen => [0.90, 0.87, 0.78],
        Room::LivingRoom => [0.80, 0.84, 0.80],
        Room::Bedroom => [0.80, 0.82, 0.90],
        Room::Bathroom => [0.84, 0.90, 0.91],
    };
    let strip = |wall: &Cuboid| {
        let (min, max) = (wall.min, wall.max);
        let out = 8;
        Cuboid {
            min: Point::new(min.x - out, min.y, min.z - out),
            max: Point::new(max.x + out, (min.y + SKIRTING).min(max.y), max.z + out),
        }
    };
    let paper = scene.walls.iter().map(|wall| Solid::filling(&Extent::of_cuboid(wall), colour));
    let skirting = scene.walls.iter().map(|wall| Solid::filling(&Extent::of_cuboid(&strip(wall)), [0.95, 0.94, 0.91]));
    paper.chain(skirting).collect()
}
