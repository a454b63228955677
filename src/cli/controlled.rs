//! Commands that can be steered by `sprint ctl` while they run.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::progress::Progress;
use crate::control::{ControlServer, Kind, Progress as Place, RunControl, RunningClock};
use crate::train::metrics::{ProgressLogger, Scalars};

/// A run that listens.
pub(crate) struct ControlledRun {
    pub(crate) control: Arc<RunControl>,
    /// Listens as long as the run goes on.
    _server: Option<ControlServer>,
}

impl ControlledRun {
    /// Begins to listen. Where that cannot be, the log says why, and the run goes on without.
    pub(crate) fn listen(
        kind: Kind,
        folder: &Path,
        stop: &Arc<AtomicBool>,
        clock: &Arc<RunningClock>,
    ) -> ControlledRun {
        let control = RunControl::new(kind, folder.display().to_string(), stop.clone(), clock.clone());
        let server = ControlServer::open(kind, control.clone());
        let server = server.inspect_err(|error| tracing::warn!("sprint ctl cannot reach this run: {error:#}")).ok();
        ControlledRun { control, _server: server }
    }
}

/// A training's progress, which waits where the training is paused.
pub(crate) struct ControlledProgress<'a> {
    pub(crate) inner: &'a mut Progress,
    pub(crate) control: &'a RunControl,
}

impl ProgressLogger for ControlledProgress<'_> {
    fn log(&mut self, scalars: &Scalars) -> anyhow::Result<()> {
        let Scalars { stage, step, of, values } = scalars;
        let numbers: Vec<String> = values.iter().map(|(name, value)| format!("{name} {value:.3}")).collect();
        let place = Place { stage: (*stage).into(), done: *step, of: Some(*of), message: numbers.join("  ") };
        // Only steps with numbers are events.
        let event = (!values.is_empty()).then(|| serde_json::to_string(scalars)).transpose()?;
        self.control.note(place, event);
        self.inner.log(scalars)?;
        self.control.wait();
        Ok(())
    }
}
