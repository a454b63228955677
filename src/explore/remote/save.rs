//! What was explored, as an ordinary run: a branch an episode.

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use sha2::{Digest, Sha256};

use super::exploration::RemoteExploration;
use crate::data::json;
use crate::domain::{Task, TaskSet};
use crate::episode::record::{Episode, TraceStep};
use crate::episode::rollout::EndedBy;
use crate::explore::explored_run;
use crate::run_dir::default_path;

impl RemoteExploration {
    /// Writes every branch as an episode of a run, into `path` or a new folder.
    ///
    /// # Errors
    /// When the folder holds something else, or cannot be written to.
    pub(crate) fn save(&mut self, path: Option<PathBuf>) -> anyhow::Result<String> {
        let path = path.unwrap_or_else(|| {
            let since = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
            default_path::default_path("explored", since, &|path| path.exists())
        });
        self.write(&path)?;
        self.saved = self.tree.len();
        let many = self.tree.branches().len();
        let what = if many == 1 { "branch".to_string() } else { format!("{many} branches") };
        Ok(format!("wrote the {what} as {}; sprint open shows it again", path.display()))
    }

    fn write(&self, path: &Path) -> anyhow::Result<()> {
        let branches = 0..self.tree.branches().len();
        let episodes: Vec<Episode> = branches.map(|branch| self.episode(branch)).collect();
        let task = |branch: &super::tree::Branch| Task::remote(branch.name.clone(), self.name.clone(), self.seed);
        let tasks = self.tree.branches().iter().map(task).collect();
        let set = TaskSet { format_version: TaskSet::FORMAT, name: "explored".into(), scenes: None, tasks };
        let scenes_hash = json::hex(&Sha256::digest(self.name.to_string()));
        explored_run::write(path, &set, scenes_hash, None, (&episodes, &self.places))
    }

    /// A branch as the record of an episode.
    pub(super) fn episode(&self, branch: usize) -> Episode {
        let branch = &self.tree.branches()[branch];
        let way = self.tree.way(branch.tip);
        let mut trace: Vec<TraceStep> = Vec::new();
        let mut before = None;
        for taken in way.iter().filter_map(|&state| self.tree.state(state).taken.as_ref()) {
            let (told, author) = (taken.instruction.clone(), taken.author.clone());
            let is_new = |a: &Option<(_, _)>| a.as_ref() != Some(&(told.clone(), author.clone()));
            let mut step = taken.record.clone();
            if is_new(&before) {
                let told_before = before.as_ref().map(|(told, _)| told);
                step.instruction = told_before.is_some_and(|before| *before != told).then(|| told.to_string());
                let author_before = before.as_ref().map(|(_, author)| author);
                step.author = (author_before != Some(&author)).then(|| author.clone());
            }
            before = Some((told, author));
            trace.push(step);
        }
        let (start, last) = (self.tree.start(), self.tree.state(branch.tip));
        let completed = TraceStep::completed(&trace);
        let of = last.observation.grading().map_or(0, |(_, of)| of as u32).max(completed);
        let first = way.iter().find_map(|&state| self.tree.state(state).taken.as_ref());
        let instruction = first.map_or_else(|| self.instruction().to_owned(), |taken| taken.instruction.to_string());
        let is_earned = way.iter().any(|&state| self.tree.state(state).observation.reward.is_some());
        let mut episode = Episode {
            task: branch.name.clone(),
            start_hash: start.observation.digest.clone(),
            instruction,
            completed,
            of,
            steps: trace.len() as u32,
            earned: is_earned.then_some(last.earned),
            attempts: 1,
            trace,
            ..Episode::default()
        };
        episode.success = episode.is_success(EndedBy::Grader);
        episode
    }
}
