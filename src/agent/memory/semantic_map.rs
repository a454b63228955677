//! What stands where: evidence for each class in each cell of the floor plan, gathered over all glances.

use std::collections::{BTreeMap, BTreeSet};

use super::eye;
use super::percept::Percept;
use crate::domain::{Cell, Class, Pose};
use crate::house::camera::Camera;

/// Beyond this depth, in metres, a glance counts for less.
const NEAR: f32 = 3.0;
/// How far a score moves towards the probability of one glance, near and beyond.
const WEIGHTS: [f32; 2] = [0.7, 0.4];
/// What should be seen again is missed only within this distance over the floor, in metres.
const CERTAIN: f32 = 3.0;
/// So much nearer than a thing, in metres, may lie what is seen in its place without hiding it.
const SLACK: f32 = 0.25;
/// A thing that is seen again within this distance, in metres, is not missed.
const DRIFT: f32 = 0.4;
/// What is left of the score of a thing that is missed.
const MISSED: f32 = 0.6;
/// The same for what the agent put there: a sink is large, and it did not look where exactly.
const MISSED_WHERE_PUT: f32 = 0.93;
/// The score of what the agent put somewhere itself.
const OWN_HAND: f32 = 0.9;
/// Within this distance over the floor, in metres, and so far inside the frame, in pixels, what can be acted on is offered.
const AT_HAND: f32 = 1.25;
const MARGIN: f32 = 15.0;
/// What is left of the score of what turned out to be something else, and of the probability with which it is seen again.
const REFUTED: f32 = 0.2;
const SEEN_AGAIN: f32 = 0.3;
/// Weaker evidence is dropped.
const WEAKEST: f32 = 0.05;

/// What speaks for a class in a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Evidence {
    /// How surely it is there, 0 to 1.
    pub(crate) score: f32,
    /// Metres above the floor.
    pub(crate) height: f32,
    /// The step at which it was seen last.
    pub(crate) seen: u32,
    /// How probably it stands open or is switched on.
    pub(crate) open: f32,
    /// The least distance over the floor that it was ever seen from, in metres.
    pub(crate) near: f32,
    /// The agent put it there, and has not seen it since: it is somewhere near.
    pub(crate) put: bool,
}

/// Cells side by side that hold the same class.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Thing {
    /// What it is.
    pub(crate) class: Class,
    /// Where it is, in order.
    pub(crate) cells: Vec<(Cell, Evidence)>,
    /// The cell with the best evidence.
    pub(crate) best: Cell,
    /// The score there.
    pub(crate) score: f32,
    /// Metres above the floor, there.
    pub(crate) height: f32,
    /// The step at which any of it was seen last.
    pub(crate) seen: u32,
    /// How probably it stands open or is switched on, by the cells that were seen last.
    pub(crate) open: f32,
}

/// The evidence that one glance adds up for a class in a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Glimpse {
    probability: f32,
    /// The sum of the probabilities, by which heights and openness are weighed.
    weight: f32,
    height: f32,
    open: f32,
    depth: f32,
}

/// The evidence for all classes in all cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SemanticMap {
    evidence: BTreeMap<(Class, Cell), Evidence>,
    /// Where something looked like a class and turned out to be something else.
    refuted: BTreeSet<(Class, Cell)>,
}

impl SemanticMap {
    /// Takes in what is seen from `pose`. The held thing is drawn before the room: what looks like it and is at arm's length
    /// says nothing.
    pub(crate) fn observe(&mut self, pose: Pose, percept: &Percept, held: Option<Class>, step: u32) {
        let glimpses = glimpses(pose, percept, held);
        self.miss(pose, percept, held.is_some(), &glimpses);
        for (&(class, cell), glimpse) in &glimpses {
            let weight = glimpse.weight.max(f32::EPSILON);
            let (height, open) = (glimpse.height / weight, glimpse.open / weight);
            let away = eye::between(pose.cell, cell);
            let fresh = Evidence { score: 0.0, height, seen: step, open, near: away, put: false };
            let known = self.evidence.entry((class, cell)).or_insert(fresh);
            let is_refuted = (-1..=1)
                .flat_map(|dx| (-1..=1).map(move |dz| (dx, dz)))
                .any(|(dx, dz)| self.refuted.contains(&(class, Cell::new(cell.x + dx, cell.z + dz))));
            let probability = glimpse.probability * if is_refuted { SEEN_AGAIN } else { 1.0 };
            let towards = WEIGHTS[usize::from(glimpse.depth > NEAR)];
            known.score += towards * (probability - known.score);
            known.height += towards * (height - known.height);
            known.open += WEIGHTS[0] * (open - known.open);
            known.near = known.near.min(away);
            (known.seen, known.put) = (step, false);
        }
        self.evidence.retain(|_, known| known.score >= WEAKEST);
    }

