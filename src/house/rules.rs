//! The rules: what each of the 12 actions does to a world. Pure; sight and reach are checked by [`super::view`].

use super::outcome::{Outcome, Reason};
use super::placing;
use crate::domain::class::FixtureEffect;
use crate::domain::place::Pose;
use crate::domain::world::{Instance, Object, Parent, World};
use crate::domain::{Action, ActionType, Class, Point, Scene};

/// Carries out `action`. An impossible one leaves the world as it was and says why.
pub fn apply(scene: &Scene, world: &mut World, action: Action) -> Outcome {
    match check(scene, world, action) {
        Ok(()) => {
            perform(scene, world, action);
            Outcome::Done
        }
        Err(reason) => Outcome::Impossible(reason),
    }
}

/// Whether the rules allow `action` now, sight and reach aside.
pub(crate) fn check(scene: &Scene, world: &World, action: Action) -> Result<(), Reason> {
    let agent = &world.agent;
    match action.kind {
        ActionType::MoveAhead if !scene.has_cell(agent.cell.ahead(agent.heading)) => return Err(Reason::Blocked),
        ActionType::LookUp if agent.horizon <= Pose::UP => return Err(Reason::HighestLook),
        ActionType::LookDown if agent.horizon >= Pose::DOWN => return Err(Reason::LowestLook),
        kind if !kind.is_interaction() => return Ok(()),
        _ => {}
    }
    let target = action.target.ok_or(Reason::NoTarget)?;
    let class = world.class_of(scene, target).ok_or(Reason::UnknownTarget)?;
    if let Instance::Object(index) = target
        && world.in_hand(index)
    {
        return Err(Reason::InHand(class));
    }
    if let Some(container) = world.shut_in(scene, target) {
        let container = world.class_of(scene, container).unwrap_or_default();
        return Err(Reason::ShutIn { inside: class, container });
    }
    match action.kind {
        ActionType::Pickup => check_pickup(world, target, class),
        ActionType::Put => placement(scene, world, target, class).map(|_| ()),
        ActionType::Open if !class.info().openable => Err(Reason::NotOpenable(class)),
        ActionType::Open if world.is_open(target) => Err(Reason::AlreadyOpen(class)),
        ActionType::Open if world.is_on(target) => Err(Reason::Running(class)),
        ActionType::Close if !class.info().openable => Err(Reason::NotOpenable(class)),
        ActionType::Close if !world.is_open(target) => Err(Reason::Closed(class)),
        ActionType::ToggleOn | ActionType::ToggleOff if !class.info().toggleable => Err(Reason::NotToggleable(class)),
        ActionType::ToggleOn if world.is_on(target) => Err(Reason::AlreadyOn(class)),
        ActionType::ToggleOn if world.is_open(target) => Err(Reason::AlreadyOpen(class)),
        ActionType::ToggleOff if !world.is_on(target) => Err(Reason::AlreadyOff(class)),
        ActionType::Slice => check_slice(world, target, class),
        _ => Ok(()),
    }
}

fn check_pickup(world: &World, target: Instance, class: Class) -> Result<(), Reason> {
    let Instance::Object(index) = target else { return Err(Reason::NotPickupable(class)) };
    if let Some(held) = world.held.and_then(|held| world.object(held)) {
        return Err(Reason::HandFull(held.class));
    }
    match world.object(index) {
        Some(object) if object.sliced => Err(Reason::AlreadySliced(class)),
        _ => Ok(()),
    }
}

fn check_slice(world: &World, target: Instance, class: Class) -> Result<(), Reason> {
    let Instance::Object(index) = target else { return Err(Reason::NotSliceable(class)) };
    let whole = world.object(index).ok_or(Reason::UnknownTarget)?;
    if class.info().slices == 0 || whole.slice_of.is_some() {
        return Err(Reason::NotSliceable(class));
    }
    if whole.sliced {
        return Err(Reason::AlreadySliced(class));
    }
    let held = world.held.and_then(|held| world.object(held));
    if held.is_some_and(|held| held.class.is_knife()) { Ok(()) } else { Err(Reason::NeedsKnife) }
}

/// The held object as a Put into `target` would leave it.
fn placement(scene: &Scene, world: &World, target: Instance, class: Class) -> Result<(u16, Object), Reason> {
    let held = world.held.ok_or(Reason::HandEmpty)?;
    let mut object = world.object(held).ok_or(Reason::HandEmpty)?.clone();
    if !class.info().receptacle {
        return Err(Reason::NotReceptacle(class));
    }
    if class.info().openable && !world.is_open(target) {
        return Err(Reason::Closed(class));
    }
    object.turn = [0, (world.agent.heading.quarters() * 900) as i16, 0];
    let spot = placing::spot(scene, world, &object, target);
    object.at = spot.ok_or(Reason::NoRoom { content: object.class, receptacle: class })?;
    object.parent = Parent::In(target);
    Ok((held, object))
}

