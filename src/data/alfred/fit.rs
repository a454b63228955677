//! Fitting furniture to the boxes in which recorded frames show it: the sides that its contents do not tell.

use super::fixtures::Use;
use super::furniture::BodyKind;
use crate::domain::place::{Cuboid, Pose};
use crate::domain::scene::Surface;
use crate::domain::world::{FixtureState, Instance};
use crate::domain::{Cell, Fixture, Point, Scene, World};
use crate::house::bounds::projected_bounds;

/// How far a side moves at a time, in millimetres, from coarse to fine.
const STEPS: [i32; 5] = [160, 80, 40, 20, 10];
/// Sweeps over all sides at each step.
const SWEEPS: usize = 4;
/// At most so many different views count.
const VIEWS: usize = 10;
/// What it costs to move one side by a metre, in units of overlap: sides that no view shows stay where they are.
const STIFF: f32 = 0.25;
/// No side moves farther than this, in millimetres.
const FARTHEST: i32 = 900;
/// Nothing is thinner than this, in millimetres.
const THINNEST: i32 = 20;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FixtureView {
    pose: Pose,
    open: bool,
    bounds: [u16; 4],
    weight: f32,
}

/// The different views of a fixture, the most frequent first.
pub(crate) fn views(uses: &[Use]) -> Vec<FixtureView> {
    let mut views: Vec<FixtureView> = Vec::new();
    for used in uses {
        let Some(bounds) = used.bounds else { continue };
        let same = |view: &&mut FixtureView| view.pose == used.pose && view.open == used.open && view.bounds == bounds;
        match views.iter_mut().find(same) {
            Some(view) => view.weight += 1.0,
            None => views.push(FixtureView { pose: used.pose, open: used.open, bounds, weight: 1.0 }),
        }
    }
    views.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    views.truncate(VIEWS);
    // A view that is repeated a hundred times is not a hundred times as telling.
    views.iter_mut().for_each(|view| view.weight = view.weight.sqrt());
    let sum: f32 = views.iter().map(|view| view.weight).sum();
    views.iter_mut().for_each(|view| view.weight /= sum);
    views
}

/// A fixture whose body is sought.
pub(crate) struct Subject<'a> {
    scene: Scene,
    world: World,
    views: Vec<FixtureView>,
    /// What the body has to contain.
    pub(crate) contents: Option<Cuboid>,
    /// Cells that it must leave free.
    pub(crate) cells: &'a [Cell],
    /// Which sides may move: smallest x, y, z, then largest.
    pub(crate) free: [bool; 6],
    /// Moves any sides together, not only opposite ones.
    pub(crate) together: bool,
    /// What lines of sight it blocks costs, of an outer box.
    pub(crate) blocks: &'a dyn Fn(&Cuboid) -> f32,
    /// Turns the outer box into the boxes of the body.
    pub(crate) parts: &'a dyn Fn(Cuboid) -> Vec<Cuboid>,
}

impl<'a> Subject<'a> {
    /// From a fixture as it is so far. Surfaces inside closed bodies do not count as seen.
    pub(crate) fn new(
        mut fixture: Fixture,
        build: BodyKind,
        uses: &[Use],
        agent_y: i32,
        cells: &'a [Cell],
        parts: &'a dyn Fn(Cuboid) -> Vec<Cuboid>,
    ) -> Subject<'a> {
        if !matches!(build, BodyKind::Block | BodyKind::Slab | BodyKind::Seat) {
            fixture.surfaces.clear();
        }
        let scene = Scene {
            format_version: Scene::FORMAT,
            name: String::new(),
            room: crate::domain::Room::Kitchen,
            agent_y,
            cells: Vec::new(),
            fixtures: vec![fixture],
            walls: Vec::new(),
            meshes: Vec::new(),
        };
        let world = World::new(&scene, Pose::default(), Vec::new());
        let views = views(uses);
        Subject {
            scene,
            world,
            views,
            contents: None,
            cells,
            free: [true; 6],
            together: false,
            blocks: &|_| 0.0,
            parts,
        }
    }

    /// The outer box that agrees best with all views, starting from `first`, and how badly it still does.
    pub(crate) fn fit(&mut self, first: Cuboid) -> (Cuboid, f32) {
        if self.views.is_empty() && (self.blocks)(&first) <= 0.0 {
            return (first, 0.0);
        }
        let start = sides(first);
        let mut best = start;
        let mut least = self.cost(start, start);
        for step in STEPS {
            for _ in 0..SWEEPS {
                let before = least;
                for moved in if self.together { joint_moves(step) } else { moves(step) } {
                    if (0..6).any(|side| moved[side] != 0 && !self.free[side]) {
                        continue;
                    }
                    let next: [i32; 6] = std::array::from_fn(|side| best[side] + moved[side]);
                    let cost = self.cost(next, start);
                    if cost < least - 1e-5 {
                        (best, least) = (next, cost);
                    }
                }
                if before - least < 1e-4 {
                    break;
                }
            }
        }
        (cuboid(best), least)
    }

    fn cost(&mut self, sides: [i32; 6], start: [i32; 6]) -> f32 {
        let outer = cuboid(sides);
        let thin = (0..3).any(|axis| sides[axis + 3] - sides[axis] < THINNEST);
        let far = (0..6).any(|side| (sides[side] - start[side]).abs() > FARTHEST);
        if thin || far || self.contents.is_some_and(|contents| !contains(&outer, &contents)) {
            return f32::INFINITY;
        }
        let moved: i32 = (0..6).map(|side| (sides[side] - start[side]).abs()).sum();
        let trodden = self.cells.iter().filter(|cell| stands_in(cell, &outer)).count();
        let mut cost = STIFF * moved as f32 / 1000.0 + trodden as f32 + (self.blocks)(&outer);
        self.scene.fixtures[0].body = (self.parts)(outer);
        for view in &self.views {
            self.world.fixtures[0] = FixtureState { open: view.open, on: false };
            let seen = projected_bounds(&self.scene, &self.world, view.pose, Instance::Fixture(0));
            cost += view.weight * seen.map_or(2.0, |seen| misfit(seen, view.bounds.map(f32::from)));
        }
        cost
    }
}

