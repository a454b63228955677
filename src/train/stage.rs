//! A stage of a training: one learner's steps, which are logged and saved, can be stopped, and are taken up again where they were.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use tch::Tensor;

use super::metrics::{ProgressLogger, Scalars};
use super::training_state::TrainingState;
use crate::algo::learner::Learner;
use crate::nets::weights::Tensors;

/// What the stages of a training have in common.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rhythm {
    /// Drives what is drawn by chance.
    pub(crate) seed: u64,
    /// One trajectory in that many is held out.
    pub(crate) hold_out: usize,
    /// Steps between two saved states.
    pub(crate) save_every: u64,
    /// Steps between two lines of progress.
    pub(crate) report_every: u64,
}

/// What is learned in a stage.
pub(crate) trait Learning<'a> {
    /// The weights that are learned, with their optimiser.
    fn learner(&self) -> &Learner<'a>;

    /// Takes the next step: its losses by name.
    ///
    /// # Errors
    /// When there is nothing to draw from.
    fn step(&mut self) -> anyhow::Result<Vec<(&'static str, Tensor)>>;

    /// Measures what was learned on what is held out.
    ///
    /// # Errors
    /// When an answer cannot be read.
    fn measure(&self, scalars: &mut Scalars) -> anyhow::Result<()>;

    /// Every tensor of the state, by name.
    fn state(&self) -> Tensors {
        self.learner().state()
    }

    /// Continues from the state that was read from the file `path`.
    ///
    /// # Errors
    /// When it does not fit the networks.
    fn restore(&mut self, path: &Path, step: u64, tensors: Tensors) -> anyhow::Result<()>;
}

/// A stage, and what goes on around it.
pub(crate) struct Stage<'a> {
    /// What its lines of progress are called.
    pub(crate) name: &'static str,
    pub(crate) rhythm: Rhythm,
    /// Where its state is kept.
    pub(crate) state: TrainingState<'a>,
    /// Says when to stop.
    pub(crate) stop: &'a AtomicBool,
    /// Keeps a checkpoint after so many steps.
    pub(crate) save: &'a dyn Fn(u64) -> anyhow::Result<()>,
}

impl Stage<'_> {
    /// Takes all steps, from where the state left off if there is one. Returns false when it was stopped; the state is saved then.
    ///
    /// # Errors
    /// When a state or a checkpoint cannot be read or written, and whatever the steps report.
    pub(crate) fn run(&self, learning: &mut dyn Learning<'_>, logger: &mut dyn ProgressLogger) -> anyhow::Result<bool> {
        let Rhythm { save_every, report_every, .. } = self.rhythm;
        if let Some((step, tensors)) = self.state.read()? {
            learning.restore(self.state.path, step, tensors)?;
        }
        while !learning.learner().is_done() {
            if self.stop.load(Ordering::Relaxed) {
                self.state.write(learning.learner().step(), &learning.state())?;
                return Ok(false);
            }
            let losses = learning.step()?;
            let (step, of) = (learning.learner().step(), learning.learner().steps());
            let is_due = |every: u64| step.is_multiple_of(every) || step == of;
            let mut scalars = Scalars::new(self.name, step, of);
            if is_due(report_every) {
                losses.iter().for_each(|(name, loss)| scalars.add(name, loss));
            }
            if is_due(report_every * 10) {
                learning.measure(&mut scalars)?;
            }
            logger.log(&scalars)?;
            if is_due(save_every) {
                self.state.write(step, &learning.state())?;
                (self.save)(step)?;
            }
        }
        Ok(true)
    }
}

#[cfg(test)]
pub(crate) mod testing {
    use std::collections::BTreeMap;

    use super::*;
    use crate::train::visual::testing::RecordedScalars;

    /// Runs a stage whole, and another time stopped at step 50 and resumed, and checks that both end with the same weights. `run`
    /// runs it on networks that always begin alike. What the whole one logged.
    pub(crate) fn whole_and_in_parts(
        run: &dyn Fn(&Stage<'_>, &mut dyn ProgressLogger) -> Tensors,
    ) -> Vec<BTreeMap<String, f64>> {
        let folder = tempfile::tempdir().unwrap();
        let rhythm = Rhythm { seed: 1, hold_out: 0, save_every: 50, report_every: 1 };
        let run = |name: &str, stop_at: Option<u64>| {
            let path = folder.path().join(name);
            let state = TrainingState { path: &path, identity: &BTreeMap::new() };
            let stop = AtomicBool::new(false);
            let save = |step: u64| {
                stop.store(Some(step) == stop_at, Ordering::Relaxed);
                Ok(())
            };
            let mut recorded = RecordedScalars(Vec::new());
            let weights = run(&Stage { name: "test", rhythm, state, stop: &stop, save: &save }, &mut recorded);
            (recorded.0, weights)
        };
        let (logged, whole) = run("whole", None);
        assert_eq!(run("parts", Some(50)).0.len(), 50);
        let (_, resumed) = run("parts", None);
        assert!(whole.iter().all(|(name, tensor)| *tensor == resumed[name]));
        logged.into_iter().map(|scalars| scalars.values).collect()
    }
}