    /// Weakens what should be in view and is not.
    fn miss(&mut self, pose: Pose, percept: &Percept, holds: bool, glimpses: &BTreeMap<(Class, Cell), Glimpse>) {
        let camera = eye::camera(pose);
        let mut seen: BTreeMap<Class, Vec<Cell>> = BTreeMap::new();
        for &(class, cell) in glimpses.keys() {
            seen.entry(class).or_default().push(cell);
        }
        for (&(class, cell), known) in &mut self.evidence {
            if eye::between(pose.cell, cell) >= CERTAIN {
                continue;
            }
            let Some(place) = camera.project(eye::over(cell, known.height)) else { continue };
            let Some(depth) = Percept::cell_at(place.x, place.y).and_then(|at| percept.depth.get(at)) else { continue };
            let hidden = *depth < place.z - SLACK || (holds && eye::is_in_hand(place.x, place.y, *depth));
            let again = seen.get(&class).is_some_and(|cells| cells.iter().any(|at| eye::between(*at, cell) <= DRIFT));
            if !hidden && !again {
                known.score *= if known.put { MISSED_WHERE_PUT } else { MISSED };
            }
        }
    }

    /// Weakens what is in view and at hand and cannot be acted on: it only looks like a thing of its class. `would_be_offered`
    /// tells whether the interactions that are possible now would hold one with a class, and do not.
    pub(crate) fn refute(&mut self, pose: Pose, percept: &Percept, would_be_offered: impl Fn(Class) -> bool) {
        let camera = eye::camera(pose);
        let inside = |at: f32| (MARGIN..Camera::IMAGE - MARGIN).contains(&at);
        for (&(class, cell), known) in &mut self.evidence {
            // What the agent put there is somewhere near.
            if known.put || eye::between(pose.cell, cell) > AT_HAND || !would_be_offered(class) {
                continue;
            }
            let Some(place) = camera.project(eye::over(cell, known.height)) else { continue };
            let Some(depth) = Percept::cell_at(place.x, place.y).and_then(|at| percept.depth.get(at)) else { continue };
            let is_hidden = *depth < place.z - SLACK;
            if inside(place.x) && inside(place.y) && !is_hidden {
                known.score *= REFUTED;
                self.refuted.insert((class, cell));
            }
        }
    }

    /// What there is with a score of at least `least`, by class and place.
    pub(crate) fn things(&self, least: f32) -> Vec<Thing> {
        let sure = |(place, known): (&(Class, Cell), &Evidence)| (known.score >= least).then_some(*place);
        let mut left: BTreeSet<(Class, Cell)> = self.evidence.iter().filter_map(sure).collect();
        let mut things = Vec::new();
        while let Some((class, first)) = left.pop_first() {
            let mut group = vec![first];
            let mut next = 0;
            while let Some(&cell) = group.get(next) {
                next += 1;
                for (dx, dz) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dz| (dx, dz))) {
                    let beside = Cell::new(cell.x + dx, cell.z + dz);
                    if left.remove(&(class, beside)) {
                        group.push(beside);
                    }
                }
            }
            group.sort_unstable();
            let cells = group.iter().filter_map(|&cell| Some((cell, *self.evidence.get(&(class, cell))?))).collect();
            things.extend(Thing::of(class, cells));
        }
        things
    }

    /// The evidence for a class in a cell.
    pub(crate) fn evidence(&self, class: Class, cell: Cell) -> Option<&Evidence> {
        self.evidence.get(&(class, cell))
    }

    /// A thing was put there by the agent itself, which need not see it to know.
    pub(crate) fn place(&mut self, class: Class, cell: Cell, height: f32, step: u32) {
        let near = Evidence { score: OWN_HAND, height, seen: step, open: 0.0, near: 0.0, put: true };
        self.evidence.insert((class, cell), near);
        self.refuted.retain(|&(of, at)| of != class || at.apart(cell) > 2);
    }

    /// Multiplies the scores of a class around a cell, up to `radius` metres from it: it turned out not to be there.
    pub(crate) fn discredit(&mut self, class: Class, cell: Cell, radius: f32, factor: f32) {
        for (&(of, at), known) in &mut self.evidence {
            if of == class && eye::between(at, cell) <= radius {
                known.score *= factor;
            }
        }
        self.evidence.retain(|_, known| known.score >= WEAKEST);
    }

    /// Drops a class around a cell, up to `radius` metres from it: it was taken away.
    pub(crate) fn forget(&mut self, class: Class, cell: Cell, radius: f32) {
        self.evidence.retain(|&(of, at), _| of != class || eye::between(at, cell) > radius);
    }
}

