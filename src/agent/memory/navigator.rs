//! Shortest ways over the floor as it is known, to where something can be acted on. What is unknown is hoped to be free.

use std::collections::BTreeSet;

use glam::{Vec2, Vec3};

use super::eye;
use super::occupancy::{Ground, Occupancy};
use crate::domain::{ActionType, Cell, Class, Heading, Pose};
use crate::house::camera::Camera;

/// Costs of the search, in half steps.
const STEP: u32 = 2;
const INTO_UNKNOWN: u32 = 3;
/// A cell that looks too narrow is tried before one gives up.
const INTO_NARROW: u32 = 16;
const NEVER: u32 = u32::MAX;
/// The search reaches so many cells beyond what is known.
const MARGIN: i16 = 3;
/// From a stand's middle to the middle of a target's cell, in metres: a hand's breadth less than the agent reaches.
const REACH: f32 = 1.35;
/// So far from the frame's middle, as a share of the way to its edge, a target may lie.
const INSIDE: f32 = 0.85;
/// Steps that a way is put back by for a target at the frame's edge, for each metre beyond [`EASY`], and for a hidden one.
const OFF_MIDDLE: f32 = 1.0;
const BEYOND_EASY: f32 = 2.0;
const HIDDEN: f32 = 2.0;
/// A target within this many metres is easily reached.
const EASY: f32 = 0.9;
/// What stands within this distance of a target, in metres, belongs to it and does not hide it.
const AROUND: f32 = 0.6;

/// Things of what class were dealt with from where, in vain.
pub(crate) type Failed = BTreeSet<(Class, Pose)>;

/// A way to a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Route {
    /// Moves, turns and looks.
    pub(crate) steps: u32,
    /// Steps, plus what speaks against the way and its end in steps.
    pub(crate) cost: f32,
    /// What is done first; `None` for who is there.
    pub(crate) first: Option<ActionType>,
    /// Where it ends.
    pub(crate) end: Pose,
}

/// A pose without its horizon, as far as the search has come.
#[derive(Clone, Copy, Debug)]
struct Reached {
    /// In half steps.
    cost: u32,
    steps: u32,
    first: Option<ActionType>,
}

/// The cheapest ways from one pose to every other; shared by all targets of a step.
#[derive(Clone, Debug)]
pub(crate) struct Routes {
    start: Pose,
    /// The corner of the rectangle of cells that is searched, and its sides.
    corner: Cell,
    sides: [i16; 2],
    /// For each cell of the rectangle, half steps into it, and the highest point over it.
    entry: Vec<u32>,
    top: Vec<f32>,
    /// Four for each cell, by the heading's quarters.
    reached: Vec<Reached>,
}

impl Routes {
    /// The ways from `start` over a known floor.
    pub(crate) fn from(occupancy: &Occupancy, start: Pose) -> Routes {
        let (mut low, mut high) = (start.cell, start.cell);
        for (cell, _) in occupancy.known() {
            low = Cell::new(low.x.min(cell.x), low.z.min(cell.z));
            high = Cell::new(high.x.max(cell.x), high.z.max(cell.z));
        }
        let corner = Cell::new(low.x - MARGIN, low.z - MARGIN);
        let sides = [high.x - low.x + 2 * MARGIN + 1, high.z - low.z + 2 * MARGIN + 1];
        let cells = sides[0] as usize * sides[1] as usize;
        let nowhere = Reached { cost: NEVER, steps: 0, first: None };
        let (entry, top, reached) = (vec![INTO_UNKNOWN; cells], vec![0.0; cells], vec![nowhere; 4 * cells]);
        let mut routes = Routes { start, corner, sides, entry, top, reached };
        for (cell, ground) in occupancy.known() {
            let Some(index) = routes.index(cell) else { continue };
            routes.top[index] = occupancy.top(cell);
            routes.entry[index] = match ground {
                Ground::Free => STEP,
                Ground::Unknown => INTO_UNKNOWN,
                Ground::Narrow => INTO_NARROW,
                Ground::Blocked => NEVER,
            };
        }
        routes.search();
        routes
    }

    /// Where the ways begin.
    pub(crate) fn start(&self) -> Pose {
        self.start
    }

    /// The number of a cell of the rectangle.
    fn index(&self, cell: Cell) -> Option<usize> {
        let (x, z) = (cell.x - self.corner.x, cell.z - self.corner.z);
        let inside = (0..self.sides[0]).contains(&x) && (0..self.sides[1]).contains(&z);
        inside.then(|| x as usize * self.sides[1] as usize + z as usize)
    }

