//! Where episodes come from: generated houses by seed, one scene, or the tasks of a set.

use std::sync::Arc;

use anyhow::Context;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::domain::scene::Room;
use crate::domain::task::SceneRef;
use crate::domain::{Scene, Task, World};
use crate::house::generate;

/// An episode's start.
#[derive(Clone, Debug)]
pub struct Opening {
    /// The floor plan.
    pub scene: Arc<Scene>,
    /// The state at the start.
    pub world: World,
    /// What is asked.
    pub task: Option<Task>,
}

/// Opens the scene files of a dataset by name, with a start state.
pub type Scenes = Box<dyn Fn(&str) -> anyhow::Result<(Scene, Option<World>)> + Send>;

/// Where to begin.
pub enum Start {
    /// In the generated house of this room and the seed.
    Generated(Room),
    /// In a scene of the dataset.
    Scene(String),
    /// At one task of a set.
    Tasks {
        /// The tasks.
        tasks: Vec<Task>,
        /// Which one, from 0.
        index: usize,
    },
}

/// The sequence of episodes.
pub struct Openings {
    start: Start,
    seed: u64,
    scenes: Scenes,
}

/// How many subtasks a task in a generated house has.
const LENGTH: usize = 2;

impl Openings {
    /// Episodes from `start` on; `scenes` opens named scenes.
    pub fn new(start: Start, seed: u64, scenes: Scenes) -> Openings {
        Openings { start, seed, scenes }
    }

    /// The seed of the present episode.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// To the next episode: the next seed, or the next task.
    pub fn advance(&mut self) {
        match &mut self.start {
            Start::Tasks { tasks, index } => *index = (*index + 1) % tasks.len().max(1),
            Start::Generated(_) | Start::Scene(_) => self.seed = self.seed.wrapping_add(1),
        }
    }

    /// To the episode of that seed; for a task set, to the task of that number.
    pub fn seek(&mut self, seed: u64) {
        match &mut self.start {
            Start::Tasks { tasks, index } => *index = seed as usize % tasks.len().max(1),
            Start::Generated(_) | Start::Scene(_) => self.seed = seed,
        }
    }

    /// Opens the present episode.
    ///
    /// # Errors
    /// When a scene or task cannot be opened.
    pub fn open(&self) -> anyhow::Result<Opening> {
        match &self.start {
            Start::Generated(room) => {
                let (scene, world) = generate::house(*room, self.seed);
                let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
                let reference = SceneRef::Generated { room: *room, seed: self.seed };
                let task = (1..=LENGTH)
                    .rev()
                    .find_map(|length| generate::task(&scene, &world, reference.clone(), length, &mut rng));
                let world = task.as_ref().and_then(|task| task.start.clone()).unwrap_or(world);
                Ok(Opening { scene: Arc::new(scene), world, task })
            }
            Start::Scene(name) => {
                let (scene, world) = (self.scenes)(name)?;
                let world = world.with_context(|| format!("{name}: no recorded start state for this scene"))?;
                let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
                let reference = SceneRef::Named(name.clone());
                let task = generate::task(&scene, &world, reference, 1, &mut rng);
                Ok(Opening { scene: Arc::new(scene), world, task })
            }
            Start::Tasks { tasks, index } => {
                let task = tasks.get(*index).context("the task set is empty")?;
                let (scene, world) = match &task.scene {
                    SceneRef::Generated { room, seed } => {
                        let (scene, world) = generate::house(*room, *seed);
                        (scene, Some(world))
                    }
                    SceneRef::Named(name) => (self.scenes)(name)?,
                };
                let world = task.start.clone().or(world);
                let world = world.with_context(|| format!("task {}: it has no start state", task.id))?;
                Ok(Opening { scene: Arc::new(scene), world, task: Some(task.clone()) })
            }
        }
    }
}
