//! What the screen opens: what the command line named, or what a person picks from a list.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender};

use anyhow::Context;
use crossterm::queue;
use crossterm::terminal::{BeginSynchronizedUpdate, EndSynchronizedUpdate};
use ratatui::Terminal;
use ratatui::backend::{Backend, ClearType, CrosstermBackend};

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
    Left { exit: ExitReason, is_opening: bool },
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
    display: &mut Terminal<CrosstermBackend<W>>,
    messages: &Receiver<Msg>,
    mut start_worker: impl FnMut(&Start) -> io::Result<Sender<SessionCommand>>,
) -> anyhow::Result<Picked> {
    let mut under_way: Option<(Sender<SessionCommand>, Start)> = None;
    let mut is_stopped = false;
    loop {
        if !is_stopped {
            draw(&page, style, display)?;
        }
        match messages.recv().context("all threads are gone")? {
            Msg::Key(key) => match page.on_key(key) {
                StartAnswer::Stay => {}
                StartAnswer::Open(start) => under_way = Some((start_worker(&start)?, start)),
                StartAnswer::Leave => {
                    return Ok(Picked::Left { exit: ExitReason::Asked, is_opening: under_way.is_some() });
                }
            },
            Msg::Paste(text) => page.on_paste(&text),
            Msg::Signal(number) => {
                return Ok(Picked::Left { exit: ExitReason::Signal(number), is_opening: under_way.is_some() });
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
            Msg::StopAsked => {
                is_stopped = true;
                terminal::stop()?;
            }
            Msg::Continued => {
                terminal::take_again()?;
                display.backend_mut().clear_region(ClearType::All)?;
                display.swap_buffers();
                is_stopped = false;
            }
            Msg::Mouse(_) | Msg::Resize(_) | Msg::Picture(_) | Msg::Elsewhere(_) | Msg::Ready => {}
        }
    }
}

fn draw<W: Write>(
    page: &StartPage,
    StartStyle { scheme, ability }: StartStyle,
    display: &mut Terminal<CrosstermBackend<W>>,
) -> io::Result<()> {
    queue!(display.backend_mut(), BeginSynchronizedUpdate)?;
    display.draw(|frame| frame.render_widget(StartView { page, scheme, ability }, frame.area()))?;
    queue!(display.backend_mut(), EndSynchronizedUpdate)?;
    Write::flush(display.backend_mut())
}
