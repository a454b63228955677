//! Chains of skills as ALFRED's seven task types have them, for the things that a house holds.

use rand::Rng;
use rand::seq::{IndexedRandom, SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::fill::hangs;
use crate::domain::skill::{Role, SkillKind, Subtask};
use crate::domain::world::{Instance, Parent};
use crate::domain::{Class, Scene, World};

/// Roles and subtasks under construction.
#[derive(Clone, Debug, Default)]
pub(crate) struct SkillChain {
    /// The parts.
    pub(crate) roles: Vec<Role>,
    /// The steps; `closes` is not known yet.
    pub(crate) subtasks: Vec<Subtask>,
}

/// ALFRED's task types, with the lamp alone and slicing alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TaskKind {
    Place,
    PlaceTwo,
    Movable,
    Change(SkillKind),
    Examine,
    Light,
}

const KINDS: [TaskKind; 8] = [
    TaskKind::Place,
    TaskKind::PlaceTwo,
    TaskKind::Movable,
    TaskKind::Change(SkillKind::Clean),
    TaskKind::Change(SkillKind::Heat),
    TaskKind::Change(SkillKind::Cool),
    TaskKind::Examine,
    TaskKind::Light,
];

/// What there is to make chains of.
pub(crate) struct Stock<'a> {
    scene: &'a Scene,
    world: &'a World,
    /// Movable classes that an action may name, each once.
    movable: Vec<Class>,
    /// Classes of the fixtures that an action may name, each once.
    fixed: Vec<Class>,
}

impl<'a> Stock<'a> {
    /// What a house holds.
    pub(crate) fn of(scene: &'a Scene, world: &'a World) -> Stock<'a> {
        let unique = |mut classes: Vec<Class>| {
            classes.sort_unstable();
            classes.dedup();
            classes.retain(|class| class.in_vocabulary());
            classes
        };
        Stock {
            scene,
            world,
            movable: unique(world.objects.iter().map(|object| object.class).filter(|&class| !hangs(class)).collect()),
            fixed: unique(scene.fixtures.iter().map(|fixture| fixture.class).collect()),
        }
    }

    fn count(&self, class: Class) -> usize {
        self.world.objects.iter().filter(|object| object.class == class).count()
    }

    /// Whether some object of the class is not in a receptacle of that class yet.
    fn is_remote(&self, content: Class, receptacle: Class) -> bool {
        self.world.objects.iter().filter(|object| object.class == content).any(|object| match object.parent {
            Parent::In(holder) => self.world.class_of(self.scene, holder) != Some(receptacle),
            _ => true,
        })
    }

    /// A movable class for which `wanted` holds.
    fn movable(&self, rng: &mut ChaCha8Rng, wanted: impl Fn(Class) -> bool) -> Option<Class> {
        let fitting: Vec<Class> = self.movable.iter().copied().filter(|&class| wanted(class)).collect();
        fitting.choose(rng).copied()
    }

    /// A class of furniture that people put `content` into, and where it is not yet.
    fn place(&self, rng: &mut ChaCha8Rng, content: Class) -> Option<Class> {
        let takes = |class: &Class| class.holds(content) && self.is_remote(content, *class);
        let fitting: Vec<Class> = self.fixed.iter().copied().filter(takes).collect();
        fitting.choose(rng).copied()
    }

    fn fixture(&self, names: &[&str], rng: &mut ChaCha8Rng) -> Option<Class> {
        let fitting: Vec<Class> = self.fixed.iter().copied().filter(|class| names.contains(&class.name())).collect();
        fitting.choose(rng).copied()
    }

    /// An instance of a class that may be in the hand at the start; never one that lies in or holds something.
    pub(crate) fn take(&self, class: Class, rng: &mut ChaCha8Rng) -> Option<u16> {
        let fitting: Vec<u16> = (0u16..)
            .zip(&self.world.objects)
            .filter(|(index, object)| {
                object.class == class && self.world.contents(Instance::Object(*index)).next().is_none()
            })
            .map(|(index, _)| index)
            .collect();
        fitting.choose(rng).copied()
    }
}

impl SkillChain {
    fn role(&mut self, class: Class, slice: bool) -> u8 {
        self.roles.push(Role { class, slice, bound: None, expert: None });
        (self.roles.len() - 1) as u8
    }

