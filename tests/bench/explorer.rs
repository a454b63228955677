//! Key to bytes written: how long the explorer takes from a key to the changed screen on the wire, at 120 x 36 with
//! half-blocks, while a policy runs at full speed and frames arrive. Must stay within a frame of 60 a second at p99.

use std::collections::VecDeque;
use std::io::{self, BufWriter, Write};
use std::sync::mpsc::sync_channel;
use std::time::{Duration, Instant};

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::backend::CrosstermBackend;
use ratatui::layout::{Rect, Size};
use ratatui::{Terminal, TerminalOptions, Viewport};
use sprint_explorer::domain::scene::Room;
use sprint_explorer::run::scenes::Scenes;
use sprint_explorer::tui::app::{App, Graphics};
use sprint_explorer::tui::update::Msg;
use sprint_explorer::tui::engine::Engine;
use sprint_explorer::tui::graphics::Protocol;
use sprint_explorer::tui::graphics::encoder::Encoder;
use sprint_explorer::tui::openings::{Openings, Start};
use sprint_explorer::tui::policies::{Policies, PolicyKind};
use sprint_explorer::tui::screen::Conversation;
use sprint_explorer::tui::terminal::Counted;
use sprint_explorer::tui::theme::Ability;
use sprint_explorer::tui::worker::{self, Command, Going, Pace};

const KEYS: usize = 600;
const BETWEEN: Duration = Duration::from_millis(11);
const LIMIT: Duration = Duration::from_micros(16_700);

fn main() -> anyhow::Result<()> {
    let (tell, messages) = sync_channel(64);
    let reports = tell.clone();
    let open = || {
        let openings = Openings::new(Start::Generated(Room::Kitchen), 1, Scenes::in_folder(None));
        let policies = Policies::new(Vec::new());
        Engine::new(openings, policies, PolicyKind::Random, Some("look around"))
    };
    let commands = worker::start(open, move |report| reports.send((None, Msg::Report(report))).is_ok())?;
    let pictures = tell.clone();
    let encoder = Encoder::start(move |picture| pictures.send((None, Msg::Picture(picture))).is_ok())?;
    let size = Size { width: 120, height: 36 };
    let viewport = Viewport::Fixed(Rect::from((ratatui::layout::Position::ORIGIN, size)));
    let backend = CrosstermBackend::new(BufWriter::new(Counted::new(io::sink())));
    let display = Terminal::with_options(backend, TerminalOptions { viewport })?;
    let graphics = Graphics { protocol: Protocol::HalfBlocks, reason: "bench".into(), cell_pixels: (8, 16), in_tmux: false };
    let app = App::new(size, graphics, Ability::FULL, PolicyKind::Random, false);
    commands.send(Command::Pace((0..9).fold(Pace::START, |pace, _| pace.faster())))?;
    commands.send(Command::Go(Some(Going::Policy)))?;
    let mut conversation = Conversation::new(app, display, commands, encoder);

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
        conversation.hear(batch)?;
        conversation.show()?;
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
    anyhow::ensure!(at(0.99) <= LIMIT, "p99 is over {LIMIT:?}");
    Ok(())
}
