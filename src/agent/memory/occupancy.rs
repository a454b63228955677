//! Where the agent can walk, from what it saw of the floor and of what stands on it.

use std::collections::BTreeMap;

use glam::Vec3;

use super::eye;
use crate::domain::{Cell, Heading, Pose};
use crate::house::view::Frame;

/// Every so manieth pixel of every so manieth row is looked at.
const STRIDE: usize = 4;
/// What is within this distance of a cell's centre, along x and z in metres, leaves no room beside it.
const CORE: f32 = 0.1;

/// The rule by which points become cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Clearance {
    /// Points no higher than this above the floor (metres), and no deeper below it, are floor.
    pub(crate) floor: f32,
    /// Points between these heights (metres) are in the way.
    pub(crate) body: [f32; 2],
    /// How far a cell's centre must be from what is in the way, along x and z (metres).
    pub(crate) radius: f32,
    /// Whether the radius is of a circle, not of a square.
    pub(crate) round: bool,
    /// So many points in the way block a cell, seen in one frame.
    pub(crate) points: u16,
    /// Farther points along the optical axis (metres) count for nothing.
    pub(crate) farthest: f32,
}

impl Default for Clearance {
    fn default() -> Clearance {
        Clearance { floor: 0.08, body: [0.1, 1.7], radius: 0.215, round: false, points: 2, farthest: 5.0 }
    }
}

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ground {
    /// Can be walked on.
    Free,
    /// Something stands so near that a person would not fit; if it was seen rightly.
    Narrow,
    /// Something stands there.
    Blocked,
    /// Not seen.
    Unknown,
}

/// What was seen of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Glimpses {
    /// Points on its floor.
    floor: u32,
    /// Points in the way of who would stand there, of frames that showed enough of them.
    body: u32,
    /// Those of them that are in the way of even the thinnest.
    core: u32,
    /// The highest point that was seen over the cell itself, in metres.
    top: f32,
    /// From how near it was looked at: the reciprocal of the least distance in metres; 0 for never.
    nearness: f32,
    /// The agent was there.
    visited: bool,
    /// A move there failed.
    bumped: bool,
}

/// The floor as far as it is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Occupancy {
    clearance: Clearance,
    cells: BTreeMap<Cell, Glimpses>,
}

impl Occupancy {
    /// Takes in the depth that an agent at `pose` sees.
    pub(crate) fn observe(&mut self, pose: Pose, frame: &Frame) {
        let mut seen: BTreeMap<Cell, Glimpses> = BTreeMap::new();
        let camera = eye::camera(pose);
        let scale = 300.0 / frame.width.max(1) as f32;
        for row in (STRIDE / 2..frame.height).step_by(STRIDE) {
            for column in (STRIDE / 2..frame.width).step_by(STRIDE) {
                let depth = frame.depth[row * frame.width + column];
                let (x, y) = ((column as f32 + 0.5) * scale, (row as f32 + 0.5) * scale);
                if depth < self.clearance.farthest && !eye::is_in_hand(x, y, depth) {
                    self.vote(camera.unproject(x, y, depth), depth, &mut seen);
                }
            }
        }
        for (cell, glimpse) in seen {
            let known = self.cells.entry(cell).or_default();
            known.floor += glimpse.floor;
            known.nearness = known.nearness.max(glimpse.nearness);
            known.top = known.top.max(glimpse.top);
            if glimpse.body >= u32::from(self.clearance.points) {
                known.body += glimpse.body;
            }
            if glimpse.core >= u32::from(self.clearance.points) {
                known.core += glimpse.core;
            }
        }
        self.cells.entry(pose.cell).or_default().visited = true;
    }

    fn vote(&self, point: Vec3, depth: f32, seen: &mut BTreeMap<Cell, Glimpses>) {
        let Clearance { floor, body: [low, high], radius, round, .. } = self.clearance;
        let own = seen.entry(eye::cell_under(point)).or_default();
        own.nearness = own.nearness.max(1.0 / depth);
        if point.y <= self.clearance.body[1] {
            own.top = own.top.max(point.y);
        }
        if point.y.abs() <= floor {
            own.floor += 1;
        }
        if !(low..=high).contains(&point.y) {
            return;
        }
        let side = Cell::SIDE as f32 / 1000.0;
        let span = |v: f32| (((v - radius) / side).ceil() as i16)..=(((v + radius) / side).floor() as i16);
        for x in span(point.x) {
            for z in span(point.z) {
                let (dx, dz) = (f32::from(x) * side - point.x, f32::from(z) * side - point.z);
                if !round || dx * dx + dz * dz <= radius * radius {
                    let near = seen.entry(Cell::new(x, z)).or_default();
                    near.body += 1;
                    near.core += u32::from(dx.abs().max(dz.abs()) <= CORE);
                }
            }
        }
    }

    /// A move ahead from `pose` failed: what lies ahead cannot be walked on.
    pub(crate) fn bump(&mut self, pose: Pose) {
        self.cells.entry(pose.cell.ahead(pose.heading)).or_default().bumped = true;
    }

