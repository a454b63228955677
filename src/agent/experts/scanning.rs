//! A demonstrator that looks before it walks: the expert, who knows where everything is, made to act on what was seen, so
//! that someone who only sees can learn from it.

use std::collections::BTreeSet;

use super::expert::task_in;
use crate::agent::decision::Decision;
use crate::agent::policy::{Decisions, Observation, Policy, each_alone};
use crate::domain::{Action, ActionType, Cell, Instance};
use crate::house::expert::{Expert, TurnTiming};

/// Turns to the right while it looks for something: with the first view, a full circle.
const TURNS: u32 = 3;

/// The expert, who first turns around until it has seen what it is going for.
pub(crate) struct ScanningExpert {
    timing: TurnTiming,
    expert: Expert,
    /// Everything that came into view in this episode.
    seen: BTreeSet<Instance>,
    /// What it looks for, where it began to, and how often it has turned since.
    search: Option<(Instance, Cell, u32)>,
}

impl ScanningExpert {
    /// A demonstrator at the start of an episode.
    pub(crate) fn new(timing: TurnTiming) -> ScanningExpert {
        ScanningExpert { timing, expert: Expert::of(timing), seen: BTreeSet::new(), search: None }
    }

    /// Whether to turn on the spot before going for `aim`.
    fn must_look(&mut self, aim: Instance, cell: Cell) -> bool {
        if self.seen.contains(&aim) {
            self.search = None;
            return false;
        }
        match &mut self.search {
            Some((wanted, place, turns)) if *wanted == aim => {
                // Once it has looked around, it goes where it knows the thing to be; a push away starts no new search.
                let looks = *place == cell && *turns < TURNS;
                *turns = if looks { *turns + 1 } else { TURNS };
                looks
            }
            _ => {
                self.search = Some((aim, cell, 1));
                true
            }
        }
    }
}

impl Policy for ScanningExpert {
    fn name(&self) -> &str {
        "scanning-expert"
    }

    fn slots(&self) -> usize {
        1
    }

    fn reset(&mut self, _slot: usize, _seed: u64) {
        *self = ScanningExpert::new(self.timing);
    }

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        each_alone(observations, |_, here| self.decide(here))
    }
}

impl ScanningExpert {
    fn decide(&mut self, observation: &mut Observation<'_>) -> anyhow::Result<Decision> {
        let (house, grader) = task_in(observation)?;
        let action = self.expert.next(house, grader)?;
        self.seen.extend(house.view().sightings.iter().map(|sighting| sighting.instance));
        let cell = house.world().agent.cell;
        let aim = self.expert.aim().and_then(|aim| aim.target);
        let looks = action.target.is_none() && aim.is_some_and(|aim| self.must_look(aim, cell));
        let action = if looks { Action::navigate(ActionType::RotateRight) } else { action };
        Ok(Decision::of(action))
    }
}
