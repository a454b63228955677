//! What holds each object at the start: as recorded, else as its neighbours, else as the furniture under it.

use super::fixtures::Inventory;
use super::recording::{RecordedStart, Recording};
use super::support::{Holder, StandingObject, foot, nearest};
use crate::domain::world::{Instance, Parent};
use crate::domain::{Fixture, Point};

/// A level this near under an object holds it, in millimetres.
const ON_LEVEL: i32 = 30;
/// Contents of a movable receptacle may lie this far below its floor, in millimetres.
const BELOW: i32 = 30;
/// The lowest rim that still holds something, in millimetres.
const RIM: i32 = 60;

/// The initial parent of every object of a recording.
pub(crate) fn parents(
    recording: &Recording,
    inventory: &Inventory,
    recorded: &[StandingObject],
    fixtures: &[Fixture],
) -> Vec<Parent> {
    let setting = &recording.setting;
    let mut parents: Vec<Option<Parent>> = vec![None; setting.objects.len()];
    for (object, holder) in recording.recorded_holders(inventory) {
        parents[usize::from(object)] = Some(match holder {
            Holder::None => Parent::Floor,
            Holder::Fixture(number) => Parent::In(Instance::Fixture(number)),
            Holder::Object(number) => Parent::In(Instance::Object(number)),
        });
    }
    (0..parents.len())
        .map(|number| {
            let inside = || movable_around(setting, number).map(Instance::Object);
            let object = &setting.objects[number];
            let at = foot(object.class, object.at);
            let beside = || nearest(recorded, at).map(Instance::Fixture);
            let above = || fixture_under(fixtures, at).map(Instance::Fixture);
            let found = || inside().or_else(beside).or_else(above).map_or(Parent::Floor, Parent::In);
            parents[number].unwrap_or_else(found)
        })
        .collect()
}

/// The movable receptacle that an object lies in, by distance, height, and what such receptacles are used for.
fn movable_around(setting: &RecordedStart, number: usize) -> Option<u16> {
    let content = &setting.objects[number];
    let under = foot(content.class, content.at);
    let holders = setting.objects.iter().enumerate().filter(|(other, holder)| {
        let class = holder.class;
        let info = class.info();
        let floor = foot(class, holder.at).y;
        let rise = under.y - floor;
        *other != number
            && info.content_radius > 0
            && class != content.class
            && class.holds(content.class)
            && holder.at.floor_distance(content.at) < info.content_radius as f32
            && (-BELOW..info.size[1].max(RIM)).contains(&rise)
    });
    let nearest = holders.min_by(|(_, a), (_, b)| a.at.distance(content.at).total_cmp(&b.at.distance(content.at)));
    nearest.map(|(number, _)| number as u16)
}

/// The fixture that has a level right under a point.
fn fixture_under(fixtures: &[Fixture], at: Point) -> Option<u16> {
    let mut best: Option<(i32, u16)> = None;
    for (number, fixture) in (0u16..).zip(fixtures) {
        for surface in &fixture.surfaces {
            let off = (surface.height - at.y).abs();
            let on = off < ON_LEVEL && surface.areas.iter().any(|area| area.contains(at.x, at.z));
            if on && best.is_none_or(|(least, _)| off < least) {
                best = Some((off, number));
            }
        }
    }
    best.map(|(_, number)| number)
}
