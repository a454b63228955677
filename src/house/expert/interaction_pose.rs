//! Where to stand for an interaction: a cheap look at the geometry first, then the frame that would be drawn there decides.

use std::collections::{HashMap, HashSet};

use glam::Vec3;

use super::super::bounds::projected_bounds;
use super::super::camera::Camera;
use super::super::extent::Extent;
use super::super::render::Renderer;
use super::super::session::House;
use super::super::view::{self, REACH, View};
use super::super::{placing, rules};
use super::paths::{Paths, WalkableCells};
use super::plan::Aim;
use crate::domain::world::Instance;
use crate::domain::{Action, Cell, Heading, Pose, Scene, World};

/// With fewer pixels than this of its target in view, a better pose is looked for.
pub(super) const WELL_SEEN: u32 = 60;
/// How many more poses are drawn in search of a better one.
const PATIENCE: u32 = 8;
/// What one pose must show of its target's place to be worth drawing, in pixels from the image's edge.
const MARGIN: f32 = 8.0;
/// Steps that a place beside a nearer thing of the same class is put back by: it can only serve if that one is out of view.
const RIVAL: f32 = 4.0;

/// A pose from which an aim may be carried out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InteractionPose {
    /// Position of the aim among those asked for.
    pub(crate) aim: usize,
    /// The number of the pose's cell.
    pub(crate) cell: usize,
    /// Where to stand and look.
    pub(crate) pose: Pose,
    /// Steps to it, plus what speaks against it in steps.
    pub(crate) score: f32,
}

/// From which cells an aim's target was found to be hidden: it then is, whichever way one looks.
type Hidden = HashSet<(usize, usize)>;

/// How a pose serves an aim.
enum Visibility {
    /// The target is the one that the action would choose by its class; with so many pixels.
    Good(u32),
    /// The target is seen, but something nearer of its class would be chosen.
    Rivalled,
    /// The target is not seen.
    Unseen,
    /// The target is seen, but the rules forbid it.
    Forbidden,
}

/// Draws what would be seen from poses, and remembers it while nothing but the agent moves.
pub(crate) struct PoseSearch {
    renderer: Renderer,
    world: World,
    views: HashMap<Pose, View>,
}

impl Default for PoseSearch {
    fn default() -> PoseSearch {
        PoseSearch::new()
    }
}

impl PoseSearch {
    /// A search that has drawn nothing.
    pub(crate) fn new() -> PoseSearch {
        PoseSearch { renderer: Renderer::new(House::FRAME), world: World::default(), views: HashMap::new() }
    }

    /// Searches in `world`; views of another one are dropped. Where the agent stands does not matter.
    pub(crate) fn set_world(&mut self, world: &World, same_scene: bool) {
        let known = &self.world;
        let same = known.objects == world.objects && known.fixtures == world.fixtures && known.held == world.held;
        if !(same && same_scene) {
            self.world = world.clone();
            self.views.clear();
        }
    }

    fn sight(&mut self, scene: &Scene, pose: Pose, aim: &Aim) -> Visibility {
        self.world.agent = pose;
        let world = &self.world;
        let action = |instance| Action::interact(aim.kind, instance);
        if rules::check(scene, world, action(aim.target)).is_err() {
            return Visibility::Forbidden;
        }
        let view = match self.views.entry(pose) {
            std::collections::hash_map::Entry::Occupied(entry) => entry.into_mut(),
            std::collections::hash_map::Entry::Vacant(entry) => entry.insert(self.renderer.look(scene, world)),
        };
        let Some(sighting) = view.sighting(aim.target).copied() else { return Visibility::Unseen };
        if view::actionable(scene, world, view, aim.kind, aim.target).is_err() {
            return Visibility::Unseen;
        }
        let class = world.class_of(scene, aim.target);
        let near = view::nearness(scene, world, aim.target);
        let rivalled = view.sightings.iter().any(|other| {
            other.instance != aim.target
                && world.class_of(scene, other.instance) == class
                && view::nearness(scene, world, other.instance) <= near
                && view::actionable(scene, world, view, aim.kind, other.instance).is_ok()
                && rules::check(scene, world, action(other.instance)).is_ok()
        });
        if rivalled { Visibility::Rivalled } else { Visibility::Good(sighting.pixels) }
    }

