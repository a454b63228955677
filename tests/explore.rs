//! The explorer in a pseudo-terminal: the real binary, real keys, and a terminal that is left as it was found.

use std::io::{Read, Write};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};

/// How long anything may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// A terminal with the explorer in it.
struct Session {
    master: Box<dyn MasterPty + Send>,
    keys: Box<dyn Write + Send>,
    child: Box<dyn Child + Send + Sync>,
    screen: Arc<Mutex<vt100::Parser>>,
    _state: tempfile::TempDir,
}

impl Session {
    fn start(arguments: &[&str]) -> Session {
        Session::of("explore", arguments)
    }

    fn of(command_name: &str, arguments: &[&str]) -> Session {
        let size = PtySize { rows: 36, cols: 120, pixel_width: 0, pixel_height: 0 };
        let pair = native_pty_system().openpty(size).unwrap();
        let state = tempfile::tempdir().unwrap();
        let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_sprint"));
        command.arg(command_name);
        command.args(arguments);
        for name in ["TMUX", "CI", "NO_COLOR", "LC_ALL", "LC_CTYPE"] {
            command.env_remove(name);
        }
        command.env("TERM", "xterm-256color");
        command.env("COLORTERM", "truecolor");
        command.env("LANG", "en_US.UTF-8");
        command.env("XDG_STATE_HOME", state.path());
        command.env("XDG_CONFIG_HOME", state.path());
        let child = pair.slave.spawn_command(command).unwrap();
        drop(pair.slave);
        let mut output = pair.master.try_clone_reader().unwrap();
        let screen = Arc::new(Mutex::new(vt100::Parser::new(36, 120, 0)));
        let shown = screen.clone();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = output.read(&mut bytes) {
                shown.lock().unwrap().process(&bytes[..count]);
            }
        });
        let keys = pair.master.take_writer().unwrap();
        Session { master: pair.master, keys, child, screen, _state: state }
    }

    fn text(&self) -> String {
        self.screen.lock().unwrap().screen().contents()
    }

    /// Waits until the screen shows `text`.
    fn see(&self, text: &str) {
        let since = Instant::now();
        while !self.text().contains(text) {
            assert!(since.elapsed() < PATIENCE, "no {text:?} on the screen:\n{}", self.text());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn press(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).unwrap();
        self.keys.flush().unwrap();
    }

    /// Waits for the end; returns the exit code.
    fn end(&mut self) -> u32 {
        let since = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status.exit_code();
            }
            assert!(since.elapsed() < PATIENCE, "it does not end:\n{}", self.text());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// The alternate screen is left, the cursor shown, pastes no longer marked.
    fn is_restored(&self) {
        let since = Instant::now();
        loop {
            let parser = self.screen.lock().unwrap();
            let screen = parser.screen();
            if !screen.alternate_screen() && !screen.hide_cursor() && !screen.bracketed_paste() {
                return;
            }
            assert!(since.elapsed() < PATIENCE, "the terminal is not restored");
            drop(parser);
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn signal(&self, name: &str) {
        let id = self.child.process_id().unwrap().to_string();
        assert!(std::process::Command::new("kill").args([name, &id]).status().unwrap().success());
    }
}

#[test]
fn an_instruction_is_typed_applied_and_stepped_and_the_terminal_is_given_back() {
    let mut session = Session::start(&["--policy", "random", "--graphics", "halfblocks", "--seed", "3", "--paused"]);
    session.see("Mind");
    session.see("step 0");
    assert!(session.screen.lock().unwrap().screen().alternate_screen());
    session.press("i");
    session.press("pick up the quince");
    session.see("now: ");
    session.press("\r");
    session.see("told: Pick up the quince.");
    session.see("Instruction > Pick up the quince.");
    session.see("(was: ");
    session.press("n");
    session.see("step 1");
    session.press("m");
    session.see("you act");
    session.press("\x1b[C");
    session.see("RotateRight (you)");
    session.press("?");
    session.see("Keys while you act");
    session.press("?");
    session.press("q");
    assert_eq!(session.end(), 0);
    session.is_restored();
}

#[test]
fn time_travel_forks_are_kept_opened_and_verified() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let mut session = Session::start(&["--policy", "random", "--graphics", "halfblocks", "--seed", "3", "--paused"]);
    session.see("Mind");
    session.see("step 0");
    for step in ["main 1/1", "main 2/2", "main 3/3", "main 4/4"] {
        session.press("n");
        session.see(step);
    }
    session.press("h");
    session.see("main 3/4");
    session.press("0");
    session.see("main 0/4");
    session.press("]");
    session.press("0");
    session.press("l");
    session.see("main 1/4");
    // Another action in the past is a fork.
    session.press("m\x1b[D");
    session.see("b1 2/2");
    session.see("2 branches");
    session.press("mt");
    session.see("Side by side");
    session.see("the same until step 1");
    session.press(":name left turn\r");
    session.see("left turn");
    session.press("\x1b");
    session.see("In reach");
    session.press(&format!(":save {}\r", run.display()));
    session.see("wrote the 2 branches");
    session.press(":quit\r");
    assert_eq!(session.end(), 0);
    session.is_restored();

    let reference = format!("{}#left turn:1", run.display());
    let mut session = Session::of("open", &[&reference, "--graphics", "ascii"]);
    session.see("main 1/2");
    session.press(" ");
    session.see("main 2/2");
    session.press("n");
    session.see("main 3/3");
    session.press("q");
    assert_eq!(session.end(), 0);

    let sprint = |arguments: &[&str]| {
        let output = assert_cmd::Command::new(env!("CARGO_BIN_EXE_sprint")).args(arguments).output().unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap())
    };
    let path = run.display().to_string();
    let (code, text) = sprint(&["verify", &path]);
    assert!(code == Some(0) && text.contains("2 episodes, 6 steps the same, 5 of them chosen again"), "{text}");
    let film = folder.path().join("a.gif").display().to_string();
    assert_eq!(sprint(&["export", &format!("{path}#1"), &film]).0, Some(0));
    assert!(std::fs::read(&film).unwrap().starts_with(b"GIF89a"));
    // A changed record is found.
    let episodes = run.join("episodes.jsonl");
    let text = std::fs::read_to_string(&episodes).unwrap();
    std::fs::write(&episodes, text.replacen("\"steps\":4", "\"steps\":5", 1)).unwrap();
    let (code, text) = sprint(&["verify", &path]);
    assert!(code == Some(3) && text.contains("result was"), "{text}");
}

