//! `sprint serve`: offers House to programs in other languages.

use std::io::{IsTerminal, Read, Write, stdin};
use std::num::NonZeroU64;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use serde_json::json;

use super::exit_status::ExitStatus;
use super::streams::say;
use super::{stop, streams, value_names};
use crate::data::taskset;
use crate::domain::Room;
use crate::episode::scenes::Scenes;
use crate::house::grading::Grading;
use crate::serve::episodes::{EpisodeOrigin, Episodes};
use crate::serve::server::Server;

/// Serves House. Prints where as one JSON object, then serves until its standard input closes.
#[derive(Args)]
pub(crate) struct Serve {
    /// Serve the tasks of this file: the seed of a reset counts through them, or `episode` names one
    #[arg(long, value_name = "FILE", conflicts_with_all = ["rooms", "length", "houses"])]
    tasks: Option<PathBuf>,
    /// The kinds of rooms of generated houses, which take turns [default: kitchen]
    #[arg(long, value_parser = value_names::room(), value_delimiter = ',', value_name = "ROOM,...")]
    rooms: Vec<Room>,
    /// Subtasks of a task in a generated house, as far as it has any as long
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=50))]
    length: u8,
    /// Only so many generated houses, again and again [default: another for each seed]
    #[arg(long, value_name = "N")]
    houses: Option<NonZeroU64>,
    /// How subtasks are graded: class, or strict as the released code does
    #[arg(long, value_name = "class|strict", default_value_t = Grading::Class)]
    grader: Grading,
    /// Pixels a side of frames, where a reset does not say
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = clap::value_parser!(u16).range(16..=600))]
    size: u16,
    /// The address to listen on
    #[arg(long, default_value = "127.0.0.1")]
    host: String,
    /// The port to listen on; 0 for any that is free
    #[arg(long, default_value_t = 0)]
    port: u16,
    /// Go on when standard input closes, until Ctrl-C or a signal
    #[arg(long)]
    keep_serving: bool,
}

impl Serve {
    /// Serves until nobody wants it any more.
    ///
    /// # Errors
    /// When the tasks cannot be used, or the address is taken.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let stop = stop::on_signals()?;
        let episodes = Episodes::new(self.origin()?, self.grader);
        let server = Server::listen(episodes, usize::from(self.size), (&self.host, self.port))?;
        server.start()?;
        let start = json!({"url": server.url()?, "protocol": "openenv", "version": 1, "socket": server.path()});
        let mut out = streams::out();
        writeln!(out, "{start}")?;
        out.flush()?;
        if !self.keep_serving && stdin().is_terminal() {
            say("serving; Ctrl-C or the end of input (Ctrl-D) ends it");
        }
        wait(&stop, !self.keep_serving);
        Ok(ExitStatus::Ok)
    }

    fn origin(&self) -> anyhow::Result<EpisodeOrigin> {
        let Some(path) = &self.tasks else {
            let rooms = if self.rooms.is_empty() { vec![Room::Kitchen] } else { self.rooms.clone() };
            return Ok(EpisodeOrigin::Generated { rooms, length: usize::from(self.length), count: self.houses });
        };
        let set = taskset::read(path)?.value;
        let scenes = Scenes::of(path, &set);
        scenes.check(&set.tasks).with_context(|| path.display().to_string())?;
        Ok(EpisodeOrigin::Tasks { tasks: set.tasks, scenes })
    }
}

/// Waits for a signal, or for standard input to close: whoever started this program is gone then, however that came about.
fn wait(stop: &AtomicBool, for_input: bool) {
    let closed = Arc::new(AtomicBool::new(false));
    if for_input {
        let closed = closed.clone();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while stdin().read(&mut bytes).is_ok_and(|read| read > 0) {}
            closed.store(true, Ordering::Relaxed);
        });
    }
    while !stop.load(Ordering::Relaxed) && !closed.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(20));
    }
}
