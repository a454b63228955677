//! A pseudo-terminal with the program in it: the real binary, real keys, and a screen to read.

use std::io::{Read, Write};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};

use crate::program::encoder_home;

/// How long anything may take on a busy machine.
pub(crate) const PATIENCE: Duration = Duration::from_secs(120);

/// A terminal with the explorer in it.
pub(crate) struct Session {
    master: Box<dyn MasterPty + Send>,
    keys: Box<dyn Write + Send>,
    child: Box<dyn Child + Send + Sync>,
    screen: Arc<Mutex<vt100::Parser>>,
    /// Everything that was written to the terminal.
    written: Arc<Mutex<Vec<u8>>>,
    _state: Option<tempfile::TempDir>,
}

fn size(cols: u16, rows: u16) -> PtySize {
    PtySize { rows, cols, pixel_width: 0, pixel_height: 0 }
}

impl Session {
    /// `sprint explore` at 120 by 36, in a folder for settings and state of its own.
    pub(crate) fn start(arguments: &[&str]) -> Session {
        Session::of("explore", arguments)
    }

    /// The same for another command.
    pub(crate) fn of(command: &str, arguments: &[&str]) -> Session {
        let state = tempfile::tempdir().unwrap();
        let mut session = Session::open(state.path(), (120, 36), command, arguments);
        session._state = Some(state);
        session
    }

    /// With settings and state in a folder that stays.
    pub(crate) fn open(state: &Path, size: (u16, u16), command: &str, arguments: &[&str]) -> Session {
        Session::open_where(state, size, command, arguments, &[])
    }

