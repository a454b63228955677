//! Where the agent is, reckoned from its own moves and from whether the picture changed.

use std::hash::{DefaultHasher, Hash, Hasher};

use crate::domain::{ActionType, Pose};

/// Dead reckoning: exact in a world of whole cells and quarter turns, as long as every move that failed is noticed.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Odometry {
    pose: Pose,
    /// A fingerprint of the last picture: a state that is kept at every step need not keep the picture.
    picture: Option<u64>,
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

    /// Takes in the picture after the action `last` (`None` at the start). `tilt` is how far the camera looks down, in
    /// degrees. A turn always succeeds; a move that leaves the picture as it was did not.
    pub(crate) fn observe(&mut self, tilt: i16, rgb: &[u8], last: Option<ActionType>) {
        let mut hasher = DefaultHasher::new();
        rgb.hash(&mut hasher);
        let picture = Some(hasher.finish());
        let unchanged = picture == self.picture;
        let Pose { cell, heading, .. } = self.pose;
        self.blocked = last == Some(ActionType::MoveAhead) && unchanged;
        match last {
            Some(ActionType::MoveAhead) if !unchanged => self.pose.cell = cell.ahead(heading),
            Some(ActionType::RotateLeft) => self.pose.heading = heading.left(),
            Some(ActionType::RotateRight) => self.pose.heading = heading.right(),
            _ => {}
        }
        self.pose.horizon = tilt;
        self.picture = picture;
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};

    use super::*;
    use crate::domain::{Action, Cell, Heading, Room};
    use crate::house::{House, generate};

    /// A pose of the house as an agent that started at `start` would call it.
    fn in_own_frame(start: Pose, pose: Pose) -> Pose {
        let (dx, dz) = (pose.cell.x - start.cell.x, pose.cell.z - start.cell.z);
        let cell = match start.heading {
            Heading::North => Cell::new(dx, dz),
            Heading::East => Cell::new(-dz, dx),
            Heading::South => Cell::new(-dx, -dz),
            Heading::West => Cell::new(dz, -dx),
        };
        let heading = Heading::from_quarters(pose.heading.quarters() - start.heading.quarters());
        Pose { cell, heading, ..pose }
    }

    #[test]
    fn a_random_walk_is_reckoned_exactly_walls_and_all() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let mut bumps = 0;
        for seed in 0..4 {
            let (scene, world) = generate::house(Room::ALL[seed as usize], seed);
            let start = world.agent;
            let mut house = House::new(scene.into(), world);
            let mut odometry = Odometry::default();
            odometry.observe(start.horizon, &house.frame().rgb, None);
            for _ in 0..60 {
                // Two moves for each other action, so that it comes about.
                let kind = ActionType::from_index(rng.random_range(0..10usize).saturating_sub(5)).unwrap();
                let outcome = house.step(Action::navigate(kind));
                let now = house.world().agent;
                odometry.observe(now.horizon, &house.frame().rgb, Some(kind));
                assert_eq!(odometry.pose(), in_own_frame(start, now));
                assert_eq!(odometry.blocked(), kind == ActionType::MoveAhead && !outcome.is_done());
                bumps += usize::from(odometry.blocked());
            }
        }
        assert!(bumps > 20, "{bumps} moves failed");
    }
}
