//! Each command, carried out.

use super::background::Work;
use super::{RunMode, Session, SessionCommand, SessionEvent};
use crate::agent::registry::PolicyKind;
use crate::explore::breakpoints::Condition;
use crate::explore::timeline::{ActionLine, BranchPosition, Timeline};

impl Session {
    /// Carries out a command. What comes of it is told as events: most before this returns, runs as [`Session::advance`] is
    /// called, chains and value maps from their own thread.
    pub(crate) fn apply(&mut self, command: SessionCommand) {
        match command {
            SessionCommand::Run { mode, until } => self.start(mode, until),
            SessionCommand::Pause => self.set_mode(None),
            SessionCommand::Step => {
                self.set_mode(None);
                if !self.is_over() {
                    self.step();
                }
            }
            SessionCommand::Act(action) => {
                self.set_mode(None);
                if !self.is_over() {
                    match self.exploration.act(action) {
                        Ok(taken) => self.stepped(taken),
                        Err(error) => self.refuse(&error),
                    }
                }
            }
            SessionCommand::Instruct(text) => drop(self.instruct(&text)),
            SessionCommand::Say { fulfilled } => {
                self.set_mode(None);
                match self.exploration.say(fulfilled) {
                    Ok(_) => self.ended(),
                    Err(error) => self.refuse(&error),
                }
            }
            SessionCommand::Mean(wanted) => match self.exploration.mean(wanted) {
                Ok(()) => self.told(),
                Err(error) => self.refuse(&error),
            },
            SessionCommand::Reset => {
                self.exploration.reset();
                self.run.heard = None;
                self.set_mode(None);
                self.emit_reading();
                self.changed();
            }
            SessionCommand::Next => {
                let opened = self.exploration.next_episode();
                self.entered(opened);
            }
            SessionCommand::Seed(seed) => {
                let opened = self.exploration.seed(seed);
                self.entered(opened);
            }
            SessionCommand::Choose(kind) => {
                if self.choose(kind) {
                    self.emit(SessionEvent::PolicyChosen(kind));
                }
            }
            SessionCommand::Checkpoint(wanted) => {
                self.emit(SessionEvent::Busy(Some(format!("loading {wanted}"))));
                let chosen = self.exploration.checkpoint(&wanted);
                if self.chosen(chosen) {
                    self.emit(SessionEvent::CheckpointChosen(self.exploration.author().policy.clone()));
                }
            }
            SessionCommand::Sample(seed) => self.reseed(seed, true),
            SessionCommand::Greedy => self.reseed(self.exploration.episode_seed(), false),
            SessionCommand::StepRate(rate) => self.run.rate = rate,
            SessionCommand::Seek(step) => {
                let last = self.exploration.tree().last();
                // `last` asks for the end by the largest number.
                if step > last && step != u32::MAX {
                    self.emit(SessionEvent::Noted(format!("there is no step {step}: the branch ends at {last}")));
                }
                self.seek(step);
            }
            SessionCommand::Along { by, steps } => {
                let (at, last) = (self.exploration.tree().at(), self.exploration.tree().last());
                match (by > 0 && at == last, steps) {
                    (true, true) => self.apply(SessionCommand::Step),
                    (true, false) => self.emit_position(),
                    (false, _) => self.seek(at.saturating_add_signed(by).min(last)),
                }
            }
            SessionCommand::SeekEvent { forward } => self.seek(self.timeline().event(forward)),
            SessionCommand::SeekSubtask(number) => match self.timeline().subtask(number) {
                Some(step) => self.seek(step),
                None => self.refuse(&anyhow::anyhow!("subtask {number} is not done on this branch")),
            },
            SessionCommand::Switch(wanted) => {
                let switched = self.exploration.branch(&wanted).and_then(|branch| self.exploration.switch(branch));
                self.switched(switched);
            }
            SessionCommand::NextBranch => {
                let tree = self.exploration.tree();
                let next = (tree.branch() + 1) % tree.branches().len().max(1);
                let switched = self.exploration.switch(next);
                self.switched(switched);
            }
            SessionCommand::Rename(name) => match self.exploration.rename(self.exploration.tree().branch(), &name) {
                Ok(()) => {
                    self.emit_position();
                    if self.live {
                        self.show();
                    }
                }
                Err(error) => self.refuse(&error),
            },
            SessionCommand::Diverge(wanted) => match self.exploration.branch(&wanted) {
                Ok(branch) => self.emit(SessionEvent::Diverged(self.exploration.parted(branch))),
                Err(error) => self.refuse(&error),
            },
            SessionCommand::Break(condition) => self.toggle_breakpoint(condition),
            SessionCommand::Breakpoints => self.emit(SessionEvent::Breakpoints(self.run.breakpoints.clone())),
            SessionCommand::Actions => {
                self.emit(SessionEvent::Actions(self.exploration.tree().steps().map(ActionLine::of).collect()));
            }
            SessionCommand::OpenLink(link) => self.open_link(link),
            SessionCommand::Compare(other) => self.compare(&other),
            SessionCommand::Swap => match self.compared.take() {
                Some(other) => {
                    let own = self.exploration.instruction().to_string();
                    if self.instruct(&other) {
                        self.compare(&own);
                    }
                }
                None => self.refuse(&anyhow::anyhow!("there is nothing to swap: compare TEXT first")),
            },
            SessionCommand::ValueMap => self.map_values(),
            SessionCommand::StopValueMap => {
                if self.jobs.background.stop_if(Work::ValueMap) {
                    self.emit(SessionEvent::Working(None));
                }
            }
            SessionCommand::Chain(text) => self.follow_chain(&text),
            SessionCommand::WhichLink(draws) => self.follow(None, Some(draws)),
            SessionCommand::Against(wanted) => {
                self.emit(SessionEvent::Busy(Some(format!("loading {wanted}"))));
                let rival = self.exploration.rival(&wanted);
                self.emit(SessionEvent::Busy(None));
                match rival {
                    Ok(rival) => self.follow(Some(rival), None),
                    Err(error) => self.refuse(&error),
                }
            }
            SessionCommand::Stop => {
                self.jobs.background.stop();
                self.emit(SessionEvent::Working(None));
            }
            SessionCommand::Save(path) => {
                let kept = self.exploration.keep(path);
                let is_kept = kept.is_ok();
                self.written(kept);
                // What there is to lose is another now.
                if is_kept && self.live {
                    self.show();
                }
            }
            SessionCommand::SaveTask(path) => self.written(self.exploration.keep_task(&path)),
            SessionCommand::Export(path) => {
                self.emit(SessionEvent::Busy(Some(format!("writing {}", path.display()))));
                let written = self.exploration.export(&path);
                self.emit(SessionEvent::Busy(None));
                self.written(written);
            }
            SessionCommand::Examples => {
                self.emit(SessionEvent::Busy(Some("looking for wishes".into())));
                let wishes = self.exploration.example_wishes();
                self.emit(SessionEvent::Busy(None));
                self.emit(SessionEvent::Examples(wishes));
            }
            SessionCommand::LookBack(looks_back) => {
                self.exploration.set_looking_back(looks_back);
                if self.live {
                    self.show();
                }
            }
            SessionCommand::Show => self.show(),
            SessionCommand::Where => self.emit_position(),
            SessionCommand::Decide => self.decide(),
        }
    }

