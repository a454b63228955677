//! The explorer on a screen as `sprint ctl` steers it: orders become the session's commands.

use std::sync::Arc;
use std::sync::mpsc::{Sender, SyncSender};

use signal_hook::consts::SIGTERM;

use super::update::Msg;
use crate::control::Order;
use crate::explore::session::{RunMode, SessionCommand};
use crate::explore::steering::ExplorerControl;

/// What steers an explorer on a screen, which ends as by SIGTERM: the session is kept.
pub(super) fn ended_by_signal(tell: &SyncSender<Msg>) -> Arc<ExplorerControl> {
    let screen = tell.clone();
    ExplorerControl::new(move || screen.try_send(Msg::Signal(SIGTERM)).is_ok())
}

/// Orders as commands of a session.
pub(super) fn obeyed_by(commands: Sender<SessionCommand>) -> impl Fn(Order) -> bool + Send + 'static {
    move |order| {
        let command = match order {
            Order::Pause | Order::Stop => SessionCommand::Pause,
            Order::Resume => SessionCommand::Run { mode: RunMode::Policy, until: None },
            Order::Instruct(text) => SessionCommand::Instruct(text),
        };
        commands.send(command).is_ok()
    }
}
