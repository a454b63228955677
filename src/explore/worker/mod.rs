//! The one thread that owns house and policy. It takes commands and answers with reports; the screen never waits for it.

mod background;
mod command;
mod obey;
mod pace;
mod report;
mod run_mode;

pub use command::{Command, Going};
pub use pace::Pace;
pub use report::Report;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Instant;

use super::breakpoints::Condition;
use super::session::Session;
use crate::agent::registry::PolicyKind;
use crate::analysis::chain::Chain;
use background::{Background, Followed, Spare, Surveys};

/// Starts the worker. `open` makes the engine on the worker's thread; reports go to `tell`, which says whether anybody still
/// listens.
///
/// # Errors
/// When the system has no thread left.
pub fn start(
    open: impl FnOnce() -> anyhow::Result<Session> + Send + 'static,
    tell: impl Fn(Report) -> bool + Send + Sync + 'static,
    fail: impl FnOnce(String) + Send + 'static,
) -> std::io::Result<Sender<Command>> {
    let (commands, inbox) = channel();
    std::thread::Builder::new().name("worker".into()).spawn(move || match open() {
        Ok(engine) => Worker {
            engine,
            tell: Arc::new(tell),
            going: None,
            pace: Pace::START,
            due: Instant::now(),
            breaks: Vec::new(),
            until: None,
            chain: None,
            followed: Followed::default(),
            surveys: Arc::default(),
            spare: Arc::default(),
            background: Background::default(),
        }
        .work(&inbox),
        Err(error) => fail(format!("{error:#}")),
    })?;
    Ok(commands)
}

struct Worker<T> {
    engine: Session,
    going: Option<Going>,
    pace: Pace,
    due: Instant,
    breaks: Vec<Condition>,
    /// A condition for this run alone.
    until: Option<Condition>,
    /// The chain that was followed last.
    chain: Option<Chain>,
    followed: Followed,
    surveys: Surveys,
    spare: Spare,
    background: Background,
    /// The last to be dropped: then all work has ended.
    tell: Arc<T>,
}

