//! The episodes of a run, in its order.

use super::manifest::Manifest;
use crate::domain::Task;
use crate::episode::instruction_variant::InstructionVariant;
use crate::episode::record::Key;
use crate::episode::seed;

/// An episode that is to be played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EpisodeSpec {
    /// Its place in the run, from 0.
    pub place: usize,
    /// The task's position in the set.
    pub task: usize,
    /// Which seed.
    pub seed: u64,
    /// Whose words.
    pub wording: InstructionVariant,
    /// From which subtask.
    pub from: u32,
    /// How often it was begun before.
    pub attempts: u32,
}

impl EpisodeSpec {
    /// The slot of a policy that acts in so many episodes at once: it follows from the episode's place alone, so that its
    /// record does not depend on what is played beside it.
    pub fn slot(&self, slots: usize) -> usize {
        self.place % slots.max(1)
    }

    /// What tells it apart from the other episodes of the run.
    pub fn key(&self, tasks: &[Task]) -> Key {
        Key { task: tasks[self.task].id.clone(), seed: self.seed, wording: self.wording, from: self.from }
    }
}

/// What drives a policy's chance in an episode: the task's position and the seed, and nothing else.
pub fn policy_seed(task: usize, seed: u64) -> u64 {
    seed::mix(task as u64, seed)
}

/// Every episode of a run in its order: by task, then seed, then what the agent is told, then from where it starts.
pub fn episode_specs(manifest: &Manifest, tasks: &[Task]) -> Vec<EpisodeSpec> {
    let wordings: &[InstructionVariant] =
        if manifest.language { &InstructionVariant::ALL } else { &InstructionVariant::ALL[..1] };
    let mut all = Vec::new();
    for (task, of) in tasks.iter().enumerate() {
        for seed in 0..manifest.seeds {
            let begin = |wording, from| EpisodeSpec { place: 0, task, seed, wording, from, attempts: 0 };
            all.extend(wordings.iter().map(|&wording| begin(wording, 0)));
            if manifest.every_start {
                all.extend((1..of.subtasks.len() as u32).map(|from| begin(InstructionVariant::Own, from)));
            }
        }
    }
    for (place, spec) in all.iter_mut().enumerate() {
        spec.place = place;
    }
    all
}
