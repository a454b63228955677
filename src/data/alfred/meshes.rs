//! Sizes of a scene's own meshes: the class's shape, scaled and shifted until it fills the boxes in which the mesh was seen.

use std::collections::BTreeMap;

use super::fit::misfit;
use super::recording::{Placed, Recording};
use crate::domain::place::Pose;
use crate::domain::scene::Mesh;
use crate::domain::world::Instance;
use crate::domain::{ActionType, Class, Object, Room, Scene, World};
use crate::house::bounds::projected_bounds;

/// How much a length changes at a time, as a share of it, from coarse to fine.
const STEPS: [f32; 4] = [0.3, 0.15, 0.07, 0.03];
/// Sweeps over all lengths at each step.
const SWEEPS: usize = 3;
/// At most so many views count, and at least so many are needed to trust them over the class.
const MOST: usize = 6;
const LEAST: usize = 2;
/// A view that agrees worse than this was half hidden: it cannot pull any harder.
const HIDDEN: f32 = 0.7;
/// What it costs to change a length by its own size, in units of overlap.
const STIFF: f32 = 0.04;
/// The thinnest that anything gets, in millimetres.
const THINNEST: i32 = 4;

/// A view of an object that nothing has moved yet.
struct ObjectView<'a> {
    placed: &'a Placed,
    pose: Pose,
    bounds: [u16; 4],
}

/// The meshes of a scene that recordings show often enough, by name.
pub(crate) fn meshes(recordings: &[&Recording], agent_y: i32) -> Vec<Mesh> {
    let mut sights: BTreeMap<&str, Vec<ObjectView<'_>>> = BTreeMap::new();
    for recording in recordings {
        for sight in first_touches(recording) {
            sights.entry(&sight.placed.mesh).or_default().push(sight);
        }
    }
    sights.retain(|_, sights| sights.len() >= LEAST);
    let mut meshes: Vec<Mesh> = sights.into_iter().map(|(name, sights)| fit(name, &sights, agent_y)).collect();
    let placed = recordings.iter().flat_map(|recording| &recording.setting.objects);
    for placed in placed.filter(|placed| placed.class.name() == "PaperTowelRoll") {
        if !meshes.iter().any(|mesh| mesh.name == placed.mesh) {
            meshes.push(roll(placed));
        }
    }
    meshes
}

/// Nobody takes paper towel rolls. They stand with their pivot 105 mm above counters and tables, the median of all plans that
/// have any: it is their middle.
fn roll(placed: &Placed) -> Mesh {
    let shape = placed.class.info().shape;
    Mesh { name: placed.mesh.clone(), shape, size: [120, 210, 120], offset: [0, 0, 0] }
}

/// Pickups and slices of objects that were not touched before. A drawer's contents slide with it: they are left out.
fn first_touches(recording: &Recording) -> Vec<ObjectView<'_>> {
    let mut touched = vec![false; recording.setting.objects.len()];
    let mut sights = Vec::new();
    let mut drawer = false;
    for (pose, step) in recording.poses().into_iter().zip(&recording.steps) {
        let Some(name) = step.target else { continue };
        match step.kind {
            ActionType::Open => drawer = name.class.name() == "Drawer",
            ActionType::Close => drawer = false,
            ActionType::Pickup | ActionType::Slice => {
                let Some(number) = recording.object(name.whole(), None).map(usize::from) else { continue };
                let first = !std::mem::replace(&mut touched[number], true);
                if let Some(bounds) = step.bounds.filter(|_| first && !drawer && name.whole() == name) {
                    sights.push(ObjectView { placed: &recording.setting.objects[number], pose, bounds });
                }
            }
            _ => {}
        }
    }
    sights
}

/// The six lengths of a shape: width, height, depth, and the offsets of its middle.
type MeshLengths = [i32; 6];