/// How badly two boxes agree: 0 when equal; the mean distance of edges keeps a slope where they do not meet.
pub(crate) fn misfit(a: [f32; 4], b: [f32; 4]) -> f32 {
    let area = |[left, top, right, bottom]: [f32; 4]| (right - left).max(0.0) * (bottom - top).max(0.0);
    let shared = area([a[0].max(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].min(b[3])]);
    let union = (area(a) + area(b) - shared).max(1.0);
    let edges: f32 = (0..4).map(|edge| (a[edge] - b[edge]).abs()).sum();
    1.0 - shared / union + edges / 1200.0
}

/// One side in or out, or two opposite sides together.
fn moves(step: i32) -> Vec<[i32; 6]> {
    let mut moves = Vec::with_capacity(18);
    for by in [step, -step] {
        for axis in 0..3 {
            for (low, high) in [(by, 0), (0, by), (by, by)] {
                let mut moved = [0; 6];
                (moved[axis], moved[axis + 3]) = (low, high);
                moves.push(moved);
            }
        }
    }
    moves
}

/// Any sides in or out together.
fn joint_moves(step: i32) -> Vec<[i32; 6]> {
    let digit = |number: i32, side: u32| (number / 3i32.pow(side) % 3 - 1) * step;
    (0..3i32.pow(6)).map(|number| [0, 1, 2, 3, 4, 5].map(|side| digit(number, side))).collect()
}

fn sides(cuboid: Cuboid) -> [i32; 6] {
    let (min, max) = (cuboid.min, cuboid.max);
    [min.x, min.y, min.z, max.x, max.y, max.z]
}

fn cuboid([x, y, z, right, top, far]: [i32; 6]) -> Cuboid {
    Cuboid { min: Point::new(x, y, z), max: Point::new(right, top, far) }
}

pub(crate) fn contains(outer: &Cuboid, inner: &Cuboid) -> bool {
    let (outer, inner) = (sides(*outer), sides(*inner));
    (0..3).all(|axis| outer[axis] <= inner[axis] && inner[axis + 3] <= outer[axis + 3])
}

/// Whether an agent in that cell would stand in the box.
fn stands_in(cell: &Cell, outer: &Cuboid) -> bool {
    let at = cell.centre(0);
    outer.footprint().grown(100).contains(at.x, at.z)
}

/// Surfaces cut to what lies inside a body; one that would vanish becomes the body's own inside.
pub(crate) fn within(surfaces: &mut [Surface], body: &Cuboid, inset: i32) {
    let inside = body.footprint().grown(-inset.min(body_half(body)));
    for surface in surfaces {
        surface.height = surface.height.clamp(body.min.y + 5, (body.max.y - 5).max(body.min.y + 5));
        for area in &mut surface.areas {
            for axis in 0..2 {
                area.min[axis] = area.min[axis].clamp(inside.min[axis], inside.max[axis]);
                area.max[axis] = area.max[axis].clamp(inside.min[axis], inside.max[axis]);
            }
        }
    }
}

fn body_half(body: &Cuboid) -> i32 {
    ((body.max.x - body.min.x).min(body.max.z - body.min.z) / 2 - 5).max(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{ActionType, Class, Heading};

    #[test]
    fn a_box_is_found_again_from_the_frames_that_show_it() {
        let truth = Cuboid::between(Point::new(-300, 700, 900), Point::new(300, 1000, 1300));
        let class = Class::named("CoffeeMachine").unwrap();
        let fixture = |body| Fixture {
            id: String::new(),
            class,
            pivot: Point::default(),
            facing: Heading::South,
            body: vec![body],
            surfaces: vec![],
            stand: None,
        };
        let parts = |outer| vec![outer];
        let seen = Subject::new(fixture(truth), BodyKind::Thing, &[], 900, &[], &parts);
        let poses = [(0, 0, Heading::North), (-5, 4, Heading::East), (5, 4, Heading::West), (0, 1, Heading::North)];
        let uses = poses.map(|(x, z, heading)| {
            let pose = Pose { cell: Cell::new(x, z), heading, horizon: 30 };
            let bounds = projected_bounds(&seen.scene, &seen.world, pose, Instance::Fixture(0)).unwrap();
            Use { kind: ActionType::Put, pose, bounds: Some(bounds.map(|edge| edge.round() as u16)), open: false }
        });
        let first = Cuboid::between(Point::new(-150, 650, 1000), Point::new(250, 1100, 1250));
        let found = Subject::new(fixture(first), BodyKind::Thing, &uses, 900, &[], &parts).fit(first).0;
        for (a, b) in sides(found).into_iter().zip(sides(truth)) {
            assert!((a - b).abs() <= 60, "{found:?}");
        }
    }
}
