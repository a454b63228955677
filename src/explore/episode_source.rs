//! Where episodes come from: generated houses by seed, one scene, or the tasks of a set.

use std::sync::Arc;

use anyhow::Context;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::domain::scene::Room;
use crate::domain::task::SceneRef;
use crate::domain::{Scene, Task, Trajectory, World};
use crate::episode::rollout::Rollout;
use crate::episode::scenes::Scenes;
use crate::house::grading::{Grader, Grading};
use crate::house::{House, generate};

/// An episode's start.
#[derive(Clone, Debug)]
pub struct EpisodeStart {
    /// The floor plan.
    pub(crate) scene: Arc<Scene>,
    /// The state at the start.
    pub(crate) world: World,
    /// How tasks refer to the floor plan.
    pub(crate) reference: SceneRef,
    /// What is asked.
    pub(crate) task: Option<Task>,
    /// The episode ends at the task's horizon.
    pub(crate) limited: bool,
}

impl EpisodeStart {
    /// The episode at its first step, told the task's words.
    pub(crate) fn rollout(&self) -> Rollout {
        let house = House::new(self.scene.clone(), self.world.clone());
        match &self.task {
            // What a person made up is not graded.
            Some(task) if task.subtasks.is_empty() => Rollout::in_house(house, task.instruction.clone(), None, None),
            Some(task) => {
                let begun = (house.scene().as_ref(), house.world());
                let grader = Grader::new(Grading::Class, &task.roles, &task.subtasks, task.goal.as_ref(), begun);
                Rollout::in_house(house, task.instruction.clone(), Some(grader), self.limited.then_some(task.horizon))
            }
            None => Rollout::in_house(house, "look around".into(), None, None),
        }
    }
}

/// Where episodes come from.
pub enum EpisodeOrigin {
    /// In the generated house of this room and the seed.
    Generated(Room),
    /// Where demonstrations of one scene began; the seed picks among them.
    Recorded {
        /// Their floor plan.
        scene: Arc<Scene>,
        /// At least one; their starts and tasks are used, not their actions.
        trajectories: Vec<Trajectory>,
    },
    /// At one task of a set.
    Tasks {
        /// The whole set; after the last comes the first.
        tasks: Vec<Task>,
        /// Which one, from 0.
        index: usize,
    },
    /// Where a session began that is taken up again.
    Kept(Box<EpisodeStart>),
}

/// The sequence of episodes.
pub struct EpisodeSource {
    origin: EpisodeOrigin,
    seed: u64,
    scenes: Scenes,
}

/// How many subtasks a task in a generated house has.
const LENGTH: usize = 2;

impl EpisodeSource {
    /// Episodes of that origin; `scenes` holds those that tasks name.
    pub fn new(origin: EpisodeOrigin, seed: u64, scenes: Scenes) -> EpisodeSource {
        EpisodeSource { origin, seed, scenes }
    }

    /// The start of a session that is taken up, which names its floor plan itself.
    pub(crate) fn kept(origin: EpisodeOrigin, seed: u64) -> EpisodeSource {
        EpisodeSource::new(origin, seed, Scenes::in_folder(None))
    }

    /// The seed of the present episode.
    pub(crate) fn seed(&self) -> u64 {
        self.seed
    }

    /// To the next episode: the next seed, or the next task.
    ///
    /// # Errors
    /// When this is the only one.
    pub(crate) fn advance(&mut self) -> anyhow::Result<()> {
        match &mut self.origin {
            EpisodeOrigin::Tasks { tasks, index } => {
                anyhow::ensure!(
                    tasks.len() > 1,
                    "there is no next one: this is a single task or recorded episode; {BACK}"
                );
                *index = (*index + 1) % tasks.len();
            }
            EpisodeOrigin::Generated(_) | EpisodeOrigin::Recorded { .. } => self.seed = self.seed.wrapping_add(1),
            EpisodeOrigin::Kept(start) => {
                let (room, seed) = generated(start)?;
                (self.origin, self.seed) = (EpisodeOrigin::Generated(room), seed.wrapping_add(1));
            }
        }
        Ok(())
    }

