//! The loop of the explorer's screen: messages in, one `update`, effects out, one drawing for all that came.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender};
use std::time::{Duration, Instant};

use anyhow::Context;
use crossterm::clipboard::CopyToClipboard;
use crossterm::queue;
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Size;

use super::app::{App, Graphics};
use super::config::ExplorerConfig;
use super::graphics::encoder::PictureEncoder;
use super::graphics::{Picture, Protocol, inline};
use super::history;
use super::opening::{Open, Opening, Picked, StartStyle, pick};
use super::paced_display::PacedDisplay;
use super::signals::PATIENCE;
use super::start_page::StartPage;
use super::steering::ExplorerControl;
use super::taken_terminal::{QUEUE, TakenTerminal, TerminalOptions};
use super::terminal;
use super::theme::Ability;
use super::update::{Effect, ExitReason, Msg, update};
use super::worker;
use crate::agent::registry::PolicyKind;
use crate::explore::session::{RunMode, SessionCommand, SessionEvent};
use crate::explore::start_list::Start;

/// What the screen is started with.
pub(crate) struct ScreenOptions {
    /// How to show pictures; `None` to find out.
    pub(crate) protocol: Option<Protocol>,
    /// Who decides at first.
    pub(crate) policy: PolicyKind,
    /// A person acts at first.
    pub(crate) manual: bool,
    /// The policy runs as soon as it is there.
    pub(crate) runs: bool,
    /// What a person has set.
    pub(crate) config: ExplorerConfig,
    /// Where it is remembered what a terminal answered.
    pub(crate) memory: Option<PathBuf>,
    /// Where instructions are kept for later sessions.
    pub(crate) history: Option<PathBuf>,
    /// Where the session is kept as it goes on.
    pub(crate) session: Option<PathBuf>,
    /// The most that a step's picture may cost on the wire, in bytes.
    pub(crate) bandwidth: Option<u64>,
    /// Where libtorch's messages go.
    pub(crate) log: Option<std::fs::File>,
}

/// How long the meter of bytes a second counts.
const METERED: Duration = Duration::from_secs(1);

/// Shows the explorer until it ends; `list` makes the list of what there is to start with, to come back to.
///
/// # Errors
/// When there is no terminal, or the worker stopped.
pub(crate) fn run(
    screen: ScreenOptions,
    mut opening: Opening,
    list: impl Fn() -> Opening,
) -> anyhow::Result<ExitReason> {
    let memory = screen.memory.as_deref();
    let options = TerminalOptions { protocol: screen.protocol, memory, log: screen.log.as_ref() };
    let TakenTerminal { guard, mut display, graphics, ability, messages, tell } = TakenTerminal::take(&options)?;
    let control = ExplorerControl::new(tell.clone());
    let listens = control.listen();
    let exit = loop {
        let is_heard = Arc::new(AtomicBool::new(true));
        let work = |open: Open| {
            let told = Told { tell: tell.clone(), is_heard: is_heard.clone(), control: control.clone() };
            start_worker(open, screen.session.clone(), told)
        };
        let style = StartStyle { scheme: screen.config.scheme, ability };
        let Opened { commands, first, goes_on } = match open(opening, style, &mut display, &messages, work)? {
            Ok(opened) => opened,
            Err((exit, is_opening)) => {
                drop(guard);
                if is_opening {
                    let_work_end(&messages, Instant::now() + PATIENCE / 2);
                }
                return Ok(exit);
            }
        };
        control.command(commands.clone());
        let app = prepared(&screen, display.size()?, graphics.clone(), ability)?;
        if screen.runs && !screen.manual && !goes_on && app.layout().is_some() {
            commands.send(SessionCommand::Run { mode: RunMode::Policy, until: None })?;
        }
        let pictures = tell.clone();
        let encoder = PictureEncoder::start(move |picture| pictures.send(Msg::Picture(picture)).is_ok())?;
        let mut shown = ScreenLoop::on(app, display, commands, encoder, screen.history.clone());
        let exit = match shown.on_messages(first)? {
            Some(exit) => Ok(exit),
            None => run_loop(&mut shown, &messages),
        };
        display = shown.display;
        if !matches!(exit, Ok(ExitReason::ToList)) {
            break exit;
        }
        is_heard.store(false, Ordering::Relaxed);
        control.leave();
        terminal::forget_pictures(display.out())?;
        display.repaint()?;
        opening = list();
    };
    drop(guard);
    control.leave();
    drop(listens);
    if !matches!(exit, Ok(ExitReason::WorkerGone)) {
        let_work_end(&messages, Instant::now() + PATIENCE / 2);
    }
    match exit? {
        ExitReason::WorkerGone => anyhow::bail!(terminal::last_words().unwrap_or_else(|| "the worker stopped".into())),
        exit => Ok(exit),
    }
}

/// What was opened.
struct Opened {
    commands: Sender<SessionCommand>,
    /// What came from the worker already.
    first: Vec<Msg>,
    /// It goes on where it was left, and does not run by itself.
    goes_on: bool,
}

