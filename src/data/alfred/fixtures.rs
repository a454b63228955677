//! The fixed furniture of a floor plan: every receptacle, lamp and faucet that any file of it names.

use std::collections::BTreeMap;

use super::layout::FloorPlanLayout;
use super::names::{Name, NamedPart};
use super::recording::{RecordedStart, Recording};
use crate::domain::place::Pose;
use crate::domain::{ActionType, Class, Point, SkillKind};

/// Two mentions of one class nearer than this are the same thing, in millimetres.
const SAME: f32 = 30.0;
/// A basin lies up to this far, seen from above, from the sink whose place its id gives, in millimetres. Some sinks have
/// their place on the floor.
const BASIN: f32 = 600.0;
/// Ids are rounded to the centimetre on each axis; twice the rounding, in millimetres.
pub(crate) const ROUNDING: f32 = 11.0;

/// A recorded use of a fixture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Use {
    /// The interaction.
    pub(crate) kind: ActionType,
    /// The agent's pose before it.
    pub(crate) pose: Pose,
    /// Its box in the frame before it.
    pub(crate) bounds: Option<[u16; 4]>,
    /// Whether it stood open then.
    pub(crate) open: bool,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FoundFixture {
    /// Its id.
    pub(crate) name: Name,
    pub(crate) pivot: Point,
    /// The vetted pose for using it, from the layout files.
    pub(crate) vetted: Option<Pose>,
    /// Poses that the expert walked to before using it.
    pub(crate) walked_to: Vec<Pose>,
    /// How the expert used it.
    pub(crate) uses: Vec<Use>,
    /// The pivot is known to the millimetre, not only from the id.
    exact: bool,
}

/// All fixtures of a floor plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Inventory {
    /// The fixtures, in the order of their names.
    pub(crate) found: Vec<FoundFixture>,
    numbers: BTreeMap<Name, u16>,
}

fn is_fixture(class: Class) -> bool {
    class != Class::NONE && !class.info().pickupable
}

pub(crate) fn is_basin(class: Class) -> bool {
    matches!(class.name(), "Sink" | "Bathtub")
}

impl Inventory {
    /// Gathers the fixtures of one floor plan from its layout and all recordings of it.
    pub(crate) fn gather(layout: &FloorPlanLayout, recordings: &[&Recording]) -> Inventory {
        let mut pivots: BTreeMap<Name, Option<Point>> = BTreeMap::new();
        for &name in layout.stands.keys() {
            pivots.entry(name).or_default();
        }
        let mut loose: Vec<(Class, Point)> = Vec::new();
        for recording in recordings {
            for name in recording.steps.iter().filter_map(|step| step.target) {
                pivots.entry(name).or_default();
            }
            for skill in &recording.skills {
                pivots.entry(skill.object).or_default();
                let placed = match skill.kind {
                    SkillKind::Put => skill.receptacle.zip(skill.receptacle_at),
                    SkillKind::Toggle => Some(skill.object).zip(skill.object_at),
                    SkillKind::Clean | SkillKind::Heat | SkillKind::Cool => Some(skill.object).zip(skill.receptacle_at),
                    SkillKind::Pickup | SkillKind::Slice => {
                        loose.extend(skill.receptacle_at);
                        None
                    }
                };
                if let Some((name, (_, point))) = placed {
                    let entry = pivots.entry(name).or_default();
                    let basin = name.part == NamedPart::Basin && point.floor_distance(name.at) <= BASIN;
                    if basin || point.distance(name.at) <= ROUNDING {
                        *entry = Some(point);
                    }
                }
            }
        }
        let mut inventory = Inventory::default();
        for (name, point) in pivots.into_iter().filter(|(name, _)| is_fixture(name.class)) {
            inventory.add(name, point);
        }
        loose.retain(|(class, _)| is_fixture(*class));
        loose.sort_unstable();
        loose.dedup();
        for (class, point) in loose {
            inventory.add_loose(class, point);
        }
        inventory.sort();
        for (name, pose) in &layout.stands {
            if let Some(number) = inventory.number(*name) {
                inventory.found[usize::from(number)].vetted = Some(*pose);
            }
        }
        for recording in recordings {
            inventory.note_uses(recording);
        }
        inventory
    }

    fn add(&mut self, name: Name, point: Option<Point>) {
        let pivot = point.unwrap_or(name.at);
        let same = |found: &FoundFixture| found.name.class == name.class && found.pivot.distance(pivot) < SAME;
        let known = self.numbers.get(&name).map(|&number| usize::from(number));
        let number = match known.or_else(|| self.found.iter().position(same)) {
            Some(number) => {
                let found = &mut self.found[number];
                if point.is_some() && !found.exact {
                    (found.pivot, found.exact) = (pivot, true);
                }
                number
            }
            None => {
                let exact = point.is_some();
                self.found.push(FoundFixture { name, pivot, vetted: None, walked_to: vec![], uses: vec![], exact });
                self.found.len() - 1
            }
        };
        self.numbers.insert(name, number as u16);
    }

