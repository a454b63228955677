//! Standard output and standard error, whose readers may leave (`| head`) without anything being lost by it.

use std::io::{ErrorKind, Result, StdoutLock, Write, stderr, stdout};

/// Standard output. Once its reader has left, the rest is written for nobody, and the command goes on to its verdict.
pub(crate) struct Out(StdoutLock<'static>);

/// Standard output, for one command.
pub(crate) fn out() -> Out {
    Out(stdout().lock())
}

fn unless_left<T>(done: Result<T>, otherwise: T) -> Result<T> {
    match done {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(otherwise),
        done => done,
    }
}

impl Write for Out {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        unless_left(self.0.write(bytes), bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        unless_left(self.0.flush(), ())
    }
}

/// Says a line on standard error, if anybody listens.
pub(crate) fn say(line: &str) {
    let _ = writeln!(stderr(), "{line}");
}
