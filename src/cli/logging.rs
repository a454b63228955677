//! The log: a file, never the terminal.

use std::fs::{File, OpenOptions};
use std::path::PathBuf;
use std::sync::Mutex;

use etcetera::BaseStrategy;
use tracing_subscriber::EnvFilter;

/// A log that has grown beyond this many bytes is set aside (as `sprint.log.old`) when the next run starts.
const LARGEST: u64 = 4 << 20;

/// The log file: `sprint/sprint.log` in the user's XDG state folder, else in the cache folder.
pub(crate) fn path() -> PathBuf {
    let state = etcetera::choose_base_strategy().ok().and_then(|base| base.state_dir());
    state.map_or_else(crate::nets::home::cache_folder, |state| state.join("sprint")).join("sprint.log")
}

/// Starts logging at the level of `SPRINT_LOG` (default `info`). A log that cannot be written is done without: it must
/// not stop the program, and there is no other place to complain to.
pub(crate) fn start() {
    let Ok(file) = open() else { return };
    let filter = EnvFilter::try_from_env("SPRINT_LOG").unwrap_or_else(|_| EnvFilter::new("info"));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_ansi(false).with_writer(Mutex::new(file));
    let _ = log.try_init();
    tracing::info!(version = env!("CARGO_PKG_VERSION"), command = ?std::env::args().nth(1), "started");
}

/// Opens the log file for appending; others (libtorch's own messages) may be sent there too.
///
/// # Errors
/// When the folder or file cannot be made.
pub(crate) fn open() -> std::io::Result<File> {
    let path = path();
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    if path.metadata().is_ok_and(|file| file.len() > LARGEST) {
        std::fs::rename(&path, path.with_extension("log.old"))?;
    }
    OpenOptions::new().create(true).append(true).open(path)
}
