//! Going on by itself, step after step, until something stops it.

use std::time::{Duration, Instant};

use super::{Going, Report, Worker};
use crate::explore::breakpoints::Facts;
use crate::explore::session::Event;

impl<T: Fn(Report) -> bool + Send + Sync + 'static> Worker<T> {
    pub(crate) fn start_going(&mut self, going: Option<Going>) -> bool {
        self.due = Instant::now();
        match going {
            None => {
                self.until = None;
                self.go(None)
            }
            Some(Going::Replay) => {
                let is_there = self.engine.tree().next().is_some();
                self.go(is_there.then_some(Going::Replay))
            }
            // Without a policy there is nothing to run; that it is missing was told.
            Some(Going::Policy | Going::Steps(_)) if !self.engine.has_policy() => true,
            Some(Going::Policy | Going::Steps(_)) => {
                let over = self.over();
                self.go(going.filter(|_| !over))
            }
        }
    }

    /// Whether the episode is over; says so again if it is.
    pub(crate) fn over(&mut self) -> bool {
        let end = self.engine.end();
        if let Some(end) = end {
            (self.tell)(Report::Ended(end));
        }
        end.is_some()
    }

    /// The next step of what goes on by itself.
    pub(crate) fn go_on(&mut self) -> bool {
        match self.going {
            Some(Going::Replay) => {
                let before = self.engine.facts();
                self.engine.seek(self.engine.tree().at() + 1);
                let over = self.engine.tree().next().is_none();
                self.show() && self.think() && self.stop_at(&before) && (!over || self.go(None))
            }
            Some(Going::Steps(left)) => {
                self.step()
                    && match self.going {
                        None => true,
                        Some(_) if left <= 1 => self.go(None),
                        Some(_) => self.go(Some(Going::Steps(left - 1))),
                    }
            }
            _ => self.step(),
        }
    }

    /// When the next step is due: a counted number of steps is taken as fast as can be.
    pub(crate) fn next_due(&self) -> Instant {
        let between = match self.going {
            Some(Going::Steps(_)) => Duration::ZERO,
            _ => self.pace.between_steps(),
        };
        Instant::now() + between
    }

    pub(crate) fn step(&mut self) -> bool {
        let before = self.engine.facts();
        match self.engine.step() {
            Ok(event) => self.stepped(event) && self.stop_at(&before),
            Err(error) => self.fail(&error) && self.go(None),
        }
    }

    pub(crate) fn stepped(&mut self, event: Event) -> bool {
        (self.tell)(Report::Stepped(event))
            && self.show()
            && match self.engine.end() {
                Some(end) => (self.tell)(Report::Ended(end)) && self.go(None),
                None => self.think(),
            }
    }

    /// Stops where a condition says so.
    fn stop_at(&mut self, before: &Facts) -> bool {
        if self.going.is_none() {
            return true;
        }
        let now = self.engine.facts();
        match self.breaks.iter().chain(&self.until).find_map(|condition| condition.hit(before, &now)) {
            Some(why) => self.go(None) && (self.tell)(Report::Stopped(why)),
            None => true,
        }
    }

    pub(crate) fn go(&mut self, going: Option<Going>) -> bool {
        let changed = going != self.going;
        self.going = going;
        if going.is_none() {
            self.until = None;
        }
        !changed || (self.tell)(Report::Going(going))
    }
}
