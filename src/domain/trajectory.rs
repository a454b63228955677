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
    pub(crate) goal: String,
    /// One sentence for each skill. The annotation is aligned when there are as many as skills.
    pub(crate) steps: Vec<String>,
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
    /// The most skills that one may have.
    pub(crate) const MOST_SKILLS: usize = 255;

    /// Whether its skills divide its actions.
    ///
    /// # Errors
    /// Names the field that does not fit.
    pub(crate) fn check(&self) -> Result<(), String> {
        let (skills, starts, steps) = (self.skills.len(), &self.skill_starts, self.actions.len());
        if skills > Trajectory::MOST_SKILLS {
            return Err(format!("skills: {skills} are more than {}", Trajectory::MOST_SKILLS));
        }
        if starts.len() != skills {
            return Err(format!("skill_starts: {} for {skills} skills", starts.len()));
        }
        if !starts.is_sorted() || starts.last().is_some_and(|&last| last as usize > steps) {
            return Err(format!("skill_starts: {starts:?} do not rise within the {steps} actions"));
        }
        Ok(())
    }

    /// What a learner should do at a step.
    pub(crate) fn choice(&self, step: usize) -> Option<Action> {
        self.choices.get(step).or_else(|| self.actions.get(step)).copied()
    }

    /// The actions of one skill, as a range of positions.
    pub(crate) fn skill_range(&self, skill: usize) -> std::ops::Range<usize> {
        let at = |i: usize| self.skill_starts.get(i).map_or(self.actions.len(), |&start| start as usize);
        at(skill)..at(skill + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{ActionType, SkillKind};

    #[test]
    fn skills_that_do_not_divide_the_actions_are_named() {
        let skill = Subtask { skill: SkillKind::Pickup, object: 0, receptacle: None, closes: false, literal: None };
        let check = |skills, skill_starts: &[u32]| {
            let actions = vec![Action::navigate(ActionType::MoveAhead); 5];
            let skills = vec![skill.clone(); skills];
            Trajectory { actions, skills, skill_starts: skill_starts.to_vec(), ..testing::empty("t", "s") }.check()
        };
        assert_eq!(check(2, &[0, 3]), Ok(()));
        assert_eq!(check(0, &[]), Ok(()));
        assert_eq!(check(2, &[0]), Err("skill_starts: 1 for 2 skills".into()));
        for starts in [[0, 6], [3, 2]] {
            assert!(check(2, &starts).unwrap_err().contains("do not rise within the 5 actions"));
        }
        assert_eq!(check(256, &[0; 256]), Err("skills: 256 are more than 255".into()));
    }
}

/// Trajectories for tests.
#[cfg(test)]
pub(crate) mod testing {
    use super::*;

    /// One of the split train that nothing happens in.
    pub(crate) fn empty(id: &str, scene: &str) -> Trajectory {
        Trajectory {
            id: id.into(),
            split: "train".into(),
            scene: SceneRef::Named(scene.into()),
            start: World::default(),
            actions: Vec::new(),
            roles: Vec::new(),
            skills: Vec::new(),
            skill_starts: Vec::new(),
            goal: None,
            annotations: Vec::new(),
            boxes: Vec::new(),
            choices: Vec::new(),
        }
    }
}
