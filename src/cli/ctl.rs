//! `sprint ctl`: watches and steers what runs here, from another terminal.

use std::io::Write;

use anyhow::{Context, bail};
use clap::{Args, Subcommand};

use super::exit_status::ExitStatus;
use super::streams;
use crate::control::client::{self, Running};
use crate::control::{Order, Status};

/// Watches and steers explorers, evaluations and trainings of this user on this machine.
#[derive(Args)]
pub(crate) struct Ctl {
    #[command(subcommand)]
    command: Command,
    /// Print JSON: an object a line
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Subcommand)]
enum Command {
    /// Everything that runs, a line each
    List,
    /// How far one is
    Status(Which),
    /// Go no further, after the step under way
    Pause(Which),
    /// Go on
    Resume(Which),
    /// Save, and end; the same command goes on from there
    Stop(Which),
    /// Tell an explorer's agent something else
    Instruct {
        /// What to tell it
        text: String,
        #[command(flatten)]
        which: Which,
    },
    /// Print what happens, a line an event, until it ends
    Tail(Which),
}

/// Which of those that run.
#[derive(Args)]
struct Which {
    /// Its process number, its kind (explore, eval, pretrain), or the folder that it writes [default: the only one]
    #[arg(long = "of", value_name = "PID|KIND|FOLDER")]
    of: Option<String>,
}

impl Ctl {
    /// Asks, and prints what was answered.
    ///
    /// # Errors
    /// When nothing such runs, or it refuses.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let running = client::running()?;
        let (which, order) = match self.command {
            Command::List => return list(&running, self.json),
            Command::Status(which) => {
                print_status(&pick(&running, which.of.as_deref())?.status, self.json)?;
                return Ok(ExitStatus::Ok);
            }
            Command::Tail(which) => return tail(pick(&running, which.of.as_deref())?, self.json),
            Command::Pause(which) => (which, Order::Pause),
            Command::Resume(which) => (which, Order::Resume),
            Command::Stop(which) => (which, Order::Stop),
            Command::Instruct { text, which } => (which, Order::Instruct(text)),
        };
        let one = pick(&running, which.of.as_deref())?;
        let done = one.order(order)?;
        let mut out = streams::out();
        match self.json {
            true => writeln!(out, "{}", serde_json::json!({"pid": one.status.pid, "done": done}))?,
            false => writeln!(out, "{} {}: {done}", one.status.kind.name(), one.status.pid)?,
        }
        out.flush()?;
        Ok(ExitStatus::Ok)
    }
}

/// The one that is meant.
fn pick<'a>(running: &'a [Running], named: Option<&str>) -> anyhow::Result<&'a Running> {
    let is_meant = |status: &Status| {
        named.is_none_or(|name| {
            let folder = |text: &str| text.trim_end_matches('/').to_owned();
            status.pid.to_string() == name || status.kind.name() == name || folder(&status.what) == folder(name)
        })
    };
    let mut meant = running.iter().filter(|one| is_meant(&one.status));
    let first = meant.next().with_context(|| match named {
        Some(name) => format!("nothing that runs here is called {name:?}: `sprint ctl list` says what does"),
        None => "nothing runs here".into(),
    })?;
    if meant.next().is_some() {
        bail!("several run here: say which with --of and a number of `sprint ctl list`");
    }
    Ok(first)
}

fn list(running: &[Running], json: bool) -> anyhow::Result<ExitStatus> {
    running.iter().try_for_each(|one| print_status(&one.status, json))?;
    if running.is_empty() && !json {
        streams::say("nothing runs here");
    }
    Ok(ExitStatus::Ok)
}

fn print_status(status: &Status, json: bool) -> anyhow::Result<()> {
    let mut out = streams::out();
    match json {
        true => writeln!(out, "{}", serde_json::to_string(status)?)?,
        false => writeln!(out, "{}", in_words(status))?,
    }
    Ok(out.flush()?)
}

fn in_words(status: &Status) -> String {
    let progress = &status.progress;
    let of = progress.of.map_or(String::new(), |of| format!("/{of}"));
    let told = status.instruction.as_ref().map_or(String::new(), |told| format!("  instruction {told:?}"));
    let Status { pid, kind, what, state, .. } = status;
    let line = format!(
        "{} {pid}  {what}  {}  {} {}{of}  {}{told}",
        kind.name(),
        state.name(),
        progress.stage,
        progress.done,
        progress.message
    );
    line.trim_end().to_owned()
}

fn tail(one: &Running, json: bool) -> anyhow::Result<ExitStatus> {
    let mut out = streams::out();
    for line in one.tail()? {
        let line = line?;
        // What a run says is JSON already; an explorer's lines are words.
        match json && !line.starts_with('{') {
            true => writeln!(out, "{}", serde_json::json!({"event": "step", "text": line}))?,
            false => writeln!(out, "{line}")?,
        }
        out.flush()?;
    }
    Ok(ExitStatus::Ok)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{Kind, Progress, State};

    #[test]
    fn a_status_is_one_line() {
        let progress = Progress { stage: "episodes".into(), done: 3, of: Some(9), message: "2 succeeded".into() };
        let status = Status {
            pid: 7,
            kind: Kind::Eval,
            what: "runs/a".into(),
            state: State::Paused,
            progress,
            instruction: None,
        };
        assert_eq!(in_words(&status), "eval 7  runs/a  paused  episodes 3/9  2 succeeded");
    }
}