    /// The part of a piece of furniture: a class plays at most one.
    fn furniture(&mut self, class: Class) -> u8 {
        match self.roles.iter().position(|role| role.class == class) {
            Some(known) => known as u8,
            None => self.role(class, false),
        }
    }

    fn step(&mut self, skill: SkillKind, object: u8) {
        self.subtasks.push(Subtask { skill, object, receptacle: None, closes: false, literal: None });
    }

    fn put(&mut self, object: u8, receptacle: u8) {
        let receptacle = Some(receptacle);
        self.subtasks.push(Subtask { skill: SkillKind::Put, object, receptacle, closes: false, literal: None });
    }

    fn uses(&self, class: Class) -> bool {
        self.roles.iter().any(|role| role.class == class)
    }

    /// A chain of exactly `length` skills, if this draw gives one. With `in_hand`, the first pickup is done already.
    pub(crate) fn draw(stock: &Stock<'_>, length: usize, in_hand: bool, rng: &mut ChaCha8Rng) -> Option<SkillChain> {
        let mut chain = SkillChain::default();
        let wanted = length + usize::from(in_hand);
        while chain.subtasks.len() < wanted {
            // Somebody who looks at a thing under a lamp still holds it: nothing can follow.
            if matches!(chain.subtasks.as_slice(), [.., held, lit]
                if held.skill == SkillKind::Pickup && lit.skill == SkillKind::Toggle)
            {
                return None;
            }
            let mut kinds = KINDS;
            kinds.shuffle(rng);
            let sliced = rng.random_bool(if wanted >= 4 { 0.5 } else { 0.15 });
            let more = kinds.into_iter().find_map(|kind| chain.clone().with(stock, kind, sliced, rng))?;
            if more.subtasks.len() == chain.subtasks.len() {
                return None;
            }
            chain = more;
        }
        chain.subtasks.truncate(wanted);
        chain.start_holding(stock, usize::from(in_hand), rng)
    }

    /// A chain of one skill; whatever it needs in the hand is there at the start.
    pub(crate) fn single(stock: &Stock<'_>, skill: SkillKind, rng: &mut ChaCha8Rng) -> Option<SkillChain> {
        let lit_alone = rng.random_bool(0.5);
        let mut chain = match skill {
            SkillKind::Pickup | SkillKind::Put => SkillChain::default().with(stock, TaskKind::Place, false, rng)?,
            SkillKind::Slice => SkillChain::default().with(stock, TaskKind::Place, true, rng)?,
            SkillKind::Toggle if lit_alone => SkillChain::default().with(stock, TaskKind::Light, false, rng)?,
            SkillKind::Toggle => SkillChain::default().with(stock, TaskKind::Examine, false, rng)?,
            change => SkillChain::default().with(stock, TaskKind::Change(change), false, rng)?,
        };
        let place = chain.subtasks.iter().position(|subtask| subtask.skill == skill)?;
        chain.subtasks.truncate(place + 1);
        chain.start_holding(stock, place, rng)
    }

    /// The chain without its first `done` skills, which are one pickup or none.
    fn start_holding(mut self, stock: &Stock<'_>, done: usize, rng: &mut ChaCha8Rng) -> Option<SkillChain> {
        match (done, self.subtasks.first()?.skill) {
            (0, _) => {}
            (1, SkillKind::Pickup) => {
                let held = usize::from(self.subtasks.remove(0).object);
                let taken = stock.take(self.roles.get(held)?.class, rng)?;
                self.roles[held].bound = Some(Instance::Object(taken));
            }
            _ => return None,
        }
        self.drop_unused_roles();
        Some(self)
    }

