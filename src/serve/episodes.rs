//! Which episodes are served: tasks that the generator finds in its houses, or those of a file. Each has a number.

use std::collections::BTreeMap;
use std::num::NonZeroU64;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Context;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::domain::task::SceneRef;
use crate::domain::{Room, Task};
use crate::env::HouseEnvironment;
use crate::episode::rollout::Rollout;
use crate::episode::scenes::{Scenes, Setting};
use crate::house::grading::Grading;
use crate::house::{House, generate};

/// How many starts are kept: a generated one takes the expert's time to make.
const KEPT: usize = 512;

/// Where episodes come from.
pub(crate) enum EpisodeOrigin {
    /// In generated houses.
    Generated {
        /// The kinds of rooms, which take turns; at least one.
        rooms: Vec<Room>,
        /// How many subtasks; fewer where a house has no such task.
        length: usize,
        /// So many episodes, then the same again; `None` for no end.
        count: Option<NonZeroU64>,
    },
    /// The tasks of a set, then the same again.
    Tasks {
        /// At least one.
        tasks: Vec<Task>,
        /// The scenes that they name.
        scenes: Scenes,
    },
}

/// Every episode that can be asked for.
pub(crate) struct Episodes {
    origin: EpisodeOrigin,
    grading: Grading,
    known: Mutex<BTreeMap<u64, Arc<EpisodeStart>>>,
}

/// An episode's start.
pub(super) struct EpisodeStart {
    pub(super) number: u64,
    pub(super) setting: Setting,
    pub(super) task: Task,
    grading: Grading,
}

impl EpisodeStart {
    /// The episode at its first step.
    pub(super) fn rollout(&self) -> Rollout {
        let house = House::new(self.setting.scene.clone(), self.setting.world.clone());
        let env = HouseEnvironment::of_task(&self.task, house, self.grading);
        Rollout::new(env, self.task.instruction.clone(), Some(self.task.horizon))
    }
}

impl Episodes {
    /// Episodes of that origin.
    pub(crate) fn new(origin: EpisodeOrigin, grading: Grading) -> Episodes {
        Episodes { origin, grading, known: Mutex::default() }
    }

    /// The episode of that seed.
    ///
    /// # Errors
    /// When it cannot be made.
    pub(super) fn open(&self, seed: u64) -> anyhow::Result<Arc<EpisodeStart>> {
        let number = self.number(seed);
        // A poisoned cache is still a cache: starts are only ever added whole.
        if let Some(start) = self.known.lock().unwrap_or_else(PoisonError::into_inner).get(&number) {
            return Ok(start.clone());
        }
        let start = Arc::new(self.make(number)?);
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() < KEPT {
            known.insert(number, start.clone());
        }
        Ok(start)
    }

    /// The number of the task of that name, in a set.
    pub(super) fn named(&self, id: &str) -> Option<u64> {
        match &self.origin {
            EpisodeOrigin::Tasks { tasks, .. } => tasks.iter().position(|task| task.id == id).map(|at| at as u64),
            EpisodeOrigin::Generated { .. } => None,
        }
    }

    fn number(&self, seed: u64) -> u64 {
        match &self.origin {
            EpisodeOrigin::Generated { count, .. } => count.map_or(seed, |count| seed % count),
            EpisodeOrigin::Tasks { tasks, .. } => seed % (tasks.len() as u64).max(1),
        }
    }

    fn make(&self, number: u64) -> anyhow::Result<EpisodeStart> {
        let (setting, task) = match &self.origin {
            EpisodeOrigin::Generated { rooms, length, .. } => {
                generated(rooms[number as usize % rooms.len()], number, *length)?
            }
            EpisodeOrigin::Tasks { tasks, scenes } => {
                let task = tasks.get(number as usize).context("the task set is empty")?;
                (scenes.setting(task).with_context(|| format!("task {}", task.id))?, task.clone())
            }
        };
        Ok(EpisodeStart { number, setting, task, grading: self.grading })
    }
}

/// The task that the generator finds in the house of a room and seed: the explorer's, where it has as many subtasks.
fn generated(room: Room, seed: u64, length: usize) -> anyhow::Result<(Setting, Task)> {
    let (scene, world) = generate::house(room, seed);
    let reference = SceneRef::Generated { room, seed };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let found =
        (1..=length).rev().find_map(|length| generate::task(&scene, &world, reference.clone(), length, &mut rng));
    let task = found.with_context(|| format!("no task was found in the {} of seed {seed}", room.option_name()))?;
    let world = task.start.clone().unwrap_or(world);
    Ok((Setting { scene: Arc::new(scene), world }, task))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_count_through_the_episodes_and_begin_again_after_the_last() {
        let rooms = vec![Room::Kitchen, Room::Bathroom];
        let origin = EpisodeOrigin::Generated { rooms, length: 1, count: NonZeroU64::new(3) };
        let episodes = Episodes::new(origin, Grading::Class);
        let starts: Vec<_> = (0..4).map(|seed| episodes.open(seed).unwrap()).collect();
        assert!(Arc::ptr_eq(&starts[0], &starts[3]));
        assert_eq!(starts.iter().map(|start| start.number).collect::<Vec<_>>(), [0, 1, 2, 0]);
        assert_eq!(starts[1].task.scene, SceneRef::Generated { room: Room::Bathroom, seed: 1 });
        assert!(starts.iter().all(|start| start.task.subtasks.len() == 1));
    }
}