    /// Adds a thing that is only known by class and place, if it is none of those known by id.
    fn add_loose(&mut self, class: Class, point: Point) {
        let near = |found: &FoundFixture| {
            if is_basin(class) {
                let (pivot, basin) = (found.pivot, found.name.part == NamedPart::Basin);
                let unsure = !found.exact && pivot.floor_distance(point) < BASIN;
                is_basin(found.name.class) && basin && (unsure || pivot.distance(point) < SAME)
            } else {
                found.name.class == class && found.pivot.distance(point) < SAME
            }
        };
        let nearest = self.found.iter_mut().filter(|found| near(found));
        match nearest.min_by(|a, b| a.pivot.distance(point).total_cmp(&b.pivot.distance(point))) {
            Some(found) if found.exact => {}
            Some(found) => (found.pivot, found.exact) = (point, true),
            None => {
                let round = |mm: i32| (mm as f32 / 10.0).round() as i32 * 10;
                let at = Point::new(round(point.x), round(point.y), round(point.z));
                let part = if is_basin(class) { NamedPart::Basin } else { NamedPart::Whole };
                self.add(Name { class, at, part }, Some(point));
            }
        }
    }

    fn sort(&mut self) {
        let mut order: Vec<usize> = (0..self.found.len()).collect();
        order.sort_by_key(|&number| self.found[number].name);
        let mut place = vec![0u16; order.len()];
        for (new, &old) in order.iter().enumerate() {
            place[old] = new as u16;
        }
        self.found.sort_by_key(|found| found.name);
        for number in self.numbers.values_mut() {
            *number = place[usize::from(*number)];
        }
    }

    fn note_uses(&mut self, recording: &Recording) {
        let mut open: BTreeMap<u16, bool> = BTreeMap::new();
        let mut noted = usize::MAX;
        for (pose, step) in recording.poses().into_iter().zip(&recording.steps) {
            let Some(number) = step.target.and_then(|name| self.number(name)) else { continue };
            let found = &mut self.found[usize::from(number)];
            let is_open = open.entry(number).or_default();
            found.uses.push(Use { kind: step.kind, pose, bounds: step.bounds, open: *is_open });
            match step.kind {
                ActionType::Open => *is_open = true,
                ActionType::Close => *is_open = false,
                _ => {}
            }
            if noted != step.skill {
                noted = step.skill;
                found.walked_to.extend(recording.skills.get(step.skill).and_then(|skill| skill.walked_to));
            }
        }
    }

    /// The number of the fixture of that name.
    pub(crate) fn number(&self, name: Name) -> Option<u16> {
        self.numbers.get(&name).copied()
    }

    /// The number of the fixture of that class at that place.
    pub(crate) fn at(&self, class: Class, point: Point) -> Option<u16> {
        let same = |found: &FoundFixture| {
            let kind = found.name.class == class || (is_basin(class) && is_basin(found.name.class));
            kind && found.pivot.distance(point) < SAME
        };
        self.found.iter().position(same).map(|number| number as u16)
    }
}

impl Recording {
    /// The agent's pose before each step.
    pub(crate) fn poses(&self) -> Vec<Pose> {
        let mut pose = self.setting.agent;
        let step = |step: &super::recording::RecordedStep| {
            let before = pose;
            match step.kind {
                ActionType::MoveAhead => pose.cell = pose.cell.ahead(pose.heading),
                ActionType::RotateLeft => pose.heading = pose.heading.left(),
                ActionType::RotateRight => pose.heading = pose.heading.right(),
                ActionType::LookUp => pose.horizon = (pose.horizon - Pose::LOOK).max(Pose::UP),
                ActionType::LookDown => pose.horizon = (pose.horizon + Pose::LOOK).min(Pose::DOWN),
                _ => {}
            }
            before
        };
        self.steps.iter().map(step).collect()
    }
}

impl RecordedStart {
    /// The number of the movable object of that name. Of several at one place, the one nearest to `precise`.
    pub(crate) fn object(&self, name: Name, precise: Option<Point>) -> Option<u16> {
        let wanted = precise.filter(|point| point.distance(name.at) <= ROUNDING).unwrap_or(name.at);
        self.object_at(name.class, wanted)
    }

    /// The number of the movable object of that class nearest to that place.
    pub(crate) fn object_at(&self, class: Class, place: Point) -> Option<u16> {
        let near = self.objects.iter().enumerate().filter(|(_, object)| object.class == class);
        let near = near.map(|(number, object)| (number, object.at.distance(place)));
        let nearest = near.filter(|(_, distance)| *distance <= ROUNDING).min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map(|(number, _)| number as u16)
    }
}