    /// To the episode of that seed; for a task set, to the task of that number from 1.
    ///
    /// # Errors
    /// When there is no such task.
    pub(crate) fn seek(&mut self, seed: u64) -> anyhow::Result<()> {
        match &mut self.origin {
            EpisodeOrigin::Tasks { tasks, index } => {
                let wanted = usize::try_from(seed).ok().and_then(|number| number.checked_sub(1));
                let known = wanted.filter(|&at| at < tasks.len() && tasks.len() > 1);
                *index = known.with_context(|| match tasks.len() {
                    1 => {
                        format!("there is no house of another seed: this is a single task or recorded episode; {BACK}")
                    }
                    many => format!("there is no task {seed}; they are numbered 1 to {many}"),
                })?;
            }
            EpisodeOrigin::Generated(_) | EpisodeOrigin::Recorded { .. } => self.seed = seed,
            EpisodeOrigin::Kept(start) => {
                let (room, _) = generated(start)?;
                (self.origin, self.seed) = (EpisodeOrigin::Generated(room), seed);
            }
        }
        Ok(())
    }

    /// Opens the present episode.
    ///
    /// # Errors
    /// When a scene or task cannot be opened.
    pub(crate) fn open(&self) -> anyhow::Result<EpisodeStart> {
        match &self.origin {
            EpisodeOrigin::Generated(room) => {
                let (scene, world) = generate::house(*room, self.seed);
                let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
                let reference = SceneRef::Generated { room: *room, seed: self.seed };
                let task = (1..=LENGTH)
                    .rev()
                    .find_map(|length| generate::task(&scene, &world, reference.clone(), length, &mut rng));
                let world = task.as_ref().and_then(|task| task.start.clone()).unwrap_or(world);
                Ok(EpisodeStart { scene: Arc::new(scene), world, reference, task, limited: false })
            }
            EpisodeOrigin::Recorded { scene, trajectories } => {
                let at = self.seed as usize % trajectories.len().max(1);
                let trajectory = trajectories.get(at).context("no demonstration was recorded in this scene")?;
                let world = trajectory.start.clone();
                let (reference, task) = (trajectory.scene.clone(), Some(task_of(trajectory)));
                Ok(EpisodeStart { scene: scene.clone(), world, reference, task, limited: false })
            }
            EpisodeOrigin::Kept(start) => Ok((**start).clone()),
            EpisodeOrigin::Tasks { tasks, index } => {
                let task = tasks.get(*index).context("the task set is empty")?;
                let setting = self.scenes.setting(task).with_context(|| format!("task {}", task.id))?;
                let (scene, world, reference) = (setting.scene, setting.world, task.scene.clone());
                Ok(EpisodeStart { scene, world, reference, task: Some(task.clone()), limited: true })
            }
        }
    }
}

/// What to do where there is no other episode.
const BACK: &str = "reset goes back to its start, sprint explore opens other houses";

/// The room and seed of a house that was generated.
fn generated(start: &EpisodeStart) -> anyhow::Result<(Room, u64)> {
    match start.reference {
        SceneRef::Generated { room, seed } => Ok((room, seed)),
        SceneRef::Named(_) | SceneRef::Remote => {
            anyhow::bail!("a session that was taken up has no next one in this floor plan; {BACK}")
        }
    }
}

/// The whole of a demonstration as a task.
fn task_of(trajectory: &Trajectory) -> Task {
    let annotation = trajectory.annotations.first();
    let steps = trajectory.actions.len() as u32;
    Task {
        id: trajectory.id.clone(),
        scene: trajectory.scene.clone(),
        start: None,
        instruction: annotation.map_or_else(|| "look around".into(), |annotation| annotation.goal.clone()),
        sentences: Vec::new(),
        roles: trajectory.roles.clone(),
        subtasks: trajectory.skills.clone(),
        expert_steps: steps,
        horizon: 2 * steps,
        goal: trajectory.goal.clone(),
        source: Some((trajectory.id.clone(), 0)),
        env: None,
        seed: None,
        reworded: false,
    }
}