    /// The best pose for any of the aims, no further than `limit` steps away if one is given.
    pub(crate) fn find(
        &mut self,
        scene: &Scene,
        floor: &WalkableCells,
        paths: &Paths,
        aims: &[Aim],
        limit: Option<u32>,
    ) -> Option<InteractionPose> {
        let mut stands = Vec::new();
        for (index, aim) in aims.iter().enumerate() {
            propose(scene, &self.world, floor, paths, (index, aim), limit, &mut stands);
        }
        stands.sort_unstable_by(|a, b| a.score.total_cmp(&b.score).then_with(|| (a.aim, a.pose).cmp(&(b.aim, b.pose))));
        let mut hidden = Hidden::new();
        if let Some(stand) = self.first_good(scene, aims, &stands, &mut hidden) {
            return Some(stand);
        }
        if limit.is_some() {
            return None;
        }
        // Of furniture a corner may show where its middle is hidden.
        hidden.retain(|&(aim, _)| matches!(aims[aim].target, Instance::Object(_)));
        // Nothing in the middle of a frame: every pose in whose frame any of the target would lie.
        let mut all = Vec::new();
        for (index, aim) in aims.iter().enumerate() {
            every_pose(scene, &self.world, floor, paths, (index, aim), &mut all);
        }
        all.sort_unstable_by(|a, b| a.score.total_cmp(&b.score).then_with(|| (a.aim, a.pose).cmp(&(b.aim, b.pose))));
        if let Some(stand) = self.first_good(scene, aims, &all, &mut hidden) {
            return Some(stand);
        }
        let mut rest = all.into_iter().filter(|stand| !hidden.contains(&(stand.aim, stand.cell)));
        rest.find(|stand| matches!(self.sight(scene, stand.pose, &aims[stand.aim]), Visibility::Rivalled))
    }

    /// The first stand from which its target is well seen, or else the first from which it is seen at all.
    fn first_good(
        &mut self,
        scene: &Scene,
        aims: &[Aim],
        stands: &[InteractionPose],
        hidden: &mut Hidden,
    ) -> Option<InteractionPose> {
        let mut poor: Option<(InteractionPose, u32)> = None;
        let mut patience = PATIENCE;
        for &stand in stands {
            if hidden.contains(&(stand.aim, stand.cell)) {
                continue;
            }
            match self.sight(scene, stand.pose, &aims[stand.aim]) {
                Visibility::Good(pixels) if pixels >= WELL_SEEN => return Some(stand),
                Visibility::Good(pixels) => {
                    if poor.is_none_or(|(_, fewer)| pixels > 2 * fewer) {
                        poor = Some((stand, pixels));
                    }
                }
                Visibility::Unseen => {
                    hidden.insert((stand.aim, stand.cell));
                }
                Visibility::Rivalled | Visibility::Forbidden => {}
            }
            if poor.is_some() {
                patience -= 1;
                if patience == 0 {
                    break;
                }
            }
        }
        poor.map(|(stand, _)| stand)
    }
}

fn horizons() -> impl Iterator<Item = i16> {
    (Pose::UP..=Pose::DOWN).step_by(Pose::LOOK.unsigned_abs().into())
}

/// The poses within reach of an aim's target from which its middle, or its nearest side, would lie well inside the frame.
fn propose(
    scene: &Scene,
    world: &World,
    floor: &WalkableCells,
    paths: &Paths,
    (index, aim): (usize, &Aim),
    limit: Option<u32>,
    stands: &mut Vec<InteractionPose>,
) {
    let class = world.class_of(scene, aim.target);
    let rivals: Vec<Instance> = world
        .instances(scene)
        .filter(|&other| other != aim.target && world.class_of(scene, other) == class)
        .filter(|&other| rules::check(scene, world, Action::interact(aim.kind, other)).is_ok())
        .collect();
    let hint = match aim.target {
        Instance::Fixture(index) => scene.fixture(index).and_then(|fixture| fixture.stand),
        Instance::Object(_) => None,
    };
    for (number, &cell) in floor.cells().iter().enumerate() {
        let Some(away) = view::distance_from(scene, world, cell, aim.target).filter(|&away| away <= REACH) else {
            continue;
        };
        if Heading::ALL.iter().all(|&heading| paths.steps(number, heading).is_none()) {
            continue;
        }
        let near = view::nearness_from(scene, world, cell, aim.target);
        let rivalled = rivals.iter().any(|&rival| view::nearness_from(scene, world, cell, rival) <= near);
        let places = places(scene, world, aim.target, cell);
        let then = aim.then.map(|then| places_in_reach(scene, world, then, cell));
        for heading in Heading::ALL {
            let Some(steps) = paths.steps(number, heading) else { continue };
            for horizon in horizons() {
                let pose = Pose { cell, heading, horizon };
                let looks = (horizon - paths.start().horizon).unsigned_abs() / Pose::LOOK.unsigned_abs();
                let cost = steps + u32::from(looks);
                if limit.is_some_and(|limit| cost > limit) {
                    continue;
                }
                let camera = Camera::of(scene, pose);
                let Some(aside) = best_aside(&camera, &places) else { continue };
                let mut score = (cost + aim.toll) as f32 + 1.5 * aside + (away / 1000.0 - 0.9).max(0.0) * 2.0;
                if rivalled {
                    score += RIVAL;
                }
                if let Some(places) = &then
                    && best_aside(&camera, places).is_none()
                {
                    score += 2.0;
                }
                if hint == Some(pose) {
                    score -= 0.5;
                }
                stands.push(InteractionPose { aim: index, cell: number, pose, score });
            }
        }
    }
}

