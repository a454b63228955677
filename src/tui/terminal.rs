//! The terminal while the explorer owns it: raw, on the alternate screen, with libtorch's messages sent to the log. Given back
//! on every way out.

use std::fs::File;
use std::io::{self, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use crossterm::event::{DisableBracketedPaste, EnableBracketedPaste};
use crossterm::terminal::{
    EndSynchronizedUpdate, EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use crossterm::{cursor, execute};

/// Whether the terminal is ours; whoever gives it back first does so for all.
static OWNED: AtomicBool = AtomicBool::new(false);
/// What makes the terminal forget the pictures that it holds.
static FORGET: Mutex<Option<String>> = Mutex::new(None);
/// The terminal sends what the mouse does.
static MOUSE: AtomicBool = AtomicBool::new(false);
/// Where error messages went before.
static STDERR: Mutex<Option<OwnedFd>> = Mutex::new(None);
/// The last words of a thread that is not the screen's.
static LAST_WORDS: Mutex<Option<String>> = Mutex::new(None);
/// Where error messages go meanwhile.
static LOG: Mutex<Option<OwnedFd>> = Mutex::new(None);

/// Owns the terminal until it is dropped.
pub(crate) struct Guard(());

impl Guard {
    /// Takes the terminal; error messages go to `log`, if there is one.
    ///
    /// # Errors
    /// When standard output is no terminal.
    pub(crate) fn take(log: Option<&File>) -> io::Result<Guard> {
        if let Some(log) = log {
            *LOG.lock().unwrap_or_else(PoisonError::into_inner) = Some(log.as_fd().try_clone_to_owned()?);
        }
        let guard = Guard(());
        seize()?;
        Ok(guard)
    }
}

/// Makes the terminal ours.
fn seize() -> io::Result<()> {
    enable_raw_mode()?;
    OWNED.store(true, Ordering::SeqCst);
    if let Some(log) = &*LOG.lock().unwrap_or_else(PoisonError::into_inner) {
        let saved = io::stderr().as_fd().try_clone_to_owned()?;
        *STDERR.lock().unwrap_or_else(PoisonError::into_inner) = Some(saved);
        rustix::stdio::dup2_stderr(log)?;
    }
    execute!(io::stdout(), EnterAlternateScreen, cursor::Hide, EnableBracketedPaste)
}

/// Gives the terminal back and stops the program, as Ctrl-Z asks; it returns when the program goes on.
///
/// # Errors
/// When it cannot be stopped.
pub(crate) fn stop() -> io::Result<()> {
    give_back();
    rustix::process::kill_current_process_group(rustix::process::Signal::STOP)?;
    Ok(())
}

/// Takes the terminal again after somebody else had it, whether it was given back before or not.
///
/// # Errors
/// When it is gone.
pub(crate) fn take_again() -> io::Result<()> {
    give_back();
    seize()?;
    if MOUSE.load(Ordering::SeqCst) {
        report_mouse(&mut io::stdout(), true)?;
        io::stdout().flush()?;
    }
    Ok(())
}

impl Drop for Guard {
    fn drop(&mut self) {
        give_back();
    }
}

/// Asks for buttons and the wheel, in SGR form; not for every motion, which would cost a slow link.
const REPORT_MOUSE: &[u8] = b"\x1b[?1000h\x1b[?1006h";
const LEAVE_MOUSE: &[u8] = b"\x1b[?1006l\x1b[?1000l";

/// Asks the terminal to send what the mouse does, or no longer.
///
/// # Errors
/// When the terminal cannot be written.
pub(crate) fn report_mouse(out: &mut impl Write, on: bool) -> io::Result<()> {
    MOUSE.store(on, Ordering::SeqCst);
    out.write_all(if on { REPORT_MOUSE } else { LEAVE_MOUSE })
}

/// Notes that the terminal holds pictures, and the sequence by which it should forget them in the end.
pub(crate) fn holds_pictures(forget: String) {
    *FORGET.lock().unwrap_or_else(PoisonError::into_inner) = Some(forget);
}

/// Lets the terminal forget the pictures that it holds, while it stays ours.
///
/// # Errors
/// When the terminal cannot be written.
pub(crate) fn forget_pictures(out: &mut impl Write) -> io::Result<()> {
    let forget = FORGET.lock().unwrap_or_else(PoisonError::into_inner).take();
    out.write_all(forget.unwrap_or_default().as_bytes())
}

/// Gives the terminal back, once. Errors are passed over: a terminal that is gone needs nothing.
pub(crate) fn give_back() {
    if !OWNED.swap(false, Ordering::SeqCst) {
        return;
    }
    let mut out = io::stdout();
    let forget = FORGET.lock().unwrap_or_else(PoisonError::into_inner).take();
    let _ = farewell(&mut out, forget.as_deref().unwrap_or(""), MOUSE.load(Ordering::SeqCst));
    let _ = disable_raw_mode();
    if let Some(saved) = STDERR.lock().unwrap_or_else(PoisonError::into_inner).take() {
        let _ = rustix::stdio::dup2_stderr(saved);
    }
}

fn farewell(out: &mut impl Write, forget: &str, mouse: bool) -> io::Result<()> {
    out.write_all(forget.as_bytes())?;
    if mouse {
        out.write_all(LEAVE_MOUSE)?;
    }
    execute!(out, EndSynchronizedUpdate, DisableBracketedPaste, LeaveAlternateScreen, cursor::Show)
}

/// From now on a panic gives the terminal back before it is reported. One on another thread than the screen's is kept as that
/// thread's last words; the screen then ends by itself.
pub(crate) fn catch_panics() {
    let screen = std::thread::current().id();
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if std::thread::current().id() == screen || !OWNED.load(Ordering::SeqCst) {
            give_back();
            report(panic);
        } else {
            tracing::error!("{panic}");
            say_last_words(panic.to_string());
        }
    }));
}

