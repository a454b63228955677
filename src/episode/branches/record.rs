//! A branch as it is written down: as an episode of a run.

use super::SavedState;
use super::tree::Tree;
use crate::episode::record::{Author, Episode};
use crate::episode::wish::{Wish, Wishes};

impl Tree {
    /// The start as a branch left it: since the tree began, something else may have been told there, or a reset may have begun
    /// to grade it.
    pub(crate) fn beginning(&self, branch: usize) -> SavedState {
        let mut start = self.start().clone();
        if let Some((next, Some(taken))) = self.story(branch).get(1)
            && let Some(wish) = &taken.wish
        {
            start.instruction = taken.instruction.to_string();
            start.grader.clone_from(&next.grader);
            start.wishes = vec![wish.clone()];
        }
        start
    }

    /// A branch as an episode of a run. Who chose is written where it changes, and at its first step.
    pub(crate) fn episode(&self, branch: usize, task: &str) -> Episode {
        let story = self.story(branch);
        let start = self.beginning(branch);
        let mut told = start.instruction.as_str();
        let mut by: Option<&Author> = None;
        let mut trace = Vec::new();
        for taken in story.iter().filter_map(|(_, taken)| *taken) {
            let mut step = taken.step.clone();
            step.instruction = (*taken.instruction != *told).then(|| taken.instruction.to_string());
            step.author = (by != Some(&taken.author)).then(|| taken.author.clone());
            (told, by) = (&taken.instruction, Some(&taken.author));
            trace.push(step);
        }
        let wishes: Vec<Wish> = story.last().map_or_else(Vec::new, |(tip, _)| owned(&tip.wishes));
        let already = start.wishes.first().map_or(0, |wish| wish.already);
        let of = start.grader.as_ref().map_or(0, |grader| (grader.total() as u32).saturating_sub(already));
        let mut episode = Episode {
            task: task.into(),
            seed: 0,
            start_hash: start.world.digest(),
            instruction: start.instruction.clone(),
            of,
            steps: trace.len() as u32,
            wishes,
            trace,
            ..Episode::default()
        };
        episode.completed = episode.own_steps().iter().filter(|step| step.subtask.is_some()).count() as u32;
        episode.success = of > 0 && episode.completed == of;
        episode
    }
}

fn owned(wishes: &Wishes) -> Vec<Wish> {
    wishes.iter().map(|wish| (**wish).clone()).collect()
}
