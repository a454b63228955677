//! The one driver of the explorer: commands in, events out. The screen's worker thread and the plain mode both use it and
//! nothing else, so that what can be done and what it means stands in one place.

mod advance;
mod apply;
mod background;
mod command;
mod event;
mod jobs;
mod run;
mod step_rate;

pub use command::{RunMode, SessionCommand};
pub(crate) use event::{EventSink, SessionEvent};
pub use step_rate::StepRate;

use super::exploration::Exploration;
use background::Jobs;
use run::Run;

/// An exploration, and what goes on in it by itself.
pub struct Session {
    exploration: Exploration,
    /// Every new state is told unasked, with what the policy would do in it.
    live: bool,
    run: Run,
    jobs: Jobs,
    /// The other instruction of the last comparison.
    compared: Option<String>,
    /// The last to be dropped: then all work has ended.
    events: EventSink,
}

impl Session {
    /// A session that tells every new state unasked, and what the policy would do in it.
    pub(crate) fn live(exploration: Exploration, events: EventSink) -> Session {
        Session { live: true, ..Session::on_request(exploration, events) }
    }

    /// A session that shows and decides where it is asked to.
    pub(crate) fn on_request(exploration: Exploration, events: EventSink) -> Session {
        let (run, jobs) = (Run::default(), Jobs::new(events.clone()));
        Session { exploration, live: false, run, jobs, compared: None, events }
    }

    /// Loads the policy where that was not done; a live session shows the house before.
    pub(crate) fn begin(&mut self) {
        if self.live {
            self.show();
        }
        self.emit_reading();
        if self.exploration.has_policy() {
            self.emit(SessionEvent::Busy(None));
            self.changed_decision();
        } else {
            self.choose(self.exploration.policy());
        }
    }

    /// Tells how the wish in force is understood, where a person told it.
    fn emit_reading(&self) {
        if let Some(wish) = self.exploration.wish().filter(|wish| wish.is_told()) {
            self.emit(SessionEvent::Read(wish.clone()));
        }
    }

    /// Keeps what was tried, where the exploration has a file for it.
    pub(crate) fn autosave(&mut self) {
        self.exploration.autosave(self.run.mode.is_some());
    }

    /// Whether something is computed in the background.
    pub(crate) fn is_working(&self) -> bool {
        self.jobs.background.is_working()
    }

    fn emit(&self, event: SessionEvent) {
        (self.events)(event);
    }

    fn show(&mut self) {
        let snapshot = self.exploration.snapshot();
        self.emit(SessionEvent::State(Box::new(snapshot)));
    }

    fn decide(&mut self) {
        match self.exploration.decide().cloned() {
            Ok((decision, values)) => {
                let words = self.exploration.words(decision.action);
                self.emit(SessionEvent::Decided(decision, words, values));
            }
            Err(error) => self.fail(&error),
        }
    }

    /// The state is another one.
    fn changed(&mut self) {
        if self.live {
            self.show();
            self.decide();
        }
    }

    /// The state is the same; what the policy makes of it may be something else.
    fn changed_decision(&mut self) {
        if self.live {
            self.decide();
        }
    }

    /// A screen shows what it failed at until the state changes; the log keeps it.
    fn fail(&self, error: &anyhow::Error) {
        tracing::warn!("{error:#}");
        self.emit(SessionEvent::Failed(format!("{error:#}")));
    }

    fn refuse(&self, error: &anyhow::Error) {
        tracing::info!("{error:#}");
        self.emit(SessionEvent::Refused(format!("{error:#}")));
    }
}
