//! Standard output and standard error, whose readers may leave (`| head`) without anything being lost by it. What is printed may
//! come from somebody's file: nothing of it steers the terminal.

use std::io::{Error, ErrorKind, Result, StdoutLock, Write, stderr, stdout};

use crate::language::instruction::is_control;

/// Standard output. Once its reader has left, the rest is written for nobody, and the command goes on to its verdict.
pub(crate) type Out = Printable<UntilLeft>;

/// Standard output, for one command.
pub(crate) fn out() -> Out {
    Printable::new(UntilLeft(StandardOutput::lock()))
}

/// Says a line on standard error, if anybody listens.
pub(crate) fn say(line: &str) {
    let _ = writeln!(stderr(), "{}", printable(line));
}

/// Standard output, whose errors say that they are of it.
pub(crate) struct StandardOutput(StdoutLock<'static>);

impl StandardOutput {
    /// For one command.
    pub(crate) fn lock() -> StandardOutput {
        StandardOutput(stdout().lock())
    }
}

fn named(error: Error) -> Error {
    Error::new(error.kind(), format!("cannot write to standard output: {error}"))
}

impl Write for StandardOutput {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        self.0.write(bytes).map_err(named)
    }

    fn flush(&mut self) -> Result<()> {
        self.0.flush().map_err(named)
    }
}

/// Standard output that does not mind when nobody reads it any more.
pub(crate) struct UntilLeft(StandardOutput);

fn unless_left<T>(done: Result<T>, otherwise: T) -> Result<T> {
    match done {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(otherwise),
        done => done,
    }
}

impl Write for UntilLeft {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        unless_left(self.0.write(bytes), bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        unless_left(self.0.flush(), ())
    }
}

/// A text in which what would steer a terminal, turn text round or show nothing is spelt out as in JSON, which stays JSON by it.
fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' | '\t' => shown.push(c),
            c if is_control(c) => shown.push_str(&format!("\\u{:04x}", u32::from(c))),
            c => shown.push(c),
        }
    }
    shown
}

/// Writes text so that it is [`printable`].
pub(crate) struct Printable<W: Write> {
    inner: W,
    /// The beginning of a character whose rest is still to come.
    begun: Vec<u8>,
}

impl<W: Write> Printable<W> {
    pub(crate) fn new(inner: W) -> Printable<W> {
        Printable { inner, begun: Vec::new() }
    }
}

impl<W: Write> Write for Printable<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        let mut all = std::mem::take(&mut self.begun);
        all.extend_from_slice(bytes);
        let whole = match std::str::from_utf8(&all) {
            Err(error) if error.error_len().is_none() => error.valid_up_to(),
            _ => all.len(),
        };
        self.begun = all.split_off(whole);
        self.inner.write_all(printable(&String::from_utf8_lossy(&all)).as_bytes())?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_is_printed_steers_the_terminal_and_json_stays_the_same_json() {
        let name = "\u{1b}]0;x\u{7}set\u{9b}31m\u{202e}\u{7f}\r a\u{308}\n";
        let mut out = Printable::new(Vec::new());
        write!(out, "{name}").unwrap();
        let shown = String::from_utf8(out.inner).unwrap();
        assert_eq!(shown, "\\u001b]0;x\\u0007set\\u009b31m\\u202e\\u007f\\u000d a\u{308}\n");
        let mut out = Printable::new(Vec::new());
        serde_json::to_writer(&mut out, name).unwrap();
        let shown = String::from_utf8(out.inner).unwrap();
        assert!(!shown.chars().any(is_control), "{shown:?}");
        assert_eq!(serde_json::from_str::<String>(&shown).unwrap(), name);
    }

    #[test]
    fn a_character_that_is_written_in_parts_is_shown_whole() {
        let mut out = Printable::new(Vec::new());
        for byte in "straße \u{9b}1m → mug\n".bytes() {
            out.write_all(&[byte]).unwrap();
        }
        assert_eq!(String::from_utf8(out.inner).unwrap(), "straße \\u009b1m → mug\n");
    }
}
