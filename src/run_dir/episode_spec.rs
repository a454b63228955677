//! The episodes of a run, in its order.

use super::manifest::RunManifest;
use crate::domain::Task;
use crate::episode::instruction_variant::InstructionVariant;
use crate::episode::record::EpisodeKey;
use crate::episode::seed;

/// An episode that is to be played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EpisodeSpec {
    /// Its position in the run, from 0.
    pub(crate) index: usize,
    /// The task's position in the set.
    pub(crate) task: usize,
    /// One of the run's seeds, from 0.
    pub(crate) seed: u64,
    /// How the instruction is derived from the task's own.
    pub(crate) variant: InstructionVariant,
    /// The subtask from which the agent acts.
    pub(crate) start_subtask: u32,
    /// How often it was begun before.
    pub(crate) attempts: u32,
}

impl EpisodeSpec {
    /// The slot of a policy that acts in so many episodes at once: it follows from the episode's index alone, so that its
    /// record does not depend on what is played beside it.
    pub(crate) fn slot(&self, slots: usize) -> usize {
        self.index % slots.max(1)
    }

    /// What tells it apart from the other episodes of the run.
    pub(crate) fn key(&self, tasks: &[Task]) -> EpisodeKey {
        EpisodeKey {
            task: tasks[self.task].id.clone(),
            seed: self.seed,
            variant: self.variant,
            start_subtask: self.start_subtask,
        }
    }
}

/// What drives a policy's chance in an episode: the task's position and the seed, and nothing else.
pub(crate) fn policy_seed(task: usize, seed: u64) -> u64 {
    seed::mix(task as u64, seed)
}

/// The episodes of a run, or of its share.
pub(crate) fn own_specs(manifest: &RunManifest, tasks: &[Task]) -> Vec<EpisodeSpec> {
    let all = episode_specs(manifest, tasks);
    let own = manifest.shard.map_or(0..all.len(), |shard| shard.range(all.len()));
    all[own].to_vec()
}

/// Every episode of a run in its order: by task, then seed, then instruction variant, then start subtask.
pub(crate) fn episode_specs(manifest: &RunManifest, tasks: &[Task]) -> Vec<EpisodeSpec> {
    let variants: &[InstructionVariant] =
        if manifest.instruction_variants { &InstructionVariant::ALL } else { &InstructionVariant::ALL[..1] };
    let mut all = Vec::new();
    for (task, of) in tasks.iter().enumerate() {
        for seed in 0..manifest.seeds {
            let spec =
                |variant, start_subtask| EpisodeSpec { index: 0, task, seed, variant, start_subtask, attempts: 0 };
            all.extend(variants.iter().map(|&variant| spec(variant, 0)));
            if manifest.all_start_subtasks {
                all.extend((1..of.subtasks.len() as u32).map(|start| spec(InstructionVariant::Original, start)));
            }
        }
    }
    for (index, spec) in all.iter_mut().enumerate() {
        spec.index = index;
    }
    all
}
