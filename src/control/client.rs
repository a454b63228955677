//! Those who ask: what runs here, and how it is told something.

use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, bail};

use super::message::{Answer, Order, Question, Status};
use super::runtime_folder;

/// Something that runs and listens.
pub(crate) struct Running {
    path: PathBuf,
    pub(crate) status: Status,
}

/// How long an answer is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// Everything of this user's that runs and listens.
///
/// # Errors
/// When the folder of the sockets is another's.
pub(crate) fn running() -> anyhow::Result<Vec<Running>> {
    running_in(&runtime_folder::path())
}

pub(super) fn running_in(folder: &Path) -> anyhow::Result<Vec<Running>> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    runtime_folder::check(folder)?;
    clear_away_stale(folder);
    let mut found = Vec::new();
    for path in runtime_folder::sockets(folder)? {
        // One that ends just now is not listed.
        if let Ok(Answer::Status(status)) = ask(&path, &Question::Status) {
            found.push(Running { path, status });
        }
    }
    Ok(found)
}

/// Removes the sockets that nobody listens on any more.
pub(super) fn clear_away_stale(folder: &Path) {
    for path in runtime_folder::sockets(folder).unwrap_or_default() {
        if UnixStream::connect(&path).is_err_and(|error| error.kind() == ErrorKind::ConnectionRefused) {
            let _ = std::fs::remove_file(path);
        }
    }
}

impl Running {
    /// Has something done; what was done, in words.
    ///
    /// # Errors
    /// When it was not done; says why.
    pub(crate) fn order(&self, order: Order) -> anyhow::Result<String> {
        match ask(&self.path, &Question::Do { order })? {
            Answer::Done(what) => Ok(what),
            Answer::Refused(why) => bail!("{why}"),
            other => bail!("it answered {other:?}"),
        }
    }

    /// What happens there, a line an event, until it ends.
    ///
    /// # Errors
    /// When it cannot be asked.
    pub(crate) fn tail(&self) -> anyhow::Result<impl Iterator<Item = anyhow::Result<String>> + use<>> {
        let stream = put(&self.path, &Question::Tail)?;
        stream.set_read_timeout(None)?;
        let lines = BufReader::new(stream).lines();
        Ok(lines.map(|line| match serde_json::from_str(&line?)? {
            Answer::Line(line) => Ok(line),
            Answer::Refused(why) => bail!("{why}"),
            other => bail!("it answered {other:?}"),
        }))
    }
}

fn ask(path: &Path, question: &Question) -> anyhow::Result<Answer> {
    let mut line = String::new();
    BufReader::new(put(path, question)?).read_line(&mut line)?;
    Ok(serde_json::from_str(&line)?)
}

fn put(path: &Path, question: &Question) -> anyhow::Result<UnixStream> {
    let mut stream = UnixStream::connect(path).with_context(|| format!("nothing listens at {}", path.display()))?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut line = serde_json::to_vec(question)?;
    line.push(b'\n');
    stream.write_all(&line)?;
    Ok(stream)
}
