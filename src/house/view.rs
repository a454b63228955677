//! What the agent sees and could act on: sight follows from the drawn frame, reach from distance.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::outcome::Reason;
use crate::domain::class::FixtureEffect;
use crate::domain::world::{Instance, World};
use crate::domain::{Action, ActionType, Cell, Class, Point, Scene};

/// How far the agent reaches, horizontally, in millimetres.
pub(crate) const REACH: f32 = 1500.0;
/// Fewer pixels than this of a 300 x 300 frame do not count as seen.
pub(crate) const FEWEST_PIXELS: u32 = 12;

/// A drawn frame: colour, depth and instance in one pass. Row-major, top left first.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Pixels in a row.
    pub(crate) width: usize,
    /// Rows.
    pub(crate) height: usize,
    /// Three bytes a pixel: red, green, blue.
    pub(crate) rgb: Vec<u8>,
    /// Distance along the optical axis in metres; infinite where nothing is.
    pub(crate) depth: Vec<f32>,
    /// What each pixel shows: see [`code`].
    pub(crate) ids: Vec<u16>,
}

/// The number of an instance in [`Frame::ids`]; 0 is structure (walls, floor, nothing).
pub(crate) fn code(instance: Instance) -> u16 {
    match instance {
        Instance::Fixture(i) => 1 + i,
        Instance::Object(i) => 0x8000 | i,
    }
}

/// The instance that a number in [`Frame::ids`] stands for.
pub(crate) fn decode(code: u16) -> Option<Instance> {
    match code {
        0 => None,
        fixture if fixture < 0x8000 => Some(Instance::Fixture(fixture - 1)),
        object => Some(Instance::Object(object & 0x7fff)),
    }
}

/// How many pixels of each place of a raster of `side` x `side` show each code but 0; places are numbered row by row.
pub(crate) fn pixels_by_place(frame: &Frame, side: usize) -> BTreeMap<u16, BTreeMap<usize, u16>> {
    let mut counts: BTreeMap<u16, BTreeMap<usize, u16>> = BTreeMap::new();
    for (y, row) in frame.ids.chunks_exact(frame.width).enumerate() {
        let down = y * side / frame.height;
        let mut x = 0;
        while x < row.len() {
            let (id, across) = (row[x], x * side / frame.width);
            let end = ((across + 1) * frame.width).div_ceil(side).min(row.len());
            let run = row[x..end].iter().take_while(|&&other| other == id).count();
            if id != 0 {
                *counts.entry(id).or_default().entry(down * side + across).or_default() += run as u16;
            }
            x += run;
        }
    }
    counts
}

/// The places in which a thing shows, of its pixels by place: not those at its edge that show little of it, whose depth is that
/// of what is before or behind it.
pub(crate) fn places_of(pixels: &BTreeMap<usize, u16>) -> Vec<usize> {
    /// So many pixels of a 300 x 300 frame in one of 1600 places show a thing there, and at least this share of the most.
    const FEWEST: u16 = 4;
    const SHARE: u16 = 2;
    let most = pixels.values().copied().max().unwrap_or(0);
    let least = FEWEST.max(most / SHARE).min(most);
    pixels.iter().filter(|(_, count)| **count >= least).map(|(&place, _)| place).collect()
}

/// An instance in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sighting {
    /// The thing whose pixels these are.
    pub(crate) instance: Instance,
    /// How many pixels show it.
    pub(crate) pixels: u32,
    /// The edges of those pixels: left, top, right, bottom (right and bottom inclusive).
    pub(crate) bounds: [u16; 4],
}

/// Everything in a frame that counts as seen, in the order of instances.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct View {
    /// One for each instance with a pixel.
    pub(crate) sightings: Vec<Sighting>,
}

impl View {
    /// Reads a frame. Every pixel counts as one of a 300 x 300 frame, whatever the frame's size.
    pub fn of(frame: &Frame) -> View {
        View::of_rows(frame.height, frame.ids.chunks_exact(frame.width).map(|row| row.iter().copied()))
    }

    /// Reads the rows of a square image of `size` rows, each pixel as in [`Frame::ids`].
    pub(crate) fn of_rows<Row: Iterator<Item = u16>>(size: usize, rows: impl Iterator<Item = Row>) -> View {
        let mut found: BTreeMap<u16, Sighting> = BTreeMap::new();
        for (y, row) in (0u16..).zip(rows) {
            let mut add = |id: u16, left: u16, end: u16| {
                let Some(instance) = decode(id) else { return };
                let right = end - 1;
                let seen = found.entry(id).or_insert(Sighting { instance, pixels: 0, bounds: [left, y, right, y] });
                seen.pixels += u32::from(end - left);
                let [l, t, r, b] = seen.bounds;
                seen.bounds = [l.min(left), t.min(y), r.max(right), b.max(y)];
            };
            let (mut run, mut from, mut end) = (0, 0, 0);
            for (x, id) in (0u16..).zip(row) {
                if id != run {
                    add(run, from, x);
                    (run, from) = (id, x);
                }
                end = x + 1;
            }
            add(run, from, end);
        }
        let scale = 90_000.0 / (size * size).max(1) as f32;
        let enough = |sighting: &Sighting| sighting.pixels as f32 * scale >= FEWEST_PIXELS as f32;
        View { sightings: found.into_values().filter(enough).collect() }
    }

    /// The sighting of an instance, if it is seen.
    pub fn sighting(&self, instance: Instance) -> Option<&Sighting> {
        self.sightings.iter().find(|sighting| sighting.instance == instance)
    }
}

