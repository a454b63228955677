//! What stands where: evidence for each class in each cell of the floor plan, gathered over all glances.

use std::collections::{BTreeMap, BTreeSet};

use super::eye;
use super::percept::Percept;
use crate::domain::{Cell, Class, Pose};

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
}

impl SemanticMap {
    /// Takes in what is seen from `pose`. The held thing is drawn before the room: what looks like it and is at arm's length
    /// says nothing.
    pub(crate) fn observe(&mut self, pose: Pose, percept: &Percept, held: Option<Class>, step: u32) {
        let glimpses = glimpses(pose, percept, held);
        self.miss(pose, percept, &glimpses);
        for (&(class, cell), glimpse) in &glimpses {
            let weight = glimpse.weight.max(f32::EPSILON);
            let (height, open) = (glimpse.height / weight, glimpse.open / weight);
            let away = eye::between(pose.cell, cell);
            let fresh = Evidence { score: 0.0, height, seen: step, open, near: away };
            let known = self.evidence.entry((class, cell)).or_insert(fresh);
            let towards = WEIGHTS[usize::from(glimpse.depth > NEAR)];
            known.score += towards * (glimpse.probability - known.score);
            known.height += towards * (height - known.height);
            known.open += WEIGHTS[0] * (open - known.open);
            known.near = known.near.min(away);
            known.seen = step;
        }
        self.evidence.retain(|_, known| known.score >= WEAKEST);
    }

    /// Weakens what should be in view and is not.
    fn miss(&mut self, pose: Pose, percept: &Percept, glimpses: &BTreeMap<(Class, Cell), Glimpse>) {
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
            let hidden = *depth < place.z - SLACK || eye::is_in_hand(place.x, place.y, *depth);
            let again = seen.get(&class).is_some_and(|cells| cells.iter().any(|at| eye::between(*at, cell) <= DRIFT));
            if !hidden && !again {
                known.score *= MISSED;
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
        let own = eye::is_in_hand(column, row, depth) || (held == Some(class) && depth < HELD);
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
