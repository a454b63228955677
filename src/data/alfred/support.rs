//! Where things stand: what each fixture holds, learned from where recorded objects lay.

use super::cover::cover;
use super::fixtures::Inventory;
use super::furniture;
use super::recording::{RecordedStart, Recording};
use crate::domain::place::Rect;
use crate::domain::scene::Surface;
use crate::domain::{ActionType, Cell, Class, Heading, Point, SkillKind};

/// Heights count this many times as much as distances over the floor when a neighbour is sought.
const HEIGHT_WEIGHT: f32 = 4.0;
/// A neighbour farther than this says nothing, in millimetres.
const LIMIT: f32 = 500.0;
/// No fixture holds anything farther from its pivot than this, in millimetres.
const WIDEST: f32 = 7000.0;
/// Around the outermost contents.
pub(crate) const MARGIN: i32 = 50;
/// Half the side of the square around a cell's middle that no furniture fills.
const WALKED: i32 = 150;
/// Shelves of one receptacle are farther apart than this.
const STOREY: i32 = 120;

/// A point on which something is known to stand, and the fixture that holds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StandingObject {
    /// The support under the object.
    pub(crate) at: Point,
    /// What stands there.
    pub(crate) class: Class,
    pub(crate) fixture: u16,
    /// How far from here things still count as standing in the same fixture.
    limit: f32,
}

/// What is recorded to hold an object at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Holder {
    /// None: it was taken from a receptacle that was shut, so it lies on or beside it.
    None,
    Fixture(u16),
    /// A movable object.
    Object(u16),
}

/// The point under an object: its pivot lowered by how high its class rests.
pub(crate) fn foot(class: Class, at: Point) -> Point {
    Point { y: at.y - class.info().rest, ..at }
}

impl Recording {
    /// Which objects are recorded in which receptacle at the start: what each first Pickup says of an unmoved object.
    pub(crate) fn recorded_holders(&self, inventory: &Inventory) -> Vec<(u16, Holder)> {
        let mut moved = vec![false; self.setting.objects.len()];
        let mut holders = Vec::new();
        let mut opened: Vec<u16> = Vec::new();
        let mut steps = self.steps.iter().peekable();
        for (number, skill) in self.skills.iter().enumerate() {
            if skill.kind == SkillKind::Pickup
                && let Some(object) = self.object(skill.object.whole(), skill.object_at)
                && !moved[usize::from(object)]
                && let Some((class, place)) = skill.receptacle_at
            {
                let here =
                    |step: &&super::recording::RecordedStep| step.skill == number && step.kind == ActionType::Open;
                let opens = self.steps.iter().filter(here).filter_map(|step| inventory.number(step.target?));
                opened.extend(opens);
                let fixture = inventory.at(class, place).map(|fixture| match class.info().openable {
                    true if !opened.contains(&fixture) => Holder::None,
                    _ => Holder::Fixture(fixture),
                });
                let movable = || {
                    let holder = self.setting.object_at(class, place).filter(|&holder| !moved[usize::from(holder)]);
                    holder.map(Holder::Object)
                };
                holders.extend(fixture.or_else(movable).map(|holder| (object, holder)));
            }
            while let Some(step) = steps.next_if(|step| step.skill == number) {
                if step.kind == ActionType::Open {
                    opened.extend(step.target.and_then(|name| inventory.number(name)));
                }
                if step.kind == ActionType::Pickup
                    && let Some(name) = step.target
                    && let Some(object) = self.object(name.whole(), None)
                {
                    moved[usize::from(object)] = true;
                }
            }
        }
        holders.sort_by_key(|(object, _)| *object);
        holders.dedup_by_key(|(object, _)| *object);
        holders
    }

    /// The number of the movable object of that name, with the plan's more exact place of it where there is one.
    pub(crate) fn object(&self, name: super::names::Name, precise: Option<(Class, Point)>) -> Option<u16> {
        let planned = || {
            let same = self.skills.iter().filter(|skill| skill.object.whole() == name);
            same.filter_map(|skill| skill.object_at).find(|(class, _)| *class == name.class)
        };
        let precise = precise.filter(|(class, _)| *class == name.class).or_else(planned);
        self.setting.object(name, precise.map(|(_, place)| place))
    }
}

/// The points that the recordings themselves assign to fixtures.
pub(crate) fn recorded(recordings: &[&Recording], inventory: &Inventory) -> Vec<StandingObject> {
    let mut standings = Vec::new();
    for recording in recordings {
        for (object, holder) in recording.recorded_holders(inventory) {
            if let Holder::Fixture(fixture) = holder {
                let placed = &recording.setting.objects[usize::from(object)];
                if inventory.found[usize::from(fixture)].pivot.floor_distance(placed.at) > WIDEST {
                    continue;
                }
                // Small things on a counter would otherwise claim what stands beside them.
                let limit = match inventory.found[usize::from(fixture)].name.class.name() {
                    "CoffeeMachine" | "ToiletPaperHanger" | "HandTowelHolder" | "TowelHolder" => 100.0,
                    "StoveBurner" => 150.0,
                    _ => LIMIT,
                };
                let at = foot(placed.class, placed.at);
                standings.push(StandingObject { at, class: placed.class, fixture, limit });
            }
        }
    }
    standings
}

/// The fixture of the nearest known point, if one is near enough.
pub(crate) fn nearest(known: &[StandingObject], at: Point) -> Option<u16> {
    let distance = |standing: &StandingObject| {
        let floor = standing.at.floor_distance(at);
        let height = (standing.at.y - at.y) as f32 * HEIGHT_WEIGHT;
        (floor * floor + height * height).sqrt()
    };
    let near = known.iter().map(|standing| (distance(standing), standing)).filter(|(d, standing)| *d <= standing.limit);
    near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, standing)| standing.fixture)
}

