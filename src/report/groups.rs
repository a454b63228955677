//! The parts of a summary that split a run's episodes: by scene, by instruction variant, by start subtask, by failure.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::estimates::{Mean, SkillRate};
use super::stats;
use super::stats::Interval;
use crate::domain::task::SceneRef;
use crate::domain::{SkillKind, Task};
use crate::episode::failure::Failure;
use crate::episode::instruction_variant::InstructionVariant;
use crate::episode::record::Episode;

/// Episodes episodes by task, in the set's order and by seed within: sums of floats then do not depend on the order in which
/// the episodes ended.
#[derive(Clone)]
pub(crate) struct EpisodesByTask<'a> {
    groups: Vec<(&'a Task, Vec<&'a Episode>)>,
}

/// Figures of some of a run's episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GroupFigures {
    /// How many episodes the figures are of.
    pub(crate) episodes: usize,
    /// How many of them completed every subtask.
    pub(crate) successes: usize,
    /// `successes` as a share of `episodes`.
    pub(crate) success: f64,
    /// The 95 % Wilson interval of `success`, lower end first.
    pub(crate) success_interval: Interval,
    /// Completed subtasks as a share of those that were asked.
    pub(crate) progress: Mean,
}

/// Episodes that fell short for one reason.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FailureCount {
    /// How many episodes fell short for this reason.
    pub(crate) episodes: usize,
    /// As a share of all episodes.
    pub(crate) share: f64,
    /// The task of the first such episode.
    pub(crate) example_task: String,
    /// The seed of that episode.
    pub(crate) example_seed: u64,
}

/// An episode that ended with an error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ErroredEpisode {
    /// The id of its task.
    pub(crate) task: String,
    /// Its seed.
    pub(crate) seed: u64,
    /// How the instruction was derived from the task's own.
    #[serde(default, skip_serializing_if = "InstructionVariant::is_original")]
    pub(crate) variant: InstructionVariant,
    /// The subtask from which the agent acted.
    pub(crate) start_subtask: u32,
    /// How often it was begun.
    pub(crate) attempts: u32,
    /// The error that ended it, as the policy or the environment reported it.
    pub(crate) error: String,
}

/// Episodes that the expert led to the same subtask.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct StartSubtaskFigures {
    /// The agent's very first subtask.
    pub(crate) first_subtask: SkillRate,
    /// Figures of all subtasks that were left to the agent.
    pub(crate) remaining: GroupFigures,
}

impl<'a> EpisodesByTask<'a> {
    /// Groups episodes by their tasks.
    pub(crate) fn new(tasks: &'a [Task], episodes: &'a [Episode]) -> EpisodesByTask<'a> {
        let mut of_task: BTreeMap<&str, Vec<&Episode>> = BTreeMap::new();
        for episode in episodes {
            of_task.entry(&episode.task).or_default().push(episode);
        }
        let mut groups: Vec<(&Task, Vec<&Episode>)> =
            tasks.iter().filter_map(|task| Some((task, of_task.remove(task.id.as_str())?))).collect();
        for (_, group) in &mut groups {
            group.sort_by_key(|episode| (episode.seed, episode.variant, episode.start_subtask));
        }
        EpisodesByTask { groups }
    }

    /// The episodes that `keep` accepts.
    pub(crate) fn filter(&self, keep: impl Fn(&Episode) -> bool) -> EpisodesByTask<'a> {
        let kept = |group: &[&'a Episode]| group.iter().copied().filter(|episode| keep(episode)).collect::<Vec<_>>();
        let groups = self.groups.iter().map(|(task, group)| (*task, kept(group)));
        EpisodesByTask { groups: groups.filter(|(_, group)| !group.is_empty()).collect() }
    }

    /// How many tasks there are.
    pub(crate) fn tasks(&self) -> usize {
        self.groups.len()
    }

    /// Every episode with its task.
    pub(crate) fn iter(&self) -> Vec<(&'a Task, &'a Episode)> {
        self.groups.iter().flat_map(|(task, group)| group.iter().map(|&episode| (*task, episode))).collect()
    }

    /// A figure of every episode, by task.
    pub(crate) fn values(&self, value: fn(&Episode) -> f64) -> Vec<Vec<f64>> {
        self.groups.iter().map(|(_, group)| group.iter().map(|episode| value(episode)).collect()).collect()
    }

    /// The figures of all of them.
    pub(crate) fn figures(&self) -> GroupFigures {
        let all = self.iter();
        let successes = all.iter().filter(|(_, episode)| episode.success).count();
        GroupFigures {
            episodes: all.len(),
            successes,
            success: if all.is_empty() { 0.0 } else { successes as f64 / all.len() as f64 },
            success_interval: stats::wilson_of_groups(&self.values(Episode::succeeded)),
            progress: Mean::of(&self.values(Episode::progress), [0.0, 1.0]),
        }
    }

    /// The figures of each scene's episodes; generated houses count by their room.
    pub(crate) fn by_scene(&self) -> BTreeMap<String, GroupFigures> {
        let mut scenes: BTreeMap<String, Vec<(&'a Task, Vec<&'a Episode>)>> = BTreeMap::new();
        for (task, group) in &self.groups {
            let name = match &task.scene {
                SceneRef::Named(name) => name.clone(),
                SceneRef::Generated { room, .. } => format!("generated {}", room.spoken()),
                SceneRef::Remote => task.env.as_ref().map_or_else(|| "remote".into(), ToString::to_string),
            };
            scenes.entry(name).or_default().push((task, group.clone()));
        }
        scenes.into_iter().map(|(name, groups)| (name, EpisodesByTask { groups }.figures())).collect()
    }

    /// Steps of successful episodes as a multiple of the expert's, where the task says how many those are.
    pub(crate) fn steps_over_expert(&self) -> Option<Mean> {
        let ratios = self.groups.iter().filter(|(task, _)| task.expert_steps > 0).map(|(task, group)| {
            let successes = group.iter().filter(|episode| episode.success);
            successes.map(|episode| f64::from(episode.steps) / f64::from(task.expert_steps)).collect::<Vec<_>>()
        });
        let ratios: Vec<Vec<f64>> = ratios.filter(|group| !group.is_empty()).collect();
        // No episode takes more steps than its horizon.
        let most = self.groups.iter().filter(|(task, _)| task.expert_steps > 0);
        let most = most.map(|(task, _)| f64::from(task.horizon) / f64::from(task.expert_steps)).fold(0.0, f64::max);
        (!ratios.is_empty()).then(|| Mean::of(&ratios, [0.0, most]))
    }
}

