//! The loop of the explorer's screen: messages in, one `update`, effects out, one drawing for all that came.

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use anyhow::Context;
use crossterm::clipboard::CopyToClipboard;
use crossterm::queue;
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;

use super::app::App;
use super::graphics::encoder::PictureEncoder;
use super::graphics::{Picture, Protocol, inline};
use super::paced_display::PacedDisplay;
use super::taken_terminal::QUEUE;
use super::update::{Effect, ExitReason, Msg, update};
use super::{history, terminal};
use crate::explore::session::{SessionCommand, SessionEvent};

/// How long the meter of bytes a second counts.
const METERED: Duration = Duration::from_secs(1);

/// The state, the display that shows it, and the threads that work for it.
pub struct ScreenLoop<W: Write> {
    app: App,
    pub(super) display: PacedDisplay<W>,
    commands: Sender<SessionCommand>,
    encoder: PictureEncoder,
    /// Where instructions are kept for later sessions.
    history: Option<PathBuf>,
    /// The step that the meter of bytes counted last, and the bytes written until then.
    metered: (u32, u64),
    /// When the meter of bytes a second began to count, and the bytes written until then.
    since: (Instant, u64),
    /// A new picture is not sent yet.
    is_picture_new: bool,
    /// A key was pressed, or a run began or ended, and that is not shown yet: over a slow link pictures wait for it.
    is_urgent: bool,
    /// The picture that waits.
    waiting: Option<Picture>,
}

impl<W: Write> ScreenLoop<W> {
    /// Nothing is shown yet.
    pub fn new(
        app: App,
        display: Terminal<CrosstermBackend<W>>,
        commands: Sender<SessionCommand>,
        encoder: PictureEncoder,
        history: Option<PathBuf>,
    ) -> ScreenLoop<W> {
        ScreenLoop::on(app, PacedDisplay::new(display), commands, encoder, history)
    }

    pub(super) fn on(
        app: App,
        display: PacedDisplay<W>,
        commands: Sender<SessionCommand>,
        encoder: PictureEncoder,
        history: Option<PathBuf>,
    ) -> ScreenLoop<W> {
        let since = (Instant::now(), terminal::WRITTEN.load(Ordering::Relaxed));
        ScreenLoop {
            app,
            display,
            commands,
            encoder,
            history,
            metered: (0, 0),
            since,
            is_picture_new: false,
            is_urgent: false,
            waiting: None,
        }
    }

    /// Draws the state and sends it out whole.
    ///
    /// # Errors
    /// When the terminal cannot be written.
    pub fn show(&mut self) -> io::Result<()> {
        self.display.show(&self.app)
    }

    /// Takes in messages until one of them ends it.
    ///
    /// # Errors
    /// When the terminal cannot be written, or all threads are gone.
    pub(super) fn run(&mut self, messages: &Receiver<Msg>) -> anyhow::Result<ExitReason> {
        // Something changed that is not drawn yet.
        let mut is_stale = true;
        loop {
            self.measure()?;
            let mut wait = None;
            if is_stale {
                wait = self.display.show_when_ready(&self.app)?;
                is_stale = wait.is_some() || self.after_drawing()?;
            }
            if is_stale && wait.is_none() {
                continue;
            }
            let first = match wait {
                None => Some(messages.recv().context("all threads are gone")?),
                Some(wait) => match messages.recv_timeout(wait) {
                    Ok(msg) => Some(msg),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => anyhow::bail!("all threads are gone"),
                },
            };
            // What came meanwhile is taken in before the next drawing: only the newest state is drawn.
            let all: Vec<Msg> = first.into_iter().chain(messages.try_iter().take(4 * QUEUE)).collect();
            // That the terminal is ready changes nothing on the self.
            is_stale |= all.iter().any(|msg| !matches!(msg, Msg::Ready));
            if let Some(exit) = self.on_messages(all)? {
                return Ok(exit);
            }
        }
    }

    /// Takes in messages; says when one of them ends it.
    ///
    /// # Errors
    /// When the terminal cannot be written.
    pub fn on_messages(&mut self, messages: impl IntoIterator<Item = Msg>) -> io::Result<Option<ExitReason>> {
        let mut encode = false;
        for msg in messages {
            match msg {
                Msg::Ready => self.display.answered(),
                Msg::Key(_) | Msg::Session(SessionEvent::Running(_)) => self.is_urgent = true,
                Msg::Picture(picture)
                    if self.display.is_new() || (self.is_urgent && self.display.affords().is_some()) =>
                {
                    self.waiting = Some(picture);
                    continue;
                }
                Msg::Picture(_) => self.is_picture_new = true,
                _ => {}
            }
            for effect in update(&mut self.app, msg) {
                match effect {
                    // A worker that is gone says so itself.
                    Effect::Send(command) => drop(self.commands.send(command)),
                    Effect::Encode => encode = true,
                    Effect::Copy(text) => {
                        queue!(self.display.out(), CopyToClipboard::to_clipboard_from(text))?;
                    }
                    Effect::Remember(instruction) => {
                        if let Some(path) = &self.history {
                            history::keep(path, Some(&instruction));
                        }
                    }
                    Effect::Mouse(on) => terminal::report_mouse(self.display.out(), on)?,
                    Effect::Repaint => self.display.repaint()?,
                    Effect::Stop => self.display.stop()?,
                    Effect::GoOn => self.display.go_on()?,
                    Effect::Quit(exit) => return Ok(Some(exit)),
                }
            }
        }
        if encode && let Some(job) = self.app.job() {
            if job.protocol == Protocol::Kitty {
                terminal::holds_pictures(inline::kitty_forget(job.in_tmux));
            }
            self.encoder.submit(job);
            self.app.traffic.is_full = false;
        }
        self.meter();
        Ok(None)
    }

    /// Takes in what the frame that was sent cost; says whether a picture waited for it, which is to be shown now.
    fn after_drawing(&mut self) -> io::Result<bool> {
        self.is_urgent = false;
        if std::mem::take(&mut self.is_picture_new) {
            self.app.traffic.keep_to_link(self.display.cost(), self.display.affords());
        }
        let Some(picture) = self.waiting.take() else { return Ok(false) };
        self.on_messages([Msg::Picture(picture)])?;
        Ok(true)
    }

    /// Takes in the terminal's size, should a message about it have been missed.
    fn measure(&mut self) -> io::Result<()> {
        let size = self.display.size()?;
        if size != self.app.terminal.size {
            self.on_messages([Msg::Resize(size)])?;
        }
        Ok(())
    }

    /// Notes what the newest steps cost on the wire.
    fn meter(&mut self) {
        let step = self.app.session.now.as_ref().map_or(0, |now| now.step);
        let (before, bytes_before) = self.metered;
        if step != before {
            let bytes = terminal::WRITTEN.load(Ordering::Relaxed);
            let steps = step.saturating_sub(before);
            self.app.traffic.of_step = (steps > 0).then(|| (bytes - bytes_before) / u64::from(steps));
            self.metered = (step, bytes);
            self.app.traffic.keep_to_limit(bytes - bytes_before, steps);
        }
        let (since, before) = self.since;
        if since.elapsed() >= METERED {
            let bytes = terminal::WRITTEN.load(Ordering::Relaxed);
            self.app.traffic.of_second = Some(((bytes - before) as f32 / since.elapsed().as_secs_f32()) as u64);
            self.since = (Instant::now(), bytes);
        }
    }
}