    /// The chain with a further part of that kind.
    fn with(mut self, stock: &Stock<'_>, kind: TaskKind, sliced: bool, rng: &mut ChaCha8Rng) -> Option<SkillChain> {
        let is_new = |chain: &SkillChain, class: Class| !chain.uses(class);
        let works = |class: Class| match kind {
            TaskKind::Change(SkillKind::Heat) => Class::named("Microwave").is_some_and(|oven| oven.holds(class)),
            TaskKind::Change(SkillKind::Cool) => Class::named("Fridge").is_some_and(|fridge| fridge.holds(class)),
            TaskKind::Change(_) => Class::named("Sink").is_some_and(|sink| sink.holds(class)),
            _ => true,
        };
        let machine = match kind {
            TaskKind::Change(SkillKind::Heat) => Some("Microwave"),
            TaskKind::Change(SkillKind::Cool) => Some("Fridge"),
            TaskKind::Change(_) => Some("Faucet"),
            _ => None,
        };
        if let Some(machine) = machine {
            stock.fixture(&[machine], rng)?;
        }
        if kind == TaskKind::Light {
            let lamp = stock.fixture(&["DeskLamp", "FloorLamp"], rng).filter(|&lamp| is_new(&self, lamp))?;
            let lamp = self.role(lamp, false);
            self.step(SkillKind::Toggle, lamp);
            return Some(self);
        }
        let needed = if kind == TaskKind::PlaceTwo && !sliced { 2 } else { 1 };
        let class = stock.movable(rng, |class| {
            is_new(&self, class)
                && works(class)
                && stock.count(class) >= needed
                && (!sliced || class.info().slices > 1 && kind != TaskKind::Examine)
        })?;
        if sliced {
            self.cut(stock, class, rng)?;
        }
        match kind {
            TaskKind::Place | TaskKind::Change(_) => {
                let thing = self.role(class, sliced);
                self.step(SkillKind::Pickup, thing);
                if let TaskKind::Change(skill) = kind {
                    self.step(skill, thing);
                }
                let place = stock.place(rng, class)?;
                let place = self.furniture(place);
                self.put(thing, place);
            }
            TaskKind::PlaceTwo => {
                let place = stock.place(rng, class)?;
                let place = self.furniture(place);
                for _ in 0..2 {
                    let thing = self.role(class, sliced);
                    self.step(SkillKind::Pickup, thing);
                    self.put(thing, place);
                }
            }
            TaskKind::Movable => {
                let holder = stock.movable(rng, |holder| {
                    holder != class && is_new(&self, holder) && holder.info().receptacle && holder.holds(class)
                })?;
                let place = stock.place(rng, holder)?;
                let (thing, holder) = (self.role(class, sliced), self.role(holder, false));
                let place = self.furniture(place);
                self.step(SkillKind::Pickup, thing);
                self.put(thing, holder);
                self.step(SkillKind::Pickup, holder);
                self.put(holder, place);
            }
            TaskKind::Examine => {
                let lamp = stock.fixture(&["DeskLamp", "FloorLamp"], rng).filter(|&lamp| is_new(&self, lamp))?;
                let (thing, lamp) = (self.role(class, false), self.role(lamp, false));
                self.step(SkillKind::Pickup, thing);
                self.step(SkillKind::Toggle, lamp);
            }
            TaskKind::Light => {}
        }
        Some(self)
    }

    /// Takes a knife, cuts something of the class, and puts the knife down.
    fn cut(&mut self, stock: &Stock<'_>, class: Class, rng: &mut ChaCha8Rng) -> Option<()> {
        let knife = stock.movable(rng, |knife| knife.is_knife() && !self.uses(knife))?;
        let rack = stock.place(rng, knife)?;
        let (knife, whole) = (self.role(knife, false), self.role(class, false));
        self.step(SkillKind::Pickup, knife);
        self.step(SkillKind::Slice, whole);
        let rack = self.furniture(rack);
        self.put(knife, rack);
        Some(())
    }

    /// Renumbers the roles that the subtasks still name.
    fn drop_unused_roles(&mut self) {
        let mut kept: Vec<u8> =
            self.subtasks.iter().flat_map(|s| std::iter::once(s.object).chain(s.receptacle)).collect();
        kept.extend((0..self.roles.len() as u8).filter(|&role| self.roles[usize::from(role)].bound.is_some()));
        kept.sort_unstable();
        kept.dedup();
        let number = |role: u8| kept.iter().position(|&other| other == role).unwrap_or_default() as u8;
        for subtask in &mut self.subtasks {
            subtask.object = number(subtask.object);
            subtask.receptacle = subtask.receptacle.map(number);
        }
        self.roles = kept.iter().map(|&role| self.roles[usize::from(role)].clone()).collect();
    }
}
