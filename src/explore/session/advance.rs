//! Going on by itself, step after step, until something stops it.

use std::time::Duration;

use super::{RunMode, Session, SessionEvent};
use crate::explore::breakpoints::{Condition, Facts};
use crate::explore::exploration::StepTaken;

impl Session {
    /// The time between two steps of the run that is under way; `None` where none is. A counted number of steps is taken as
    /// fast as can be.
    pub(crate) fn interval(&self) -> Option<Duration> {
        self.run.mode.map(|mode| match mode {
            RunMode::Steps(_) => Duration::ZERO,
            RunMode::Replay | RunMode::Policy => self.run.rate.between_steps(),
        })
    }

    /// Takes the next step of the run that is under way.
    pub(crate) fn advance(&mut self) {
        match self.run.mode {
            None => {}
            Some(RunMode::Policy) => self.step(),
            Some(RunMode::Steps(left)) => {
                self.step();
                if self.run.mode.is_some() {
                    self.set_mode(if left <= 1 { None } else { Some(RunMode::Steps(left - 1)) });
                }
            }
            Some(RunMode::Replay) => {
                let before = self.facts();
                self.exploration.seek(self.exploration.tree().at() + 1);
                self.changed();
                self.stop_where_asked(before.as_ref());
                if self.exploration.tree().next().is_none() {
                    self.set_mode(None);
                }
            }
        }
    }

    pub(super) fn start(&mut self, mode: RunMode, until: Option<Condition>) {
        let can_run = match mode {
            RunMode::Replay => self.exploration.tree().next().is_some(),
            // That there is no policy was told to whoever looks on.
            RunMode::Policy | RunMode::Steps(_) if !self.exploration.has_policy() => {
                if !self.live {
                    self.decide();
                }
                return;
            }
            RunMode::Policy | RunMode::Steps(_) => !self.is_over(),
        };
        if can_run && until.is_some() {
            self.run.until = until;
        }
        self.set_mode(can_run.then_some(mode));
    }

    /// Whether the episode is over; says so if it is.
    pub(super) fn is_over(&self) -> bool {
        let end = self.exploration.end();
        if let Some(end) = end {
            self.emit(SessionEvent::AlreadyOver(end));
        }
        end.is_some()
    }

    pub(super) fn step(&mut self) {
        let before = self.facts();
        match self.exploration.step() {
            Ok(taken) => {
                self.stepped(taken);
                self.stop_where_asked(before.as_ref());
            }
            Err(error) => {
                self.fail(&error);
                self.set_mode(None);
            }
        }
    }

    pub(super) fn stepped(&mut self, taken: StepTaken) {
        self.emit(SessionEvent::Stepped(Box::new(taken)));
        match self.exploration.end() {
            Some(end) => {
                if self.live {
                    self.show();
                }
                self.emit(SessionEvent::Ended(end));
                self.set_mode(None);
            }
            None => self.changed(),
        }
    }

    pub(super) fn set_mode(&mut self, mode: Option<RunMode>) {
        let changed = mode != self.run.mode;
        self.run.mode = mode;
        if mode.is_none() {
            self.run.until = None;
        }
        if changed {
            self.emit(SessionEvent::Running(mode));
        }
    }

    /// What the run's conditions ask of the present state, where it has any. Some ask what the policy makes of it.
    fn facts(&mut self) -> Option<Facts> {
        self.run.has_conditions().then(|| {
            // What fails here is told by the next step.
            let _ = self.exploration.decide();
            self.exploration.facts()
        })
    }

    fn stop_where_asked(&mut self, before: Option<&Facts>) {
        let (Some(before), Some(now)) = (before, self.facts()) else { return };
        if let Some(why) = self.run.stops(before, &now) {
            self.set_mode(None);
            self.emit(SessionEvent::Stopped(why));
        }
    }
}