    /// Dijkstra with a bucket for each cost: costs are small whole numbers.
    fn search(&mut self) {
        let mut buckets: Vec<Vec<(Cell, Heading)>> = vec![Vec::new(); INTO_NARROW as usize + 1];
        let Pose { cell, heading, .. } = self.start;
        let Some(first) = self.index(cell) else { return };
        self.reached[4 * first + heading.quarters() as usize] = Reached { cost: 0, steps: 0, first: None };
        buckets[0].push((cell, heading));
        let (mut cost, mut waiting) = (0u32, 1usize);
        while waiting > 0 {
            let ring = cost as usize % buckets.len();
            for (cell, heading) in std::mem::take(&mut buckets[ring]) {
                waiting -= 1;
                let Some(here) = self.reached(cell, heading).filter(|here| here.cost == cost) else { continue };
                let ahead = cell.ahead(heading);
                let into = self.index(ahead).map_or(NEVER, |index| self.entry[index]);
                for (cell, heading, kind, more) in [
                    (ahead, heading, ActionType::MoveAhead, into),
                    (cell, heading.left(), ActionType::RotateLeft, STEP),
                    (cell, heading.right(), ActionType::RotateRight, STEP),
                ] {
                    let Some(index) = self.index(cell).filter(|_| more != NEVER) else { continue };
                    let there = &mut self.reached[4 * index + heading.quarters() as usize];
                    if cost + more < there.cost {
                        let first = here.first.or(Some(kind));
                        *there = Reached { cost: cost + more, steps: here.steps + 1, first };
                        let ring = (cost + more) as usize % buckets.len();
                        buckets[ring].push((cell, heading));
                        waiting += 1;
                    }
                }
            }
            cost += 1;
        }
    }

    fn reached(&self, cell: Cell, heading: Heading) -> Option<Reached> {
        let reached = self.reached[4 * self.index(cell)? + heading.quarters() as usize];
        (reached.cost != NEVER).then_some(reached)
    }

    /// The way to a pose.
    pub(crate) fn to_pose(&self, end: Pose) -> Option<Route> {
        let Reached { cost, steps, first } = self.reached(end.cell, end.heading)?;
        let looks = (end.horizon - self.start.horizon) / Pose::LOOK;
        let look = match looks {
            0 => None,
            1.. => Some(ActionType::LookDown),
            _ => Some(ActionType::LookUp),
        };
        let looks = u32::from(looks.unsigned_abs());
        Some(Route { steps: steps + looks, cost: cost as f32 / STEP as f32 + looks as f32, first: first.or(look), end })
    }

