//! The screen of an exploration in an environment with actions of its own: one worker thread owns the environment, so that the
//! screen never waits for it.

mod keys;
mod layout;
mod state;
mod steering;
mod view;
mod worker;

pub(crate) use worker::RemoteEvent;

use std::io::Write;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use anyhow::Context;

use super::graphics::{Protocol, inline};
use super::paced_display::PacedDisplay;
use super::screen::ScreenOptions;
use super::steering::ended_by_signal;
use super::taken_terminal::{QUEUE, TakenTerminal, TerminalOptions};
use super::terminal;
use super::update::{ExitReason, Msg};
use crate::agent::policy_source::PolicySource;
use crate::explore::remote::OpenRemote;
use keys::KeyAnswer;
use state::RemoteApp;

/// How often the screen tells how long it waits already.
const TICK: Duration = Duration::from_millis(250);

/// Shows the exploration until a person leaves.
///
/// # Errors
/// When there is no terminal, or the environment cannot be opened.
pub(crate) fn run(screen: ScreenOptions, open: OpenRemote, agent: PolicySource) -> anyhow::Result<ExitReason> {
    let options =
        TerminalOptions { protocol: screen.protocol, memory: screen.memory.as_deref(), log: screen.log.as_ref() };
    let TakenTerminal { guard, mut display, graphics, ability, messages, tell } = TakenTerminal::take(&options)?;
    let control = ended_by_signal(&tell);
    let heard = control.clone();
    let commands = worker::start(open, agent, move |event| {
        steering::heard_by(&heard, &event);
        tell.send(Msg::Remote(Box::new(event))).is_ok()
    })?;
    control.command(steering::obeyed_by(commands.clone()));
    let listens = control.listen();
    let mut app = RemoteApp::new(display.size()?, graphics, ability, screen.config.scheme, commands);
    app.traffic.limit = screen.bandwidth;
    if screen.runs && !screen.manual {
        app.run_when_open();
    }
    if app.graphics.protocol == Protocol::Kitty {
        terminal::holds_pictures(inline::kitty_forget(app.graphics.in_tmux));
    }
    let exit = run_loop(&mut app, &mut display, &messages);
    drop(guard);
    control.leave();
    drop(listens);
    exit
}

fn run_loop<W: Write>(
    app: &mut RemoteApp,
    display: &mut PacedDisplay<W>,
    messages: &Receiver<Msg>,
) -> anyhow::Result<ExitReason> {
    // Something changed that is not drawn yet.
    let mut is_stale = true;
    loop {
        let size = display.size()?;
        if size != app.size {
            app.resize(size);
            is_stale = true;
        }
        let mut wait = None;
        if is_stale {
            wait = display.waits();
            is_stale = wait.is_some();
            if !is_stale {
                // Only what is shown is encoded.
                let is_picture_new = app.encode();
                display.show_when_ready(&*app)?;
                if is_picture_new {
                    app.traffic.keep_to_link(display.cost(), display.affords());
                }
            }
        }
        let tick = app.is_waiting().then_some(TICK);
        let first = match wait.into_iter().chain(tick).min() {
            None => Some(messages.recv().context("all threads are gone")?),
            Some(wait) => match messages.recv_timeout(wait) {
                Ok(msg) => Some(msg),
                Err(RecvTimeoutError::Timeout) => {
                    is_stale |= app.is_waiting();
                    None
                }
                Err(RecvTimeoutError::Disconnected) => anyhow::bail!("all threads are gone"),
            },
        };
        let all: Vec<Msg> = first.into_iter().chain(messages.try_iter().take(4 * QUEUE)).collect();
        for msg in all {
            is_stale |= !matches!(msg, Msg::Ready);
            match msg {
                Msg::Key(key) => match app.on_key(key) {
                    KeyAnswer::Quit => return Ok(ExitReason::Asked),
                    KeyAnswer::Stop => display.stop()?,
                    KeyAnswer::Repaint => display.repaint()?,
                    KeyAnswer::Nothing => {}
                },
                Msg::Paste(text) => app.paste(&text),
                Msg::Resize(_) => display.repaint()?,
                Msg::Remote(event) => app.on_event(*event)?,
                Msg::Signal(number) => return Ok(ExitReason::Signal(number)),
                Msg::StopAsked => display.stop()?,
                Msg::Continued => display.go_on()?,
                Msg::Ready => display.answered(),
                Msg::Mouse(_) | Msg::Session(_) | Msg::Picture(_) | Msg::WorkerGone => {}
            }
        }
    }
}
