//! The value of every cell: what a state would be worth if the agent stood there, for the instruction at hand.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::agent::{Observation, Policy};
use crate::domain::{Cell, Heading, Scene, World};
use crate::env::HouseEnvironment;
use crate::house::House;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Measure {
    /// V, by the checkpoint's critics.
    Value,
    /// The probability of the likeliest choice; for policies without critics.
    Confidence,
}

impl Measure {
    pub(crate) fn words(self) -> &'static str {
        match self {
            Measure::Value => "V",
            Measure::Confidence => "no critic: p of the likeliest choice",
        }
    }

    pub(crate) fn letter(self) -> char {
        match self {
            Measure::Value => 'V',
            Measure::Confidence => 'p',
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CellValue {
    pub(crate) cell: Cell,
    /// The value looking each way, in the order of [`Heading::ALL`].
    pub(crate) values: [f32; 4],
}

impl CellValue {
    /// The value looking one way; without one, the highest and the way it looks.
    pub(crate) fn facing(&self, heading: Option<Heading>) -> (Heading, f32) {
        let each = Heading::ALL.into_iter().zip(self.values).filter(|(one, _)| heading.is_none_or(|only| only == *one));
        each.reduce(|best, other| if other.1 > best.1 { other } else { best }).unwrap_or((Heading::North, 0.0))
    }
}

/// What was found so far.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueMap {
    /// What the agent was told.
    pub(crate) instruction: String,
    /// What was measured.
    pub(crate) measure: Measure,
    /// The cells that are done.
    pub(crate) cells: Vec<CellValue>,
    /// How many cells there are.
    pub(crate) of: usize,
}

impl ValueMap {
    /// The lowest and the highest value, looking one way or the best.
    pub(crate) fn range(&self, heading: Option<Heading>) -> Option<(f32, f32)> {
        let values = self.cells.iter().map(|height| height.facing(heading).1);
        values.map(|value| (value, value)).reduce(|(low, high), (value, _)| (low.min(value), high.max(value)))
    }

    /// The value of each cell that is done, between the lowest (0) and the highest (1).
    pub(crate) fn shares(&self, heading: Option<Heading>) -> HashMap<Cell, f32> {
        let Some((low, high)) = self.range(heading) else { return HashMap::new() };
        let share = |value: f32| if high > low { (value - low) / (high - low) } else { 0.5 };
        self.cells.iter().map(|height| (height.cell, share(height.facing(heading).1))).collect()
    }
}

/// What an agent sees that has just come there.
fn looks<'a>(environment: &'a mut HouseEnvironment, instruction: &'a str) -> Observation<'a> {
    Observation { environment, instruction, step: 0, last: None }
}

/// Puts the agent on every cell, looking each way, and asks the policy. `visit` sees what is there after every cell; it, or
/// `stop`, ends it early.
///
/// # Errors
/// Whatever the policy reports.
pub(crate) fn compute(
    policy: &mut dyn Policy,
    scene: &Arc<Scene>,
    world: &World,
    instruction: &str,
    stop: &AtomicBool,
    visit: &mut dyn FnMut(&ValueMap) -> bool,
) -> anyhow::Result<ValueMap> {
    let mut environment = HouseEnvironment::new(House::new(scene.clone(), world.clone()), None);
    let (instruction, of) = (instruction.to_string(), scene.cells.len());
    let mut found = ValueMap { instruction, measure: Measure::Confidence, cells: Vec::with_capacity(of), of };
    // From where the agent is outwards: what matters most comes first.
    let mut cells = scene.cells.clone();
    let here = world.agent.cell;
    cells.sort_by_key(|cell| cell.x.abs_diff(here.x) + cell.z.abs_diff(here.z));
    for cell in cells {
        let mut values = [0.0; 4];
        for (heading, height) in Heading::ALL.into_iter().zip(&mut values) {
            if stop.load(Ordering::Relaxed) {
                return Ok(found);
            }
            let mut there = world.clone();
            (there.agent.cell, there.agent.heading) = (cell, heading);
            environment.house.restore(there);
            policy.reset(0, 0);
            let decision = policy.act_in(0, looks(&mut environment, &found.instruction))?;
            let values = match decision.values {
                Some(values) => Some(values),
                None => policy.values(0, &mut looks(&mut environment, &found.instruction))?,
            };
            *height = match values {
                Some(values) => {
                    found.measure = Measure::Value;
                    values.state
                }
                None => decision.distribution.map_or(0.0, |it| it.actions.into_iter().flatten().fold(0.0, f32::max)),
            };
        }
        found.cells.push(CellValue { cell, values });
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
    fn a_cell_is_worth_what_it_is_in_its_best_heading_or_in_one() {
        let height = CellValue { cell: Cell::default(), values: [0.1, 0.7, 0.3, 0.7] };
        assert_eq!(height.facing(None), (Heading::East, 0.7));
        assert_eq!(height.facing(Some(Heading::South)), (Heading::South, 0.3));
    }

    #[test]
    fn every_cell_is_measured_once_unless_it_is_stopped() {
        let (scene, world) = kitchen();
        let stop = AtomicBool::new(false);
        let mut policy = RandomPolicy::new();
        let mut seen = 0;
        let all = compute(&mut policy, &scene, &world, "go", &stop, &mut |found| {
            seen += 1;
            found.cells.len() == seen
        });
        let all = all.unwrap();
        assert_eq!((all.cells.len(), all.of, seen), (scene.cells.len(), scene.cells.len(), scene.cells.len()));
        assert_eq!(all.cells[0].cell, world.agent.cell, "from the agent outwards");
        for heading in [None, Some(Heading::West)] {
            let shares = all.shares(heading);
            assert_eq!(shares.len(), scene.cells.len());
            assert!(shares.values().all(|share| (0.0..=1.0).contains(share)));
        }
        let few = compute(&mut policy, &scene, &world, "go", &stop, &mut |found| found.cells.len() < 3).unwrap();
        assert_eq!(few.cells.len(), 3);
        stop.store(true, Ordering::Relaxed);
        assert!(compute(&mut policy, &scene, &world, "go", &stop, &mut |_| true).unwrap().cells.is_empty());
    }
}