impl<T: Fn(Report) -> bool + Send + Sync + 'static> Worker<T> {
    fn work(mut self, inbox: &Receiver<Command>) {
        self.show();
        if self.engine.has_policy() {
            (self.tell)(Report::Busy(None));
            self.think();
        } else {
            self.choose(self.engine.policy());
        }
        loop {
            let command = if self.going.is_some() {
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
                    self.due = self.next_due();
                    self.go_on()
                }
            };
            if !heard {
                return;
            }
        }
    }

    fn choose(&mut self, kind: PolicyKind) -> bool {
        (self.tell)(Report::Busy(Some(format!("loading the {} policy", kind.name()))));
        let chosen = self.engine.choose(kind);
        self.chosen(chosen)
    }

    fn chosen(&mut self, chosen: anyhow::Result<()>) -> bool {
        (self.tell)(Report::Busy(None));
        match chosen {
            Ok(()) => self.show() && self.think(),
            Err(error) => {
                self.go(None);
                let before = self.show() && (!self.engine.has_policy() || self.think());
                before && self.fail(&error)
            }
        }
    }

    fn show(&mut self) -> bool {
        let snapshot = self.engine.snapshot();
        (self.tell)(Report::Seen(Box::new(snapshot)))
    }

    fn think(&mut self) -> bool {
        match self.engine.think().cloned() {
            Ok((decision, values)) => {
                let words = self.engine.words(decision.action);
                (self.tell)(Report::Thought(decision, words, values))
            }
            Err(error) => self.fail(&error),
        }
    }

    fn fail(&self, error: &anyhow::Error) -> bool {
        tracing::warn!("{error:#}");
        (self.tell)(Report::Failed(format!("{error:#}")))
    }

    fn kept(&self, kept: anyhow::Result<String>) -> bool {
        match kept {
            Ok(said) => (self.tell)(Report::Noted(said)),
            Err(error) => self.refuse(&error),
        }
    }

    fn refuse(&self, error: &anyhow::Error) -> bool {
        tracing::info!("{error:#}");
        (self.tell)(Report::Refused(format!("{error:#}")))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::time::Duration;

    use super::*;
    use crate::analysis::chain::Draws;
    use crate::domain::{Action, ActionType};
    use crate::explore::testing;

    /// A worker in the kitchen, and what it tells.
    fn start() -> (Sender<Command>, Receiver<Report>) {
        let (tell, reports) = channel();
        let commands =
            super::start(|| Ok(testing::engine()), move |report| tell.send(report).is_ok(), |error| panic!("{error}"))
                .unwrap();
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
        commands.send(Command::Go(Some(Going::Policy))).unwrap();
        wait(&reports, |report| matches!(report, Report::Stepped(event) if event.step >= 5));
        commands.send(Command::Go(None)).unwrap();
        wait(&reports, |report| matches!(report, Report::Going(None)));
        commands.send(Command::Reset).unwrap();
        wait(&reports, |report| matches!(report, Report::Seen(now) if now.step == 0));
        commands.send(Command::Act(Action::navigate(ActionType::RotateLeft))).unwrap();
        let report = wait(&reports, |report| matches!(report, Report::Stepped(_)));
        assert!(matches!(report, Report::Stepped(event) if event.by_hand && event.step == 1));
    }

    #[test]
    fn it_takes_so_many_steps_at_full_speed_unless_told_to_stop() {
        let (commands, reports) = start();
        commands.send(Command::Go(Some(Going::Steps(3)))).unwrap();
        wait(&reports, |report| matches!(report, Report::Stepped(event) if event.step == 3));
        wait(&reports, |report| matches!(report, Report::Going(None)));
        commands.send(Command::Go(Some(Going::Steps(u32::MAX)))).unwrap();
        wait(&reports, |report| matches!(report, Report::Stepped(event) if event.step == 4));
        commands.send(Command::Go(None)).unwrap();
        wait(&reports, |report| matches!(report, Report::Going(None)));
    }

    #[test]
    fn a_chain_belongs_to_the_house_that_it_was_asked_in() {
        let (commands, reports) = start();
        commands.send(Command::Chain("take the mug; open the fridge".into())).unwrap();
        wait(&reports, |report| matches!(report, Report::Chained(_)));
        commands.send(Command::Next).unwrap();
        wait(&reports, |report| matches!(report, Report::Working(None)));
        commands.send(Command::WhichLink(Draws { times: 1, only: None })).unwrap();
        let refused = wait(&reports, |report| matches!(report, Report::Refused(_)));
        assert!(matches!(refused, Report::Refused(why) if why.contains("there is no chain yet")));
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
    fn a_value_map_is_computed_once_for_a_house_and_can_be_stopped() {
        let (commands, reports) = start();
        wait(&reports, |report| matches!(report, Report::Thought(..)));
        commands.send(Command::Survey).unwrap();
        wait(&reports, |report| matches!(report, Report::Surveyed(found, 0) if found.heights.len() == 2));
        commands.send(Command::Stop).unwrap();
        wait(&reports, |report| matches!(report, Report::Working(None)));
        commands.send(Command::Survey).unwrap();
        wait(&reports, |report| matches!(report, Report::Surveyed(found, _) if found.heights.len() == found.of));
        wait(&reports, |report| matches!(report, Report::Working(None)));
        // Wherever the agent stands, the house is the same one.
        commands.send(Command::Act(Action::navigate(ActionType::RotateLeft))).unwrap();
        wait(&reports, |report| matches!(report, Report::Stepped(_)));
        commands.send(Command::Survey).unwrap();
        let mut worked = false;
        let whole = |report: &Report| matches!(report, Report::Surveyed(found, 1) if found.heights.len() == found.of);
        wait(&reports, |report| {
            worked |= matches!(report, Report::Working(Some(_)));
            whole(report)
        });
        assert!(!worked, "what is known is not computed again");
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