/// Carries out an action that [`check`] allows.
fn perform(scene: &Scene, world: &mut World, action: Action) {
    let agent = &mut world.agent;
    match action.kind {
        ActionType::MoveAhead => agent.cell = agent.cell.ahead(agent.heading),
        ActionType::RotateLeft => agent.heading = agent.heading.left(),
        ActionType::RotateRight => agent.heading = agent.heading.right(),
        ActionType::LookUp => agent.horizon -= Pose::LOOK,
        ActionType::LookDown => agent.horizon += Pose::LOOK,
        _ => {
            if let Some(target) = action.target {
                interact(scene, world, action.kind, target);
            }
        }
    }
}

fn interact(scene: &Scene, world: &mut World, kind: ActionType, target: Instance) {
    let class = world.class_of(scene, target).unwrap_or_default();
    match (kind, target) {
        (ActionType::Pickup, Instance::Object(index)) => {
            world.objects[usize::from(index)].parent = Parent::Hand;
            world.held = Some(index);
        }
        (ActionType::Put, _) => put(scene, world, target, class),
        (ActionType::Open, _) => set_open(scene, world, target, true),
        (ActionType::Close, _) => {
            set_open(scene, world, target, false);
            if class.info().effect == Some(FixtureEffect::Cool) {
                change_contents(world, target, |object| object.cold = true);
            }
        }
        (ActionType::ToggleOn, Instance::Fixture(index)) => toggle_on(scene, world, index, class),
        (ActionType::ToggleOff, Instance::Fixture(index)) => world.fixtures[usize::from(index)].on = false,
        (ActionType::Slice, Instance::Object(index)) => slice(scene, world, index, class),
        _ => {}
    }
}

fn put(scene: &Scene, world: &mut World, target: Instance, class: Class) {
    let Ok((held, object)) = placement(scene, world, target, class) else { return };
    let from = world.objects[usize::from(held)].at;
    let by = Point::new(object.at.x - from.x, object.at.y - from.y, object.at.z - from.z);
    world.objects[usize::from(held)] = object;
    world.held = None;
    placing::carry_contents(world, Instance::Object(held), by);
}

fn set_open(scene: &Scene, world: &mut World, target: Instance, open: bool) {
    match target {
        Instance::Fixture(index) => {
            world.fixtures[usize::from(index)].open = open;
            let shift = placing::drawer_shift(scene, index);
            let by = if open { shift } else { Point::new(-shift.x, -shift.y, -shift.z) };
            placing::carry_contents(world, target, by);
        }
        Instance::Object(index) => world.objects[usize::from(index)].open = open,
    }
}

fn toggle_on(scene: &Scene, world: &mut World, index: u16, class: Class) {
    world.fixtures[usize::from(index)].on = true;
    match class.info().effect {
        Some(FixtureEffect::Heat) => change_contents(world, Instance::Fixture(index), |object| object.hot = true),
        Some(FixtureEffect::Rinse) => {
            if let Some(basin) = nearest_basin(scene, scene.fixtures[usize::from(index)].pivot) {
                change_contents(world, basin, |object| object.clean = true);
            }
        }
        Some(FixtureEffect::Cool) | None => {}
    }
}

/// The sink basin that a faucet at `pivot` runs into.
pub(crate) fn nearest_basin(scene: &Scene, pivot: Point) -> Option<Instance> {
    let basins = (0u16..).zip(&scene.fixtures).filter(|(_, fixture)| fixture.class.info().basin);
    let nearest = basins.min_by(|(_, a), (_, b)| a.pivot.distance(pivot).total_cmp(&b.pivot.distance(pivot)));
    nearest.map(|(index, _)| Instance::Fixture(index))
}

fn change_contents(world: &mut World, receptacle: Instance, change: impl Fn(&mut Object)) {
    let inside: Vec<u16> = world.contents(receptacle).collect();
    for index in inside {
        change(&mut world.objects[usize::from(index)]);
    }
}

/// Cuts an object: it stays as `sliced`, and its slices appear along its width, in the same receptacle.
fn slice(scene: &Scene, world: &mut World, index: u16, class: Class) {
    let whole = &world.objects[usize::from(index)];
    let count = class.info().slices;
    let mut slices = Vec::with_capacity(usize::from(count));
    for part in 1..=count {
        let mut slice = Object { slice_of: Some((index, part)), ..whole.clone() };
        let [thickness, height, _] = slice.shape_in(scene).1;
        // Twice the signed place in the row, so that an even count stays centred in whole numbers.
        let along = (2 * i32::from(part) - i32::from(count) - 1) * thickness / 2;
        let (dx, dz) = match (i32::from(whole.turn[1]) + 450).rem_euclid(3600) / 900 {
            0 => (along, 0),
            1 => (0, -along),
            2 => (-along, 0),
            _ => (0, along),
        };
        let support = whole.at.y - class.info().rest;
        slice.at = Point::new(whole.at.x + dx, support + height / 2, whole.at.z + dz);
        slice.turn = [0, whole.turn[1], 0];
        slices.push(slice);
    }
    world.objects[usize::from(index)].sliced = true;
    world.objects.extend(slices);
}
