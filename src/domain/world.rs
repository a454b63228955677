//! A world: the full mutable state of a scene. A value: cheap to clone, comparable, hashable.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::class::{Class, Shape};
use super::place::{Point, Pose};
use super::scene::Scene;

/// One thing in a world: a fixture of the scene, or a movable object, by position in its list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Instance {
    /// `scene.fixtures[i]`.
    Fixture(u16),
    /// `world.objects[i]`.
    Object(u16),
}

/// What holds a movable object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Parent {
    /// The floor, or nothing that is known.
    #[default]
    Floor,
    /// The agent's hand.
    Hand,
    /// A receptacle, fixed or movable.
    In(Instance),
}

/// A movable object.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Object {
    /// Its class; a slice has the class of what it was cut from.
    pub class: Class,
    /// The scene's mesh that it shows, if the scene knows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) mesh: Option<u16>,
    /// Its pivot. Meaningless while it is in the hand, or in something that is.
    pub(crate) at: Point,
    /// Rotation about x, y, z in tenths of a degree, applied z first, then x, then y.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(crate) turn: [i16; 3],
    /// What holds it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub parent: Parent,
    /// For a slice: what it was cut from, and which slice (from 1).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slice_of: Option<(u16, u8)>,
    /// It was cut; its slices are objects of their own and it can no longer be picked up.
    #[serde(default, skip_serializing_if = "is_default")]
    pub sliced: bool,
    /// Its lid is open (laptops, boxes).
    #[serde(default, skip_serializing_if = "is_default")]
    pub open: bool,
    /// It was rinsed under a running faucet.
    #[serde(default, skip_serializing_if = "is_default")]
    pub clean: bool,
    /// It was in a microwave that ran.
    #[serde(default, skip_serializing_if = "is_default")]
    pub hot: bool,
    /// It was in a fridge whose door was closed.
    #[serde(default, skip_serializing_if = "is_default")]
    pub cold: bool,
}

impl Object {
    /// No slice is thinner than this, in millimetres.
    const THINNEST_SLICE: i32 = 15;

    /// Shape, size and offset in millimetres in the object's own frame. A slice is a disc of what it was cut from.
    pub(crate) fn shape_in(&self, scene: &Scene) -> (Shape, [i32; 3], [i32; 3]) {
        let info = self.class.info();
        let whole = match self.mesh.and_then(|index| scene.meshes.get(usize::from(index))) {
            Some(mesh) => (mesh.shape, mesh.size, mesh.offset),
            None => (info.shape, info.size, info.offset),
        };
        match self.slice_of {
            None => whole,
            Some(_) => {
                let (shape, [width, height, depth], _) = whole;
                let thickness = (width / i32::from(info.slices.max(1))).max(Self::THINNEST_SLICE);
                (shape, [thickness, height * 9 / 10, depth * 9 / 10], [0, 0, 0])
            }
        }
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// What can change about a fixture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FixtureState {
    /// Its door or drawer stands open.
    #[serde(default, skip_serializing_if = "is_default")]
    pub open: bool,
    /// It is switched on, or runs.
    #[serde(default, skip_serializing_if = "is_default")]
    pub on: bool,
}

/// The full mutable state of a scene.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct World {
    /// Where the agent stands and looks.
    pub agent: Pose,
    /// Every movable object; slices are appended when something is cut.
    pub objects: Vec<Object>,
    /// One state for each fixture of the scene.
    pub fixtures: Vec<FixtureState>,
    /// The object in the agent's hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held: Option<u16>,
}

impl World {
    /// The world at the start of an episode: every fixture closed and off, nothing in the hand.
    pub(crate) fn new(scene: &Scene, agent: Pose, objects: Vec<Object>) -> World {
        World { agent, objects, fixtures: vec![FixtureState::default(); scene.fixtures.len()], held: None }
    }

