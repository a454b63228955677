//! The value of every cell: what a state would be worth if the agent stood there, for the instruction at hand.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::agent::{Policy, Situation};
use crate::domain::{Cell, Heading, Scene, World};
use crate::house::House;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// V, by the checkpoint's critics.
    Value,
    /// The probability of the likeliest choice; for policies without critics.
    Confidence,
}

impl Measure {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Measure::Value => "V, best heading",
            Measure::Confidence => "no critic: p of the likeliest choice",
        }
    }
}

/// One cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Height {
    /// Where.
    pub cell: Cell,
    /// The heading with the highest value.
    pub heading: Heading,
    /// That value.
    pub value: f32,
}

/// What was found so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Landscape {
    /// What the agent was told.
    pub instruction: String,
    /// What was measured.
    pub measure: Measure,
    /// The cells that are done.
    pub heights: Vec<Height>,
    /// How many cells there are.
    pub of: usize,
}

impl Landscape {
    /// The lowest and the highest value.
    pub fn range(&self) -> Option<(f32, f32)> {
        let values = self.heights.iter().map(|height| height.value);
        values.map(|value| (value, value)).reduce(|(low, high), (value, _)| (low.min(value), high.max(value)))
    }

    /// The value of each cell that is done, between the lowest (0) and the highest (1).
    pub fn shares(&self) -> HashMap<Cell, f32> {
        let Some((low, high)) = self.range() else { return HashMap::new() };
        let share = |value: f32| if high > low { (value - low) / (high - low) } else { 0.5 };
        self.heights.iter().map(|height| (height.cell, share(height.value))).collect()
    }
}

/// Puts the agent on every cell, looking each way, and asks the policy. `visit` sees what is there after every cell; it, or
/// `stop`, ends the survey early.
///
/// # Errors
/// Whatever the policy reports.
pub fn survey(
    policy: &mut dyn Policy,
    scene: &Arc<Scene>,
    world: &World,
    instruction: &str,
    stop: &AtomicBool,
    visit: &mut dyn FnMut(&Landscape) -> bool,
) -> anyhow::Result<Landscape> {
    let mut house = House::new(scene.clone(), world.clone());
    let (instruction, of) = (instruction.to_string(), scene.cells.len());
    let mut found = Landscape { instruction, measure: Measure::Confidence, heights: Vec::with_capacity(of), of };
    // From where the agent is outwards: what matters most comes first.
    let mut cells = scene.cells.clone();
    let here = world.agent.cell;
    cells.sort_by_key(|cell| cell.x.abs_diff(here.x) + cell.z.abs_diff(here.z));
    for cell in cells {
        let mut best: Option<Height> = None;
        for heading in Heading::ALL {
            if stop.load(Ordering::Relaxed) {
                return Ok(found);
            }
            let mut there = world.clone();
            (there.agent.cell, there.agent.heading) = (cell, heading);
            house.restore(there);
            policy.begin(0);
            let mut situation = Situation { house: &mut house, instruction: &found.instruction, step: 0, grader: None };
            let decision = policy.decide(&mut situation)?;
            let value = match policy.values(&mut situation)? {
                Some(values) => {
                    found.measure = Measure::Value;
                    values.state
                }
                None => decision.mind.map_or(0.0, |mind| mind.actions.into_iter().flatten().fold(0.0, f32::max)),
            };
            if best.is_none_or(|best| value > best.value) {
                best = Some(Height { cell, heading, value });
            }
        }
        found.heights.extend(best);
        if !visit(&found) {
            break;
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::RandomPolicy;
    use crate::house::testing::kitchen;

    #[test]
    fn every_cell_is_measured_once_unless_it_is_stopped() {
        let (scene, world) = kitchen();
        let stop = AtomicBool::new(false);
        let mut policy = RandomPolicy::new();
        let mut seen = 0;
        let all = survey(&mut policy, &scene, &world, "go", &stop, &mut |found| {
            seen += 1;
            found.heights.len() == seen
        });
        let all = all.unwrap();
        assert_eq!((all.heights.len(), all.of, seen), (scene.cells.len(), scene.cells.len(), scene.cells.len()));
        assert_eq!(all.heights[0].cell, world.agent.cell, "from the agent outwards");
        let shares = all.shares();
        assert_eq!(shares.len(), scene.cells.len());
        assert!(shares.values().all(|share| (0.0..=1.0).contains(share)));
        let few = survey(&mut policy, &scene, &world, "go", &stop, &mut |found| found.heights.len() < 3).unwrap();
        assert_eq!(few.heights.len(), 3);
        stop.store(true, Ordering::Relaxed);
        assert!(survey(&mut policy, &scene, &world, "go", &stop, &mut |_| true).unwrap().heights.is_empty());
    }
}
