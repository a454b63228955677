//! What the explorer costs on the wire and how fast it answers. Frames: the bytes of a typical step while the expert does a
//! task, and the time to encode one. Keys: from a key to the changed screen on the wire, at 120 x 36 with half-blocks, while a
//! policy runs at full speed and frames arrive; within 5 ms at p50 and a frame of 60 a second at p99. A figure that misses its
//! target is named, and fails the bench.

mod baseline;

use std::collections::VecDeque;
use std::io::{self, BufWriter, Write};
use std::sync::Arc;
use std::sync::mpsc::sync_channel;
use std::time::{Duration, Instant};

use baseline::CriterionBaselines;
use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::backend::CrosstermBackend;
use ratatui::layout::{Rect, Size};
use ratatui::{Terminal, TerminalOptions, Viewport};
use sprint_explorer::agent::registry::{Policies, PolicyKind};
use sprint_explorer::domain::scene::Room;
use sprint_explorer::episode::scenes::Scenes;
use sprint_explorer::explore::episode_source::{EpisodeOrigin, EpisodeSource};
use sprint_explorer::explore::exploration::Exploration;
use sprint_explorer::explore::session::{RunMode, SessionCommand, StepRate};
use sprint_explorer::tui::app::{App, Graphics};
use sprint_explorer::tui::graphics::encoder::PictureEncoder;
use sprint_explorer::tui::graphics::letters::{self, Letters};
use sprint_explorer::tui::graphics::overlay::Overlay;
use sprint_explorer::tui::graphics::{Job, Picture, Protocol};
use sprint_explorer::tui::screen_loop::ScreenLoop;
use sprint_explorer::tui::terminal::{Counted, WRITTEN};
use sprint_explorer::tui::theme::Ability;
use sprint_explorer::tui::update::Msg;
use sprint_explorer::tui::worker;

const KEYS: usize = 600;
const BETWEEN: Duration = Duration::from_millis(11);
/// Key to bytes, at p50 and p99.
const LIMITS: (Duration, Duration) = (Duration::from_millis(5), Duration::from_micros(16_700));

/// Steps over which bytes and times of frames are taken.
const STEPS: usize = 60;

fn exploration() -> anyhow::Result<Exploration> {
    let source = EpisodeSource::new(EpisodeOrigin::Generated(Room::Kitchen), 1, Scenes::in_folder(None));
    Exploration::new(source, Policies::new(Vec::new()), PolicyKind::Expert, None)
}

/// What a protocol is measured at, and what a typical step may cost.
struct Target {
    protocol: Protocol,
    cells: (u16, u16),
    kilobytes: Option<f64>,
    encoding: Option<Duration>,
}

/// The typical cost of a step's picture, in bytes and encoding time, while the expert does a task. Returns what misses its target.
fn frames(baselines: &mut CriterionBaselines) -> anyhow::Result<Vec<String>> {
    let target = |protocol, cells, kilobytes, encoding| Target { protocol, cells, kilobytes, encoding };
    // Half-blocks at 40 x 20 cells; sixels at 300 x 300 pixels; kitty and iTerm2 get the frame at its own 300 x 300.
    let targets = [
        target(Protocol::HalfBlocks, (40, 20), Some(6.0), None),
        target(Protocol::Kitty, (40, 20), Some(25.0), None),
        target(Protocol::Sixel, (30, 15), Some(25.0), Some(Duration::from_millis(3))),
        target(Protocol::Iterm2, (40, 20), None, None),
        target(Protocol::Ascii, (40, 20), None, None),
    ];
    let mut missed = Vec::new();
    for Target { protocol, cells: (width, height), kilobytes: most, encoding: longest } in targets {
        let mut exploration = exploration()?;
        exploration.choose(PolicyKind::Expert)?;
        let cells = Size { width, height };
        let area = Rect::from((ratatui::layout::Position::ORIGIN, cells));
        let viewport = Viewport::Fixed(area);
        let backend = CrosstermBackend::new(Counted::new(io::sink()));
        let mut display = Terminal::with_options(backend, TerminalOptions { viewport })?;
        let (mut sizes, mut times) = (Vec::new(), Vec::new());
        for _ in 0..STEPS {
            let now = exploration.snapshot();
            let job = Job {
                frame: now.frame.clone(),
                overlay: Overlay::Colour,
                coarseness: 0,
                budget: None,
                in_blocks: false,
                in_tmux: false,
                recent: Vec::new(),
                letters: Arc::new(Letters::of(&now.scene, &now.world)),
                classes: Arc::new(letters::names(&now.scene, &now.world)),
                labels: Vec::new(),
                protocol,
                cells,
                cell_pixels: (10, 20),
            };
            let since = Instant::now();
            let picture = Picture::encode(&job);
            times.push(since.elapsed());
            let before = WRITTEN.load(std::sync::atomic::Ordering::Relaxed);
            display.draw(|frame| frame.render_widget(&picture, area))?;
            Write::flush(display.backend_mut())?;
            sizes.push(WRITTEN.load(std::sync::atomic::Ordering::Relaxed) - before);
            if exploration.end().is_some() || exploration.step().is_err() {
                exploration.next_episode()?;
            }
        }
        sizes.sort_unstable();
        times.sort_unstable();
        let middle = STEPS / 2;
        let (name, kilobytes) = (protocol.name(), |at: usize| sizes[at] as f64 / 1000.0);
        writeln!(
            io::stdout(),
            "{name} at {width} x {height} cells: median step {:.1} kB, largest {:.1} kB; encoding {:?}, longest {:?}",
            kilobytes(middle),
            kilobytes(STEPS - 1),
            times[middle],
            times[STEPS - 1]
        )?;
        baselines.compare(&format!("explorer/encoding for {name}"), times[0])?;
        if most.is_some_and(|most| kilobytes(middle) > most) {
            missed.push(format!("{name}: a typical step is {:.1} kB", kilobytes(middle)));
        }
        if longest.is_some_and(|longest| times[middle] > longest) {
            missed.push(format!("{name}: encoding takes {:?}", times[middle]));
        }
    }
    Ok(missed)
}

