//! What to do next for a subtask, from whatever state: the interactions that would bring it forward.
//!
//! The order follows ALFRED's demonstrations: Pickup is `[Open] Pickup [Close]`; Put is `[Open] Put [Close]`; Clean is Put
//! ToggleOn ToggleOff Pickup; Heat is Open Put Close ToggleOn ToggleOff Open Pickup Close; Cool is Open Put Close Open
//! Pickup Close. Each is read off the state, so that it can be entered anywhere.

use super::super::grading::{Grader, describe};
use super::super::rules;
use super::no_way::NoWay;
use crate::domain::class::FixtureEffect;
use crate::domain::skill::{SkillKind, Subtask};
use crate::domain::world::Instance;
use crate::domain::{Action, ActionType, Scene, World};

/// An interaction that would bring a subtask forward.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Aim {
    /// The interaction.
    pub(crate) kind: ActionType,
    /// What it acts on.
    pub(crate) target: Instance,
    /// What comes next, and should be in view already.
    pub(crate) then: Option<Instance>,
    /// About how many interactions follow.
    pub(crate) toll: u32,
}

impl Aim {
    fn new(kind: ActionType, target: Instance, toll: u32) -> Aim {
        Aim { kind, target, then: None, toll }
    }
}

/// What the expert means to do now.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Intent {
    /// Any one of these will do. Empty: the subtask is met by any step.
    pub(crate) aims: Vec<Aim>,
    /// What must not be closed or switched off meanwhile.
    pub(crate) keep: Vec<Instance>,
}

/// What brings the grader's current subtask forward.
///
/// # Errors
/// When nothing does.
pub(crate) fn intent(scene: &Scene, world: &World, grader: &Grader) -> Result<Intent, NoWay> {
    let subtask = grader.subtask().ok_or(NoWay::Finished)?;
    if grader.is_cut_short() {
        return Err(NoWay::CutShort);
    }
    let plan = Planner { scene, world, grader, subtask };
    let intent = if plan.awaits_close() { plan.close() } else { plan.skill() }?;
    Ok(intent)
}

/// The doors that stand open and the taps and ovens that run for nothing: what a tidy expert shuts where it stands.
pub(crate) fn left_open(scene: &Scene, world: &World, intent: &Intent) -> Vec<Aim> {
    let fixtures = (0..scene.fixtures.len() as u16).map(Instance::Fixture);
    let left = fixtures.filter(|fixture| !intent.keep.contains(fixture));
    left.filter_map(|fixture| {
        let class = world.class_of(scene, fixture)?;
        if world.is_open(fixture) {
            return Some(Aim::new(ActionType::Close, fixture, 0));
        }
        let runs =
            world.is_on(fixture) && matches!(class.info().effect, Some(FixtureEffect::Heat | FixtureEffect::Rinse));
        runs.then_some(Aim::new(ActionType::ToggleOff, fixture, 0))
    })
    .collect()
}

struct Planner<'a> {
    scene: &'a Scene,
    world: &'a World,
    grader: &'a Grader,
    subtask: &'a Subtask,
}

