//! The loop of the explorer's screen: messages in, one `update`, effects out, one drawing for all that came.

use std::io::{self, BufWriter, Stdout};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use anyhow::Context;
use crossterm::event::Event;
use crossterm::queue;
use crossterm::terminal::{BeginSynchronizedUpdate, EndSynchronizedUpdate};
use ratatui::Terminal;
use ratatui::backend::{Backend, CrosstermBackend};
use ratatui::layout::Size;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use super::app::{App, Effect, Farewell, Graphics, Msg, update};
use super::engine::Engine;
use super::graphics::encoder::Encoder;
use super::graphics::{Protocol, detect};
use super::policies::PolicyKind;
use super::terminal::{self, Counted};
use super::theme::Ability;
use super::worker::{self, Command};

/// What the screen is started with.
pub struct Screen {
    /// How to show pictures; `None` to find out.
    pub protocol: Option<Protocol>,
    /// Who decides at first.
    pub policy: PolicyKind,
    /// A person acts at first.
    pub manual: bool,
    /// Where libtorch's messages go.
    pub log: Option<std::fs::File>,
}

/// Messages that may wait for the screen; beyond that their senders wait.
const QUEUE: usize = 64;
/// How long a screen that does not react to a signal is waited for.
const PATIENCE: Duration = Duration::from_secs(2);

/// Shows the explorer until it ends.
///
/// # Errors
/// When there is no terminal, or the worker stopped.
pub fn run(screen: Screen, open: impl FnOnce() -> anyhow::Result<Engine> + Send + 'static) -> anyhow::Result<Farewell> {
    // The screen strips colours itself where there are none: kitty's placeholders carry a number in theirs.
    crossterm::style::force_color_output(true);
    let ability = ability();
    terminal::catch_panics();
    let (tell, messages) = sync_channel(QUEUE);
    watch_signals(tell.clone())?;
    let guard = terminal::Guard::take(screen.log.as_ref()).context("the explorer needs a terminal; --plain does not")?;
    let graphics = graphics(screen.protocol);
    let mut display = Terminal::new(CrosstermBackend::new(BufWriter::with_capacity(1 << 16, Counted::new(io::stdout()))))?;
    let app = App::new(display.size()?, graphics, ability, screen.policy, screen.manual);

    let reports = tell.clone();
    let open = move || {
        let engine = open();
        if engine.is_err() {
            // The reason is shown for as long as the screen is; the worker then ends.
            std::thread::sleep(Duration::from_millis(50));
        }
        engine
    };
    let gone = Gone(tell.clone());
    let commands = worker::start(open, move |report| {
        let _ = &gone;
        reports.send(Msg::Report(report)).is_ok()
    })?;
    let pictures = tell.clone();
    let encoder = Encoder::start(move |picture| pictures.send(Msg::Picture(picture)).is_ok())?;
    read_keys(tell)?;
    let farewell = converse(&mut display, app, &messages, &commands, &encoder)?;
    drop(guard);
    Ok(farewell)
}

/// Says that the worker ended, however it did.
struct Gone(SyncSender<Msg>);

impl Drop for Gone {
    fn drop(&mut self) {
        let _ = self.0.send(Msg::WorkerGone);
    }
}

/// Takes in messages until one of them ends it.
fn converse(
    display: &mut Terminal<CrosstermBackend<BufWriter<Counted<Stdout>>>>,
    mut app: App,
    messages: &Receiver<Msg>,
    commands: &Sender<Command>,
    encoder: &Encoder,
) -> anyhow::Result<Farewell> {
    let mut step = 0;
    let mut before = 0;
    loop {
        queue!(display.backend_mut(), BeginSynchronizedUpdate)?;
        draw(display, &app)?;
        queue!(display.backend_mut(), EndSynchronizedUpdate)?;
        io::Write::flush(display.backend_mut())?;

        let first = messages.recv().context("all threads are gone")?;
        let mut encode = false;
        for msg in std::iter::once(first).chain(messages.try_iter().take(4 * QUEUE)) {
            for effect in update(&mut app, msg) {
                match effect {
                    Effect::Send(command) => drop(commands.send(command)),
                    Effect::Encode => encode = true,
                    Effect::Repaint => display.clear()?,
                    Effect::Quit(farewell) => return Ok(farewell),
                }
            }
        }
        if encode && let Some(job) = app.job() {
            if job.protocol == Protocol::Kitty {
                terminal::holds_pictures();
            }
            encoder.submit(job);
        }
        let now = app.now.as_ref().map_or(0, |now| now.step);
        if now > step {
            let written = terminal::WRITTEN.load(Ordering::Relaxed);
            app.bytes = Some((written - before) / u64::from(now - step));
            before = written;
        }
        step = now;
    }
}

/// Draws the state.
///
/// # Errors
/// When the terminal cannot be written.
pub fn draw<B: Backend>(display: &mut Terminal<B>, app: &App) -> Result<(), B::Error> {
    display.draw(|frame| frame.render_widget(app, frame.area())).map(drop)
}

/// What the terminal can show, from the environment.
fn ability() -> Ability {
    let colours = termprofile::TermProfile::detect(&io::stdout(), termprofile::DetectorSettings::new());
    let variable = |name: &str| std::env::var(name).ok();
    Ability { colours, unicode: detect::shows_unicode(variable) }
}

/// How to show pictures: as asked, or as the environment and the terminal's own answer suggest.
fn graphics(asked: Option<Protocol>) -> Graphics {
    let cell_pixels = match crossterm::terminal::window_size() {
        Ok(window) if window.width > 0 && window.height > 0 => {
            ((window.width / window.columns.max(1)).max(1), (window.height / window.rows.max(1)).max(1))
        }
        _ => (10, 20),
    };
    let (protocol, reason) = match asked {
        Some(protocol) => (protocol, "asked for".to_string()),
        None => {
            let (protocol, reason) = detect::guess(|name| std::env::var(name).ok());
            let patience = if std::env::var_os("SSH_CONNECTION").is_some() { 700 } else { 250 };
            match reason == detect::UNKNOWN && detect::has_sixel(Duration::from_millis(patience)).unwrap_or(false) {
                true => (Protocol::Sixel, "the terminal says that it has sixels".into()),
                false => (protocol, reason),
            }
        }
    };
    Graphics { protocol, reason, cell_pixels }
}

fn read_keys(tell: SyncSender<Msg>) -> io::Result<()> {
    let read = move || {
        while let Ok(event) = crossterm::event::read() {
            let msg = match event {
                Event::Key(key) => Msg::Key(key),
                Event::Paste(text) => Msg::Paste(text),
                Event::Resize(width, height) => Msg::Resize(Size { width, height }),
                _ => continue,
            };
            if tell.send(msg).is_err() {
                break;
            }
        }
    };
    std::thread::Builder::new().name("keys".into()).spawn(read).map(drop)
}

/// A signal asks the screen to end; when it does not in time, the terminal is given back here and the program ends.
fn watch_signals(tell: SyncSender<Msg>) -> io::Result<()> {
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    let watch = move || {
        if let Some(number) = signals.forever().next() {
            let asked = Instant::now();
            while tell.try_send(Msg::Signal(number)).is_err() && asked.elapsed() < PATIENCE {
                std::thread::sleep(Duration::from_millis(10));
            }
            std::thread::sleep(PATIENCE.saturating_sub(asked.elapsed()));
            terminal::give_back();
            std::process::exit(128 + number);
        }
    };
    std::thread::Builder::new().name("signals".into()).spawn(watch).map(drop)
}