fn main() -> anyhow::Result<()> {
    let mut missed = frames(&mut CriterionBaselines::open()?)?;
    let (tell, messages) = sync_channel(64);
    let reports = tell.clone();
    let open = || {
        let source = EpisodeSource::new(EpisodeOrigin::Generated(Room::Kitchen), 1, Scenes::in_folder(None));
        let policies = Policies::new(Vec::new());
        Exploration::new(source, policies, PolicyKind::Random, Some("look around"))
    };
    let commands =
        worker::start(open, move |event| drop(reports.send((None, Msg::Session(event)))), |error| panic!("{error}"))?;
    let pictures = tell.clone();
    let encoder = PictureEncoder::start(move |picture| pictures.send((None, Msg::Picture(picture))).is_ok())?;
    let size = Size { width: 120, height: 36 };
    let viewport = Viewport::Fixed(Rect::from((ratatui::layout::Position::ORIGIN, size)));
    let backend = CrosstermBackend::new(BufWriter::new(Counted::new(io::sink())));
    let display = Terminal::with_options(backend, TerminalOptions { viewport })?;
    let graphics =
        Graphics { protocol: Protocol::HalfBlocks, reason: "bench".into(), cell_pixels: (8, 16), in_tmux: false };
    let app = App::new(size, graphics, Ability::FULL, PolicyKind::Random, false);
    commands.send(SessionCommand::StepRate((0..9).fold(StepRate::default(), |rate, _| rate.faster())))?;
    commands.send(SessionCommand::Run { mode: RunMode::Policy, until: None })?;
    let mut screen = ScreenLoop::new(app, display, commands, encoder, None);

    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(500));
        for i in 0..KEYS {
            // A label on, a label off: every key changes what is shown.
            let code = KeyCode::Char(if i % 2 == 0 { '?' } else { 'q' });
            let key = Msg::Key(KeyEvent::new(code, KeyModifiers::NONE));
            if tell.send((Some(Instant::now()), key)).is_err() {
                break;
            }
            std::thread::sleep(BETWEEN);
        }
    });

    let (mut waits, mut frames) = (Vec::new(), 0u64);
    while waits.len() < KEYS {
        let first = messages.recv()?;
        let mut pressed = VecDeque::new();
        let batch: Vec<Msg> = std::iter::once(first)
            .chain(messages.try_iter().take(256))
            .map(|(at, msg)| {
                pressed.extend(at);
                frames += u64::from(matches!(msg, Msg::Picture(_)));
                msg
            })
            .collect();
        screen.on_messages(batch)?;
        screen.show()?;
        waits.extend(pressed.iter().map(Instant::elapsed));
    }
    waits.sort();
    let at = |share: f64| waits[((waits.len() - 1) as f64 * share) as usize];
    let mut out = io::stdout();
    writeln!(
        out,
        "key to bytes written: p50 {:?}, p99 {:?}, max {:?} ({KEYS} keys, {frames} pictures meanwhile)",
        at(0.5),
        at(0.99),
        at(1.0)
    )?;
    let (p50, p99) = LIMITS;
    if at(0.5) > p50 || at(0.99) > p99 {
        missed.push(format!("key to bytes: p50 {:?}, p99 {:?}; targets {p50:?} and {p99:?}", at(0.5), at(0.99)));
    }
    anyhow::ensure!(missed.is_empty(), "missed: {}", missed.join("; "));
    Ok(())
}