/// How many episodes fell short for each reason, with an example.
pub(crate) fn failures(episodes: &EpisodesByTask<'_>) -> BTreeMap<Failure, FailureCount> {
    let all = episodes.iter();
    let mut classes: BTreeMap<Failure, FailureCount> = BTreeMap::new();
    for (task, episode) in &all {
        let Some(failure) = episode.failure else { continue };
        let new =
            || FailureCount { episodes: 0, share: 0.0, example_task: task.id.clone(), example_seed: episode.seed };
        let class = classes.entry(failure).or_insert_with(new);
        class.episodes += 1;
        class.share = class.episodes as f64 / all.len() as f64;
    }
    classes
}

/// Every episode that ended with an error.
pub(crate) fn errored(episodes: &EpisodesByTask<'_>) -> Vec<ErroredEpisode> {
    let errors = episodes.iter().into_iter().filter_map(|(_, episode)| Some((episode, episode.error.clone()?)));
    let listed = errors.map(|(episode, error)| ErroredEpisode {
        task: episode.task.clone(),
        seed: episode.seed,
        variant: episode.variant,
        start_subtask: episode.start_subtask,
        attempts: episode.attempts,
        error,
    });
    listed.collect()
}

/// The figures of each instruction variant, over episodes that start where their tasks do.
pub(crate) fn instruction_variants(episodes: &EpisodesByTask<'_>) -> BTreeMap<InstructionVariant, GroupFigures> {
    let of = |variant: InstructionVariant| {
        episodes.filter(|episode| episode.variant == variant && episode.start_subtask == 0).figures()
    };
    InstructionVariant::ALL
        .into_iter()
        .map(|variant| (variant, of(variant)))
        .filter(|(_, group)| group.episodes > 0)
        .collect()
}

/// Figures by the subtask from which the agent acted.
pub(crate) fn start_subtasks(episodes: &EpisodesByTask<'_>) -> BTreeMap<u32, StartSubtaskFigures> {
    let own = episodes.filter(|episode| episode.variant.is_original());
    let last = own.iter().iter().map(|(_, episode)| episode.start_subtask).max();
    let of = |from: u32| {
        let there = own.filter(|episode| episode.start_subtask == from);
        let first = SkillRate::of(&there.values(|episode| f64::from(u8::from(episode.completed > 0))));
        StartSubtaskFigures { first_subtask: first, remaining: there.figures() }
    };
    last.map(|last| (0..=last).map(|from| (from, of(from))).collect()).unwrap_or_default()
}

/// How often a subtask whose turn came was completed, by its kind.
pub(crate) fn skills(episodes: &EpisodesByTask<'_>) -> BTreeMap<SkillKind, SkillRate> {
    rates(episodes, |task, episode| {
        let completed = episode.completed as usize;
        let turns = task.subtasks.iter().enumerate().take(completed + 1);
        turns.map(|(i, subtask)| (subtask.skill, i < completed)).collect()
    })
}

/// How often the agent completed its very first subtask, by the subtask's kind.
pub(crate) fn first_subtask_skills(episodes: &EpisodesByTask<'_>) -> BTreeMap<SkillKind, SkillRate> {
    let own = episodes.filter(|episode| episode.variant.is_original());
    rates(&own, |task, episode| {
        let first = task.subtasks.get(episode.start_subtask as usize);
        first.map(|subtask| (subtask.skill, episode.completed > 0)).into_iter().collect()
    })
}

/// Rates by kind of skill, of what each episode's turns came to.
fn rates(
    episodes: &EpisodesByTask<'_>,
    turns: impl Fn(&Task, &Episode) -> Vec<(SkillKind, bool)>,
) -> BTreeMap<SkillKind, SkillRate> {
    let mut by_kind: BTreeMap<SkillKind, Vec<Vec<f64>>> = BTreeMap::new();
    for (task, group) in &episodes.groups {
        let mut of_task: BTreeMap<SkillKind, Vec<f64>> = BTreeMap::new();
        for (kind, completed) in group.iter().flat_map(|episode| turns(task, episode)) {
            of_task.entry(kind).or_default().push(f64::from(u8::from(completed)));
        }
        for (kind, values) in of_task {
            by_kind.entry(kind).or_default().push(values);
        }
    }
    by_kind.into_iter().map(|(kind, groups)| (kind, SkillRate::of(&groups))).collect()
}
