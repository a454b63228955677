//! Whether an agent there would have seen and reached what was acted on, and what kept it from that.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use serde::Serialize;

use crate::domain::world::{Instance, Parent};
use crate::domain::{Action, ActionType, Class, Scene, Trajectory, World};
use crate::house::bounds::projected_bounds;
use crate::house::outcome::Reason;
use crate::house::render::Renderer;
use crate::house::view::{Frame, View, actionable, decode};
use crate::house::{House, Replay};

/// Why a target cannot be acted on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Cause {
    /// It is seen, and out of reach.
    TooFar,
    /// It lies outside the frame.
    OutOfFrame,
    /// Too few pixels show it.
    TooSmall,
    /// A wall, the floor, or nothing that has a class is in front of it.
    HiddenByStructure,
    /// What holds it is in front of it.
    HiddenByOwn(Class),
    /// Something else is.
    HiddenBy(Class),
}

impl std::fmt::Display for Cause {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Cause::TooFar => f.write_str("too far"),
            Cause::OutOfFrame => f.write_str("out of the frame"),
            Cause::TooSmall => f.write_str("too small"),
            Cause::HiddenByStructure => f.write_str("hidden by a wall or the floor"),
            Cause::HiddenByOwn(class) => write!(f, "hidden by its own {class}"),
            Cause::HiddenBy(class) => write!(f, "hidden by a {class}"),
        }
    }
}

/// A kind of interaction that a recording holds and an agent there could not have taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub(crate) struct Miss {
    /// What was done.
    pub(crate) action: ActionType,
    /// To what.
    pub(crate) object: Class,
    /// What that lay in.
    pub(crate) receptacle: Option<Class>,
    /// What kept it from being acted on.
    pub(crate) cause: Cause,
}

/// How often each kind of miss came about.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct MissCount {
    /// Which.
    #[serde(flatten)]
    pub(crate) miss: Miss,
    /// How often.
    pub(crate) count: usize,
}

/// The kinds of misses, the most frequent first.
pub(super) fn ranked(misses: impl Iterator<Item = Miss>) -> Vec<MissCount> {
    let mut counts: BTreeMap<Miss, usize> = BTreeMap::new();
    misses.for_each(|miss| *counts.entry(miss).or_default() += 1);
    let mut ranked: Vec<MissCount> = counts.into_iter().map(|(miss, count)| MissCount { miss, count }).collect();
    ranked.sort_by_key(|kind| std::cmp::Reverse(kind.count));
    ranked
}

/// Every interaction of a recording whose target an agent there could not have acted on, with the action's number. `pictures`
/// is a folder that takes what the agent sees then.
///
/// # Errors
/// When a picture cannot be written.
pub(super) fn misses(
    scene: &Scene,
    trajectory: &Trajectory,
    pictures: Option<&Path>,
) -> anyhow::Result<Vec<(usize, Miss)>> {
    let mut renderer = Renderer::new(House::FRAME);
    let mut replay = Replay::new(scene, trajectory.start.clone(), &trajectory.actions);
    let mut found = Vec::new();
    for number in 0..trajectory.actions.len() {
        let before = replay.world().clone();
        let Some((action, outcome)) = replay.step() else { break };
        let Some(target) = action.target.filter(|_| outcome.is_done()) else { continue };
        let frame = renderer.draw(scene, &before);
        let Err(reason) = actionable(scene, &before, &View::of(frame), action.kind, target) else { continue };
        found.push((number, Miss::of(scene, &before, frame, (action, target), &reason)));
        if let Some(folder) = pictures {
            let file = folder.join(format!("{}-{number}.png", trajectory.id.replace('/', "-")));
            let bounds = projected_bounds(scene, &before, before.agent, target);
            picture(frame, bounds, &file).with_context(|| format!("cannot write {}", file.display()))?;
        }
    }
    Ok(found)
}

impl Miss {
    fn of(scene: &Scene, world: &World, frame: &Frame, (action, target): (Action, Instance), reason: &Reason) -> Miss {
        let class = |instance| world.class_of(scene, instance).unwrap_or_default();
        let holder = match target {
            Instance::Object(index) => world.object(index).and_then(|object| match object.parent {
                Parent::In(holder) => Some(holder),
                _ => None,
            }),
            Instance::Fixture(_) => None,
        };
        let cause = match (reason, projected_bounds(scene, world, world.agent, target)) {
            (Reason::TooFar { .. }, _) => Cause::TooFar,
            (_, None) => Cause::OutOfFrame,
            (_, Some(bounds)) => match in_front(frame, bounds, target) {
                Some(front) if front == target => Cause::TooSmall,
                Some(front) if Some(front) == holder => Cause::HiddenByOwn(class(front)),
                Some(front) => Cause::HiddenBy(class(front)),
                None => Cause::HiddenByStructure,
            },
        };
        Miss { action: action.kind, object: class(target), receptacle: holder.map(class), cause }
    }
}

