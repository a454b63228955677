//! What an agent of Actionable Models is shown: the last frames of an expert who does the task.

use std::sync::Arc;

use anyhow::Context;

use super::environment::HouseAccess;
use crate::house::House;
use crate::house::expert::demonstrate;
use crate::house::view::Frame;

/// Longer than any demonstration.
const LONGEST: usize = 1000;

/// Frames of the last `count` states, oldest first, of the expert who goes on from here until the task is done.
///
/// # Errors
/// When there is no task, or the expert sees no way.
pub(crate) fn goal_frames(access: &HouseAccess<'_>, count: usize) -> anyhow::Result<Vec<Frame>> {
    let grader = access.grader.context("the agent is shown its goal, which a task has; it reads no instructions")?;
    let mut house = House::new(Arc::clone(access.house.scene()), access.house.world().clone());
    let mut states = vec![house.world().clone()];
    demonstrate(&mut house, &mut grader.clone(), LONGEST, &mut |house| states.push(house.world().clone()))
        .context("the expert, who shows the goal")?;
    let last = states.split_off(states.len().saturating_sub(count));
    let draw = |world| {
        house.restore(world);
        house.frame().clone()
    };
    Ok(last.into_iter().map(draw).collect())
}