fn fit(name: &str, sights: &[ObjectView<'_>], agent_y: i32) -> Mesh {
    let class = sights.first().map_or(Class::NONE, |sight| sight.placed.class);
    let info = class.info();
    let first: MeshLengths = [info.size[0], info.size[1], info.size[2], info.offset[0], info.offset[1], info.offset[2]];
    // Evenly over all recordings: the first ones may all be of one task.
    let every = sights.len().div_ceil(MOST).max(1);
    let sights: Vec<&ObjectView<'_>> = sights.iter().step_by(every).collect();
    let mut trial = Trial::new(name, class, agent_y);
    let mut best = first;
    let mut least = trial.cost(best, first, &sights);
    for step in STEPS {
        for _ in 0..SWEEPS {
            let before = least;
            for length in 0..6 {
                for sign in [1.0, -1.0] {
                    let mut next = best;
                    // An offset moves by shares of the side along it.
                    let by = (best[length % 3] as f32 * step * sign).round() as i32;
                    next[length] += if by == 0 { sign as i32 } else { by };
                    let cost = trial.cost(next, first, &sights);
                    if cost < least - 1e-4 {
                        (best, least) = (next, cost);
                    }
                }
            }
            if before - least < 1e-3 {
                break;
            }
        }
    }
    let [width, height, depth, right, up, ahead] = best;
    Mesh { name: name.to_owned(), shape: info.shape, size: [width, height, depth], offset: [right, up, ahead] }
}

/// A world with nothing but one object, to project it.
struct Trial {
    scene: Scene,
    world: World,
}

impl Trial {
    fn new(name: &str, class: Class, agent_y: i32) -> Trial {
        let info = class.info();
        let mesh = Mesh { name: name.to_owned(), shape: info.shape, size: info.size, offset: info.offset };
        let scene = Scene {
            format_version: Scene::FORMAT,
            name: String::new(),
            room: Room::Kitchen,
            agent_y,
            cells: Vec::new(),
            fixtures: Vec::new(),
            walls: Vec::new(),
            meshes: vec![mesh],
        };
        // Laptops are shut before they are picked up.
        let object = Object { class, mesh: Some(0), ..Object::default() };
        let world = World::new(&scene, Pose::default(), vec![object]);
        Trial { scene, world }
    }

    fn cost(&mut self, lengths: MeshLengths, first: MeshLengths, sights: &[&ObjectView<'_>]) -> f32 {
        let [width, height, depth, right, up, ahead] = lengths;
        let wild = (0..3).any(|side| lengths[side] < THINNEST || lengths[side] > 4 * first[side].max(20));
        if wild {
            return f32::INFINITY;
        }
        let mesh = &mut self.scene.meshes[0];
        (mesh.size, mesh.offset) = ([width, height, depth], [right, up, ahead]);
        let changed = (0..6).map(|i| (lengths[i] - first[i]).abs() as f32 / first[i % 3].max(20) as f32).sum::<f32>();
        let mut cost = 0.0;
        for sight in sights {
            let object = &mut self.world.objects[0];
            (object.at, object.turn) = (sight.placed.at, sight.placed.turn);
            let seen = projected_bounds(&self.scene, &self.world, sight.pose, Instance::Object(0));
            cost += seen.map_or(HIDDEN, |seen| misfit(seen, sight.bounds.map(f32::from)).min(HIDDEN));
        }
        cost / sights.len().max(1) as f32 + STIFF * changed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Cell, Heading, Point};

    #[test]
    fn a_mesh_twice_as_tall_as_its_class_is_found_from_a_few_frames() {
        let class = Class::named("SoapBottle").unwrap();
        let placed = Placed { class, mesh: "Bottle_1".into(), at: Point::new(0, 800, 700), turn: [0; 3] };
        let mut trial = Trial::new("Bottle_1", class, 900);
        trial.scene.meshes[0].size[1] *= 2;
        trial.scene.meshes[0].offset[1] *= 2;
        (trial.world.objects[0].at, trial.world.objects[0].turn) = (placed.at, placed.turn);
        let sights: Vec<ObjectView<'_>> = [0, -1, 1]
            .map(|x| {
                let pose = Pose { cell: Cell::new(x, 0), heading: Heading::North, horizon: 45 };
                let bounds = projected_bounds(&trial.scene, &trial.world, pose, Instance::Object(0)).unwrap();
                ObjectView { placed: &placed, pose, bounds: bounds.map(|edge| edge.round() as u16) }
            })
            .into();
        let mesh = fit("Bottle_1", &sights, 900);
        let info = class.info();
        assert!(2 * mesh.size[1] > 3 * info.size[1], "{:?}", mesh.size);
        assert!((mesh.size[0] - info.size[0]).abs() < info.size[0] / 4, "{:?}", mesh.size);
    }
}