impl Thing {
    /// The cell of it that is nearest to the middle of all of them.
    pub(crate) fn middle(&self) -> Cell {
        let sum = |of: fn(Cell) -> i16| self.cells.iter().map(|(cell, _)| i32::from(of(*cell))).sum::<i32>();
        let (x, z, count) = (sum(|cell| cell.x), sum(|cell| cell.z), self.cells.len() as i32);
        let off = |cell: Cell| (i32::from(cell.x) * count - x).abs() + (i32::from(cell.z) * count - z).abs();
        self.cells.iter().map(|(cell, _)| *cell).min_by_key(|&cell| (off(cell), cell)).unwrap_or(self.best)
    }

    /// The thing that these cells make up; `None` without cells.
    fn of(class: Class, cells: Vec<(Cell, Evidence)>) -> Option<Thing> {
        let better = |a: &&(Cell, Evidence), b: &&(Cell, Evidence)| {
            // Of equally sure cells the one that was seen from nearest, then the first.
            a.1.score.total_cmp(&b.1.score).then(b.1.near.total_cmp(&a.1.near)).then(b.0.cmp(&a.0))
        };
        let &(best, Evidence { score, height, .. }) = cells.iter().max_by(better)?;
        let seen = cells.iter().map(|(_, known)| known.seen).max()?;
        let last = cells.iter().filter(|(_, known)| known.seen == seen);
        let (weight, open) =
            last.fold((0.0, 0.0), |(weight, open), (_, it)| (weight + it.score, open + it.score * it.open));
        Some(Thing { class, best, score, height, seen, open: open / weight.max(f32::EPSILON), cells })
    }
}

/// What one glance says for each class and cell.
fn glimpses(pose: Pose, percept: &Percept, held: Option<Class>) -> BTreeMap<(Class, Cell), Glimpse> {
    /// What has the held thing's class and is nearer than this, in metres, is taken for it.
    const HELD: f32 = 0.8;
    let camera = eye::camera(pose);
    let mut glimpses: BTreeMap<(Class, Cell), Glimpse> = BTreeMap::new();
    for &(class, at, probability) in &percept.detections {
        let depth = percept.depth.get(usize::from(at)).copied().unwrap_or(f32::INFINITY);
        let (column, row) = Percept::middle(at);
        let own = (held.is_some() && eye::is_in_hand(column, row, depth)) || (held == Some(class) && depth < HELD);
        if own || !depth.is_finite() {
            continue;
        }
        let point = camera.unproject(column, row, depth);
        let glimpse = glimpses.entry((class, eye::cell_under(point))).or_default();
        if probability > glimpse.probability {
            (glimpse.probability, glimpse.depth) = (probability, depth);
        }
        glimpse.weight += probability;
        glimpse.height += probability * point.y;
        glimpse.open += probability * percept.open.get(usize::from(at)).copied().unwrap_or(0.0);
    }
    glimpses
}

#[cfg(test)]
mod tests {
    use super::super::percept::GRID;
    use super::*;
    use crate::agent::memory::testing::point_in_own_frame;
    use crate::domain::world::Instance;
    use crate::domain::{Heading, Room};
    use crate::house::{House, generate};