    /// Loads a policy; whether it decides from here on.
    pub(super) fn choose(&mut self, kind: PolicyKind) -> bool {
        self.emit(SessionEvent::Busy(Some(format!("loading the {} policy", kind.name()))));
        let chosen = self.exploration.choose(kind);
        self.chosen(chosen)
    }

    fn chosen(&mut self, chosen: anyhow::Result<()>) -> bool {
        self.emit(SessionEvent::Busy(None));
        match chosen {
            Ok(()) => {
                // Another agent may say so in the same state.
                self.run.heard = None;
                self.changed();
                true
            }
            Err(error) => {
                self.set_mode(None);
                if self.live {
                    self.show();
                    if self.exploration.has_policy() {
                        self.decide();
                    }
                }
                self.fail(&error);
                false
            }
        }
    }

    /// Tells the agent something else; whether that could be done.
    fn instruct(&mut self, text: &str) -> bool {
        let old = self.exploration.instruction().to_string();
        let asked = self.exploration.asked_reader().map(|name| format!("asking {name} what is meant"));
        let is_asked = asked.is_some();
        if is_asked {
            self.emit(SessionEvent::Busy(asked));
        }
        let told = self.exploration.instruct(text);
        if is_asked {
            self.emit(SessionEvent::Busy(None));
        }
        match told {
            Ok(note) => {
                let new = self.exploration.instruction().to_string();
                self.emit(SessionEvent::Instructed { old, new, note });
                let resumes = self.run.resumes;
                self.told();
                if resumes && self.exploration.end().is_none() {
                    self.start(RunMode::Policy, None);
                }
                true
            }
            Err(error) => {
                self.refuse(&error);
                false
            }
        }
    }