/// Every pose within reach in whose frame anything of the target would lie.
fn every_pose(
    scene: &Scene,
    world: &World,
    floor: &WalkableCells,
    paths: &Paths,
    (index, aim): (usize, &Aim),
    stands: &mut Vec<InteractionPose>,
) {
    for (number, &cell) in floor.cells().iter().enumerate() {
        if view::distance_from(scene, world, cell, aim.target).is_none_or(|away| away > REACH) {
            continue;
        }
        for heading in Heading::ALL {
            let Some(steps) = paths.steps(number, heading) else { continue };
            for horizon in horizons() {
                let pose = Pose { cell, heading, horizon };
                if projected_bounds(scene, world, pose, aim.target).is_none() {
                    continue;
                }
                let looks = (horizon - paths.start().horizon).unsigned_abs() / Pose::LOOK.unsigned_abs();
                let score = (steps + u32::from(looks) + aim.toll) as f32;
                stands.push(InteractionPose { aim: index, cell: number, pose, score });
            }
        }
    }
}

fn places_in_reach(scene: &Scene, world: &World, instance: Instance, cell: Cell) -> Vec<Vec3> {
    match view::distance_from(scene, world, cell, instance) {
        Some(away) if away <= REACH => places(scene, world, instance, cell),
        _ => Vec::new(),
    }
}

/// Points (metres) that stand for an instance as seen from a cell: its middle; for furniture also the nearest side and top.
fn places(scene: &Scene, world: &World, instance: Instance, cell: Cell) -> Vec<Vec3> {
    match instance {
        Instance::Object(index) => {
            world.object(index).map(|object| Extent::of_object(scene, object).centre).into_iter().collect()
        }
        Instance::Fixture(index) => {
            let Some(fixture) = scene.fixture(index) else { return Vec::new() };
            let open = world.is_open(instance);
            let shift = if open { placing::drawer_shift(scene, index).metres() } else { Vec3::ZERO };
            let agent = cell.centre(0);
            let mut places = Vec::new();
            for part in &fixture.body {
                let middle = part.centre();
                places.push(middle.metres() + shift);
                let mut side = part.footprint().nearest(agent);
                side.y = middle.y;
                places.push(side.metres() + shift);
            }
            if !fixture.class.info().openable || fixture.body.is_empty() {
                for surface in &fixture.surfaces {
                    places.extend(surface.areas.iter().map(|area| {
                        let mut top = area.nearest(agent);
                        top.y = surface.height;
                        top.metres() + shift
                    }));
                }
            }
            if places.is_empty() {
                places.push(fixture.pivot.metres());
            }
            places
        }
    }
}

/// How far from the image's middle the best of the places lies, as a sum of squares of half images; `None` when none of
/// them lies well inside.
fn best_aside(camera: &Camera, places: &[Vec3]) -> Option<f32> {
    let half = Camera::IMAGE / 2.0;
    let inside = |place: &Vec3| {
        let seen = camera.project(*place)?;
        let (across, down) = ((seen.x - half) / half, (seen.y - half) / half);
        let edge = 1.0 - MARGIN / half;
        (across.abs() <= edge && down.abs() <= edge).then_some(across * across + down * down)
    };
    places.iter().filter_map(inside).reduce(f32::min)
}
