//! What an agent keeps of what it saw: where it is, where it can walk, and what stands where. It knows its frames and its own
//! moves, and nothing else of the simulator. Poses are in its own frame: it starts in cell (0, 0) and faces north; heights are
//! in metres above the floor.

mod eye;
pub(crate) mod navigator;
pub(crate) mod occupancy;
pub(crate) mod odometry;
pub(crate) mod percept;
pub(crate) mod semantic_map;

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
