//! What an agent of Actionable Models is shown: the last frames of an expert who does the task.

use std::sync::Arc;

use anyhow::Context;

use super::policy::Observation;
use crate::domain::World;
use crate::house::House;
use crate::house::expert::Expert;

/// Longer than any demonstration.
const LONGEST: usize = 1000;

/// The last `count` states, oldest first, of the expert who goes on from here until the task is done.
///
/// # Errors
/// When there is no task, or the expert sees no way.
pub fn end_states(situation: &Observation<'_>, count: usize) -> anyhow::Result<Vec<World>> {
    let grader = situation.grader.context("the agent is shown its goal, which a task has; it reads no instructions")?;
    let (mut grader, mut expert) = (grader.clone(), Expert::new());
    let mut house = House::new(Arc::clone(situation.house.scene()), situation.house.world().clone());
    let mut states = vec![house.world().clone()];
    while !grader.is_done() && states.len() < LONGEST {
        let action = expert.next(&mut house, &grader).context("the expert, who shows the goal")?;
        let outcome = house.step(action);
        grader.observe(house.scene(), house.world(), action, outcome);
        states.push(house.world().clone());
    }
    anyhow::ensure!(grader.is_done(), "the expert, who shows the goal, did not get there in {LONGEST} steps");
    Ok(states.split_off(states.len().saturating_sub(count)))
}
