//! How well the boxes of targets, as the simulator projects them, fit those that ALFRED recorded.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::domain::world::Instance;
use crate::domain::{ActionType, Scene, World};
use crate::house::bounds::projected_bounds;

/// How well the boxes of targets, as the simulator projects them, fit those that ALFRED recorded.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct BoxReport {
    /// How many boxes were compared.
    pub(crate) n: usize,
    /// Median intersection over union, first pickups of objects that nothing moved before.
    pub(crate) pickup_median_iou: f64,
    /// The same of receptacles that something is put into.
    pub(crate) put_median_iou: f64,
    /// By what was done and the target's class.
    pub(crate) per_class: BTreeMap<String, ClassBoxes>,
}

/// The same for one action and class.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ClassBoxes {
    /// How many boxes of it were compared.
    pub(crate) n: usize,
    /// Median intersection over union of projected and recorded box.
    pub(crate) median_iou: f64,
}

/// An action, its target's class, and the intersection over union of projected and recorded box.
pub(super) type Overlap = (ActionType, &'static str, f32);

/// Marks an object and all it carries as moved.
pub(super) fn note_moved(world: &World, index: u16, moved: &mut [bool]) {
    let carried: Vec<u16> = world.contents(Instance::Object(index)).collect();
    for index in carried.into_iter().chain([index]) {
        if let Some(moved) = moved.get_mut(usize::from(index)) {
            *moved = true;
        }
    }
}

/// How well the projected target fits the recorded box, for the interactions that are compared.
pub(super) fn compare(
    scene: &Scene,
    world: &World,
    kind: ActionType,
    target: Instance,
    recorded: [u16; 4],
    moved: &[bool],
) -> Option<Overlap> {
    let counts = match (kind, target) {
        (ActionType::Pickup, Instance::Object(index)) => moved.get(usize::from(index)) == Some(&false),
        (ActionType::Put, _) => true,
        _ => false,
    };
    if !counts || recorded == [0; 4] {
        return None;
    }
    let class = world.class_of(scene, target)?.name();
    let projected = projected_bounds(scene, world, world.agent, target);
    Some((kind, class, projected.map_or(0.0, |projected| iou(projected, recorded.map(f32::from)))))
}

/// Intersection over union of two boxes, given by left, top, right and bottom edges.
fn iou(a: [f32; 4], b: [f32; 4]) -> f32 {
    let area = |[left, top, right, bottom]: [f32; 4]| (right - left).max(0.0) * (bottom - top).max(0.0);
    let shared = area([a[0].max(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].min(b[3])]);
    let all = area(a) + area(b) - shared;
    if all > 0.0 { shared / all } else { 0.0 }
}

/// The overlaps of all replayed demonstrations together.
pub(super) fn box_report(all: &[Overlap]) -> BoxReport {
    let median_of =
        |kind: ActionType| median(all.iter().filter(|(k, _, _)| *k == kind).map(|(_, _, iou)| *iou).collect());
    let mut classes: BTreeMap<String, Vec<f32>> = BTreeMap::new();
    for (kind, class, iou) in all {
        classes.entry(format!("{kind} {class}")).or_default().push(*iou);
    }
    let class = |ious: Vec<f32>| ClassBoxes { n: ious.len(), median_iou: median(ious) };
    BoxReport {
        n: all.len(),
        pickup_median_iou: median_of(ActionType::Pickup),
        put_median_iou: median_of(ActionType::Put),
        per_class: classes.into_iter().map(|(name, ious)| (name, class(ious))).collect(),
    }
}

/// The middle value; 0 of nothing.
fn median(mut values: Vec<f32>) -> f64 {
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied().map_or(0.0, f64::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlap_of_boxes_is_one_for_equal_and_zero_for_apart() {
        let unit = [0.0, 0.0, 10.0, 10.0];
        assert_eq!(iou(unit, unit), 1.0);
        assert_eq!(iou(unit, [20.0, 0.0, 30.0, 10.0]), 0.0);
        assert!((iou(unit, [5.0, 0.0, 15.0, 10.0]) - 1.0 / 3.0).abs() < 1e-6);
    }
}
