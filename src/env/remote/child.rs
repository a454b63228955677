//! An environment's child process: started, watched, and ended with everything that it started itself.

use std::collections::{BTreeSet, VecDeque};
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use rustix::process::{Pid, Signal};
use serde::Deserialize;

use crate::domain::environment_name::ServerAddress;

/// How many of a child's last lines are shown when it fails.
const LAST_LINES: usize = 5;
/// Longer lines are cut.
const LONGEST_LINE: u64 = 2000;
/// How long a child that is no longer needed may take to end by itself.
const GRACE: Duration = Duration::from_millis(500);

/// The process groups of children that live. What is left of them is ended when the program ends.
static LIVING: Mutex<BTreeSet<i32>> = Mutex::new(BTreeSet::new());

/// Ends every child that still lives.
pub(crate) fn end_all() {
    let groups = std::mem::take(&mut *LIVING.lock().unwrap_or_else(PoisonError::into_inner));
    for group in groups {
        kill_group(group);
    }
}

fn kill_group(group: i32) {
    if let Some(group) = Pid::from_raw(group) {
        // Where none of it is left there is nothing to end.
        let _ = rustix::process::kill_process_group(group, Signal::KILL);
    }
}

/// A child that serves an environment. Dropped, it is gone with everything that it started.
pub(crate) struct Child {
    process: std::process::Child,
    group: i32,
    last_lines: Arc<Mutex<VecDeque<String>>>,
}

/// What a child says of itself when it listens.
#[derive(Deserialize)]
struct Greeting {
    url: String,
    protocol: String,
    version: u32,
}

impl Child {
    /// Starts a program and waits until it says where it listens.
    ///
    /// # Errors
    /// When it cannot be started, ends, says something else, or says nothing in time; with its last words.
    pub(crate) fn start(mut command: Command, limit: Duration) -> anyhow::Result<(Child, ServerAddress)> {
        let program = command.get_program().to_string_lossy().into_owned();
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).process_group(0);
        let mut process = command.spawn().with_context(|| format!("cannot start {program}"))?;
        let group = process.id() as i32;
        LIVING.lock().unwrap_or_else(PoisonError::into_inner).insert(group);
        let last_lines = Arc::new(Mutex::new(VecDeque::new()));
        let (stdout, stderr) = (process.stdout.take(), process.stderr.take());
        let mut child = Child { process, group, last_lines: last_lines.clone() };
        if let Some(stderr) = stderr {
            let keep = move |line: String| {
                let mut lines = last_lines.lock().unwrap_or_else(PoisonError::into_inner);
                lines.push_back(line);
                while lines.len() > LAST_LINES {
                    lines.pop_front();
                }
            };
            each_line(stderr, keep)?;
        }
        let (sender, first) = mpsc::channel();
        if let Some(stdout) = stdout {
            // Only the first is waited for; what follows is read so that the child never waits.
            each_line(stdout, move |line| drop(sender.send(line)))?;
        }
        let address = child.greeting(&first, limit)?;
        Ok((child, address))
    }

    fn greeting(&mut self, first: &Receiver<String>, limit: Duration) -> anyhow::Result<ServerAddress> {
        let line = match first.recv_timeout(limit) {
            Ok(line) => line,
            Err(RecvTimeoutError::Timeout) => {
                bail!("it did not say in {} s where it listens{}", limit.as_secs_f64(), self.last_words())
            }
            Err(RecvTimeoutError::Disconnected) => bail!("{}", self.how_it_ended()),
        };
        let greeting: Greeting = serde_json::from_str(&line).map_err(|_| {
            let said: String = line.chars().take(200).collect();
            anyhow::anyhow!("it said {said:?} in place of where it listens{}", self.last_words())
        })?;
        if (greeting.protocol.as_str(), greeting.version) != ("openenv", 1) {
            let Greeting { protocol, version, .. } = greeting;
            bail!("it speaks {protocol} {version}, but this program speaks openenv 1");
        }
        greeting.url.parse().map_err(anyhow::Error::msg)
    }

    /// That it ended, how, and what it said last. A child that still runs when its connection broke is about to end.
    pub(crate) fn how_it_ended(&mut self) -> String {
        let asked = Instant::now();
        loop {
            match self.process.try_wait() {
                Ok(Some(status)) => {
                    // Its last lines may still be on their way.
                    thread::sleep(Duration::from_millis(50));
                    return format!("the child ended ({status}){}", self.last_words());
                }
                Ok(None) if asked.elapsed() < GRACE => thread::sleep(Duration::from_millis(5)),
                _ => return format!("the child still runs, but no longer answers{}", self.last_words()),
            }
        }
    }

    /// What it said last on standard error, to end a sentence with.
    pub(crate) fn last_words(&self) -> String {
        let lines = self.last_lines.lock().unwrap_or_else(PoisonError::into_inner);
        let lines: Vec<&str> = lines.iter().map(|line| line.trim()).filter(|line| !line.is_empty()).collect();
        if lines.is_empty() { String::new() } else { format!("; its last words: {}", lines.join(" | ")) }
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        drop(self.process.stdin.take());
        let asked = Instant::now();
        while matches!(self.process.try_wait(), Ok(None)) && asked.elapsed() < GRACE {
            thread::sleep(Duration::from_millis(2));
        }
        // What it started itself is in its group still.
        kill_group(self.group);
        let _ = self.process.wait();
        LIVING.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.group);
    }
}