    fn class(name: &str) -> Class {
        Class::named(name).unwrap()
    }

    /// A class in one cell of the raster, before a wall at that depth.
    fn percept(name: &str, at: u16, probability: f32, depth: f32) -> Percept {
        let cells = GRID * GRID;
        Percept { detections: vec![(class(name), at, probability)], open: vec![0.0; cells], depth: vec![depth; cells] }
    }

    fn nothing(depth: f32) -> Percept {
        Percept { detections: vec![], ..percept("Mug", 0, 0.0, depth) }
    }

    /// Right of and below the middle of the frame, which falls between cells.
    const MIDDLE: u16 = (20 * GRID + 20) as u16;

    #[test]
    fn the_middle_of_a_thing_is_a_cell_of_it() {
        let cells = |cells: &[(i16, i16)]| {
            let known = Evidence { score: 0.5, ..Evidence::default() };
            let all = cells.iter().map(|&(x, z)| (Cell::new(x, z), known)).collect();
            Thing::of(class("Fridge"), all).unwrap().middle()
        };
        assert_eq!(cells(&[(0, 0), (1, 0), (2, 0), (2, 1)]), Cell::new(1, 0));
        assert_eq!(cells(&[(0, 0), (0, 4), (4, 0), (4, 4)]), Cell::new(0, 0));
    }

    #[test]
    fn what_is_seen_ahead_is_placed_ahead() {
        for heading in Heading::ALL {
            let mut map = SemanticMap::default();
            let pose = Pose { heading, ..Pose::default() };
            map.observe(pose, &percept("Mug", MIDDLE, 0.9, 2.0), None, 7);
            let (dx, dz) = heading.step();
            let [thing] = map.things(0.3).try_into().unwrap();
            assert_eq!((thing.class, thing.best, thing.seen), (class("Mug"), Cell::new(8 * dx, 8 * dz), 7));
            assert!((thing.height - 1.55).abs() < 0.05 && (thing.score - 0.63).abs() < 1e-5, "{thing:?}");
        }
    }

    #[test]
    fn a_thing_that_is_gone_fades_and_a_thing_that_is_hidden_does_not() {
        let mut map = SemanticMap::default();
        map.observe(Pose::default(), &percept("Mug", MIDDLE, 0.9, 2.0), None, 0);
        let seen = map.clone();
        map.observe(Pose::default(), &nothing(1.0), None, 1);
        assert_eq!(map, seen, "something stands before it");
        map.observe(Pose { heading: Heading::South, ..Pose::default() }, &nothing(4.0), None, 2);
        assert_eq!(map, seen, "it is behind the agent");
        map.observe(Pose::default(), &nothing(4.0), None, 3);
        assert!((map.things(0.3)[0].score - 0.6 * 0.63).abs() < 1e-5);
        for step in 4..12 {
            map.observe(Pose::default(), &nothing(4.0), None, step);
        }
        assert_eq!(map, SemanticMap::default());
    }

    #[test]
    fn what_looks_like_a_mug_and_cannot_be_taken_at_hand_is_none_however_often_it_is_seen() {
        let mut map = SemanticMap::default();
        let mug = percept("Mug", MIDDLE, 0.9, 1.0);
        let look = |map: &mut SemanticMap, percept: &Percept, is_offered: bool| {
            map.observe(Pose::default(), percept, None, 0);
            map.refute(Pose::default(), percept, |class| class.info().pickupable && !is_offered);
            map.things(0.0).first().map_or(0.0, |thing| thing.score)
        };
        assert!(look(&mut map, &mug, true) > 0.6, "it can be taken");
        let far = percept("Mug", MIDDLE, 0.9, 2.0);
        assert!(look(&mut SemanticMap::default(), &far, false) > 0.6, "it is out of reach");
        assert!(look(&mut map, &nothing(0.5), false) > 0.6, "something stands before it");
        for _ in 0..5 {
            assert!(look(&mut map, &mug, false) < 0.2, "it is something else");
        }
        let place = map.things(0.0)[0].best;
        map.place(class("Mug"), place, 0.9, 1);
        assert!(look(&mut map, &mug, true) > 0.8, "the agent put one there");
    }

