//! A branch as it is written down: as an episode of a run.

use super::SavedState;
use super::tree::Tree;
use crate::episode::record::{Author, Episode};

impl Tree {
    /// The start as a branch left it: since the tree began, a reset may have begun to grade what is told there.
    pub(crate) fn beginning(&self, branch: usize) -> SavedState {
        let mut start = self.start().clone();
        if let Some((next, Some(taken))) = self.story(branch).get(1)
            && start.grader.is_none()
            && next.grader.is_some()
        {
            start.instruction = taken.instruction.to_string();
            start.grader.clone_from(&next.grader);
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
        let completed = trace.iter().filter(|step| step.subtask.is_some()).count() as u32;
        let of = start.grader.as_ref().map_or(0, |grader| grader.total() as u32);
        Episode {
            task: task.into(),
            seed: 0,
            start_hash: start.world.digest(),
            instruction: start.instruction.clone(),
            completed,
            of,
            success: of > 0 && completed == of,
            steps: trace.len() as u32,
            trace,
            ..Episode::default()
        }
    }
}
