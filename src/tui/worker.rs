//! The thread that owns the session: commands in, events out. The screen never waits for it.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Instant;

use crate::explore::exploration::Exploration;
use crate::explore::session::{Session, SessionCommand, SessionEvent};

/// Starts the worker. `open` makes the exploration on the worker's thread; events go to `tell`.
///
/// # Errors
/// When the system has no thread left.
pub fn start(
    open: impl FnOnce() -> anyhow::Result<Exploration> + Send + 'static,
    tell: impl Fn(SessionEvent) + Send + Sync + 'static,
    fail: impl FnOnce(String) + Send + 'static,
) -> std::io::Result<Sender<SessionCommand>> {
    let (commands, inbox) = channel();
    std::thread::Builder::new().name("worker".into()).spawn(move || match open() {
        Ok(exploration) => work(Session::live(exploration, Arc::new(tell)), &inbox),
        Err(error) => fail(format!("{error:#}")),
    })?;
    Ok(commands)
}

/// Carries out commands, and steps between them while a run is under way, until nobody commands any more.
fn work(mut session: Session, inbox: &Receiver<SessionCommand>) {
    session.begin();
    // When the next step of a run is due.
    let mut due = Instant::now();
    loop {
        let command = match session.interval() {
            Some(_) => inbox.recv_timeout(due.saturating_duration_since(Instant::now())),
            None => inbox.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        match command {
            Ok(command) => {
                let starts = matches!(command, SessionCommand::Run { .. });
                let opens = matches!(command, SessionCommand::Next | SessionCommand::Seed(_));
                session.apply(command);
                session.autosave();
                let now = Instant::now();
                let Some(interval) = session.interval() else { continue };
                due = match (starts, opens) {
                    (true, _) => now,
                    // A new house is shown before the first step in it.
                    (false, true) => now + interval,
                    // Another rate counts at once.
                    (false, false) => due.min(now + interval),
                };
            }
            Err(RecvTimeoutError::Timeout) => {
                session.advance();
                session.autosave();
                due = Instant::now() + session.interval().unwrap_or_default();
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::time::Duration;

    use super::*;
    use crate::agent::registry::PolicyKind;
    use crate::analysis::chain::Draws;
    use crate::domain::{Action, ActionType};
    use crate::explore::session::{RunMode, StepRate};
    use crate::explore::testing;

    /// A worker in the kitchen, and what it tells.
    fn start() -> (Sender<SessionCommand>, Receiver<SessionEvent>) {
        let (tell, events) = channel();
        let commands =
            super::start(|| Ok(testing::exploration()), move |event| drop(tell.send(event)), |error| panic!("{error}"))
                .unwrap();
        (commands, events)
    }

    fn wait(events: &Receiver<SessionEvent>, mut wanted: impl FnMut(&SessionEvent) -> bool) -> SessionEvent {
        loop {
            let event = events.recv_timeout(Duration::from_secs(60)).unwrap();
            if wanted(&event) {
                return event;
            }
        }
    }

    #[test]
    fn the_house_is_shown_before_the_policy_is_loaded() {
        let (_commands, events) = start();
        assert!(matches!(events.recv().unwrap(), SessionEvent::State(_)));
        assert!(matches!(events.recv().unwrap(), SessionEvent::Busy(Some(_))));
        wait(&events, |event| matches!(event, SessionEvent::Decided(..)));
    }

    #[test]
    fn it_runs_until_told_to_stop_and_steps_one_at_a_time() {
        let (commands, events) = start();
        commands.send(SessionCommand::StepRate((0..9).fold(StepRate::default(), |rate, _| rate.faster()))).unwrap();
        commands.send(SessionCommand::Run { mode: RunMode::Policy, until: None }).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::Stepped(step) if step.step >= 5));
        commands.send(SessionCommand::Pause).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::Running(None)));
        commands.send(SessionCommand::Reset).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::State(now) if now.step == 0));
        commands.send(SessionCommand::Act(Action::navigate(ActionType::RotateLeft))).unwrap();
        let event = wait(&events, |event| matches!(event, SessionEvent::Stepped(_)));
        assert!(matches!(event, SessionEvent::Stepped(step) if step.by_hand && step.step == 1));
    }

    #[test]
    fn it_takes_so_many_steps_at_full_speed_unless_told_to_stop() {
        let (commands, events) = start();
        commands.send(SessionCommand::Run { mode: RunMode::Steps(3), until: None }).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::Stepped(step) if step.step == 3));
        wait(&events, |event| matches!(event, SessionEvent::Running(None)));
        commands.send(SessionCommand::Run { mode: RunMode::Steps(u32::MAX), until: None }).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::Stepped(step) if step.step == 4));
        commands.send(SessionCommand::Pause).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::Running(None)));
    }

    #[test]
    fn a_chain_belongs_to_the_house_that_it_was_asked_in() {
        let (commands, events) = start();
        commands.send(SessionCommand::Chain("take the mug; open the fridge".into())).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::Chain(_)));
        commands.send(SessionCommand::Next).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::Working(None)));
        commands.send(SessionCommand::WhichLink(Draws { times: 1, only: None })).unwrap();
        let refused = wait(&events, |event| matches!(event, SessionEvent::Refused(_)));
        assert!(matches!(refused, SessionEvent::Refused(why) if why.contains("there is no chain yet")));
    }

    #[test]
    fn a_policy_that_cannot_be_loaded_is_told_and_the_house_stays() {
        let (commands, events) = start();
        commands.send(SessionCommand::Choose(PolicyKind::Agent)).unwrap();
        let event = wait(&events, |event| matches!(event, SessionEvent::Failed(_)));
        assert!(matches!(event, SessionEvent::Failed(reason) if reason.contains("there is no checkpoint")));
        commands.send(SessionCommand::Step).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::Stepped(_)));
    }

    #[test]
    fn a_value_map_is_computed_once_for_a_house_and_can_be_stopped() {
        let (commands, events) = start();
        wait(&events, |event| matches!(event, SessionEvent::Decided(..)));
        commands.send(SessionCommand::ValueMap).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::ValueMap(found, 0) if found.cells.len() == 2));
        commands.send(SessionCommand::Stop).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::Working(None)));
        commands.send(SessionCommand::ValueMap).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::ValueMap(found, _) if found.cells.len() == found.of));
        wait(&events, |event| matches!(event, SessionEvent::Working(None)));
        // Wherever the agent stands, the house is the same one.
        commands.send(SessionCommand::Act(Action::navigate(ActionType::RotateLeft))).unwrap();
        wait(&events, |event| matches!(event, SessionEvent::Stepped(_)));
        commands.send(SessionCommand::ValueMap).unwrap();
        let mut worked = false;
        let whole =
            |event: &SessionEvent| matches!(event, SessionEvent::ValueMap(found, 1) if found.cells.len() == found.of);
        wait(&events, |event| {
            worked |= matches!(event, SessionEvent::Working(Some(_)));
            whole(event)
        });
        assert!(!worked, "what is known is not computed again");
    }

    #[test]
    fn it_ends_when_nobody_commands_any_more() {
        let (commands, events) = start();
        wait(&events, |event| matches!(event, SessionEvent::Decided(..)));
        drop(commands);
        while let Ok(event) = events.recv_timeout(Duration::from_secs(60)) {
            assert!(!matches!(event, SessionEvent::Stepped(_)));
        }
    }
}
