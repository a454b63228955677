//! BabyAI itself in a child, with BabyAI's own bot behind a policy server: explored in a terminal, and evaluated. Where the
//! packages are installed.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::needed::{Need, missing};
use crate::program::Sprint;
use crate::terminal::Session;

const PACKAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/python");

/// The Python that has all packages.
fn python() -> Option<PathBuf> {
    let installed = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/python/bin/python");
    let python = std::env::var_os("SPRINT_PYTHON").map_or(installed, PathBuf::from);
    let imports =
        Command::new(&python).args(["-c", "import minigrid, msgpack, websockets"]).stderr(Stdio::null()).status();
    if imports.is_ok_and(|status| status.success()) {
        return Some(python);
    }
    missing(Need::Python, "BabyAI");
    None
}

/// The bot, serving until it is dropped, and its address.
struct Bot {
    child: Child,
    address: String,
}

impl Bot {
    fn start(python: &Path) -> Bot {
        let mut command = Command::new(python);
        command.args(["-B", "-m", "sprint_env.babyai_bot", "--port", "0"]).current_dir(PACKAGE);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let address = lines.next().unwrap().unwrap();
        // What else BabyAI prints must not fill the pipe.
        std::thread::spawn(move || lines.for_each(drop));
        Bot { child, address }
    }
}

impl Drop for Bot {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

#[test]
fn the_bot_is_explored_in_a_terminal_back_and_forth_until_it_is_done() {
    let Some(python) = python() else { return };
    let (bot, state) = (Bot::start(&python), tempfile::tempdir().unwrap());
    let arguments = ["--env", "gym:BabyAI-GoToLocal-v0", "--policy", &bot.address, "--seed", "4", "--paused"];
    let arguments = [&arguments[..], &["--graphics", "halfblocks"]].concat();
    let mut session =
        Session::open_where(state.path(), (100, 30), "explore", &arguments, &[("SPRINT_PYTHON", &python)]);
    session.see("asked: go to");
    session.see("ws:babyai-bot acts");
    session.see("56 x 56");
    session.press("nnn");
    session.see("step 3/3");
    session.press("hh");
    session.see("step 1/3");
    session.press("m");
    session.press(":act left\r");
    session.see("branch 2 (2 of 2)");
    session.press("m");
    session.press(" ");
    session.see("over: done");
    session.press("qq");
    assert_eq!(session.end(), 0);
    session.is_restored();
}

#[test]
fn the_bot_solves_every_level_that_is_evaluated() {
    let Some(python) = python() else { return };
    let (bot, sprint) = (Bot::start(&python), Sprint::new());
    let line =
        format!("eval --env gym:BabyAI-GoToLocal-v0 --policy {} --limit 20 --jobs 2 --json --out run", bot.address);
    let output = sprint.command(&line).env("SPRINT_PYTHON", &python).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&summary["episodes"], &summary["success"]), (&20.into(), &1.0.into()));
}