    /// The cheapest way into a cell, whichever way one faces there.
    pub(crate) fn to_cell(&self, cell: Cell) -> Option<Route> {
        let ends = Heading::ALL.map(|heading| Pose { cell, heading, ..self.start });
        let routes = ends.into_iter().filter_map(|end| self.to_pose(end));
        routes.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// The cheapest way to a pose from which something can be acted on that fills `cells`, each with its height in metres. What
    /// was tried in vain is in `failed`.
    pub(crate) fn plan(&self, class: Class, cells: &[(Cell, f32)], failed: &Failed) -> Option<Route> {
        let mut nearest_first = cells.to_vec();
        nearest_first.sort_by(|a, b| {
            eye::between(a.0, self.start.cell).total_cmp(&eye::between(b.0, self.start.cell)).then(a.0.cmp(&b.0))
        });
        let horizons = horizons();
        let mut best: Option<Route> = None;
        for (cell, height) in nearest_first {
            for (stand, away) in stands_around(cell) {
                for heading in Heading::ALL {
                    let Some(reached) = self.reached(stand, heading) else { continue };
                    let spare = |best: Option<Route>| best.map_or(f32::INFINITY, |best| best.cost);
                    if reached.cost as f32 / STEP as f32 >= spare(best) {
                        continue;
                    }
                    let Some(level) = faced(stand, heading, cell, height) else { continue };
                    for &(horizon, turn) in &horizons {
                        let Some(off_middle) = off_middle(level, turn) else { continue };
                        let end = Pose { cell: stand, heading, horizon };
                        let Some(mut route) = self.to_pose(end) else { continue };
                        route.cost += OFF_MIDDLE * off_middle + BEYOND_EASY * (away - EASY).max(0.0);
                        if route.cost >= spare(best) || failed.contains(&(class, end)) {
                            continue;
                        }
                        route.cost += if self.is_hidden(stand, cell, height) { HIDDEN } else { 0.0 };
                        if route.cost < spare(best) {
                            best = Some(route);
                        }
                    }
                }
            }
        }
        best
    }

    /// Whether something that was seen stands between the eye of who is in `stand` and a target.
    fn is_hidden(&self, stand: Cell, target: Cell, height: f32) -> bool {
        const STRIDE: f32 = 0.125;
        const LEEWAY: f32 = 0.1;
        let (from, to) = (eye::camera(Pose { cell: stand, ..Pose::default() }).eye(), eye::over(target, height));
        let away = eye::between(stand, target);
        let mut walked = STRIDE;
        while walked < away - AROUND {
            let point = from.lerp(to, walked / away);
            let top = self.index(eye::cell_under(point)).map_or(0.0, |index| self.top[index]);
            if top > point.y + LEEWAY {
                return true;
            }
            walked += STRIDE;
        }
        false
    }
}

/// The cells from which a cell is in reach, with the distance in metres, but for the cell itself.
fn stands_around(cell: Cell) -> impl Iterator<Item = (Cell, f32)> {
    const CELLS: i16 = (REACH * 1000.0) as i16 / Cell::SIDE as i16;
    let offsets = (-CELLS..=CELLS).flat_map(|x| (-CELLS..=CELLS).map(move |z| (x, z)));
    let stands = offsets.filter(|offset| *offset != (0, 0)).map(move |(x, z)| Cell::new(cell.x + x, cell.z + z));
    stands.map(move |stand| (stand, eye::between(stand, cell))).filter(|(_, away)| *away <= REACH)
}

/// Every horizon, with its cosine and sine.
fn horizons() -> Vec<(i16, Vec2)> {
    let all = (Pose::UP..=Pose::DOWN).step_by(usize::from(Pose::LOOK.unsigned_abs()));
    all.map(|horizon| (horizon, Vec2::from_angle(f32::from(horizon).to_radians()))).collect()
}

/// The target as seen level by who stands and faces so: right, up and forward from the eye, in metres. `None` when it is so
/// far to the side that no horizon brings it well into the frame.
fn faced(stand: Cell, heading: Heading, target: Cell, height: f32) -> Option<Vec3> {
    let side = Cell::SIDE as f32 / 1000.0;
    let along = |(x, z): (i16, i16)| f32::from((target.x - stand.x) * x + (target.z - stand.z) * z) * side;
    let level = Vec3::new(along(heading.right().step()), height - eye::HEIGHT as f32 / 1000.0, along(heading.step()));
    // With this tilt it is seen nearest to the frame's middle column.
    let ahead = Vec2::new(level.z, level.y).length();
    (level.z > 0.0 && level.x.abs() <= INSIDE * Camera::SLOPE * ahead).then_some(level)
}

/// The square of the distance from the frame's middle at which the camera of that cosine and sine sees the target; 1 at the
/// middle of an edge. `None` outside, or near the edge.
fn off_middle(level: Vec3, turn: Vec2) -> Option<f32> {
    let ahead = level.z * turn.x - level.y * turn.y;
    let up = level.y * turn.x + level.z * turn.y;
    let edge = Camera::SLOPE * ahead;
    let inside = ahead > Camera::NEAR && level.x.abs().max(up.abs()) <= INSIDE * edge;
    inside.then(|| (level.x * level.x + up * up) / (edge * edge))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::domain::Room;
    use crate::house::expert::paths::{Paths, Turning, WalkableCells};
    use crate::house::generate;

    /// A strip of floor along z, from 0 to `length`; the rest is blocked.
    fn corridor(length: i16) -> Occupancy {
        let free = (0..=length).map(|z| Cell::new(0, z));
        let beside = (-1..=length + 1).flat_map(|z| [Cell::new(-1, z), Cell::new(1, z)]);
        Occupancy::with(free, beside.chain([Cell::new(0, -1), Cell::new(0, length + 1)]))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn on_a_floor_that_is_all_known_ways_are_as_short_as_the_experts(
            seed in 0u64..500, room in 0usize..4, at in 0usize..1000, quarters in 0..4,
        ) {
            let (scene, _) = generate::house(Room::ALL[room], seed);
            let fringe = scene.cells.iter().flat_map(|cell| Heading::ALL.map(|heading| cell.ahead(heading)));
            let fringe: Vec<Cell> = fringe.filter(|cell| !scene.has_cell(*cell)).collect();
            let occupancy = Occupancy::with(scene.cells.iter().copied(), fringe);
            let cell = scene.cells[at % scene.cells.len()];
            let start = Pose { cell, heading: Heading::from_quarters(quarters), horizon: 0 };
            let paths = Paths::from(&WalkableCells::of(&scene), start, Turning::Late);
            let routes = Routes::from(&occupancy, start);
            for (number, &cell) in scene.cells.iter().enumerate() {
                for heading in Heading::ALL {
                    let route = routes.to_pose(Pose { cell, heading, horizon: 0 });
                    prop_assert_eq!(route.map(|route| route.steps), paths.steps(number, heading));
                }
            }
        }

        #[test]
        fn who_takes_the_first_step_again_and_again_arrives_at_the_cost_foretold(
            x in -6i16..7, z in 1i16..14, height in 0.0f32..1.8, tilt in -2i16..=4,
        ) {
            let floor = (-6..=6).flat_map(|x| (0..=9).map(move |z| Cell::new(x, z)));
            let occupancy = Occupancy::with(floor, []);
            let (class, failed) = (Class::NONE, BTreeSet::new());
            let mut pose = Pose { horizon: 15 * tilt, ..Pose::default() };
            let plan = |pose| Routes::from(&occupancy, pose).plan(class, &[(Cell::new(x, z), height)], &failed);
            let Some(mut left) = plan(pose) else { return Ok(()) };
            while let Some(kind) = left.first {
                match kind {
                    ActionType::MoveAhead => pose.cell = pose.cell.ahead(pose.heading),
                    ActionType::RotateLeft => pose.heading = pose.heading.left(),
                    ActionType::RotateRight => pose.heading = pose.heading.right(),
                    ActionType::LookDown => pose.horizon += Pose::LOOK,
                    _ => pose.horizon -= Pose::LOOK,
                }
                let next = plan(pose).unwrap();
                prop_assert!((left.cost - next.cost - 1.0).abs() < 0.51, "{left:?}, then {next:?}");
                prop_assert!(next.cost < left.cost - 0.4);
                left = next;
            }
            prop_assert_eq!(left.end, pose);
        }
    }

    #[test]
    fn a_thing_on_a_counter_ahead_is_walked_to_and_looked_down_at() {
        let mug = [(Cell::new(0, 12), 0.9)];
        let routes = Routes::from(&corridor(9), Pose::default());
        let route = routes.plan(Class::NONE, &mug, &BTreeSet::new()).unwrap();
        assert_eq!((route.end.heading, route.first), (Heading::North, Some(ActionType::MoveAhead)));
        assert!((7..=9).contains(&route.end.cell.z) && route.end.horizon >= 15, "{route:?}");
        let there = Routes::from(&corridor(9), route.end).plan(Class::NONE, &mug, &BTreeSet::new()).unwrap();
        assert_eq!((there.steps, there.first, there.end), (0, None, route.end));
    }

    #[test]
    fn a_pose_that_failed_is_not_gone_to_again() {
        let mug = [(Cell::new(0, 12), 0.9)];
        let routes = Routes::from(&corridor(9), Pose::default());
        let mut failed = BTreeSet::new();
        for _ in 0..6 {
            let end = routes.plan(Class::NONE, &mug, &failed).unwrap().end;
            assert!(failed.insert((Class::NONE, end)), "{end:?} again");
        }
        let other = Class::named("Mug").unwrap();
        assert!(!failed.contains(&(other, routes.plan(other, &mug, &failed).unwrap().end)));
    }

    #[test]
    fn what_is_walled_in_is_out_of_reach_and_what_is_unknown_is_hoped_to_be_free() {
        let routes = Routes::from(&corridor(9), Pose::default());
        assert_eq!(routes.plan(Class::NONE, &[(Cell::new(0, 20), 0.9)], &BTreeSet::new()), None);
        assert_eq!(routes.to_cell(Cell::new(0, 10)), None);
        let open = Occupancy::with((0..=2).map(|z| Cell::new(0, z)), []);
        let route = Routes::from(&open, Pose::default()).to_cell(Cell::new(0, 4)).unwrap();
        assert_eq!((route.steps, route.cost), (4, 5.0));
    }
}