    /// The same, with these environment variables.
    pub(crate) fn open_where(
        state: &Path,
        (cols, rows): (u16, u16),
        command: &str,
        arguments: &[&str],
        variables: &[(&str, &Path)],
    ) -> Session {
        let pair = native_pty_system().openpty(size(cols, rows)).unwrap();
        let mut line = CommandBuilder::new(env!("CARGO_BIN_EXE_sprint"));
        line.arg(command);
        line.args(arguments);
        // Where `checkpoints` lies, wherever the program was built.
        line.cwd(env!("CARGO_MANIFEST_DIR"));
        for name in ["TMUX", "CI", "NO_COLOR", "LC_ALL", "LC_CTYPE", "TERM_PROGRAM", "KITTY_WINDOW_ID", "WT_SESSION"] {
            line.env_remove(name);
        }
        line.env("TERM", "xterm-256color");
        line.env("COLORTERM", "truecolor");
        line.env("LANG", "en_US.UTF-8");
        line.env("XDG_STATE_HOME", state);
        line.env("XDG_CONFIG_HOME", state);
        let runtime = state.join("runtime");
        std::fs::create_dir_all(&runtime).unwrap();
        line.env("XDG_RUNTIME_DIR", runtime);
        if let Some(home) = encoder_home() {
            line.env("SPRINT_HOME", home);
        }
        for (name, value) in variables {
            line.env(name, value);
        }
        let child = pair.slave.spawn_command(line).unwrap();
        drop(pair.slave);
        let mut output = pair.master.try_clone_reader().unwrap();
        let screen = Arc::new(Mutex::new(vt100::Parser::new(rows, cols, 0)));
        let written = Arc::new(Mutex::new(Vec::new()));
        let (shown, kept) = (screen.clone(), written.clone());
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = output.read(&mut bytes) {
                kept.lock().unwrap().extend_from_slice(&bytes[..count]);
                shown.lock().unwrap().process(&bytes[..count]);
            }
        });
        let keys = pair.master.take_writer().unwrap();
        Session { master: pair.master, keys, child, screen, written, _state: None }
    }

    /// What the screen shows.
    pub(crate) fn text(&self) -> String {
        self.screen.lock().unwrap().screen().contents()
    }

    /// Whether that sequence was written to the terminal.
    pub(crate) fn has_written(&self, sequence: &str) -> bool {
        let written = self.written.lock().unwrap();
        written.windows(sequence.len()).any(|bytes| bytes == sequence.as_bytes())
    }

    /// How often that sequence was written to the terminal.
    pub(crate) fn times_written(&self, sequence: &str) -> usize {
        let written = self.written.lock().unwrap();
        written.windows(sequence.len()).filter(|bytes| *bytes == sequence.as_bytes()).count()
    }

    /// Whether the program is stopped, and may go on later.
    pub(crate) fn is_stopped(&self) -> bool {
        let state = std::fs::read_to_string(format!("/proc/{}/stat", self.child.process_id().unwrap())).unwrap();
        state.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with('T'))
    }

    fn stty(&self, arguments: &[&str]) -> String {
        let name = self.master.tty_name().unwrap();
        let output = std::process::Command::new("stty").arg("-F").arg(name).args(arguments).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    }

    /// Whether the terminal hands on whole lines, as a shell's does.
    pub(crate) fn takes_lines(&self) -> bool {
        self.stty(&["-a"]).split_whitespace().any(|mode| mode == "icanon")
    }

    /// Makes the terminal what a shell makes of it.
    pub(crate) fn reset_modes(&self) {
        self.stty(&["sane"]);
    }

    /// Waits until something holds.
    pub(crate) fn wait(&self, what: &str, holds: impl Fn(&Session) -> bool) {
        let since = Instant::now();
        while !holds(self) {
            assert!(since.elapsed() < PATIENCE, "no {what} on the screen:\n{}", self.text());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until the screen shows `text`.
    pub(crate) fn see(&self, text: &str) {
        self.wait(text, |session| session.text().contains(text));
    }

    /// Waits until the screen no longer shows `text`.
    pub(crate) fn miss(&self, text: &str) {
        self.wait(&format!("end of {text}"), |session| !session.text().contains(text));
    }

    /// Sends keys.
    pub(crate) fn press(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).unwrap();
        self.keys.flush().unwrap();
    }

    /// Gives the terminal another size. The screen has it before the program hears of it: what the program draws at once would
    /// be cut to the old size otherwise.
    pub(crate) fn resize(&self, cols: u16, rows: u16) {
        self.screen.lock().unwrap().screen_mut().set_size(rows.max(2), cols.max(2));
        self.master.resize(size(cols, rows)).unwrap();
    }

    /// Whether the alternate screen is shown.
    pub(crate) fn is_taken(&self) -> bool {
        self.screen.lock().unwrap().screen().alternate_screen()
    }

    /// Waits for the end; returns the exit code, and prints the last words with one that is not 0.
    pub(crate) fn end(&mut self) -> u32 {
        let since = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                if !status.success() {
                    eprintln!("{status}:\n{}", self.text());
                }
                return status.exit_code();
            }
            assert!(since.elapsed() < PATIENCE, "it does not end:\n{}", self.text());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Presses `q`, and again where that would leave something unsaved; it ends well.
    pub(crate) fn leave(&mut self) {
        self.press("q");
        let since = Instant::now();
        while self.child.try_wait().unwrap().is_none() {
            if self.text().contains("q again leaves") {
                self.press("q");
                break;
            }
            assert!(since.elapsed() < PATIENCE, "it does not end:\n{}", self.text());
            std::thread::sleep(Duration::from_millis(20));
        }
        assert_eq!(self.end(), 0);
    }

    /// The alternate screen is left, the cursor shown, pastes no longer marked.
    pub(crate) fn is_restored(&self) {
        self.wait("restored terminal", |session| {
            let parser = session.screen.lock().unwrap();
            let screen = parser.screen();
            !screen.alternate_screen() && !screen.hide_cursor() && !screen.bracketed_paste()
        });
    }

    /// Sends a signal.
    pub(crate) fn signal(&self, name: &str) {
        let id = self.child.process_id().unwrap().to_string();
        assert!(std::process::Command::new("kill").args([name, &id]).status().unwrap().success());
    }
}
