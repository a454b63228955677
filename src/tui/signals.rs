//! Signals: those that end the program, that stop it and let it go on, and that say that the terminal has another size.

use std::io;
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use ratatui::layout::Size;
use signal_hook::consts::{SIGABRT, SIGCONT, SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP, SIGWINCH};

use super::terminal;
use super::update::Msg;

/// How long a screen that does not react to a signal is waited for.
pub(crate) const PATIENCE: Duration = Duration::from_secs(2);

/// Tells of signals. One that ends the program asks the screen to end; when it does not in time, the terminal is given back here
/// and the program ends.
pub(crate) fn watch(tell: SyncSender<Msg>) -> io::Result<()> {
    let asked = [SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGABRT, SIGTSTP, SIGCONT, SIGWINCH];
    let mut signals = signal_hook::iterator::Signals::new(asked)?;
    let insist = move |msg: &Msg| {
        let asked = Instant::now();
        while tell.try_send(msg.clone()).is_err() && asked.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(10));
        }
        PATIENCE.saturating_sub(asked.elapsed())
    };
    let watch = move || {
        for number in signals.forever() {
            match number {
                SIGTSTP => drop(insist(&Msg::StopAsked)),
                SIGCONT => drop(insist(&Msg::Continued)),
                SIGWINCH => {
                    if let Ok((width, height)) = crossterm::terminal::size() {
                        insist(&Msg::Resize(Size { width, height }));
                    }
                }
                number => {
                    let left = insist(&Msg::Signal(number));
                    std::thread::sleep(left);
                    terminal::give_back();
                    crate::env::remote::end_children();
                    std::process::exit(128 + number);
                }
            }
        }
    };
    std::thread::Builder::new().name("signals".into()).spawn(watch).map(drop)
}