/// Horizontal distance from the agent to an instance in millimetres: to the pivot, or to the nearest point of a fixture's
/// body or surfaces when that is nearer.
pub(crate) fn distance(scene: &Scene, world: &World, instance: Instance) -> Option<f32> {
    distance_from(scene, world, world.agent.cell, instance)
}

/// The same distance for an agent that stands in `cell`.
pub(crate) fn distance_from(scene: &Scene, world: &World, cell: Cell, instance: Instance) -> Option<f32> {
    let agent = cell.centre(scene.agent_y);
    let pivot = agent.floor_distance(world.position(scene, instance)?);
    let Instance::Fixture(index) = instance else { return Some(pivot) };
    let fixture = scene.fixture(index)?;
    let body = fixture.body.iter().map(|part| part.footprint());
    let areas = fixture.surfaces.iter().flat_map(|surface| surface.areas.iter().copied());
    Some(body.chain(areas).map(|rect| agent.floor_distance(rect.nearest(agent))).fold(pivot, f32::min))
}

/// Distance in space from the agent's own point to the pivot, in millimetres: what "nearest" of a class means (paper's code).
pub(crate) fn nearness(scene: &Scene, world: &World, instance: Instance) -> f32 {
    nearness_from(scene, world, world.agent.cell, instance)
}

/// The same distance for an agent that stands in `cell`.
pub(crate) fn nearness_from(scene: &Scene, world: &World, cell: Cell, instance: Instance) -> f32 {
    let agent: Point = cell.centre(scene.agent_y);
    world.position(scene, instance).map_or(f32::INFINITY, |pivot| agent.distance(pivot))
}

/// Whether the agent could act on an instance from where it stands: it sees it and reaches it.
pub(crate) fn reachable(scene: &Scene, world: &World, view: &View, instance: Instance) -> Result<(), Reason> {
    let class = world.class_of(scene, instance).ok_or(Reason::UnknownTarget)?;
    if view.sighting(instance).is_none() {
        return Err(Reason::NotVisible(class));
    }
    let away = distance(scene, world, instance).ok_or(Reason::UnknownTarget)?;
    if away > REACH {
        return Err(Reason::TooFar { class, millimetres: away as i32 });
    }
    Ok(())
}

/// Whether the agent could act so on an instance from where it stands: as [`reachable`], and a tap is only turned on while what
/// it runs into is seen.
pub(crate) fn actionable(
    scene: &Scene,
    world: &World,
    view: &View,
    kind: ActionType,
    instance: Instance,
) -> Result<(), Reason> {
    reachable(scene, world, view, instance)?;
    let rinses = world.class_of(scene, instance).is_some_and(|class| class.info().effect == Some(FixtureEffect::Rinse));
    if kind == ActionType::ToggleOn
        && rinses
        && let Some(pivot) = world.position(scene, instance)
        && let Some(basin) = super::rules::nearest_basin(scene, pivot)
        && view.sighting(basin).is_none()
    {
        return Err(Reason::NotVisible(world.class_of(scene, basin).unwrap_or_default()));
    }
    Ok(())
}

/// An interaction that is possible now.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// The interaction.
    pub(crate) kind: ActionType,
    /// Its target.
    pub(crate) instance: Instance,
    /// The target's class, by which a policy chooses it.
    pub(crate) class: Class,
    /// From the agent's own point to its pivot, in millimetres.
    pub(crate) distance: f32,
}

impl Candidate {
    /// As the house takes it.
    pub(crate) fn action(&self) -> Action {
        Action::interact(self.kind, self.instance)
    }
}

/// Every interaction that is possible now, by action and then by distance: the target's class can be named, it is seen and in
/// reach, and the rules would carry it out.
pub(crate) fn candidates(scene: &Scene, world: &World, view: &View) -> Vec<Candidate> {
    let mut found = Vec::new();
    for sighting in &view.sightings {
        let instance = sighting.instance;
        let Some(class) = world.class_of(scene, instance).filter(|class| class.in_vocabulary()) else { continue };
        if reachable(scene, world, view, instance).is_err() {
            continue;
        }
        for kind in ActionType::ALL.into_iter().filter(|kind| kind.is_interaction()) {
            if super::rules::check(scene, world, Action::interact(kind, instance)).is_ok()
                && actionable(scene, world, view, kind, instance).is_ok()
            {
                found.push(Candidate { kind, instance, class, distance: nearness(scene, world, instance) });
            }
        }
    }
    found.sort_by(|a, b| (a.kind, a.distance).partial_cmp(&(b.kind, b.distance)).unwrap_or(std::cmp::Ordering::Equal));
    found
}

/// The candidate that a policy means by an action and a class: the nearest one.
pub(crate) fn nearest(candidates: &[Candidate], kind: ActionType, class: Class) -> Option<&Candidate> {
    candidates.iter().find(|candidate| candidate.kind == kind && candidate.class == class)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thing_shows_where_there_is_much_of_it_and_a_small_one_where_there_is_any() {
        let large = BTreeMap::from([(1, 56), (2, 30), (3, 20), (4, 5)]);
        assert_eq!(places_of(&large), [1, 2]);
        let small = BTreeMap::from([(7, 5), (8, 4), (9, 2)]);
        assert_eq!(places_of(&small), [7, 8]);
        assert_eq!(places_of(&BTreeMap::from([(7, 1)])), [7]);
    }
}