    /// The class of an instance; `None` for one that does not exist.
    pub fn class_of(&self, scene: &Scene, instance: Instance) -> Option<Class> {
        match instance {
            Instance::Fixture(i) => scene.fixtures.get(usize::from(i)).map(|fixture| fixture.class),
            Instance::Object(i) => self.objects.get(usize::from(i)).map(|object| object.class),
        }
    }

    /// The movable object of that number.
    pub(crate) fn object(&self, index: u16) -> Option<&Object> {
        self.objects.get(usize::from(index))
    }

    /// Every instance: objects first, then fixtures.
    pub(crate) fn instances(&self, scene: &Scene) -> impl Iterator<Item = Instance> + use<> {
        let objects = (0..self.objects.len() as u16).map(Instance::Object);
        objects.chain((0..scene.fixtures.len() as u16).map(Instance::Fixture))
    }

    /// What directly holds an instance; `None` for fixtures and for objects on the floor or in the hand.
    pub(crate) fn container_of(&self, instance: Instance) -> Option<Instance> {
        match instance {
            Instance::Fixture(_) => None,
            Instance::Object(i) => match self.object(i)?.parent {
                Parent::In(holder) => Some(holder),
                Parent::Floor | Parent::Hand => None,
            },
        }
    }

    /// The chain of receptacles around an instance, innermost first.
    pub fn containers_of(&self, instance: Instance) -> impl Iterator<Item = Instance> {
        // Containment has no cycles; the bound only keeps a malformed file from looping.
        std::iter::successors(self.container_of(instance), |holder| self.container_of(*holder))
            .take(self.objects.len() + 1)
    }

    /// Whether `content` lies in `receptacle`, directly or in something that does.
    pub fn is_in(&self, content: Instance, receptacle: Instance) -> bool {
        self.containers_of(content).any(|holder| holder == receptacle)
    }

    /// The objects that lie in `receptacle`, directly or in something that does.
    pub(crate) fn contents(&self, receptacle: Instance) -> impl Iterator<Item = u16> {
        (0..self.objects.len() as u16).filter(move |&i| self.is_in(Instance::Object(i), receptacle))
    }

    /// Whether the object is in the hand, directly or in something that is.
    pub(crate) fn in_hand(&self, index: u16) -> bool {
        self.held.is_some_and(|held| held == index || self.is_in(Instance::Object(index), Instance::Object(held)))
    }

    /// Whether an instance is open.
    pub fn is_open(&self, instance: Instance) -> bool {
        match instance {
            Instance::Fixture(i) => self.fixtures.get(usize::from(i)).is_some_and(|state| state.open),
            Instance::Object(i) => self.object(i).is_some_and(|object| object.open),
        }
    }

    /// Whether an instance is switched on.
    pub fn is_on(&self, instance: Instance) -> bool {
        matches!(instance, Instance::Fixture(i) if self.fixtures.get(usize::from(i)).is_some_and(|state| state.on))
    }

    /// The first closed receptacle around an instance, if it is shut in.
    pub(crate) fn shut_in(&self, scene: &Scene, instance: Instance) -> Option<Instance> {
        self.containers_of(instance).find(|&holder| {
            self.class_of(scene, holder).is_some_and(|class| class.info().openable) && !self.is_open(holder)
        })
    }

    /// An instance's pivot.
    pub(crate) fn position(&self, scene: &Scene, instance: Instance) -> Option<Point> {
        match instance {
            Instance::Fixture(i) => scene.fixtures.get(usize::from(i)).map(|fixture| fixture.pivot),
            Instance::Object(i) => self.object(i).map(|object| object.at),
        }
    }

    /// A fingerprint of the whole state: equal worlds have equal digests, on every machine.
    pub fn digest(&self) -> String {
        let text = serde_json::to_vec(self).unwrap_or_default();
        Sha256::digest(&text).iter().take(8).map(|byte| format!("{byte:02x}")).collect()
    }
}
