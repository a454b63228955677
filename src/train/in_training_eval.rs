//! Evaluation while training: the agent plays some tasks of a set at times, and its curve shows what losses do not.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use tch::Device;

use super::metrics::Scalars;
use crate::agent::Policy;
use crate::agent::learned::SharedEmbedder;
use crate::agent::policy_source::{MakePolicy, load_agent};
use crate::data::taskset;
use crate::episode::scenes::Scenes;
use crate::eval::evaluation::Evaluation;
use crate::eval::options::Options;
use crate::house::grading::Grading;

/// Which tasks are played, and how often.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct InTrainingEval {
    /// A task set's file; its scenes are looked for beside it.
    pub(crate) tasks: PathBuf,
    /// Only that many tasks, from the first.
    pub(crate) limit: Option<usize>,
    /// Steps between two evaluations; each is run when the training is saved next.
    pub(crate) every: u64,
}

impl InTrainingEval {
    /// Whether the tasks are played at the save at `step`, when the save before it was at `before`.
    pub(crate) fn is_due(&self, before: u64, step: u64) -> bool {
        step / self.every.max(1) > before / self.every.max(1)
    }

    /// The tasks, ready to be played.
    ///
    /// # Errors
    /// When the task file or a scene cannot be read.
    pub(crate) fn prepare(&self) -> anyhow::Result<Evaluation> {
        let set = taskset::read(&self.tasks)?;
        let options = Options { limit: self.limit, ..Options::plain(Grading::Class) };
        Evaluation::prepare(&set, Scenes::of(&self.tasks, &set.value), options, "agent", None)
            .with_context(|| self.tasks.display().to_string())
    }
}

/// Lets the checkpoint in `folder` play, and puts its success rate and mean completed subtasks among the scalars as
/// `eval_success_rate` and `eval_completed_subtasks`. Nothing when it was stopped meanwhile.
///
/// # Errors
/// When the checkpoint cannot be read. An episode that fails counts as no success.
pub(crate) fn run(
    evaluation: &Evaluation,
    folder: &Path,
    sentences: Option<&SharedEmbedder>,
    device: Device,
    stop: &Arc<AtomicBool>,
    scalars: &mut Scalars,
) -> anyhow::Result<()> {
    let (folder, sentences) = (folder.to_owned(), sentences.cloned());
    let make_policy: Arc<MakePolicy> =
        Arc::new(move || -> anyhow::Result<Box<dyn Policy>> { load_agent(&folder, sentences.clone(), device) });
    let (mut episodes, mut successes, mut completed) = (0u32, 0u32, 0u32);
    evaluation.play(&evaluation.all(), &make_policy, stop, &mut |episode| {
        episodes += 1;
        successes += u32::from(episode.success);
        completed += episode.completed;
        Ok(())
    })?;
    if episodes > 0 && !stop.load(Ordering::Relaxed) {
        scalars.set("eval_success_rate", f64::from(successes) / f64::from(episodes));
        scalars.set("eval_completed_subtasks", f64::from(completed) / f64::from(episodes));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_are_played_at_the_first_save_after_each_so_many_steps() {
        let settings = InTrainingEval { tasks: "t.json".into(), limit: None, every: 300 };
        let mut before = 0;
        let mut played = Vec::new();
        for saved in [200, 400, 600, 800, 850] {
            if settings.is_due(before, saved) {
                played.push(saved);
            }
            before = saved;
        }
        assert_eq!(played, [400, 600]);
    }
}
