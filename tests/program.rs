//! The program as tests start it.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use assert_cmd::Command;
use serde_json::Value;
use sprint_explorer::nets::sentence::default_folder;
use tempfile::TempDir;

use crate::needed;

/// A home for the program that holds the sentence encoder.
pub(crate) fn encoder_home() -> Option<PathBuf> {
    let encoder = needed::sentence_encoder(&default_folder())?;
    Some(encoder.ancestors().nth(2).unwrap().to_owned())
}

/// The program, in an empty folder of its own.
pub(crate) struct Sprint {
    folder: TempDir,
}

/// How a command ended.
pub(crate) struct Ended {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Sprint {
    /// In a new folder.
    pub(crate) fn new() -> Sprint {
        Sprint { folder: tempfile::tempdir().unwrap() }
    }

    /// A file in its folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs it with these words.
    pub(crate) fn run(&self, line: &str) -> Ended {
        let mut command = Command::cargo_bin("sprint").unwrap();
        let command = command.current_dir(self.folder.path()).env("SPRINT_HOME", self.path("home"));
        let command = command.env("XDG_RUNTIME_DIR", self.folder.path());
        let output = command.args(line.split_whitespace()).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Ended { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }

    /// The lines of a file, sorted.
    pub(crate) fn sorted(&self, name: &str) -> Vec<String> {
        let mut lines: Vec<String> = self.read(name).lines().map(String::from).collect();
        lines.sort();
        lines
    }

    /// The program, ready to be started with these words.
    pub(crate) fn command(&self, line: &str) -> std::process::Command {
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("sprint"));
        command.current_dir(self.folder.path()).env("SPRINT_HOME", self.path("home"));
        command.env("XDG_RUNTIME_DIR", self.folder.path());
        command.args(line.split_whitespace());
        command
    }

    pub(crate) fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// Samples a set of tasks in generated houses.
    pub(crate) fn sample(&self, name: &str, length: usize, count: usize) {
        let ended =
            self.run(&format!("tasks sample {name} --scenes generated --length {length} --count {count} --seed 7"));
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    }

    /// Changes a file, and gives what `sprint eval` says of it.
    pub(crate) fn complaint(&self, name: &str, change: impl FnOnce(&mut Value)) -> String {
        let mut value: Value = serde_json::from_str(&self.read(name)).unwrap();
        change(&mut value);
        std::fs::write(self.path("changed.json"), value.to_string()).unwrap();
        self.refused("changed.json")
    }

    /// What `sprint eval` says of a file that it must refuse without writing anything.
    pub(crate) fn refused(&self, name: &str) -> String {
        let ended = self.run(&format!("eval --tasks {name} --policy random --out refused"));
        assert_eq!(ended.code, Some(1), "{}", ended.stderr);
        assert!(ended.stderr.contains(name), "the file is named: {}", ended.stderr);
        assert!(!ended.stderr.contains("panicked"), "{}", ended.stderr);
        assert!(!self.path("refused").exists(), "nothing is half-written");
        ended.stderr
    }
}

/// Waits until it happened, a minute at the most.
pub(crate) fn wait_for(happened: impl Fn() -> bool) {
    let began = Instant::now();
    while !happened() {
        assert!(began.elapsed() < Duration::from_secs(60), "it did not happen within a minute");
        std::thread::sleep(Duration::from_millis(5));
    }
}