/// Keeps why a thread ends.
pub(crate) fn say_last_words(words: String) {
    *LAST_WORDS.lock().unwrap_or_else(PoisonError::into_inner) = Some(words);
}

/// Why a thread ended: its error, or its panic.
pub(crate) fn last_words() -> Option<String> {
    LAST_WORDS.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// Counts what is written through it.
pub struct Counted<W> {
    inner: W,
    bytes: &'static AtomicU64,
}

/// Bytes written to the terminal so far.
pub static WRITTEN: AtomicU64 = AtomicU64::new(0);

impl<W> Counted<W> {
    /// Counts into [`WRITTEN`].
    pub fn new(inner: W) -> Counted<W> {
        Counted { inner, bytes: &WRITTEN }
    }
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(data)?;
        self.bytes.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::graphics::inline;

    #[test]
    fn the_farewell_leaves_the_alternate_screen_shows_the_cursor_and_forgets_pictures() {
        let mut out = Vec::new();
        farewell(&mut out, &inline::kitty_forget(false), true).unwrap();
        let text = String::from_utf8(out).unwrap();
        let order = ["\x1b_Ga=d", "\x1b[?1000l", "\x1b[?2026l", "\x1b[?2004l", "\x1b[?1049l", "\x1b[?25h"];
        let places: Vec<_> =
            order.iter().map(|part| text.find(part).unwrap_or_else(|| panic!("no {part:?}"))).collect();
        assert!(places.is_sorted(), "{text:?}");
    }

    #[test]
    fn a_panic_gives_the_terminal_back_before_it_is_reported() {
        // The hook is the process's: this thread plays the screen's, and the terminal is not really taken.
        let seen = std::thread::spawn(|| {
            static ORDER: Mutex<Vec<bool>> = Mutex::new(Vec::new());
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(|_| ORDER.lock().unwrap().push(OWNED.load(Ordering::SeqCst))));
            catch_panics();
            OWNED.store(true, Ordering::SeqCst);
            let _ = std::panic::catch_unwind(|| panic!("on purpose"));
            std::panic::set_hook(before);
            ORDER.lock().unwrap().clone()
        });
        assert_eq!(seen.join().unwrap(), [false]);
    }
}
