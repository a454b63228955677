//! The explorer's screen: a session is opened, shown until it is left, and perhaps another one after it.

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender};
use std::time::Instant;

use ratatui::layout::Size;

use super::app::{App, Graphics};
use super::config::ExplorerConfig;
use super::graphics::Protocol;
use super::graphics::encoder::PictureEncoder;
use super::history;
use super::opening::{Open, Opening, Picked, StartStyle, pick};
use super::paced_display::PacedDisplay;
use super::screen_loop::ScreenLoop;
use super::session_worker::{AtWork, Told, let_work_end, start_worker};
use super::signals::PATIENCE;
use super::start_page::StartPage;
use super::steering::{ended_by_signal, obeyed_by};
use super::taken_terminal::{TakenTerminal, TerminalOptions};
use super::terminal;
use super::theme::Ability;
use super::update::{ExitReason, Msg};
use crate::agent::registry::PolicyKind;
use crate::explore::session::{RunMode, SessionCommand};
use crate::explore::session_file::SessionFile;
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
    /// Where the last session is kept; this one is kept beside it as it goes on.
    pub(crate) session: Option<PathBuf>,
    /// The most that a step's picture may cost on the wire, in bytes.
    pub(crate) bandwidth: Option<u64>,
    /// Where libtorch's messages go.
    pub(crate) log: Option<std::fs::File>,
}

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
    let control = ended_by_signal(&tell);
    let listens = control.listen();
    let at_work = AtWork::default();
    let (exit, kept_in) = loop {
        let is_heard = Arc::new(AtomicBool::new(true));
        let kept_in = screen.session.as_deref().map(SessionFile::beside);
        let work = |open: Open| {
            let told = Told::new(tell.clone(), is_heard.clone(), control.clone(), at_work.clone());
            start_worker(open, kept_in.clone(), told)
        };
        let style = StartStyle { scheme: screen.config.scheme, ability };
        let Opened { commands, first, goes_on } = match open(opening, style, &mut display, &messages, work)? {
            Ok(opened) => opened,
            Err(exit) => {
                drop(guard);
                let_work_end(&messages, at_work, Instant::now() + PATIENCE / 2);
                return Ok(exit);
            }
        };
        control.command(obeyed_by(commands.clone()));
        let app = prepared(&screen, display.size()?, graphics.clone(), ability)?;
        if screen.runs && !screen.manual && !goes_on && app.layout().is_some() {
            commands.send(SessionCommand::Run { mode: RunMode::Policy, until: None })?;
        }
        let pictures = tell.clone();
        let encoder = PictureEncoder::start(move |picture| pictures.send(Msg::Picture(picture)).is_ok())?;
        let mut shown = ScreenLoop::on(app, display, commands, encoder, screen.history.clone());
        let exit = match shown.on_messages(first)? {
            Some(exit) => Ok(exit),
            None => shown.run(&messages),
        };
        display = shown.display;
        if !matches!(exit, Ok(ExitReason::ToList)) {
            break (exit, kept_in);
        }
        if let Some(file) = kept_in {
            file.end();
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
    let_work_end(&messages, at_work, Instant::now() + PATIENCE / 2);
    if let (Ok(ExitReason::Asked), Some(file)) = (&exit, kept_in) {
        file.end();
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

/// Opens what was named or is picked; where the person left instead, why.
fn open<W: Write>(
    opening: Opening,
    style: StartStyle,
    display: &mut PacedDisplay<W>,
    messages: &Receiver<Msg>,
    work: impl Fn(Open) -> io::Result<Sender<SessionCommand>>,
) -> anyhow::Result<Result<Opened, ExitReason>> {
    match opening {
        Opening::Named(open) => Ok(Ok(Opened { commands: work(open)?, first: Vec::new(), goes_on: false })),
        Opening::Picked(entries, open) => {
            let start = |start: &Start| {
                let (open, start) = (open.clone(), start.clone());
                work(Box::new(move || open(&start)))
            };
            Ok(match pick(StartPage::new(entries), style, display, messages, start)? {
                Picked::Started { commands, first, start } => Ok(Opened { commands, first, goes_on: start.goes_on() }),
                Picked::Left(exit) => Err(exit),
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
        history::keep(path, None);
    }
    Ok(app)
}
