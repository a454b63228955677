//! Lines of sight that recordings prove free: what the expert acted on was in its frame, so nothing stood between.

use glam::Vec3;

use crate::domain::place::Cuboid;
use crate::domain::world::{Instance, Object, Parent, World};
use crate::domain::{Scene, Trajectory};
use crate::house::camera::Camera;
use crate::house::render::Renderer;
use crate::house::view::{FEWEST_PIXELS, Frame, View, decode, reachable};
use crate::house::{House, Replay};

/// At most so many lines stand for a target.
const LINES: usize = 150;
/// A line ends this much before its target, as a share of its length.
const SHORT: f32 = 0.01;

/// A line from the eye to a point of what was acted on. Metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    pub(crate) eye: Vec3,
    pub(crate) end: Vec3,
}

impl Line {
    /// The part of the line that runs through a box, as its two ends.
    pub(crate) fn through(&self, cuboid: &Cuboid) -> Option<[Vec3; 2]> {
        let (min, max) = (cuboid.min.metres(), cuboid.max.metres());
        let along = self.end - self.eye;
        let (mut enter, mut leave) = (0.0f32, 1.0 - SHORT);
        for axis in 0..3 {
            let (from, by) = (self.eye[axis], along[axis]);
            if by.abs() < 1e-6 {
                if from < min[axis] || max[axis] < from {
                    return None;
                }
                continue;
            }
            let (a, b) = ((min[axis] - from) / by, (max[axis] - from) / by);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter < leave).then(|| [self.eye + along * enter, self.eye + along * leave])
    }

    /// Where the line crosses a plane across an axis; `None` when it does not.
    pub(crate) fn crossing(&self, axis: usize, at: f32) -> Option<Vec3> {
        let by = self.end[axis] - self.eye[axis];
        let share = (at - self.eye[axis]) / by;
        (by.abs() > 1e-6 && (0.0..=1.0).contains(&share)).then(|| self.eye + (self.end - self.eye) * share)
    }
}

/// An interaction, whose target was seen.
#[derive(Clone, Debug)]
pub(crate) struct SeenTarget {
    /// Before the interaction.
    world: World,
    pub(crate) target: Instance,
    /// What it lies in, at any depth.
    pub(crate) holders: Vec<Instance>,
    /// It lies where it was recorded: what is put away may lie elsewhere here.
    pub(crate) as_recorded: bool,
    pub(crate) lines: Vec<Line>,
    /// The pixels that the lines go through.
    pixels: Vec<usize>,
}

/// What stands before a hidden target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hider {
    /// A wall, or what carries a counter.
    Structure,
    Fixture(u16),
}

impl Hider {
    /// Its number, when it is furniture.
    pub(crate) fn fixture(self) -> Option<u16> {
        match self {
            Hider::Structure => None,
            Hider::Fixture(index) => Some(index),
        }
    }
}

/// The targets of all interactions of a recording, but those that lie out of the frame here.
pub(crate) fn seen_targets(scene: &Scene, trajectory: &Trajectory) -> Vec<SeenTarget> {
    let mut replay = Replay::new(scene, trajectory.start.clone(), &trajectory.actions);
    let mut boxes = trajectory.boxes.iter();
    let mut found = Vec::new();
    while let Some(action) = replay.upcoming() {
        let recorded = if action.kind.is_interaction() { boxes.next().copied().unwrap_or_default() } else { [0; 4] };
        let before = action.target.map(|target| (target, replay.world().clone()));
        let Some((_, outcome)) = replay.step() else { break };
        let Some((target, world)) = before.filter(|_| outcome.is_done()) else { continue };
        found.extend(SeenTarget::new(scene, world, target, recorded));
    }
    found
}

