//! Trajectories: recorded demonstrations with their skills and annotations.

use serde::{Deserialize, Serialize};

use super::action::Action;
use super::skill::{Goal, Role, Subtask};
use super::task::SceneRef;
use super::world::World;

/// What one annotator wrote of a trajectory.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Annotation {
    /// The whole task in a sentence.
    pub goal: String,
    /// One sentence for each skill. The annotation is aligned when there are as many as skills.
    pub steps: Vec<String>,
}

/// A recorded demonstration.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trajectory {
    /// A name that is unique in its dataset.
    pub id: String,
    /// `train`, `valid_seen`, ...
    pub split: String,
    /// Where it was recorded.
    pub scene: SceneRef,
    /// The state before the first action.
    pub start: World,
    /// What the expert did.
    pub actions: Vec<Action>,
    /// The parts that instances play in it.
    pub roles: Vec<Role>,
    /// The skills, in order.
    pub skills: Vec<Subtask>,
    /// The position in `actions` at which each skill begins.
    pub skill_starts: Vec<u32>,
    /// ALFRED's goal for the whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<Goal>,
    /// What people (or the generator's grammar) wrote of it.
    pub annotations: Vec<Annotation>,
    /// For each interaction, in order: the recorded box of its target in the frame before it, as left, top, right, bottom
    /// pixel edges of a 300 x 300 image; all zero where none was recorded.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub boxes: Vec<[u16; 4]>,
    /// Where actions were disturbed on purpose: what the expert would have done at each step. Empty when it did just that.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub choices: Vec<Action>,
}

impl Trajectory {
    /// What a learner should do at a step.
    pub fn choice(&self, step: usize) -> Option<Action> {
        self.choices.get(step).or_else(|| self.actions.get(step)).copied()
    }

    /// The actions of one skill, as a range of positions.
    pub fn skill_range(&self, skill: usize) -> std::ops::Range<usize> {
        let at = |i: usize| self.skill_starts.get(i).map_or(self.actions.len(), |&start| start as usize);
        at(skill)..at(skill + 1)
    }
}
