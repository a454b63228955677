//! What the screen opens: what the command line named, or what a person picks from a list.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};

use anyhow::Context;

use super::paced_display::PacedDisplay;
use super::start_page::{StartAnswer, StartPage};
use super::terminal;
use super::theme::{Ability, Scheme};
use super::update::{ExitReason, Msg};
use super::view::start::StartView;
use crate::explore::exploration::Exploration;
use crate::explore::session::SessionCommand;
use crate::explore::start_list::{Start, StartEntry};

/// Opens an exploration, once, on the worker's thread.
pub(crate) type Open = Box<dyn FnOnce() -> anyhow::Result<Exploration> + Send>;
/// Opens what was picked, on the worker's thread.
pub(crate) type OpenPicked = Arc<dyn Fn(&Start) -> anyhow::Result<Exploration> + Send + Sync>;

/// What the screen opens.
pub(crate) enum Opening {
    /// What the command line named.
    Named(Open),
    /// What a person picks from a list.
    Picked(Vec<StartEntry>, OpenPicked),
}

/// What came of the start page.
pub(super) enum Picked {
    /// A worker opened it; these messages came from it already.
    Started { commands: Sender<SessionCommand>, first: Vec<Msg>, start: Start },
    /// The person left; a worker may still be opening something.
    Left(ExitReason),
}

/// How the page is drawn.
#[derive(Clone, Copy)]
pub(super) struct StartStyle {
    pub(super) scheme: Scheme,
    pub(super) ability: Ability,
}

/// Shows the list until something is open. What cannot be opened is said, and the list stays.
///
/// # Errors
/// When the terminal cannot be written, or no worker can be started.
pub(super) fn pick<W: Write>(
    mut page: StartPage,
    style: StartStyle,
    display: &mut PacedDisplay<W>,
    messages: &Receiver<Msg>,
    mut start_worker: impl FnMut(&Start) -> io::Result<Sender<SessionCommand>>,
) -> anyhow::Result<Picked> {
    let mut under_way: Option<(Sender<SessionCommand>, Start)> = None;
    let StartStyle { scheme, ability } = style;
    // Something changed that is not drawn yet.
    let mut is_stale = true;
    loop {
        let mut wait = None;
        if is_stale {
            wait = display.show_when_ready(StartView { page: &page, scheme, ability })?;
            is_stale = wait.is_some();
        }
        let msg = match wait {
            None => messages.recv().context("all threads are gone")?,
            Some(wait) => match messages.recv_timeout(wait) {
                Ok(msg) => msg,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => anyhow::bail!("all threads are gone"),
            },
        };
        is_stale |= !matches!(msg, Msg::Ready);
        match msg {
            Msg::Key(key) => match page.on_key(key) {
                StartAnswer::Stay => {}
                StartAnswer::Open(start) => under_way = Some((start_worker(&start)?, start)),
                StartAnswer::Leave => {
                    return Ok(Picked::Left(ExitReason::Asked));
                }
            },
            Msg::Paste(text) => page.on_paste(&text),
            Msg::Signal(number) => {
                return Ok(Picked::Left(ExitReason::Signal(number)));
            }
            Msg::WorkerGone => {
                under_way = None;
                page.fail(terminal::last_words().unwrap_or_else(|| "it could not be opened".into()));
            }
            event @ Msg::Session(_) => {
                if let Some((commands, start)) = under_way.take() {
                    return Ok(Picked::Started { commands, first: vec![event], start });
                }
            }
            Msg::StopAsked => display.stop()?,
            Msg::Continued => display.go_on()?,
            Msg::Ready => display.answered(),
            Msg::Mouse(_) | Msg::Resize(_) | Msg::Picture(_) | Msg::Remote(_) => {}
        }
    }
}
