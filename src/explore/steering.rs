//! The explorer as `sprint ctl` steers it: what it tells is noted, and orders are handed on to whoever explores.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::control::{ControlServer, Controlled, Kind, Order, Progress, State, Status, Tail};
use crate::explore::session::SessionEvent;

/// What an explorer shares with those who steer it.
pub(crate) struct ExplorerControl {
    seen: Mutex<Seen>,
    tail: Tail,
    /// Asks the explorer to end.
    end: Box<dyn Fn() -> bool + Send + Sync>,
}

/// Takes in an order; false where nobody obeys any more.
type Obey = Box<dyn Fn(Order) -> bool + Send>;

/// What is explored, as it was told last.
#[derive(Default)]
pub(crate) struct Seen {
    obey: Option<Obey>,
    /// It goes on by itself.
    pub(crate) runs: bool,
    /// What the agent is told.
    pub(crate) instruction: Option<String>,
    /// Who acts.
    pub(crate) acts: String,
    /// How many steps were taken, and at most.
    pub(crate) step: u32,
    pub(crate) horizon: Option<u32>,
}

impl ExplorerControl {
    /// Of an explorer that `end` asks to end.
    pub(crate) fn new(end: impl Fn() -> bool + Send + Sync + 'static) -> Arc<ExplorerControl> {
        Arc::new(ExplorerControl { seen: Mutex::default(), tail: Tail::default(), end: Box::new(end) })
    }

    /// Begins to listen. Where that cannot be, the log says why, and the explorer goes on without.
    pub(crate) fn listen(self: &Arc<ExplorerControl>) -> Option<ControlServer> {
        let server = ControlServer::open(Kind::Explore, self.clone());
        server.inspect_err(|error| tracing::warn!("sprint ctl cannot reach this explorer: {error:#}")).ok()
    }

    /// From now on orders go there.
    pub(crate) fn command(&self, obey: impl Fn(Order) -> bool + Send + 'static) {
        self.seen().obey = Some(Box::new(obey));
    }

    /// Nobody steers it any more: the worker ends when nobody can command it.
    pub(crate) fn leave(&self) {
        self.seen().obey = None;
    }

    /// Notes how it stands.
    pub(crate) fn note(&self, change: impl FnOnce(&mut Seen)) {
        change(&mut self.seen());
    }

    /// Something happened.
    pub(crate) fn say(&self, line: String) {
        self.tail.say(line);
    }

    /// Notes what the session tells.
    pub(crate) fn hear(&self, event: &SessionEvent) {
        match event {
            SessionEvent::State(now) => {
                let mut seen = self.seen();
                (seen.step, seen.horizon) = (now.step, now.horizon);
                seen.instruction = Some(now.instruction.clone());
                seen.acts.clone_from(&now.acts);
            }
            SessionEvent::Running(mode) => self.seen().runs = mode.is_some(),
            SessionEvent::Stepped(taken) => {
                self.seen().step = taken.step;
                let done = taken.completed.as_ref().map_or(String::new(), |done| format!(" | done: {done}"));
                let end = taken.end.map_or(String::new(), |end| format!(" | {}", end.words()));
                self.say(format!("step {}: {}: {}{done}{end}", taken.step, taken.action, taken.outcome));
            }
            SessionEvent::Instructed { new, .. } => {
                self.seen().instruction = Some(new.clone());
                self.say(format!("instruction: {new}"));
            }
            SessionEvent::Stopped(why) => self.say(format!("stopped: {why}")),
            SessionEvent::Refused(why) | SessionEvent::Failed(why) => self.say(format!("problem: {why}")),
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
        let done = match order {
            Order::Pause => "pauses",
            Order::Resume => "goes on",
            Order::Instruct(_) => "gives the agent that instruction",
            Order::Stop if (self.end)() => return Ok("ends, as when it is left".into()),
            Order::Stop => return Err("it is busy".into()),
        };
        match &self.seen().obey {
            None => Err("nothing is explored yet: its list is shown".into()),
            Some(obey) if obey(order) => Ok(done.into()),
            Some(_) => Err("its session is over, or busy".into()),
        }
    }

    fn tail(&self) -> &Tail {
        &self.tail
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::mpsc::channel;

    use super::*;
    use crate::explore::session::RunMode;

    #[test]
    fn orders_are_handed_on_and_what_a_session_tells_is_seen() {
        let asked = Arc::new(AtomicBool::new(false));
        let ends = asked.clone();
        let control = ExplorerControl::new(move || !ends.swap(true, Ordering::Relaxed));
        assert!(control.obey(Order::Pause).unwrap_err().contains("its list is shown"));
        let (orders, inbox) = channel();
        control.command(move |order| orders.send(order).is_ok());
        control.obey(Order::Instruct("open the fridge".into())).unwrap();
        control.obey(Order::Pause).unwrap();
        let heard: Vec<Order> = inbox.try_iter().collect();
        assert_eq!(heard, [Order::Instruct("open the fridge".into()), Order::Pause]);
        control.hear(&SessionEvent::Running(Some(RunMode::Policy)));
        assert_eq!(control.status().state, State::Running);
        control.obey(Order::Stop).unwrap();
        assert!(asked.load(Ordering::Relaxed));
        assert!(control.obey(Order::Stop).unwrap_err().contains("busy"));
        control.leave();
        assert!(inbox.recv().is_err(), "the worker can end");
    }
}