/// Hands each line of a stream on, on a thread of its own, to the stream's end.
fn each_line(stream: impl Read + Send + 'static, mut take: impl FnMut(String) + Send + 'static) -> anyhow::Result<()> {
    let read = move || {
        let mut stream = BufReader::new(stream);
        loop {
            let mut line = Vec::new();
            match (&mut stream).take(LONGEST_LINE).read_until(b'\n', &mut line) {
                Ok(0) | Err(_) => break,
                Ok(_) => take(printable(&String::from_utf8_lossy(&line))),
            }
        }
    };
    thread::Builder::new().name("child's words".into()).spawn(read).context("a thread could not be started")?;
    Ok(())
}

/// Without what could move a cursor or change a terminal's state.
fn printable(line: &str) -> String {
    line.trim_end().chars().map(|c| if c.is_control() && c != '\t' { '\u{fffd}' } else { c }).collect()
}

/// The command that serves a Gymnasium environment.
pub(crate) fn gym(id: &str, package: Option<PathBuf>) -> Command {
    let python = std::env::var_os("SPRINT_PYTHON").filter(|python| !python.is_empty());
    let mut command = Command::new(python.unwrap_or_else(|| OsString::from("python3")));
    command.args(["-m", "sprint_env", "gym", id, "--port", "0"]);
    if let Some(folder) = package {
        let others = std::env::var_os("PYTHONPATH").filter(|path| !path.is_empty());
        let folders = std::iter::once(folder).chain(others.iter().flat_map(std::env::split_paths));
        if let Ok(path) = std::env::join_paths(folders) {
            command.env("PYTHONPATH", path);
        }
    }
    command
}

/// The folder that holds the Python package: in `assets/python` beside the program, in the repository that it was built in, or
/// here; `None` where only an installed one can be meant.
pub(crate) fn package() -> Option<PathBuf> {
    let program = std::env::current_exe().and_then(|path| path.canonicalize()).ok();
    let near = program.iter().flat_map(|path| path.ancestors().skip(1).take(3)).map(std::path::Path::to_owned);
    let here = std::env::current_dir().ok();
    let mut folders = near.chain(here).map(|folder| folder.join("assets").join("python"));
    folders.find(|folder| folder.join("sprint_env").is_dir())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start(script: &str, limit: Duration) -> anyhow::Result<(Child, ServerAddress)> {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        Child::start(command, limit)
    }

    fn error_of(script: &str) -> String {
        format!("{:#}", start(script, Duration::from_millis(500)).err().unwrap())
    }

    const GREETING: &str = r#"echo '{"url": "ws://127.0.0.1:9/ws", "protocol": "openenv", "version": 1}'"#;

    #[test]
    fn a_child_that_does_not_say_where_it_listens_is_shown_with_its_last_words() {
        let dead = error_of("echo starting >&2; echo 'No module named gym' >&2; exit 3");
        assert!(dead.contains("ended (exit status: 3)") && dead.contains("starting | No module named gym"), "{dead}");
        let rubbish = error_of("printf 'pygame 2.6\\033[2J\\n'; sleep 60");
        assert!(rubbish.contains("said \"pygame 2.6") && !rubbish.contains('\u{1b}'), "{rubbish}");
        let silent = error_of("echo loading >&2; sleep 60");
        assert!(silent.contains("did not say in 0.5 s") && silent.contains("loading"), "{silent}");
        let newer = error_of(r#"echo '{"url": "ws://127.0.0.1:9/ws", "protocol": "openenv", "version": 2}'; sleep 60"#);
        assert!(newer.contains("speaks openenv 2"), "{newer}");
        let missing = Child::start(Command::new("no-such-python"), Duration::from_secs(1)).err().unwrap();
        assert!(format!("{missing:#}").contains("cannot start no-such-python"));
    }

    #[test]
    fn a_child_is_gone_with_all_that_it_started_however_deaf() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("forked");
        // It ignores the end of its input, and so does what it forks.
        let script =
            format!("trap '' TERM HUP; sleep 600 & echo $! > {}; {GREETING}; sleep 600; sleep 600", file.display());
        let (child, address) = start(&script, Duration::from_secs(10)).unwrap();
        assert_eq!(address.port, 9);
        let forked: i32 = std::fs::read_to_string(&file).unwrap().trim().parse().unwrap();
        let group = child.group;
        drop(child);
        assert!(is_gone(forked) && is_gone(group));
    }

    #[test]
    fn a_child_that_ends_when_its_input_does_is_not_waited_for() {
        let (child, _) = start(&format!("{GREETING}; cat > /dev/null"), Duration::from_secs(10)).unwrap();
        let group = child.group;
        drop(child);
        assert!(is_gone(group));
    }

    /// Whether a process runs no longer; one that nobody has waited for yet counts as gone.
    fn is_gone(process: i32) -> bool {
        let state = || std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        let ended = || state().rsplit_once(") ").is_none_or(|(_, rest)| rest.starts_with('Z'));
        (0..400).any(|_| {
            thread::sleep(Duration::from_millis(5));
            ended()
        })
    }
}
