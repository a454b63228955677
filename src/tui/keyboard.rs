//! The thread that reads the terminal.

use std::io;
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::terminal_input::{InputParser, TerminalInput};
use super::update::Msg;

/// After so long without more an escape byte is the key.
const ALONE: Duration = Duration::from_millis(50);

/// What the terminal sends, read from standard input.
#[derive(Default)]
pub(crate) struct Keyboard {
    parser: InputParser,
    /// What came while an answer was waited for.
    early: Vec<TerminalInput>,
}

impl Keyboard {
    /// Waits for the terminal's answer to what it is, until `patience` is over. What else comes is kept for later.
    ///
    /// # Errors
    /// When the terminal cannot be read.
    pub(crate) fn attributes(&mut self, patience: Duration) -> io::Result<Option<Vec<u32>>> {
        let deadline = Instant::now() + patience;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            let Some(found) = self.read(Some(left))? else { return Ok(None) };
            let mut attributes = None;
            for input in found {
                match input {
                    TerminalInput::Attributes(numbers) => attributes = Some(numbers),
                    other => self.early.push(other),
                }
            }
            if attributes.is_some() {
                return Ok(attributes);
            }
        }
    }

    /// Tells all that comes from now on, from a thread of its own.
    ///
    /// # Errors
    /// When the system has no thread left.
    pub(crate) fn listen(mut self, tell: SyncSender<Msg>) -> io::Result<()> {
        let listen = move || {
            let mut found = std::mem::take(&mut self.early);
            loop {
                for msg in found.into_iter().filter_map(message) {
                    if tell.send(msg).is_err() {
                        return;
                    }
                }
                match self.read(self.parser.is_in_doubt().then_some(ALONE)) {
                    Ok(Some(more)) => found = more,
                    // The terminal is gone; a signal says so too.
                    Ok(None) | Err(_) => return,
                }
            }
        };
        std::thread::Builder::new().name("keys".into()).spawn(listen).map(drop)
    }

    /// What came, within a time if one is given; `None` at the end of all.
    fn read(&mut self, within: Option<Duration>) -> io::Result<Option<Vec<TerminalInput>>> {
        let stdin = io::stdin();
        let within =
            within.map(|time| Timespec { tv_sec: time.as_secs() as i64, tv_nsec: i64::from(time.subsec_nanos()) });
        let mut waiting = [PollFd::new(&stdin, PollFlags::IN)];
        let mut bytes = [0; 4096];
        let count = match poll(&mut waiting, within.as_ref()) {
            Ok(0) => return Ok(Some(self.parser.settle())),
            Ok(_) => rustix::io::read(&stdin, &mut bytes),
            Err(error) => Err(error),
        };
        match count {
            Ok(0) => Ok(None),
            Ok(count) => Ok(Some(self.parser.take(&bytes[..count]))),
            Err(rustix::io::Errno::INTR | rustix::io::Errno::AGAIN) => Ok(Some(Vec::new())),
            Err(error) => Err(error.into()),
        }
    }
}

fn message(input: TerminalInput) -> Option<Msg> {
    match input {
        TerminalInput::Key(key) => Some(Msg::Key(key)),
        TerminalInput::Mouse(event) => Some(Msg::Mouse(event)),
        TerminalInput::Paste(text) => Some(Msg::Paste(text)),
        TerminalInput::Ready => Some(Msg::Ready),
        TerminalInput::Attributes(_) => None,
    }
}