#[test]
fn a_huge_paste_and_a_storm_of_resizes_do_no_harm() {
    let mut session = Session::start(&["--policy", "random", "--graphics", "halfblocks", "--seed", "3", "--paused"]);
    session.see("Mind");
    session.see("step 0");
    session.press("i\x1b[200~");
    session.press(&"carry the mug ".repeat(75_000));
    session.press("\x1b[201~");
    session.see("carry the mug");
    for (rows, cols) in [(24, 80), (10, 30), (60, 200), (30, 100), (1, 1), (36, 120)] {
        let size = PtySize { rows, cols, pixel_width: 0, pixel_height: 0 };
        session.master.resize(size).unwrap();
        session.screen.lock().unwrap().screen_mut().set_size(rows.max(2), cols.max(2));
    }
    // A screen that is too small takes no keys: it has to be large again first.
    session.see("esc leave");
    session.press("\x1b");
    session.see("space run");
    session.press("n");
    session.see("main 1/1");
    session.press("q");
    assert_eq!(session.end(), 0);
    session.is_restored();
}

#[test]
fn signals_end_it_and_restore_the_terminal() {
    for name in ["-TERM", "-INT", "-HUP"] {
        let mut session = Session::start(&["--policy", "random", "--graphics", "ascii", "--paused"]);
        session.see("Mind");
        session.press(" ");
        session.see("running");
        session.signal(name);
        assert_eq!(session.end(), 130, "{name}");
        session.is_restored();
    }
}

#[test]
fn without_a_terminal_it_says_what_to_do() {
    let output = assert_cmd::Command::new(env!("CARGO_BIN_EXE_sprint")).arg("explore").output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert!(complaint.contains("--plain"), "{complaint}");
}

#[test]
fn plain_mode_takes_verbs_and_prints_a_line_a_step_without_escape_codes() {
    let verbs = "look\ncandidates\ninstruct find the quince\nstep 3\ndo RotateLeft\ndo 99\ndance\nreset\nquit\n";
    let output = assert_cmd::Command::new(env!("CARGO_BIN_EXE_sprint"))
        .args(["explore", "--plain", "--policy", "random", "--seed", "3"])
        .write_stdin(verbs)
        .output()
        .unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(!text.contains('\x1b'), "{text}");
    for wanted in
        ["scene: kitchen", "hand: empty", "instruction: Find the quince. (was: ", "step 3: ", "step 4: RotateLeft: ok"]
    {
        assert!(text.contains(wanted), "no {wanted:?} in:\n{text}");
    }
    assert!(
        text.contains("error: there is no candidate 99") && text.contains("error: unknown verb \"dance\""),
        "{text}"
    );
}
