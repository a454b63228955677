//! The screen of an exploration in an environment with actions of its own: one worker thread owns the environment, so that the
//! screen never waits for it.

mod keys;
mod layout;
mod state;
mod view;
mod worker;

pub(crate) use worker::OwnEvent;

use std::io::{self, BufWriter, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use anyhow::Context;
use crossterm::queue;
use crossterm::terminal::{BeginSynchronizedUpdate, EndSynchronizedUpdate};
use ratatui::Terminal;
use ratatui::backend::{Backend, ClearType, CrosstermBackend};

use super::capabilities::{ability, graphics};
use super::graphics::{Protocol, inline};
use super::keyboard::Keyboard;
use super::screen::ScreenOptions;
use super::signals;
use super::terminal::{self, Counted};
use super::update::{ExitReason, Msg};
use crate::agent::policy_source::PolicySource;
use crate::explore::elsewhere::OpenOwn;
use keys::KeyAnswer;
use state::OwnApp;

/// Messages that may wait for the screen; beyond that their senders wait.
const QUEUE: usize = 64;
/// How often the screen tells how long it waits already.
const TICK: Duration = Duration::from_millis(250);

/// Shows the exploration until a person leaves.
///
/// # Errors
/// When there is no terminal, or the environment cannot be opened.
pub(crate) fn run(screen: ScreenOptions, open: OpenOwn, agent: PolicySource) -> anyhow::Result<ExitReason> {
    crossterm::style::force_color_output(true);
    let ability = ability();
    terminal::catch_panics();
    let (tell, messages) = sync_channel(QUEUE);
    signals::watch(tell.clone())?;
    let guard =
        terminal::Guard::take(screen.log.as_ref()).context("the explorer needs a terminal; --plain does not")?;
    let mut keyboard = Keyboard::default();
    let graphics = graphics(screen.protocol, ability, screen.memory.as_deref(), &mut keyboard);
    let mut display =
        Terminal::new(CrosstermBackend::new(BufWriter::with_capacity(1 << 16, Counted::new(io::stdout()))))?;
    keyboard.listen(tell.clone())?;
    let commands = worker::start(open, agent, move |event| tell.send(Msg::Elsewhere(Box::new(event))).is_ok())?;
    let mut app = OwnApp::new(display.size()?, graphics, ability, screen.config.scheme, commands);
    if screen.runs && !screen.manual {
        app.run_when_open();
    }
    if app.graphics.protocol == Protocol::Kitty {
        terminal::holds_pictures(inline::kitty_forget(app.graphics.in_tmux));
    }
    let exit = run_loop(&mut app, &mut display, &messages);
    drop(guard);
    exit
}

fn run_loop<W: Write>(
    app: &mut OwnApp,
    display: &mut Terminal<CrosstermBackend<W>>,
    messages: &Receiver<Msg>,
) -> anyhow::Result<ExitReason> {
    loop {
        let size = display.size()?;
        if size != app.size {
            app.resize(size);
        }
        if !app.is_stopped {
            queue!(display.backend_mut(), BeginSynchronizedUpdate)?;
            display.draw(|frame| frame.render_widget(&*app, frame.area()))?;
            queue!(display.backend_mut(), EndSynchronizedUpdate)?;
            Write::flush(display.backend_mut())?;
        }
        let first = match app.is_waiting() {
            false => Some(messages.recv().context("all threads are gone")?),
            true => match messages.recv_timeout(TICK) {
                Ok(msg) => Some(msg),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => anyhow::bail!("all threads are gone"),
            },
        };
        let all: Vec<Msg> = first.into_iter().chain(messages.try_iter().take(4 * QUEUE)).collect();
        for msg in all {
            match msg {
                Msg::Key(key) => match app.on_key(key) {
                    KeyAnswer::Quit => return Ok(ExitReason::Asked),
                    KeyAnswer::Stop => stop(app, display)?,
                    KeyAnswer::Repaint => repaint(display)?,
                    KeyAnswer::Nothing => {}
                },
                Msg::Paste(text) => app.paste(&text),
                Msg::Resize(_) => repaint(display)?,
                Msg::Elsewhere(event) => app.on_event(*event)?,
                Msg::Signal(number) => return Ok(ExitReason::Signal(number)),
                Msg::StopAsked => stop(app, display)?,
                Msg::Continued => {
                    terminal::take_again()?;
                    app.is_stopped = false;
                    repaint(display)?;
                }
                Msg::Mouse(_) | Msg::Session(_) | Msg::Picture(_) | Msg::Ready | Msg::WorkerGone => {}
            }
        }
    }
}

/// Gives the terminal back and stops; whoever lets the program go on says so by a signal.
fn stop<W: Write>(app: &mut OwnApp, display: &mut Terminal<CrosstermBackend<W>>) -> io::Result<()> {
    Write::flush(display.backend_mut())?;
    app.is_stopped = true;
    terminal::stop()
}

fn repaint<W: Write>(display: &mut Terminal<CrosstermBackend<W>>) -> io::Result<()> {
    display.backend_mut().clear_region(ClearType::All)?;
    display.swap_buffers();
    Ok(())
}
