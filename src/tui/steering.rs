//! The explorer as `sprint ctl` steers it: what its session tells is noted, and orders become the session's commands.

use std::sync::mpsc::{Sender, SyncSender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use signal_hook::consts::SIGTERM;

use super::update::Msg;
use crate::control::{ControlServer, Controlled, Kind, Order, Progress, State, Status, Tail};
use crate::explore::session::{RunMode, SessionCommand, SessionEvent};

/// What the screen shares with those who steer it.
pub(super) struct ExplorerControl {
    seen: Mutex<Seen>,
    tail: Tail,
    /// How the screen is asked to end.
    screen: SyncSender<Msg>,
}

/// What the session told last.
#[derive(Default)]
struct Seen {
    commands: Option<Sender<SessionCommand>>,
    runs: bool,
    instruction: Option<String>,
    acts: String,
    step: u32,
    horizon: Option<u32>,
}

impl ExplorerControl {
    pub(super) fn new(screen: SyncSender<Msg>) -> Arc<ExplorerControl> {
        Arc::new(ExplorerControl { seen: Mutex::default(), tail: Tail::default(), screen })
    }

    /// Begins to listen. Where that cannot be, the log says why, and the explorer goes on without.
    pub(super) fn listen(self: &Arc<ExplorerControl>) -> Option<ControlServer> {
        let server = ControlServer::open(Kind::Explore, self.clone());
        server.inspect_err(|error| tracing::warn!("sprint ctl cannot reach this explorer: {error:#}")).ok()
    }

    /// From now on orders go there.
    pub(super) fn command(&self, commands: Sender<SessionCommand>) {
        self.seen().commands = Some(commands);
    }

    /// Nobody steers it any more: the worker ends when nobody can command it.
    pub(super) fn leave(&self) {
        self.seen().commands = None;
    }

    /// Notes what the session tells.
    pub(super) fn hear(&self, event: &SessionEvent) {
        match event {
            SessionEvent::State(now) => {
                let mut seen = self.seen();
                (seen.step, seen.horizon) = (now.step, now.horizon);
                seen.instruction = Some(now.instruction.clone());
                seen.acts.clone_from(&now.acts);
            }
            SessionEvent::Running(mode) => self.seen().runs = mode.is_some(),
            SessionEvent::Stepped(taken) => {
                let done = taken.completed.as_ref().map_or(String::new(), |done| format!(" | done: {done}"));
                let end = taken.end.map_or(String::new(), |end| format!(" | {}", end.words()));
                self.tail.say(format!("step {}: {}: {}{done}{end}", taken.step, taken.action, taken.outcome));
            }
            SessionEvent::Instructed { new, .. } => self.tail.say(format!("told: {new}")),
            SessionEvent::Stopped(why) => self.tail.say(format!("stopped: {why}")),
            SessionEvent::Refused(why) | SessionEvent::Failed(why) => self.tail.say(format!("problem: {why}")),
            _ => {}
        }
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Controlled for ExplorerControl {
    fn status(&self) -> Status {
        let seen = self.seen();
        let (done, of) = (u64::from(seen.step), seen.horizon.map(u64::from));
        Status {
            pid: std::process::id(),
            kind: Kind::Explore,
            what: seen.acts.clone(),
            state: if seen.runs { State::Running } else { State::Paused },
            progress: Progress { stage: "steps".into(), done, of, message: String::new() },
            instruction: seen.instruction.clone(),
        }
    }

    fn obey(&self, order: Order) -> Result<String, String> {
        let (command, done) = match order {
            Order::Pause => (SessionCommand::Pause, "pauses"),
            Order::Resume => (SessionCommand::Run { mode: RunMode::Policy, until: None }, "goes on"),
            Order::Instruct(text) => (SessionCommand::Instruct(text), "tells the agent so"),
            Order::Stop => {
                // As SIGTERM does: the session is kept.
                let asked = self.screen.try_send(Msg::Signal(SIGTERM));
                return asked.map(|()| "ends; its session is kept".into()).map_err(|_| "its screen is busy".into());
            }
        };
        let commands = self.seen().commands.clone().ok_or("nothing is explored yet: its list is shown")?;
        commands.send(command).map(|()| done.into()).map_err(|_| "its session is over".into())
    }

    fn tail(&self) -> &Tail {
        &self.tail
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{channel, sync_channel};

    use super::*;

    #[test]
    fn orders_become_the_sessions_commands_and_what_it_tells_is_seen() {
        let (screen, asked) = sync_channel(1);
        let control = ExplorerControl::new(screen);
        assert!(control.obey(Order::Pause).unwrap_err().contains("its list is shown"));
        let (commands, inbox) = channel();
        control.command(commands);
        control.obey(Order::Instruct("open the fridge".into())).unwrap();
        control.obey(Order::Pause).unwrap();
        let heard: Vec<SessionCommand> = inbox.try_iter().collect();
        assert_eq!(heard, [SessionCommand::Instruct("open the fridge".into()), SessionCommand::Pause]);
        control.hear(&SessionEvent::Running(Some(RunMode::Policy)));
        assert_eq!(control.status().state, State::Running);
        control.obey(Order::Stop).unwrap();
        assert!(matches!(asked.try_recv(), Ok(Msg::Signal(SIGTERM))));
        control.leave();
        assert!(inbox.recv().is_err(), "the worker can end");
    }
}
