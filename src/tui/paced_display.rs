//! The display that screens draw on: a frame is sent whole, when the terminal has taken in the one before; it can be given back
//! for a while and taken again.

use std::io::{self, Write};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use crossterm::queue;
use crossterm::terminal::{BeginSynchronizedUpdate, EndSynchronizedUpdate};
use ratatui::Terminal;
use ratatui::backend::{Backend, ClearType, CrosstermBackend};
use ratatui::layout::Size;
use ratatui::widgets::Widget;

use super::capabilities::first_answer;
use super::link_speed::LinkSpeed;
use super::pacing::{self, Pacer};
use super::terminal;

/// A terminal's display, and whether it can take another frame.
pub(crate) struct PacedDisplay<W: Write> {
    display: Terminal<CrosstermBackend<W>>,
    pacer: Pacer,
    link: LinkSpeed,
    /// The frame that is on its way, and its bytes.
    on_its_way: Option<(Instant, u64)>,
    /// When the terminal was asked for the first time, ahead of the first frame: its answer takes the way there and back alone.
    first_asked: Option<Instant>,
    /// The bytes of the newest frame.
    cost: u64,
    /// The program was stopped, and has not been let go on yet: the terminal is another's.
    is_stopped: bool,
}

impl<W: Write> PacedDisplay<W> {
    /// Nothing is shown yet.
    pub(crate) fn new(display: Terminal<CrosstermBackend<W>>) -> PacedDisplay<W> {
        PacedDisplay {
            display,
            pacer: Pacer::new(first_answer()),
            link: LinkSpeed::default(),
            on_its_way: None,
            first_asked: None,
            cost: 0,
            is_stopped: false,
        }
    }

    /// The terminal's size.
    ///
    /// # Errors
    /// When it cannot be asked.
    pub(crate) fn size(&self) -> io::Result<Size> {
        self.display.size()
    }

    /// What sequences are written to that are no drawing.
    pub(crate) fn out(&mut self) -> &mut CrosstermBackend<W> {
        self.display.backend_mut()
    }

    /// Draws something over the whole screen and sends it out whole.
    ///
    /// # Errors
    /// When the terminal cannot be written.
    pub(crate) fn show(&mut self, screen: impl Widget) -> io::Result<()> {
        queue!(self.display.backend_mut(), BeginSynchronizedUpdate)?;
        self.display.draw(|frame| frame.render_widget(screen, frame.area()))?;
        queue!(self.display.backend_mut(), EndSynchronizedUpdate)?;
        Write::flush(self.display.backend_mut())
    }

    /// How long the next frame has to wait, unless an answer comes first.
    pub(crate) fn waits(&mut self) -> Option<Duration> {
        if self.is_stopped { None } else { self.pacer.waits(Instant::now()) }
    }

    /// The same where the terminal has taken in what was drawn before; asks it to say when it has taken in this. Returns how long that
    /// has to wait otherwise.
    ///
    /// # Errors
    /// When the terminal cannot be written.
    pub(crate) fn show_when_ready(&mut self, screen: impl Widget) -> io::Result<Option<Duration>> {
        let now = Instant::now();
        if self.is_stopped {
            return Ok(None);
        }
        if let Some(left) = self.pacer.waits(now) {
            return Ok(Some(left));
        }
        if self.pacer.is_unused() {
            self.first_asked = Some(now);
            self.display.backend_mut().write_all(pacing::QUESTION)?;
            // On its own, so that it is on its way before the frame is.
            Write::flush(self.display.backend_mut())?;
        }
        let before = terminal::WRITTEN.load(Ordering::Relaxed);
        self.show(screen)?;
        self.cost = terminal::WRITTEN.load(Ordering::Relaxed) - before;
        self.on_its_way = None;
        if self.pacer.sends(now) {
            self.on_its_way = Some((now, self.cost));
            self.display.backend_mut().write_all(pacing::QUESTION)?;
            Write::flush(self.display.backend_mut())?;
        }
        Ok(None)
    }

    /// The terminal has taken in all that was sent.
    pub(crate) fn answered(&mut self) {
        if let Some(asked) = self.first_asked.take() {
            self.link.is_so_far(asked.elapsed());
            return;
        }
        self.pacer.answered();
        if let Some((sent, bytes)) = self.on_its_way.take() {
            self.link.observe(bytes, sent.elapsed());
        }
    }

    /// Nothing is known of the link yet, as the first answer is still out: what is large had better wait.
    pub(crate) fn is_new(&self) -> bool {
        self.pacer.awaits_first()
    }

    /// The bytes of the newest frame.
    pub(crate) fn cost(&self) -> u64 {
        self.cost
    }

    /// The most bytes that a picture may cost so that keys are answered in time; nothing where the link is fast.
    pub(crate) fn affords(&self) -> Option<u64> {
        self.link.affords()
    }

    /// Clears the screen, so that the next drawing is a whole one. The display's own way would ask the terminal where its
    /// cursor is, and its answer would be taken by whoever reads the keys.
    ///
    /// # Errors
    /// When the terminal cannot be written.
    pub(crate) fn repaint(&mut self) -> io::Result<()> {
        if self.is_stopped {
            return Ok(());
        }
        self.display.backend_mut().clear_region(ClearType::All)?;
        self.display.swap_buffers();
        Ok(())
    }

    /// Gives the terminal back and stops, with all that was started together with it; whoever lets it go on says so by a signal.
    ///
    /// # Errors
    /// When the program cannot be stopped.
    pub(crate) fn stop(&mut self) -> io::Result<()> {
        Write::flush(self.display.backend_mut())?;
        self.is_stopped = true;
        terminal::stop()
    }

    /// Takes the terminal again: whoever had it meanwhile left it as they like it.
    ///
    /// # Errors
    /// When it is gone.
    pub(crate) fn go_on(&mut self) -> io::Result<()> {
        terminal::take_again()?;
        self.is_stopped = false;
        (self.pacer, self.first_asked) = (Pacer::new(first_answer()), None);
        self.repaint()
    }
}
