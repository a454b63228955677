//! The one thread that owns house and policy. It takes commands and answers with reports; the screen never waits for it.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use super::engine::{Engine, Event, Snapshot};
use super::policies::PolicyKind;
use crate::agent::Decision;
use crate::domain::Action;
use crate::run::rollout::End;

/// What the screen asks of the worker.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Go on by itself, or stop.
    Run(bool),
    /// One step by the policy's choice.
    Step,
    /// One step that a person chose.
    Act(Action),
    /// Tell the agent something else.
    Instruct(String),
    /// Back to the start.
    Reset,
    /// The next house or task.
    Next,
    /// Another policy.
    Choose(PolicyKind),
    /// How fast it runs.
    Pace(Pace),
}

/// What the worker tells the screen.
#[derive(Clone, Debug)]
pub enum Report {
    /// The present state.
    Seen(Box<Snapshot>),
    /// A step was taken.
    Stepped(Event),
    /// What the policy would do next, with the action in words.
    Thought(Decision, String),
    /// It goes on by itself, or no longer.
    Running(bool),
    /// Something slow goes on (or nothing any more).
    Busy(Option<String>),
    /// The instruction changed, and what that means.
    Instructed {
        /// What the agent was told.
        old: String,
        /// What it is told now.
        new: String,
        /// What that means for the task.
        note: &'static str,
    },
    /// The episode is over.
    Ended(End),
    /// Something could not be done.
    Failed(String),
}

/// How fast the policy runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pace(usize);

impl Pace {
    /// Steps a second; none for as fast as it can.
    const LEVELS: [(Option<f32>, &'static str); 8] = [
        (Some(0.5), "0.5/s"),
        (Some(1.0), "1/s"),
        (Some(2.0), "2/s"),
        (Some(4.0), "4/s"),
        (Some(8.0), "8/s"),
        (Some(15.0), "15/s"),
        (Some(30.0), "30/s"),
        (None, "full speed"),
    ];
    /// Slow enough to follow.
    pub const START: Pace = Pace(3);

    /// The next faster one.
    pub fn faster(self) -> Pace {
        Pace((self.0 + 1).min(Self::LEVELS.len() - 1))
    }

    /// The next slower one.
    pub fn slower(self) -> Pace {
        Pace(self.0.saturating_sub(1))
    }

    /// In words.
    pub fn name(self) -> &'static str {
        Self::LEVELS[self.0].1
    }

    fn between_steps(self) -> Duration {
        Self::LEVELS[self.0].0.map_or(Duration::ZERO, |rate| Duration::from_secs_f32(1.0 / rate))
    }
}

/// Starts the worker. `open` makes the engine on the worker's thread; reports go to `tell`, which says whether anybody still
/// listens.
///
/// # Errors
/// When the system has no thread left.
pub fn start(
    open: impl FnOnce() -> anyhow::Result<Engine> + Send + 'static,
    tell: impl Fn(Report) -> bool + Send + 'static,
) -> std::io::Result<Sender<Command>> {
    let (commands, inbox) = channel();
    std::thread::Builder::new().name("worker".into()).spawn(move || match open() {
        Ok(engine) => Worker { engine, tell, running: false, pace: Pace::START, due: Instant::now() }.work(&inbox),
        Err(error) => super::terminal::say_last_words(format!("{error:#}")),
    })?;
    Ok(commands)
}

struct Worker<T> {
    engine: Engine,
    tell: T,
    running: bool,
    pace: Pace,
    due: Instant,
}

impl<T: Fn(Report) -> bool> Worker<T> {
    fn work(mut self, inbox: &Receiver<Command>) {
        self.show();
        self.choose(self.engine.policy());
        loop {
            let command = if self.running {
                match inbox.recv_timeout(self.due.saturating_duration_since(Instant::now())) {
                    Ok(command) => Some(command),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => return,
                }
            } else {
                match inbox.recv() {
                    Ok(command) => Some(command),
                    Err(_) => return,
                }
            };
            let heard = match command {
                Some(command) => self.obey(command),
                None => {
                    self.due = Instant::now() + self.pace.between_steps();
                    self.step()
                }
            };
            if !heard {
                return;
            }
        }
    }

    /// Carries out a command; false when nobody listens any more.
    fn obey(&mut self, command: Command) -> bool {
        match command {
            // Without a policy there is nothing to run; that it is missing was told.
            Command::Run(true) if !self.engine.has_policy() => true,
            Command::Run(running) => {
                let over = running && self.over();
                self.due = Instant::now();
                self.run(running && !over)
            }
            Command::Step => {
                self.run(false);
                if self.over() { true } else { self.step() }
            }
            Command::Act(action) => {
                self.run(false);
                if self.over() {
                    return true;
                }
                let event = self.engine.act(action);
                self.stepped(event)
            }
            Command::Instruct(text) => {
                let old = self.engine.instruction().to_string();
                match self.engine.instruct(&text) {
                    Ok(note) => {
                        let new = self.engine.instruction().to_string();
                        (self.tell)(Report::Instructed { old, new, note }) && self.show() && self.think()
                    }
                    Err(error) => self.fail(&error),
                }
            }
            Command::Reset => {
                self.engine.reset();
                self.run(false) && self.show() && self.think()
            }
            Command::Next => {
                self.due = Instant::now() + self.pace.between_steps();
                match self.engine.next_episode() {
                    Ok(()) => self.show() && self.think(),
                    Err(error) => self.fail(&error),
                }
            }
            Command::Choose(kind) => self.choose(kind),
            Command::Pace(pace) => {
                self.pace = pace;
                self.due = self.due.min(Instant::now() + pace.between_steps());
                true
            }
        }
    }