/// What most pixels show within bounds of the frame; the target itself where any do. `None` for structure.
fn in_front(frame: &Frame, [left, top, right, bottom]: [f32; 4], target: Instance) -> Option<Instance> {
    let pixel = |edge: f32, size: usize| ((edge * size as f32 / 300.0) as usize).min(size - 1);
    let (columns, rows) =
        (pixel(left, frame.width)..=pixel(right, frame.width), pixel(top, frame.height)..=pixel(bottom, frame.height));
    let mut counts: BTreeMap<u16, usize> = BTreeMap::new();
    for row in rows {
        for column in columns.clone() {
            *counts.entry(frame.ids[row * frame.width + column]).or_default() += 1;
        }
    }
    if counts.keys().any(|&code| decode(code) == Some(target)) {
        return Some(target);
    }
    counts.into_iter().max_by_key(|(_, count)| *count).and_then(|(code, _)| decode(code))
}

/// The frame as PNG, with a red outline where the target would be seen.
fn picture(frame: &Frame, bounds: Option<[f32; 4]>, file: &Path) -> anyhow::Result<()> {
    let mut rgb = frame.rgb.clone();
    let (width, height) = (frame.width, frame.height);
    if let Some([left, top, right, bottom]) = bounds {
        let at = |edge: f32, size: usize| ((edge * size as f32 / 300.0) as usize).min(size - 1);
        let (left, right, top, bottom) = (at(left, width), at(right, width), at(top, height), at(bottom, height));
        let across = (left..=right).flat_map(|x| [(x, top), (x, bottom)]);
        let down = (top..=bottom).flat_map(|y| [(left, y), (right, y)]);
        for (x, y) in across.chain(down) {
            rgb[3 * (y * width + x)..][..3].copy_from_slice(&[255, 0, 0]);
        }
    }
    image::save_buffer(file, &rgb, width as u32, height as u32, image::ColorType::Rgb8)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::house::testing::{kitchen, named};
    use crate::house::view::{code, reachable};

    #[test]
    fn what_keeps_a_target_from_being_acted_on_is_told() {
        let (scene, mut world) = kitchen();
        let target = named(&scene, &world, "Mug");
        let mut renderer = Renderer::new(House::FRAME);
        let mut causes = std::collections::BTreeSet::new();
        for cell in &scene.cells {
            for quarter in 0..4 {
                world.agent.cell = *cell;
                world.agent.heading = crate::domain::Heading::from_quarters(quarter);
                let frame = renderer.draw(&scene, &world);
                if let Err(reason) = reachable(&scene, &world, &View::of(frame), target) {
                    let action = Action::interact(ActionType::Pickup, target);
                    let miss = Miss::of(&scene, &world, frame, (action, target), &reason);
                    assert_eq!(matches!(reason, Reason::TooFar { .. }), miss.cause == Cause::TooFar, "{miss:?}");
                    assert_eq!(miss.object.name(), "Mug");
                    causes.insert(miss.cause);
                }
            }
        }
        assert!(causes.contains(&Cause::TooFar) && causes.contains(&Cause::OutOfFrame), "{causes:?}");
    }

    #[test]
    fn what_is_in_front_is_what_most_pixels_show_and_the_target_where_any_does() {
        let (mug, fridge) = (Instance::Object(0), Instance::Fixture(3));
        let ids = |codes: [u16; 4]| codes.into_iter().flat_map(|code| [code; 4]).collect::<Vec<u16>>();
        let front = |codes: [u16; 4]| {
            let frame = Frame { width: 4, height: 4, rgb: vec![0; 48], depth: vec![1.0; 16], ids: ids(codes) };
            in_front(&frame, [0.0, 0.0, 299.0, 299.0], mug)
        };
        assert_eq!(front([0, code(fridge), code(fridge), 0x8001]), Some(fridge));
        assert_eq!(front([0, 0, 0, code(fridge)]), None, "a wall");
        assert_eq!(front([code(mug), code(fridge), code(fridge), 0]), Some(mug), "too few of its pixels");
    }

    #[test]
    fn misses_are_ranked_by_how_often_they_come_about() {
        let miss = |cause| Miss { action: ActionType::Open, object: Class::NONE, receptacle: None, cause };
        let all = [Cause::TooFar, Cause::OutOfFrame, Cause::OutOfFrame].map(miss);
        let ranked: Vec<(Cause, usize)> = ranked(all.into_iter()).iter().map(|it| (it.miss.cause, it.count)).collect();
        assert_eq!(ranked, [(Cause::OutOfFrame, 2), (Cause::TooFar, 1)]);
    }
}
