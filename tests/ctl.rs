//! `sprint ctl` steers what runs beside it.

use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use serde_json::Value;

use crate::program::{Sprint, wait_for};
use crate::terminal::Session;
use crate::training::{demonstrations, done};

/// Seeds enough for an evaluation that lasts until it is stopped, however busy the machine is.
const ENDLESS: u32 = 4_000;

/// The program in a folder of its own, with a folder of its own for sockets.
struct Steered {
    sprint: Sprint,
}

impl Steered {
    fn new() -> Steered {
        let sprint = Sprint::new();
        std::fs::create_dir(sprint.path("runtime")).unwrap();
        Steered { sprint }
    }

    fn command(&self, line: &str) -> Command {
        let mut command = self.sprint.command(line);
        command.env("XDG_RUNTIME_DIR", self.sprint.path("runtime"));
        command
    }

    /// An evaluation of five tasks, `seeds` times each.
    fn eval(&self, run: &str, seeds: u32) -> Child {
        let line = format!("eval --tasks tasks.json --policy random --seeds {seeds} --jobs 1 --json --out {run}");
        self.command(&line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }

    fn ctl(&self, line: &str) -> Output {
        self.command(&format!("ctl {line}")).output().unwrap()
    }

    fn text(&self, line: &str) -> String {
        let ended = self.ctl(line);
        assert!(ended.status.success(), "{line}: {}", String::from_utf8_lossy(&ended.stderr));
        String::from_utf8(ended.stdout).unwrap()
    }

    /// Tells an explorer something of several words.
    fn tell(&self, words: &str) {
        assert!(self.command("ctl instruct").arg(words).status().unwrap().success());
    }

    fn refusal(&self, line: &str) -> String {
        let ended = self.ctl(line);
        assert_eq!(ended.status.code(), Some(1), "{line}");
        String::from_utf8(ended.stderr).unwrap()
    }

    fn list(&self) -> Vec<Value> {
        self.text("list --json").lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    fn sockets(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.sprint.path("runtime/sprint")).into_iter().flatten();
        entries.map(|entry| entry.unwrap().path()).collect()
    }
}

#[test]
fn an_evaluation_that_was_paused_comes_to_the_same_bytes() {
    let steered = Steered::new();
    steered.sprint.sample("tasks.json", 1, 5);
    assert!(steered.eval("whole", 60).wait().unwrap().success());
    let mut paused = steered.eval("paused", 60);
    wait_for(|| !steered.list().is_empty());
    assert!(steered.text("pause").contains("paused"));
    let status = || serde_json::from_str::<Value>(&steered.text("status --json --of paused")).unwrap();
    assert_eq!(status()["state"], "paused");
    let before = status()["progress"]["done"].clone();
    std::thread::sleep(std::time::Duration::from_millis(300));
    let after = status()["progress"]["done"].clone();
    assert!(
        after.as_u64().unwrap() <= before.as_u64().unwrap() + 1,
        "{before} {after}: no more than the step under way"
    );
    assert!(paused.try_wait().unwrap().is_none());
    assert!(steered.refusal("instruct Hello").contains("its tasks'"));
    steered.text("resume");
    assert!(paused.wait().unwrap().success());
    for file in ["episodes.jsonl", "manifest.json", "summary.json"] {
        let read = |run: &str| steered.sprint.read(&format!("{run}/{file}"));
        assert_eq!(read("paused"), read("whole"), "{file}");
    }
    assert!(steered.list().is_empty() && steered.sockets().is_empty());
}

#[test]
fn two_of_a_kind_are_told_apart_one_is_stopped_and_what_a_killed_one_left_is_cleared_away() {
    let steered = Steered::new();
    steered.sprint.sample("tasks.json", 1, 5);
    let (mut one, mut other) = (steered.eval("one", ENDLESS), steered.eval("other", ENDLESS));
    wait_for(|| steered.list().len() == 2);
    for which in ["one", "other"] {
        steered.text(&format!("pause --of {which}"));
    }
    assert!(steered.refusal("status").contains("several run here"));
    assert!(steered.refusal("status --of third").contains("nothing that runs here is called"));
    let mut tail = steered.command("ctl tail --of one").stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(tail.stdout.take().unwrap()).lines();
    let mut heard = vec![lines.next().unwrap().unwrap()];
    steered.text(&format!("stop --of {}", one.id()));
    assert_eq!(one.wait().unwrap().code(), Some(130), "as after Ctrl-C");
    heard.extend(lines.map(Result::unwrap));
    assert!(tail.wait().unwrap().success());
    assert!(heard.iter().any(|line| line.contains("\"event\":\"progress\"")), "{heard:?}");
    assert!(heard.iter().any(|line| line.contains("\"event\":\"stopping\"")), "{heard:?}");
    let summary: Value = serde_json::from_str(&steered.sprint.read("one/summary.json")).unwrap();
    assert_eq!(summary["partial"], true);
    other.kill().unwrap();
    other.wait().unwrap();
    assert_eq!(steered.sockets().len(), 1);
    assert!(steered.list().is_empty() && steered.sockets().is_empty());
}

#[test]
fn only_the_user_himself_is_obeyed() {
    let steered = Steered::new();
    steered.sprint.sample("tasks.json", 1, 5);
    let mut child = steered.eval("run", ENDLESS);
    wait_for(|| !steered.list().is_empty());
    let socket = steered.sockets().pop().unwrap();
    let folder = socket.parent().unwrap();
    assert_eq!((folder.metadata().unwrap().mode() & 0o777, socket.metadata().unwrap().mode() & 0o777), (0o700, 0o600));
    let as_other = |script: &str| {
        let mut command = Command::new("setpriv");
        command.args(["--reuid", "65534", "--clear-groups", "perl", "-MIO::Socket::UNIX", "-e", script]);
        command.arg(&socket).output()
    };
    if as_other("exit 0").is_ok_and(|tried| tried.status.success()) {
        // Even where every file permission lets him in.
        for path in socket.ancestors().take_while(|path| *path != std::env::temp_dir() && path.parent().is_some()) {
            std::fs::set_permissions(path, PermissionsExt::from_mode(0o777)).unwrap();
        }
        let ask = r#"$SIG{PIPE} = "IGNORE"; $s = IO::Socket::UNIX->new(Peer => $ARGV[0]) or die $!; print $s qq({"ask":"do","order":"stop"}\n);
                     print <$s>"#;
        let said = String::from_utf8(as_other(ask).unwrap().stdout).unwrap();
        assert!(said.contains("it is another user's"), "{said}");
        assert!(steered.refusal("list").contains("a folder of your own"), "and the folder is trusted no more");
        std::fs::set_permissions(folder, PermissionsExt::from_mode(0o700)).unwrap();
    } else {
        eprintln!("skipped: no process of another user can be started here");
    }
    assert!(child.try_wait().unwrap().is_none(), "it goes on");
    steered.text("stop");
    child.wait().unwrap();
}

/// What `sprint ctl` says beside a session on a screen.
fn ctl_beside(state: &Path, words: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sprint"));
    let ended = command.arg("ctl").args(words).env("XDG_RUNTIME_DIR", state.join("runtime")).output().unwrap();
    assert!(ended.status.success(), "{words:?}: {}", String::from_utf8_lossy(&ended.stderr));
    String::from_utf8(ended.stdout).unwrap()
}

#[test]
fn an_explorer_is_told_run_paused_and_ended_from_another_terminal() {
    let state = tempfile::tempdir().unwrap();
    let arguments = ["--policy", "random", "--graphics", "halfblocks", "--seed", "3", "--paused"];
    let mut session = Session::open(state.path(), (120, 36), "explore", &arguments);
    session.see("step 0");
    let ctl = |words: &[&str]| ctl_beside(state.path(), words);
    ctl(&["instruct", "pick up the quince"]);
    session.see("instruction: Pick up the quince.");
    session.see("Instruction > Pick up the quince.");
    ctl(&["resume", "--of", "explore"]);
    session.miss("step 0");
    ctl(&["pause"]);
    let status = || serde_json::from_str::<Value>(&ctl(&["status", "--json"])).unwrap();
    wait_for(|| status()["state"] == "paused");
    let told = status();
    assert_eq!((&told["kind"], &told["instruction"]), (&"explore".into(), &"Pick up the quince.".into()));
    assert!(told["progress"]["done"].as_u64().unwrap() > 0);
    ctl(&["stop"]);
    assert_eq!(session.end(), 130, "as after a signal");
    assert_eq!(ctl(&["list", "--json"]), "");
}

#[test]
fn a_training_that_was_paused_ends_with_the_same_bytes() {
    let Some(sprint) = demonstrations() else { return };
    let longer = sprint.read("tiny.toml").replace("steps = 6\n", "steps = 120\n");
    std::fs::write(sprint.path("longer.toml"), longer).unwrap();
    let line = "pretrain D --preset longer.toml --out paused";
    let mut paused = sprint.command(line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let status = || serde_json::from_str::<Value>(&done(&sprint, "ctl status --json --of pretrain")).unwrap();
    wait_for(|| done(&sprint, "ctl list --json").contains("\"stage\":\"policy\""));
    wait_for(|| status()["progress"]["done"].as_u64().unwrap() > 3);
    done(&sprint, "ctl pause --of paused");
    assert_eq!(status()["state"], "paused");
    let before = status()["progress"]["done"].as_u64().unwrap();
    std::thread::sleep(std::time::Duration::from_millis(500));
    let after = status()["progress"]["done"].as_u64().unwrap();
    assert!(after <= before + 1 && after < 120, "{before} {after}: no more than the step under way");
    assert!(paused.try_wait().unwrap().is_none());
    assert!(sprint.run("ctl instruct Hello").stderr.contains("a training takes no instructions"));
    done(&sprint, "ctl resume --of paused");
    assert!(paused.wait().unwrap().success());
    done(&sprint, "pretrain D --preset longer.toml --out whole");
    let [whole, paused] =
        ["whole", "paused"].map(|run| std::fs::read(sprint.path(run).join("model.safetensors")).unwrap());
    assert!(whole == paused, "the weights are others");
}

/// An explorer without a screen, whose input stays open.
fn plain(steered: &Steered, line: &str) -> Child {
    let mut command = steered.command(&format!("explore --plain --policy random {line}"));
    command.env("SPRINT_PYTHON", concat!(env!("CARGO_MANIFEST_DIR"), "/tests/corridor_server.py"));
    let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    wait_for(|| steered.list().iter().any(|one| one["instruction"].is_string()));
    child
}

/// What it printed in all, once it has ended well.
fn printed(child: Child) -> String {
    let ended = child.wait_with_output().unwrap();
    let shown = String::from_utf8(ended.stdout).unwrap();
    assert!(ended.status.success(), "{shown}");
    shown
}

#[test]
fn an_explorer_without_a_screen_is_told_run_paused_and_ended_while_it_waits_for_a_line() {
    let steered = Steered::new();
    // Nothing ends the run: what is told is not graded.
    let mut child = plain(&steered, "--seed 3 --expect none");
    // An input that ends would end the explorer.
    let input = child.stdin.take();
    let mut output = child.stdout.take().unwrap();
    steered.tell("pick up the quince");
    let status = || serde_json::from_str::<Value>(&steered.text("status --json")).unwrap();
    wait_for(|| status()["instruction"] == "Pick up the quince.");
    // While nobody reads what it prints it cannot come to the end of the run.
    steered.text("resume");
    wait_for(|| status()["progress"]["done"].as_u64().unwrap() > 1);
    assert_eq!(status()["state"], "running");
    steered.text("pause");
    let shown = std::thread::spawn(move || {
        let mut shown = String::new();
        output.read_to_string(&mut shown).unwrap();
        shown
    });
    wait_for(|| status()["state"] == "paused");
    assert!(status()["progress"]["done"].as_u64().unwrap() < 1000, "it was paused on the way");
    steered.text("stop");
    assert!(child.wait().unwrap().success());
    let shown = shown.join().unwrap();
    drop(input);
    assert!(shown.contains("instruction: Pick up the quince.") && shown.contains("step 2: "), "{shown}");
    assert!(steered.list().is_empty() && steered.sockets().is_empty());
}

#[test]
fn an_explorer_of_another_environment_without_a_screen_is_steered_too() {
    let steered = Steered::new();
    let mut child = plain(&steered, "--env gym:none --seed 2");
    let input = child.stdin.take();
    let status = || serde_json::from_str::<Value>(&steered.text("status --json")).unwrap();
    assert_eq!(status()["what"], "gym:none, random");
    steered.text("instruct home");
    wait_for(|| status()["instruction"] == "Home.");
    let mut tail = steered.command("ctl tail").stdout(Stdio::piped()).spawn().unwrap();
    steered.text("resume");
    wait_for(|| status()["state"] == "paused" && status()["progress"]["done"].as_u64().unwrap() >= 5);
    steered.text("stop");
    let heard: Vec<String> = BufReader::new(tail.stdout.take().unwrap()).lines().map(Result::unwrap).collect();
    assert!(heard.iter().any(|line| line.starts_with("step ")) && heard.contains(&"over: done".into()), "{heard:?}");
    let shown = printed(child);
    drop(input);
    assert!(tail.wait().unwrap().success());
    assert!(shown.contains("instruction: Home.") && shown.contains("over: done"), "{shown}");
}

#[test]
fn the_screen_of_another_environment_is_steered_too() {
    let state = tempfile::tempdir().unwrap();
    let corridor = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/corridor_server.py"));
    let arguments = ["--env", "gym:none", "--policy", "random", "--seed", "2", "--paused", "--graphics", "halfblocks"];
    let variables = [("SPRINT_PYTHON", corridor)];
    let mut session = Session::open_where(state.path(), (80, 24), "explore", &arguments, &variables);
    session.see("asked: go to the right end");
    let ctl = |words: &[&str]| ctl_beside(state.path(), words);
    ctl(&["instruct", "go home"]);
    session.see("instruction: Go home.");
    ctl(&["resume"]);
    session.see("over: done");
    wait_for(|| serde_json::from_str::<Value>(&ctl(&["status", "--json"])).unwrap()["state"] == "paused");
    ctl(&["stop"]);
    assert_eq!(session.end(), 130, "as after a signal");
    assert_eq!(ctl(&["list", "--json"]), "");
}