    /// Whether the episode is over; says so again if it is.
    fn over(&mut self) -> bool {
        let end = self.engine.end();
        if let Some(end) = end {
            (self.tell)(Report::Ended(end));
        }
        end.is_some()
    }

    fn choose(&mut self, kind: PolicyKind) -> bool {
        (self.tell)(Report::Busy(Some(format!("loading the {} policy", kind.name()))));
        let chosen = self.engine.choose(kind);
        (self.tell)(Report::Busy(None));
        match chosen {
            Ok(()) => self.show() && self.think(),
            Err(error) => {
                self.run(false);
                let before = self.show() && (!self.engine.has_policy() || self.think());
                before && self.fail(&error)
            }
        }
    }

    fn step(&mut self) -> bool {
        match self.engine.step() {
            Ok(event) => self.stepped(event),
            Err(error) => self.fail(&error) && self.run(false),
        }
    }

    fn stepped(&mut self, event: Event) -> bool {
        (self.tell)(Report::Stepped(event))
            && self.show()
            && match self.engine.end() {
                Some(end) => (self.tell)(Report::Ended(end)) && self.run(false),
                None => self.think(),
            }
    }

    fn run(&mut self, running: bool) -> bool {
        let changed = running != self.running;
        self.running = running;
        !changed || (self.tell)(Report::Running(running))
    }

    fn show(&mut self) -> bool {
        let snapshot = self.engine.snapshot();
        (self.tell)(Report::Seen(Box::new(snapshot)))
    }

    fn think(&mut self) -> bool {
        match self.engine.think().cloned() {
            Ok(decision) => {
                let words = self.engine.words(decision.action);
                (self.tell)(Report::Thought(decision, words))
            }
            Err(error) => self.fail(&error),
        }
    }

    fn fail(&self, error: &anyhow::Error) -> bool {
        tracing::warn!("{error:#}");
        (self.tell)(Report::Failed(format!("{error:#}")))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;
    use crate::domain::ActionType;
    use crate::tui::testing;

    /// A worker in the kitchen, and what it tells.
    fn start() -> (Sender<Command>, Receiver<Report>) {
        let (tell, reports) = channel();
        let commands = super::start(|| Ok(testing::engine()), move |report| tell.send(report).is_ok()).unwrap();
        (commands, reports)
    }

    fn wait(reports: &Receiver<Report>, mut wanted: impl FnMut(&Report) -> bool) -> Report {
        loop {
            let report = reports.recv_timeout(Duration::from_secs(60)).unwrap();
            if wanted(&report) {
                return report;
            }
        }
    }

    #[test]
    fn the_house_is_shown_before_the_policy_is_loaded() {
        let (_commands, reports) = start();
        assert!(matches!(reports.recv().unwrap(), Report::Seen(_)));
        assert!(matches!(reports.recv().unwrap(), Report::Busy(Some(_))));
        wait(&reports, |report| matches!(report, Report::Thought(..)));
    }

    #[test]
    fn it_runs_until_told_to_stop_and_steps_one_at_a_time() {
        let (commands, reports) = start();
        commands.send(Command::Pace((0..9).fold(Pace::START, |pace, _| pace.faster()))).unwrap();
        commands.send(Command::Run(true)).unwrap();
        wait(&reports, |report| matches!(report, Report::Stepped(event) if event.step >= 5));
        commands.send(Command::Run(false)).unwrap();
        wait(&reports, |report| matches!(report, Report::Running(false)));
        commands.send(Command::Reset).unwrap();
        wait(&reports, |report| matches!(report, Report::Seen(now) if now.step == 0));
        commands.send(Command::Act(Action::navigate(ActionType::RotateLeft))).unwrap();
        let report = wait(&reports, |report| matches!(report, Report::Stepped(_)));
        assert!(matches!(report, Report::Stepped(event) if event.by_hand && event.step == 1));
    }

    #[test]
    fn a_policy_that_cannot_be_loaded_is_told_and_the_house_stays() {
        let (commands, reports) = start();
        commands.send(Command::Choose(PolicyKind::Agent)).unwrap();
        let report = wait(&reports, |report| matches!(report, Report::Failed(_)));
        assert!(matches!(report, Report::Failed(reason) if reason.contains("there is no checkpoint")));
        commands.send(Command::Step).unwrap();
        wait(&reports, |report| matches!(report, Report::Stepped(_)));
    }

    #[test]
    fn it_ends_when_nobody_commands_any_more() {
        let (commands, reports) = start();
        wait(&reports, |report| matches!(report, Report::Thought(..)));
        drop(commands);
        while let Ok(report) = reports.recv_timeout(Duration::from_secs(60)) {
            assert!(!matches!(report, Report::Stepped(_)));
        }
    }
}
