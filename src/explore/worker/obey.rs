//! Each command, carried out.

use std::time::Instant;

use super::background::{Followed, Work};
use super::{Command, Going, Report, Worker};

impl<T: Fn(Report) -> bool + Send + Sync + 'static> Worker<T> {
    /// Carries out a command; false when nobody listens any more.
    pub(crate) fn obey(&mut self, command: Command) -> bool {
        match command {
            Command::Go(going) => self.start_going(going),
            Command::Until(condition) => {
                self.until = Some(condition);
                self.start_going(Some(Going::Policy))
            }
            Command::Step => {
                self.go(None);
                if self.over() { true } else { self.step() }
            }
            Command::Act(action) => {
                self.go(None);
                if self.over() {
                    return true;
                }
                match self.engine.act(action) {
                    Ok(event) => self.stepped(event),
                    Err(error) => self.refuse(&error),
                }
            }
            Command::Instruct(text) => {
                let old = self.engine.instruction().to_string();
                match self.engine.instruct(&text) {
                    Ok(note) => {
                        let new = self.engine.instruction().to_string();
                        (self.tell)(Report::Instructed { old, new, note }) && self.show() && self.think()
                    }
                    Err(error) => self.refuse(&error),
                }
            }
            Command::Reset => {
                self.engine.reset();
                self.go(None) && self.show() && self.think()
            }
            Command::Next | Command::Seed(_) => {
                self.due = Instant::now() + self.pace.between_steps();
                let opened = match command {
                    Command::Seed(seed) => self.engine.seed(seed),
                    _ => self.engine.next_episode(),
                };
                match opened {
                    // What is known of the chain is of the house before.
                    Ok(()) => {
                        self.background.stop();
                        (self.chain, self.followed) = (None, Followed::default());
                        (self.tell)(Report::Working(None)) && self.show() && self.think()
                    }
                    Err(error) => self.refuse(&error),
                }
            }
            Command::Choose(kind) => self.choose(kind),
            Command::Checkpoint(wanted) => {
                (self.tell)(Report::Busy(Some(format!("loading {wanted}"))));
                let chosen = self.engine.checkpoint(&wanted);
                self.chosen(chosen)
            }
            Command::Reseed(seed, samples) => {
                self.engine.reseed(seed, samples);
                self.show() && self.think()
            }
            Command::Pace(pace) => {
                self.pace = pace;
                self.due = self.due.min(Instant::now() + pace.between_steps());
                true
            }
            Command::Seek(step) => {
                self.engine.seek(step);
                self.go(None) && self.show() && self.think()
            }
            Command::Along { by, steps } => {
                let (at, last) = (self.engine.tree().at(), self.engine.tree().last());
                match (by > 0 && at == last, steps) {
                    (true, true) => self.obey(Command::Step),
                    (true, false) => true,
                    (false, _) => self.obey(Command::Seek(at.saturating_add_signed(by).min(last))),
                }
            }
            Command::Switch(wanted) => {
                let switched = self.engine.branch(&wanted).and_then(|branch| self.engine.switch(branch));
                match switched {
                    Ok(()) => self.go(None) && self.show() && self.think(),
                    Err(error) => self.refuse(&error),
                }
            }
            Command::Rename(name) => match self.engine.rename(self.engine.tree().branch(), &name) {
                Ok(()) => self.show(),
                Err(error) => self.refuse(&error),
            },
            Command::Diverge(wanted) => match self.engine.branch(&wanted) {
                Ok(branch) => (self.tell)(Report::Diverged(self.engine.parted(branch))),
                Err(error) => self.refuse(&error),
            },
            Command::Break(breaks) => {
                self.breaks = breaks;
                true
            }
            Command::Compare(other) => {
                let compared = self.engine.contrast(&other);
                match compared {
                    Ok(contrast) => (self.tell)(Report::Compared(Box::new(contrast))),
                    Err(error) => self.refuse(&error),
                }
            }
            Command::Survey => self.survey(),
            Command::Chain(text) => {
                let chain = self.engine.chain(&text);
                match chain {
                    Ok(chain) => {
                        // The same one again is another policy's turn, and what the others made of it stays.
                        if !self.chain.as_ref().is_some_and(|known| known.is_same(&chain)) {
                            self.followed = Followed::default();
                        }
                        self.chain = Some(chain);
                        self.follow(None, None)
                    }
                    Err(error) => self.refuse(&error),
                }
            }
            Command::WhichLink(draws) => self.follow(None, Some(draws)),
            Command::Against(wanted) => {
                (self.tell)(Report::Busy(Some(format!("loading {wanted}"))));
                let rival = self.engine.rival(&wanted);
                (self.tell)(Report::Busy(None));
                match rival {
                    Ok(rival) => self.follow(Some(rival), None),
                    Err(error) => self.refuse(&error),
                }
            }
            Command::StopSurvey => !self.background.stop_if(Work::Survey) || (self.tell)(Report::Working(None)),
            Command::Stop => {
                self.background.stop();
                (self.tell)(Report::Working(None))
            }
            Command::Save(path) => {
                let kept = self.engine.keep(path);
                self.kept(kept)
            }
            Command::SaveTask(path) => {
                let kept = self.engine.keep_task(&path);
                self.kept(kept)
            }
            Command::Export(path) => {
                (self.tell)(Report::Busy(Some(format!("writing {}", path.display()))));
                let kept = self.engine.export(&path);
                (self.tell)(Report::Busy(None));
                self.kept(kept)
            }
            Command::LookBack(looks_back) => {
                self.engine.set_looking_back(looks_back);
                self.show()
            }
        }
    }
}