/// Opens what was named or is picked; where the person left instead, why, and whether something is still being opened.
fn open<W: Write>(
    opening: Opening,
    style: StartStyle,
    display: &mut PacedDisplay<W>,
    messages: &Receiver<Msg>,
    work: impl Fn(Open) -> io::Result<Sender<SessionCommand>>,
) -> anyhow::Result<Result<Opened, (ExitReason, bool)>> {
    match opening {
        Opening::Named(open) => Ok(Ok(Opened { commands: work(open)?, first: Vec::new(), goes_on: false })),
        Opening::Picked(entries, open) => {
            let start = |start: &Start| {
                let (open, start) = (open.clone(), start.clone());
                work(Box::new(move || open(&start)))
            };
            Ok(match pick(StartPage::new(entries), style, display, messages, start)? {
                Picked::Started { commands, first, start } => Ok(Opened { commands, first, goes_on: start.goes_on() }),
                Picked::Left { exit, is_opening } => Err((exit, is_opening)),
            })
        }
    }
}

/// The state before anything is seen, with what the person has set and typed before.
fn prepared(screen: &ScreenOptions, size: Size, graphics: Graphics, ability: Ability) -> io::Result<App> {
    let mut app = App::new(size, graphics, ability, screen.policy, screen.manual);
    app.config = screen.config.clone();
    app.traffic.limit = screen.bandwidth;
    app.terminal.mouse = app.config.mouse;
    if app.terminal.mouse {
        terminal::report_mouse(&mut io::stdout(), true)?;
    }
    if let Some(path) = &screen.history {
        let remembered = history::read(path);
        app.input.newcomer = remembered.is_first;
        remembered.instructions.iter().for_each(|instruction| app.input.editor.remember(instruction));
        keep(path, None);
    }
    Ok(app)
}

/// Where a worker tells what happens, as long as anybody wants to know.
struct Told {
    tell: SyncSender<Msg>,
    is_heard: Arc<AtomicBool>,
    /// Those who steer from elsewhere hear it, too.
    control: Arc<ExplorerControl>,
}

impl Told {
    fn tell(&self, msg: Msg) {
        if self.is_heard.load(Ordering::Relaxed) {
            // Whoever does not listen any more commands nothing any more either.
            drop(self.tell.send(msg));
        }
    }
}

/// Says that the worker and all that it set to work ended, however they did.
impl Drop for Told {
    fn drop(&mut self) {
        self.tell(Msg::WorkerGone);
    }
}

/// Starts the worker that opens an exploration, which is kept in that file as it goes on.
fn start_worker(open: Open, session: Option<PathBuf>, told: Told) -> io::Result<Sender<SessionCommand>> {
    let tell_event = move |event| {
        told.control.hear(&event);
        told.tell(Msg::Session(event));
    };
    let open = move || {
        let exploration = open()?;
        Ok(match session {
            Some(path) => exploration.kept_in(path),
            None => exploration,
        })
    };
    worker::start(open, tell_event, terminal::say_last_words)
}

/// Keeps an instruction; where that cannot be, the log says why and the session goes on.
fn keep(path: &Path, instruction: Option<&str>) {
    if let Err(error) = history::add(path, instruction) {
        tracing::info!("{}: {error}", path.display());
    }
}

/// Waits for those who still compute: libtorch must not be taken down under them, as the end of the program does.
fn let_work_end(messages: &Receiver<Msg>, until: Instant) {
    while let Ok(msg) = messages.recv_timeout(until.saturating_duration_since(Instant::now())) {
        if matches!(msg, Msg::WorkerGone) {
            return;
        }
    }
}

/// The state, the display that shows it, and the threads that work for it.
pub struct ScreenLoop<W: Write> {
    app: App,
    display: PacedDisplay<W>,
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

    fn on(
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
                Msg::Picture(picture) if self.is_urgent && self.display.affords().is_some() => {
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
                            keep(path, Some(&instruction));
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

/// Takes in messages until one of them ends it.
fn run_loop(screen: &mut ScreenLoop<impl Write>, messages: &Receiver<Msg>) -> anyhow::Result<ExitReason> {
    // Something changed that is not drawn yet.
    let mut is_stale = true;
    loop {
        screen.measure()?;
        let mut wait = None;
        if is_stale {
            wait = screen.display.show_when_ready(&screen.app)?;
            is_stale = wait.is_some() || screen.after_drawing()?;
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
        // That the terminal is ready changes nothing on the screen.
        is_stale |= all.iter().any(|msg| !matches!(msg, Msg::Ready));
        if let Some(exit) = screen.on_messages(all)? {
            return Ok(exit);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;

    use super::*;

    fn told(tell: &SyncSender<Msg>) -> Told {
        Told {
            tell: tell.clone(),
            is_heard: Arc::new(AtomicBool::new(true)),
            control: ExplorerControl::new(tell.clone()),
        }
    }

    #[test]
    fn the_end_waits_for_those_who_still_compute_and_hears_them_out() {
        let (tell, messages) = sync_channel(1);
        let computed = Arc::new(AtomicBool::new(false));
        let (done, gone) = (computed.clone(), told(&tell));
        std::thread::spawn(move || {
            let _gone = gone;
            // The queue holds one message: unheard, the worker would wait here for ever.
            for _ in 0..3 {
                tell.send(Msg::Paste(String::new())).unwrap();
            }
            done.store(true, Ordering::Relaxed);
        });
        let_work_end(&messages, Instant::now() + Duration::from_secs(60));
        assert!(computed.load(Ordering::Relaxed));
    }

    #[test]
    fn the_end_does_not_wait_for_a_worker_past_its_time() {
        let (tell, messages) = sync_channel(1);
        let still_working = told(&tell);
        drop(tell);
        let_work_end(&messages, Instant::now());
        assert!(messages.try_recv().is_err(), "the worker is still there, and has said nothing");
        drop(still_working);
        assert!(matches!(messages.try_recv(), Ok(Msg::WorkerGone)));
    }
}