    /// The map on which these cells are free and those blocked.
    #[cfg(test)]
    pub(crate) fn with(free: impl IntoIterator<Item = Cell>, blocked: impl IntoIterator<Item = Cell>) -> Occupancy {
        let free = free.into_iter().map(|cell| (cell, Glimpses { floor: 1, ..Glimpses::default() }));
        let blocked =
            blocked.into_iter().map(|cell| (cell, Glimpses { core: 9, body: 9, top: 1.0, ..Glimpses::default() }));
        Occupancy { cells: free.chain(blocked).collect(), ..Occupancy::default() }
    }

    /// What is known of a cell.
    pub(crate) fn ground(&self, cell: Cell) -> Ground {
        let Some(glimpses) = self.cells.get(&cell) else { return Ground::Unknown };
        match glimpses {
            Glimpses { visited: true, .. } => Ground::Free,
            Glimpses { bumped: true, .. } => Ground::Blocked,
            Glimpses { core, .. } if *core > 0 => Ground::Blocked,
            Glimpses { body, .. } if *body > 0 => Ground::Narrow,
            Glimpses { floor, .. } if *floor > 0 => Ground::Free,
            _ => Ground::Unknown,
        }
    }

    /// The highest point that was seen over a cell, in metres; 0 where nothing was.
    pub(crate) fn top(&self, cell: Cell) -> f32 {
        self.cells.get(&cell).map_or(0.0, |glimpses| glimpses.top)
    }

    /// The least distance, in metres, from which a cell was looked at.
    pub(crate) fn looked_from(&self, cell: Cell) -> Option<f32> {
        let nearness = self.cells.get(&cell).map(|glimpses| glimpses.nearness);
        nearness.filter(|nearness| *nearness > 0.0).map(|nearness| 1.0 / nearness)
    }

    /// A cell was looked at from so many metres.
    #[cfg(test)]
    pub(crate) fn look_at(&mut self, cell: Cell, away: f32) {
        self.cells.entry(cell).or_default().nearness = 1.0 / away;
    }

    /// Every cell of which something is known, in order.
    pub(crate) fn known(&self) -> impl Iterator<Item = (Cell, Ground)> {
        let grounds = self.cells.keys().map(|&cell| (cell, self.ground(cell)));
        grounds.filter(|(_, ground)| *ground != Ground::Unknown)
    }

    /// Free cells beside unknown ones, in order.
    pub(crate) fn frontier(&self) -> impl Iterator<Item = Cell> {
        let unknown = |cell: Cell| self.ground(cell) == Ground::Unknown;
        let beside = move |cell: &Cell| Heading::ALL.into_iter().any(|heading| unknown(cell.ahead(heading)));
        self.known().filter(|(_, ground)| *ground == Ground::Free).map(|(cell, _)| cell).filter(beside)
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};

    use super::*;
    use crate::domain::{Room, Scene, World};
    use crate::house::generate;
    use crate::house::render::Renderer;

    fn look_around(map: &mut Occupancy, scene: &Scene, world: &World, cell: Cell) {
        let mut renderer = Renderer::new(300);
        for (heading, horizon) in Heading::ALL.into_iter().flat_map(|heading| [(heading, 0), (heading, 30)]) {
            let agent = Pose { cell, heading, horizon };
            map.observe(agent, renderer.draw(scene, &World { agent, ..world.clone() }));
        }
    }

    #[test]
    fn a_look_around_tells_most_cells_rightly() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let (mut right, mut wrong, mut found, mut all) = (0, 0, 0, 0);
        for room in Room::ALL {
            let (scene, world) = generate::house(room, 41);
            let mut map = Occupancy::default();
            for _ in 0..2 {
                look_around(&mut map, &scene, &world, scene.cells[rng.random_range(0..scene.cells.len())]);
            }
            for (cell, ground) in map.known() {
                let walkable = scene.has_cell(cell);
                let taken = ground == Ground::Free;
                right += usize::from(walkable == taken);
                wrong += usize::from(walkable != taken);
                found += usize::from(walkable && taken);
            }
            all += scene.cells.len();
        }
        assert!(wrong * 25 < right, "{wrong} cells wrong, {right} right");
        assert!(found * 10 > all * 7, "{found} of {all} cells found");
    }

    #[test]
    fn where_the_agent_was_stays_free_and_where_it_bumped_stays_blocked() {
        let mut map = Occupancy::with([Cell::new(0, 1)], [Cell::new(0, 0)]);
        let empty = Frame { width: 0, height: 0, rgb: vec![], depth: vec![], ids: vec![] };
        map.observe(Pose::default(), &empty);
        map.bump(Pose::default());
        assert_eq!((map.ground(Cell::new(0, 0)), map.ground(Cell::new(0, 1))), (Ground::Free, Ground::Blocked));
    }

    #[test]
    fn the_frontier_is_where_the_known_floor_ends() {
        let free = (0..3).map(|z| Cell::new(0, z));
        let beside = (0..3).flat_map(|z| [Cell::new(-1, z), Cell::new(1, z)]);
        let map = Occupancy::with(free, beside.chain([Cell::new(0, -1)]));
        assert_eq!(map.frontier().collect::<Vec<_>>(), [Cell::new(0, 2)]);
    }
}