    #[test]
    fn what_is_in_the_hand_is_not_taken_for_a_thing_in_the_room() {
        let mut map = SemanticMap::default();
        map.observe(Pose::default(), &percept("Mug", MIDDLE, 0.9, 0.7), Some(class("Mug")), 0);
        let corner = (35 * GRID + 35) as u16;
        map.observe(Pose::default(), &percept("Mug", corner, 0.9, 0.6), Some(class("Cup")), 1);
        assert_eq!(map.things(0.0), []);
        map.observe(Pose::default(), &percept("Mug", MIDDLE, 0.9, 0.7), Some(class("Cup")), 2);
        assert_eq!(map.things(0.0).len(), 1);
    }

    #[test]
    fn two_things_apart_are_two_and_cells_side_by_side_are_one() {
        let mut map = SemanticMap::default();
        let mut both = percept("Mug", MIDDLE, 0.9, 2.0);
        // 2.6 cm of the scene lie in one cell of the raster at 2 m: these are 0.23 m and 0.92 m to the right.
        both.detections.extend([(class("Mug"), MIDDLE + 4, 0.5), (class("Mug"), MIDDLE + 16, 0.5)]);
        map.observe(Pose::default(), &both, None, 0);
        let things = map.things(0.3);
        assert_eq!(things.iter().map(|thing| thing.cells.len()).collect::<Vec<_>>(), [2, 1]);
        assert_eq!(things[0].best, Cell::new(0, 8));
        map.forget(class("Mug"), Cell::new(0, 8), 0.5);
        assert_eq!(map.things(0.3), things[1..]);
        map.discredit(class("Mug"), things[1].best, 0.5, 0.5);
        assert!((map.things(0.0)[0].score - 0.5 * things[1].score).abs() < 1e-6);
    }

    #[test]
    fn an_open_door_is_known_to_be_open_and_to_be_shut_again() {
        let mut map = SemanticMap::default();
        let mut open = percept("Fridge", MIDDLE, 0.9, 1.0);
        map.observe(Pose::default(), &open, None, 0);
        open.open = vec![1.0; GRID * GRID];
        map.observe(Pose::default(), &open, None, 1);
        assert!(map.things(0.3)[0].open > 0.5);
        map.observe(Pose::default(), &percept("Fridge", MIDDLE, 0.9, 1.0), None, 2);
        assert!(map.things(0.3)[0].open < 0.5);
    }

    #[test]
    fn what_one_look_around_shows_is_where_it_stands() {
        for room in Room::ALL {
            let (scene, mut world) = generate::house(room, 17);
            world.agent.horizon = 30;
            let start = world.agent;
            let mut house = House::new(scene.into(), world);
            let mut map = SemanticMap::default();
            let mut seen = Vec::new();
            for quarters in 0..4 {
                let mut world = house.world().clone();
                world.agent.heading = Heading::from_quarters(start.heading.quarters() + quarters);
                house.restore(world.clone());
                let percept = Percept::of_truth(&house.scene().clone(), &world, house.frame());
                let pose = Pose { heading: Heading::from_quarters(quarters), horizon: 30, ..Pose::default() };
                map.observe(pose, &percept, None, quarters as u32);
                seen.extend(house.view().sightings.iter().filter(|it| it.pixels > 150).map(|it| it.instance));
            }
            let things = map.things(0.3);
            let mut objects = 0;
            for instance in seen.into_iter().filter(|instance| matches!(instance, Instance::Object(_))) {
                let at = house.world().position(house.scene(), instance).unwrap();
                let cell = Cell::nearest(point_in_own_frame(house.scene(), start, at));
                let class = house.world().class_of(house.scene(), instance).unwrap();
                if !class.in_vocabulary() {
                    continue;
                }
                let mut cells = things.iter().filter(|it| it.class == class).flat_map(|it| &it.cells);
                assert!(cells.any(|(at, _)| eye::between(*at, cell) < 0.4), "{class} at {cell:?}");
                objects += 1;
            }
            assert!(objects > 0 || room == Room::Bathroom, "{room:?}");
        }
    }
}
