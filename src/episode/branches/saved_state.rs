//! A saved state: one with everything that decides what follows from it, and how a policy comes to one from elsewhere.

use std::sync::Arc;

use crate::agent::{Policy, PolicyState};
use crate::domain::{Action, World};
use crate::episode::record::Author;
use crate::episode::rollout::Rollout;
use crate::episode::wish::Wishes;
use crate::house::grading::Grader;

/// A state with everything that decides what follows from it.
#[derive(Clone, Debug)]
pub(crate) struct SavedState {
    /// The house.
    pub(crate) world: Arc<World>,
    /// How far the task is.
    pub(crate) grader: Option<Grader>,
    /// How far the task is while something else was told; only where a person explores.
    pub(crate) task_aside: Option<Grader>,
    /// After how many steps the episode ends.
    pub(crate) horizon: Option<u32>,
    /// What the agent is told.
    pub(crate) instruction: String,
    /// What the agent was told so far, and what came of it; only where a person explores.
    pub(crate) wishes: Wishes,
    /// Who decides.
    pub(crate) author: Author,
    /// The action that led here; `None` at the start.
    pub(crate) last: Option<Action>,
    /// What the policy carries.
    pub(crate) carried: PolicyState,
}

impl SavedState {
    /// The present state of a rollout.
    pub(crate) fn of(rollout: &Rollout, author: &Author, carried: PolicyState) -> SavedState {
        SavedState {
            world: Arc::new(rollout.env.house.world().clone()),
            grader: rollout.env.grader.clone(),
            task_aside: None,
            horizon: rollout.horizon,
            instruction: rollout.instruction.clone(),
            wishes: Wishes::new(),
            author: author.clone(),
            last: rollout.last(),
            carried,
        }
    }

    /// Brings a rollout to this state, `steps` into the episode.
    pub(crate) fn restore(&self, rollout: &mut Rollout, steps: u32) {
        rollout.instruction.clone_from(&self.instruction);
        rollout.horizon = self.horizon;
        rollout.env.house.restore((*self.world).clone());
        rollout.env.grader.clone_from(&self.grader);
        rollout.set_steps(steps);
        rollout.set_last(self.last);
    }
}

/// Frames that a trained agent looks back on, the present one included.
pub(crate) const FRAMES: usize = 5;

/// Lets a policy begin in the middle of an episode as if it had been there all along: it looks at the states before this one
/// (`before`, the newest first), `now` steps into the episode.
pub(crate) fn look_back(
    policy: &mut dyn Policy,
    author: &Author,
    rollout: &mut Rollout,
    before: &[SavedState],
    now: u32,
) {
    policy.reset(rollout.slot, author.seed);
    policy.set_sampling(author.sampling);
    policy.set_deciding(author.deciding);
    if before.is_empty() {
        return;
    }
    let present = SavedState::of(rollout, author, PolicyState::Nothing);
    for (back, moment) in before.iter().enumerate().take(FRAMES - 1).rev() {
        moment.restore(rollout, now.saturating_sub(back as u32 + 1));
        // What it would have done is of no interest here; an expert may not even know.
        let _ = rollout.decide(policy);
    }
    present.restore(rollout, now);
}