impl SeenTarget {
    fn new(scene: &Scene, world: World, target: Instance, recorded: [u16; 4]) -> Option<SeenTarget> {
        let alone = alone(scene, &world, target)?;
        let mut renderer = Renderer::new(House::FRAME);
        let frame = renderer.draw(&alone.0, &alone.1);
        let shown = (0..frame.ids.len()).filter(|&pixel| frame.ids[pixel] != 0).collect::<Vec<_>>();
        let [left, top, right, bottom] = recorded.map(usize::from);
        let recorded = |pixel: &usize| {
            let (x, y) = (pixel % frame.width, pixel / frame.width);
            (left..right).contains(&x) && (top..bottom).contains(&y)
        };
        let seen: Vec<usize> = shown.iter().copied().filter(recorded).collect();
        let as_recorded = agrees(&shown, frame.width, [left, top, right, bottom]);
        let pixels = if seen.len() >= FEWEST_PIXELS as usize { seen } else { shown };
        if pixels.len() < FEWEST_PIXELS as usize {
            return None;
        }
        let pixels: Vec<usize> = pixels.iter().copied().step_by(pixels.len().div_ceil(LINES)).collect();
        let camera = Camera::of(scene, world.agent);
        let line = |&pixel: &usize| {
            let (column, row) = ((pixel % frame.width) as f32 + 0.5, (pixel / frame.width) as f32 + 0.5);
            Line { eye: camera.eye(), end: camera.unproject(column, row, frame.depth[pixel]) }
        };
        let lines = pixels.iter().map(line).collect();
        let holders = world.containers_of(target).collect();
        Some(SeenTarget { world, target, holders, as_recorded, lines, pixels })
    }

    /// Whether an interaction in the same state has been taken.
    pub(crate) fn same(&self, other: &SeenTarget) -> bool {
        self.target == other.target && self.world.agent == other.world.agent && self.lines == other.lines
    }

    /// What stands before the target, by how much of it; nothing once enough of it is seen.
    pub(crate) fn hiders(&self, scene: &Scene, renderer: &mut Renderer) -> Vec<Hider> {
        /// So much of what was seen has to be seen, and what hides less than a share of it may stay.
        const ENOUGH: usize = 8;
        const LITTLE: usize = 20;
        let frame = renderer.draw(scene, &self.world);
        let mut counts: Vec<(usize, Option<Instance>)> = Vec::new();
        for &pixel in &self.pixels {
            let shows = decode(frame.ids[pixel]);
            match counts.iter_mut().find(|(_, known)| *known == shows) {
                Some((count, _)) => *count += 1,
                None => counts.push((1, shows)),
            }
        }
        let shown = counts.iter().find(|(_, shows)| *shows == Some(self.target)).map_or(0, |(count, _)| *count);
        if shown * ENOUGH >= self.pixels.len() && self.is_seen(scene, frame) {
            return Vec::new();
        }
        counts.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        counts.retain(|(count, _)| count * LITTLE >= self.pixels.len());
        let hider = |(_, shows): (usize, Option<Instance>)| match shows {
            None => Some(Hider::Structure),
            Some(Instance::Fixture(index)) if shows != Some(self.target) => Some(Hider::Fixture(index)),
            Some(_) => None,
        };
        counts.into_iter().filter_map(hider).collect()
    }

    /// Whether the agent does not see it here.
    pub(crate) fn is_hidden(&self, scene: &Scene, renderer: &mut Renderer) -> bool {
        !self.is_seen(scene, renderer.draw(scene, &self.world))
    }

    fn is_seen(&self, scene: &Scene, frame: &Frame) -> bool {
        reachable(scene, &self.world, &View::of(frame), self.target).is_ok()
    }
}

/// Whether most of the recorded box, which shows what was visible, lies within the bounds of the pixels.
fn agrees(pixels: &[usize], width: usize, [left, top, right, bottom]: [usize; 4]) -> bool {
    let range = |of: &dyn Fn(usize) -> usize| {
        let all = || pixels.iter().map(|&pixel| of(pixel));
        all().min().zip(all().max().map(|most| most + 1)).unwrap_or_default()
    };
    let (columns, rows) = (range(&|pixel| pixel % width), range(&|pixel| pixel / width));
    let shared = |low: usize, high: usize, (from, to): (usize, usize)| high.min(to).saturating_sub(low.max(from));
    let area = (right - left) * (bottom - top);
    2 * shared(left, right, columns) * shared(top, bottom, rows) > area
}

/// A scene with nothing in it but the target, as it is.
fn alone(scene: &Scene, world: &World, target: Instance) -> Option<(Scene, World)> {
    let (mut fixtures, mut states, mut objects) = (Vec::new(), Vec::new(), Vec::new());
    match target {
        Instance::Fixture(index) => {
            fixtures.push(scene.fixture(index)?.clone());
            states.push(*world.fixtures.get(usize::from(index))?);
        }
        Instance::Object(index) => objects.push(Object { parent: Parent::Floor, ..world.object(index)?.clone() }),
    }
    let scene = Scene { walls: Vec::new(), cells: Vec::new(), fixtures, ..scene.clone() };
    Some((scene, World { held: None, fixtures: states, objects, ..world.clone() }))
}