impl Planner<'_> {
    fn no_way(&self) -> NoWay {
        NoWay::Nothing { subtask: describe(self.grader.roles(), self.subtask) }
    }

    /// One of `aims`, with everything around their targets left as it is.
    fn any(&self, aims: Vec<Aim>) -> Result<Intent, NoWay> {
        let aims: Vec<Aim> = aims.into_iter().filter(|aim| self.in_vocabulary(aim.target)).collect();
        if aims.is_empty() {
            return Err(self.no_way());
        }
        let mut keep = Vec::new();
        for aim in &aims {
            for target in [Some(aim.target), aim.then].into_iter().flatten() {
                keep.push(target);
                keep.extend(self.world.containers_of(target));
            }
        }
        Ok(Intent { aims, keep })
    }

    fn in_vocabulary(&self, instance: Instance) -> bool {
        self.world.class_of(self.scene, instance).is_some_and(|class| class.in_vocabulary())
    }

    fn fits(&self, instance: Instance) -> bool {
        self.grader.fits(self.scene, self.world, self.subtask.object, instance)
    }

    fn allowed(&self, kind: ActionType, target: Instance) -> bool {
        rules::check(self.scene, self.world, Action::interact(kind, target)).is_ok()
    }

    fn held(&self) -> Option<Instance> {
        self.world.held.map(Instance::Object)
    }

    fn held_fits(&self) -> Option<Instance> {
        self.held().filter(|&held| self.fits(held))
    }

    fn with_effect(&self, effect: FixtureEffect) -> Vec<Instance> {
        let fixtures = (0..self.scene.fixtures.len() as u16).map(Instance::Fixture);
        fixtures
            .filter(|&fixture| {
                self.world.class_of(self.scene, fixture).is_some_and(|class| class.info().effect == Some(effect))
            })
            .collect()
    }

    /// The movable objects that may play the subtask's object and could be taken into the hand.
    fn fitting_objects(&self) -> Vec<Instance> {
        let objects = (0u16..).zip(&self.world.objects).filter(|(_, object)| !object.sliced);
        objects.map(|(index, _)| Instance::Object(index)).filter(|&object| self.fits(object)).collect()
    }

    fn awaits_close(&self) -> bool {
        self.grader.is_half_done()
    }

    /// The subtask's last step: what was opened for it is closed.
    fn close(&self) -> Result<Intent, NoWay> {
        if let Some(shut) = self.grader.to_close() {
            let kind = if self.world.is_open(shut) { ActionType::Close } else { ActionType::Open };
            return self.any(vec![Aim::new(kind, shut, 0)]);
        }
        let open = self.world.instances(self.scene).filter(|&instance| self.allowed(ActionType::Close, instance));
        self.any(open.map(|instance| Aim::new(ActionType::Close, instance, 0)).collect())
    }

    fn skill(&self) -> Result<Intent, NoWay> {
        match self.subtask.skill {
            SkillKind::Pickup => match self.held() {
                Some(held) => self.put_down(held),
                None => self.fetch(&self.fitting_objects(), 0),
            },
            SkillKind::Put => self.put(),
            SkillKind::Slice => self.slice(),
            SkillKind::Toggle => self.toggle(),
            SkillKind::Clean => self.clean(),
            SkillKind::Heat => self.heat(),
            SkillKind::Cool => self.cool(),
        }
    }

    /// The first step towards an interaction with something that may be shut in: opens the outermost closed door.
    fn reach(&self, kind: ActionType, target: Instance, toll: u32) -> Aim {
        let closed = |holder: &Instance| {
            self.world.class_of(self.scene, *holder).is_some_and(|class| class.info().openable)
                && !self.world.is_open(*holder)
        };
        match self.world.containers_of(target).filter(closed).last() {
            Some(shell) => Aim { then: Some(target), ..self.opening(shell, toll + 1) },
            None => Aim::new(kind, target, toll),
        }
    }

    /// Opens something; what runs is stopped first.
    fn opening(&self, closed: Instance, toll: u32) -> Aim {
        match self.world.is_on(closed) {
            true => Aim::new(ActionType::ToggleOff, closed, toll + 1),
            false => Aim::new(ActionType::Open, closed, toll),
        }
    }

    /// Takes one of `objects` into the hand, which must be empty or is emptied first.
    fn fetch(&self, objects: &[Instance], toll: u32) -> Result<Intent, NoWay> {
        if let Some(held) = self.held() {
            return self.put_down(held);
        }
        self.any(objects.iter().map(|&object| self.reach(ActionType::Pickup, object, toll)).collect())
    }

    /// Frees the hand at whatever takes the thing, where people keep such things if it is no detour.
    fn put_down(&self, held: Instance) -> Result<Intent, NoWay> {
        let content = self.world.class_of(self.scene, held).unwrap_or_default();
        let aims = self.world.instances(self.scene).filter_map(|receptacle| {
            let class = self.world.class_of(self.scene, receptacle)?;
            if !class.info().receptacle || !self.in_vocabulary(receptacle) {
                return None;
            }
            let odd = if class.holds(content) { 0 } else { 6 };
            let movable = if matches!(receptacle, Instance::Object(_)) { 10 } else { 0 };
            if class.info().openable && !self.world.is_open(receptacle) {
                let shut = self.world.shut_in(self.scene, receptacle).is_some();
                return (!shut).then(|| self.opening(receptacle, 12 + odd + movable));
            }
            let door = if class.info().openable { 8 } else { 0 };
            self.allowed(ActionType::Put, receptacle)
                .then(|| Aim::new(ActionType::Put, receptacle, odd + movable + door))
        });
        self.any(aims.collect())
    }

    /// Puts what is held into one of `receptacles`.
    fn put_into(&self, receptacles: &[Instance], toll: u32) -> Result<Intent, NoWay> {
        let aims = receptacles.iter().filter_map(|&receptacle| {
            if self.world.shut_in(self.scene, receptacle).is_some() {
                return Some(self.reach(ActionType::Put, receptacle, toll));
            }
            let openable = self.world.class_of(self.scene, receptacle)?.info().openable;
            if openable && !self.world.is_open(receptacle) {
                return Some(self.opening(receptacle, toll + 2));
            }
            self.allowed(ActionType::Put, receptacle).then(|| Aim::new(ActionType::Put, receptacle, toll))
        });
        self.any(aims.collect())
    }

    fn put(&self) -> Result<Intent, NoWay> {
        if self.held_fits().is_none() {
            return self.fetch(&self.fitting_objects(), 1);
        }
        let role = self.subtask.receptacle.ok_or_else(|| self.no_way())?;
        let fitting: Vec<Instance> = self
            .world
            .instances(self.scene)
            .filter(|&instance| self.grader.fits(self.scene, self.world, role, instance))
            .filter(|&instance| !matches!(instance, Instance::Object(index) if self.world.in_hand(index)))
            .collect();
        if fitting.is_empty()
            && let Some(Instance::Object(index)) = self.grader.binding(role)
            && self.world.in_hand(index)
        {
            // What it should be put into hangs in the hand with it.
            return self.held().ok_or_else(|| self.no_way()).and_then(|held| self.put_down(held));
        }
        self.put_into(&fitting, 0)
    }

    fn slice(&self) -> Result<Intent, NoWay> {
        let whole = |index: u16| self.world.object(index).filter(|object| object.slice_of.is_none());
        let objects = (0..self.world.objects.len() as u16).filter(|&index| whole(index).is_some());
        let fitting: Vec<Instance> = objects.map(Instance::Object).filter(|&object| self.fits(object)).collect();
        let cut = |object: &Instance| matches!(object, Instance::Object(index) if whole(*index).is_some_and(|object| object.sliced));
        if fitting.iter().any(cut) {
            return Ok(Intent::default());
        }
        let armed = self.world.held.and_then(|held| self.world.object(held)).is_some_and(|held| held.class.is_knife());
        if !armed {
            let knives = (0u16..).zip(&self.world.objects).filter(|(_, object)| object.class.is_knife());
            let knives: Vec<Instance> = knives.map(|(index, _)| Instance::Object(index)).collect();
            return self.fetch(&knives, 1);
        }
        self.any(fitting.into_iter().map(|object| self.reach(ActionType::Slice, object, 0)).collect())
    }

    fn toggle(&self) -> Result<Intent, NoWay> {
        let lamps: Vec<Instance> = self.world.instances(self.scene).filter(|&lamp| self.fits(lamp)).collect();
        if lamps.iter().any(|&lamp| self.world.is_on(lamp)) {
            return Ok(Intent::default());
        }
        self.any(lamps.into_iter().map(|lamp| Aim::new(ActionType::ToggleOn, lamp, 0)).collect())
    }

    fn clean(&self) -> Result<Intent, NoWay> {
        let faucets = self.with_effect(FixtureEffect::Rinse);
        let basin = |faucet: Instance| match faucet {
            Instance::Fixture(index) => {
                self.scene.fixture(index).and_then(|fixture| rules::nearest_basin(self.scene, fixture.pivot))
            }
            Instance::Object(_) => None,
        };
        if self.held_fits().is_some() {
            let mut basins: Vec<Instance> = faucets.iter().filter_map(|&faucet| basin(faucet)).collect();
            basins.dedup();
            return self.put_into(&basins, 3);
        }
        if let Some(held) = self.held() {
            return self.put_down(held);
        }
        let mut aims = Vec::new();
        let mut keep = Vec::new();
        for object in self.fitting_objects() {
            let below = faucets
                .iter()
                .copied()
                .filter(|&faucet| basin(faucet).is_some_and(|basin| self.world.is_in(object, basin)));
            let below: Vec<Instance> = below.collect();
            if self.is_clean(object) {
                match below.iter().find(|&&faucet| self.world.is_on(faucet)) {
                    Some(&faucet) => aims.push(Aim::new(ActionType::ToggleOff, faucet, 1)),
                    None => aims.push(self.reach(ActionType::Pickup, object, 0)),
                }
            } else if below.is_empty() {
                aims.push(self.reach(ActionType::Pickup, object, 4));
            } else {
                aims.extend(below.iter().map(|&faucet| match self.world.is_on(faucet) {
                    true => Aim::new(ActionType::ToggleOff, faucet, 3),
                    false => Aim { then: Some(object), ..Aim::new(ActionType::ToggleOn, faucet, 2) },
                }));
            }
            keep.extend(below);
        }
        let mut intent = self.any(aims)?;
        intent.keep.extend(keep);
        Ok(intent)
    }

    fn is_clean(&self, instance: Instance) -> bool {
        matches!(instance, Instance::Object(index) if self.world.object(index).is_some_and(|object| object.clean))
    }

    fn heat(&self) -> Result<Intent, NoWay> {
        self.change_in(
            FixtureEffect::Heat,
            |object| object.hot,
            |plan, oven, object, hot| {
                let (open, on) = (plan.world.is_open(oven), plan.world.is_on(oven));
                match (hot, open, on) {
                    (true, true, _) => Aim::new(ActionType::Pickup, object, 1),
                    (true, false, true) => Aim::new(ActionType::ToggleOff, oven, 3),
                    (true, false, false) => Aim { then: Some(object), ..Aim::new(ActionType::Open, oven, 2) },
                    (false, true, _) => Aim::new(ActionType::Close, oven, 5),
                    (false, false, false) => Aim::new(ActionType::ToggleOn, oven, 4),
                    (false, false, true) => Aim::new(ActionType::ToggleOff, oven, 5),
                }
            },
        )
    }

    fn cool(&self) -> Result<Intent, NoWay> {
        self.change_in(
            FixtureEffect::Cool,
            |object| object.cold,
            |plan, fridge, object, cold| match (cold, plan.world.is_open(fridge)) {
                (true, true) => Aim::new(ActionType::Pickup, object, 1),
                (true, false) => Aim { then: Some(object), ..Aim::new(ActionType::Open, fridge, 2) },
                (false, true) => Aim::new(ActionType::Close, fridge, 3),
                (false, false) => Aim::new(ActionType::Open, fridge, 4),
            },
        )
    }

    /// Heating and cooling: into the machine, out of it again when it has worked, and its door closed.
    fn change_in(
        &self,
        effect: FixtureEffect,
        is_changed: impl Fn(&crate::domain::Object) -> bool,
        inside: impl Fn(&Self, Instance, Instance, bool) -> Aim,
    ) -> Result<Intent, NoWay> {
        let changed = |instance: Instance| matches!(instance, Instance::Object(index) if self.world.object(index).is_some_and(&is_changed));
        let machines = self.with_effect(effect);
        let intent = match self.held_fits() {
            Some(held) if changed(held) => {
                let open: Vec<Instance> = machines.iter().copied().filter(|&it| self.world.is_open(it)).collect();
                match open.is_empty() {
                    false => self.any(open.into_iter().map(|it| Aim::new(ActionType::Close, it, 0)).collect()),
                    true => self.any(machines.iter().map(|&it| self.opening(it, 1)).collect()),
                }
            }
            Some(_) => self.put_into(&machines, 6),
            None if self.held().is_some() => self.fetch(&[], 0),
            None => {
                let aims = self.fitting_objects().into_iter().map(|object| {
                    match machines.iter().find(|&&it| self.world.is_in(object, it)) {
                        Some(&it) => inside(self, it, object, changed(object)),
                        None => self.reach(ActionType::Pickup, object, 8),
                    }
                });
                self.any(aims.collect())
            }
        };
        intent.map(|mut intent| {
            // Between its steps the machine is left as it is.
            if self.held_fits().is_some() || intent.aims.iter().any(|aim| machines.contains(&aim.target)) {
                intent.keep.extend(machines);
            }
            intent
        })
    }
}
