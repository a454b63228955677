//! What an agent keeps of what it saw: where it is, where it can walk, and what stands where. It knows its frames and its own
//! moves, and nothing else of the simulator. Poses are in its own frame: where the episode began is cell (0, 0), faced north;
//! heights are in metres above the floor.

pub(crate) mod coverage;
mod eye;
pub(crate) mod navigator;
pub(crate) mod occupancy;
pub(crate) mod odometry;
pub(crate) mod percept;
pub(crate) mod semantic_map;
#[cfg(test)]
pub(crate) mod testing;

use occupancy::Occupancy;
use odometry::Odometry;
use percept::Percept;
use semantic_map::SemanticMap;

use crate::domain::{Class, Pose};
use crate::house::view::Frame;

/// All that is kept from the start of an episode on.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Memory {
    /// Where the agent is.
    pub(crate) odometry: Odometry,
    /// Where it can walk.
    pub(crate) occupancy: Occupancy,
    /// What stands where.
    pub(crate) map: SemanticMap,
    /// How many frames were taken in before the last one.
    pub(crate) step: u32,
    begun: bool,
}

/// What the agent has of one moment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glance<'a> {
    /// Where it stands and looks, in its own frame.
    pub(crate) pose: Pose,
    /// Whether the last action was a move ahead that led nowhere.
    pub(crate) blocked: bool,
    /// The picture and its depth.
    pub(crate) frame: &'a Frame,
    /// What shows in the picture.
    pub(crate) percept: &'a Percept,
    /// What it believes to have in its hand.
    pub(crate) held: Option<Class>,
}

impl Memory {
    /// Takes in the next moment; each moment once.
    pub(crate) fn observe(&mut self, glance: Glance<'_>) {
        let Glance { pose, blocked, frame, percept, held } = glance;
        self.step += u32::from(std::mem::replace(&mut self.begun, true));
        self.odometry.observe(pose, blocked);
        if blocked {
            self.occupancy.bump(pose);
        }
        self.occupancy.observe(pose, frame);
        self.map.observe(pose, percept, held, self.step);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Action, ActionType, Room};
    use crate::house::{House, generate};

    #[test]
    fn the_same_walk_is_remembered_in_the_same_way_and_from_a_copy_too() {
        use ActionType::{LookUp, MoveAhead, RotateLeft, RotateRight};
        let (scene, world) = generate::house(Room::Kitchen, 5);
        let start = world.agent;
        let walk = |mut memory: Memory, from: usize| {
            let mut house = House::new(scene.clone().into(), world.clone());
            let kinds = [RotateRight, MoveAhead, MoveAhead, LookUp, MoveAhead, RotateLeft, MoveAhead, MoveAhead];
            let mut halfway = Memory::default();
            for (step, last) in std::iter::once(None).chain(kinds.map(Some)).enumerate() {
                let before = house.world().agent;
                if let Some(kind) = last {
                    house.step(Action::navigate(kind));
                }
                let now = house.world().clone();
                let (pose, blocked) = (now.agent.relative_to(start), last == Some(MoveAhead) && now.agent == before);
                let frame = house.frame();
                let percept = Percept::of_truth(&scene, &now, frame);
                if step >= from {
                    memory.observe(Glance { pose, blocked, frame, percept: &percept, held: None });
                }
                if step == 3 {
                    halfway = memory.clone();
                }
            }
            (halfway, memory)
        };
        let (halfway, whole) = walk(Memory::default(), 0);
        assert_eq!(whole.step, 8);
        assert!(whole.map.things(0.3).len() > 3 && whole.occupancy.known().count() > 20);
        assert_eq!(walk(halfway, 4).1, whole);
    }
}
