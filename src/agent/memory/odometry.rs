//! Where the agent is, relative to where it began: what its own moves come to, whoever chose them.

use crate::domain::Pose;

/// The present pose, and whether the last move led anywhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Odometry {
    pose: Pose,
    blocked: bool,
}

impl Odometry {
    /// Where the agent stands and looks, in its own frame.
    pub(crate) fn pose(&self) -> Pose {
        self.pose
    }

    /// Whether the last action was a move ahead that led nowhere.
    pub(crate) fn blocked(&self) -> bool {
        self.blocked
    }

    /// Takes in the pose after an action, and whether that was a move in vain.
    pub(crate) fn observe(&mut self, pose: Pose, blocked: bool) {
        *self = Odometry { pose, blocked };
    }
}