    /// A wish came into force.
    fn told(&mut self) {
        self.run.heard = None;
        self.emit_reading();
        match self.exploration.end() {
            // It holds already, or what was done before fulfils it as it is meant.
            Some(_) => self.ended(),
            None => self.changed(),
        }
    }

    fn compare(&mut self, other: &str) {
        match self.exploration.contrast(other) {
            Ok(contrast) => {
                self.compared = Some(other.to_string());
                self.emit(SessionEvent::Compared(Box::new(contrast)));
            }
            Err(error) => self.refuse(&error),
        }
    }

    fn entered(&mut self, opened: anyhow::Result<()>) {
        match opened {
            Ok(()) => {
                // What is known of the chain and of other words is of the house before.
                self.jobs.leave_house();
                self.compared = None;
                self.run.heard = None;
                self.run.resumes = false;
                self.emit(SessionEvent::Working(None));
                self.changed();
            }
            Err(error) => self.refuse(&error),
        }
    }

    fn reseed(&mut self, seed: u64, samples: bool) {
        self.exploration.reseed(seed, samples);
        self.run.heard = None;
        self.emit(SessionEvent::Sampling(samples.then_some(seed)));
        self.changed();
    }

    fn seek(&mut self, step: u32) {
        self.exploration.seek(step);
        self.moved();
    }

    fn switched(&mut self, switched: anyhow::Result<()>) {
        match switched {
            Ok(()) => self.moved(),
            Err(error) => self.refuse(&error),
        }
    }

    fn moved(&mut self) {
        self.run.heard = None;
        self.set_mode(None);
        self.emit_position();
        self.changed();
    }

    fn emit_position(&self) {
        self.emit(SessionEvent::At(BranchPosition::of(self.exploration.tree())));
    }

    fn timeline(&self) -> Timeline {
        Timeline::of(self.exploration.tree())
    }

    /// A link of the last chain becomes a branch, as it was followed, with the state in which it began in hand.
    fn open_link(&mut self, link: usize) {
        let opened = self
            .jobs
            .link(&self.exploration.who(), link)
            .and_then(|(place, steps)| self.exploration.open_link(place, &steps));
        match opened {
            Ok(()) => self.moved(),
            Err(error) => self.refuse(&error),
        }
    }

    fn toggle_breakpoint(&mut self, condition: Option<Condition>) {
        let breakpoints = &mut self.run.breakpoints;
        match condition {
            None => breakpoints.clear(),
            Some(condition) if breakpoints.contains(&condition) => breakpoints.retain(|known| *known != condition),
            Some(condition) => breakpoints.push(condition),
        }
        self.emit(SessionEvent::Breakpoints(self.run.breakpoints.clone()));
    }

    fn written(&self, written: anyhow::Result<String>) {
        match written {
            Ok(what) => self.emit(SessionEvent::Noted(what)),
            Err(error) => self.refuse(&error),
        }
    }
}