/// Every point at which anything stood, assigned to fixtures: as recorded, else as its nearest recorded neighbour.
pub(crate) fn assigned(settings: &[&RecordedStart], recorded: &[StandingObject]) -> Vec<StandingObject> {
    let mut all = recorded.to_vec();
    for object in settings.iter().flat_map(|setting| &setting.objects) {
        let at = foot(object.class, object.at);
        if let Some(fixture) = nearest(recorded, at) {
            all.push(StandingObject { at, class: object.class, fixture, limit: 0.0 });
        }
    }
    all
}

/// The surfaces of one fixture, lowest first, from the points assigned to it; medians of its class where there are none.
/// Nothing stands on what is `blocked`.
pub(crate) fn surfaces(
    inventory: &Inventory,
    number: u16,
    assigned: &[StandingObject],
    blocked: &[Rect],
    facing: Heading,
    floor: i32,
) -> Vec<Surface> {
    let found = &inventory.found[usize::from(number)];
    let row = furniture::of(found.name.class);
    let mine: Vec<Point> = assigned.iter().filter(|s| s.fixture == number).map(|s| s.at).collect();
    if row.supports.is_empty() {
        return Vec::new();
    }
    if mine.is_empty() {
        let area = ahead_of(found.pivot, facing, row.area, -row.behind);
        let level = |height: &furniture::MeasuredHeight| Surface {
            height: height.above(found.pivot.y, floor),
            areas: vec![area],
        };
        return row.supports.iter().map(level).collect();
    }
    let outline = extent(&mine);
    let storeys = if row.supports.len() > 1 { storeys(&mine) } else { vec![mine.clone()] };
    let level = |points: &Vec<Point>| {
        let flat: Vec<[i32; 2]> = points.iter().map(|p| [p.x, p.z]).collect();
        // A shelf of a closed receptacle is as large as the receptacle; a single point on it says nothing of its size.
        let outline = if points.len() < 8 { outline } else { extent(points) };
        let mut areas = cover(outline, &flat, blocked);
        if areas.is_empty() {
            areas.push(outline);
        }
        Surface { height: median(points.iter().map(|p| p.y)), areas }
    };
    storeys.iter().map(level).collect()
}

/// Places that no furniture standing on the floor covers: around the middles of cells.
pub(crate) fn walked(cells: &[Cell]) -> Vec<Rect> {
    let middle = |cell: &Cell| {
        let at = cell.centre(0);
        Rect { min: [at.x, at.z], max: [at.x, at.z] }.grown(WALKED)
    };
    cells.iter().map(middle).collect()
}

/// A rectangle of that width and depth whose middle lies `ahead` of the pivot in the direction of its front.
pub(crate) fn ahead_of(pivot: Point, facing: Heading, [width, depth]: [i32; 2], ahead: i32) -> Rect {
    let (dx, dz) = facing.step();
    let middle = [pivot.x + i32::from(dx) * ahead, pivot.z + i32::from(dz) * ahead];
    let half = if dx == 0 { [width / 2, depth / 2] } else { [depth / 2, width / 2] };
    Rect { min: [middle[0] - half[0], middle[1] - half[1]], max: [middle[0] + half[0], middle[1] + half[1]] }
}

/// Where nearly all points lie, with a margin.
fn extent(points: &[Point]) -> Rect {
    let range = |values: Vec<i32>| {
        let mut values = values;
        values.sort_unstable();
        let off = values.len() / 100;
        (values[off], values[values.len() - 1 - off])
    };
    let (left, right) = range(points.iter().map(|p| p.x).collect());
    let (bottom, top) = range(points.iter().map(|p| p.z).collect());
    Rect { min: [left, bottom], max: [right, top] }.grown(MARGIN)
}

/// The middle value; 0 of nothing.
pub(crate) fn median(values: impl Iterator<Item = i32>) -> i32 {
    let mut values: Vec<i32> = values.collect();
    values.sort_unstable();
    values.get(values.len() / 2).copied().unwrap_or_default()
}

/// Points by height, split where there is a gap; a storey that hardly anything stands on is dropped.
fn storeys(points: &[Point]) -> Vec<Vec<Point>> {
    let mut sorted = points.to_vec();
    sorted.sort_unstable_by_key(|p| p.y);
    let mut storeys: Vec<Vec<Point>> = Vec::new();
    for point in sorted {
        match storeys.last_mut() {
            Some(storey) if point.y - storey[storey.len() - 1].y < STOREY => storey.push(point),
            _ => storeys.push(vec![point]),
        }
    }
    let enough = (points.len() / 50).max(1);
    storeys.retain(|storey| storey.len() >= enough);
    storeys
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shelves_are_told_apart_by_gaps_in_height() {
        let points: Vec<Point> = [400, 410, 405, 800, 805, 1200].map(|y| Point::new(0, y, 0)).into();
        let heights: Vec<i32> = storeys(&points).iter().map(|s| median(s.iter().map(|p| p.y))).collect();
        assert_eq!(heights, [405, 805, 1200]);
    }

    #[test]
    fn the_nearest_known_point_decides_unless_it_is_too_far_above_or_below() {
        let known = |at, fixture| StandingObject { at, class: Class::default(), fixture, limit: LIMIT };
        let known = [known(Point::new(0, 900, 0), 1), known(Point::new(300, 900, 0), 2)];
        assert_eq!(nearest(&known, Point::new(200, 905, 0)), Some(2));
        assert_eq!(nearest(&known, Point::new(0, 700, 0)), None);
    }
}
