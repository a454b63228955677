//! Environments in another process, with the real binary: a corridor served by a few lines of Python stands for them.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::program::{Ended, Sprint};
use crate::terminal::Session;

const SERVER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/corridor_server.py");

/// Runs the program with the corridor as the Python that serves `gym:ID`; the id says what it does wrong.
fn with_child(sprint: &Sprint, line: &str) -> Ended {
    let output = sprint.command(line).env("SPRINT_PYTHON", SERVER).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
}

/// A server that goes on until it is dropped, and its address.
pub(crate) struct Server {
    child: Child,
    pub(crate) url: String,
}

impl Server {
    pub(crate) fn start(fault: &str) -> Server {
        let mut child = Command::new(SERVER).arg(fault).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let greeting: serde_json::Value = serde_json::from_str(&line).unwrap();
        Server { child, url: greeting["url"].as_str().unwrap().to_owned() }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// Processes of that id that still run.
fn running(id: &str) -> Vec<String> {
    let lines = Command::new("ps").args(["-eo", "stat,args"]).output().unwrap().stdout;
    let lines = String::from_utf8_lossy(&lines).into_owned();
    let is_one = |line: &&str| line.contains(SERVER) && line.contains(id) && !line.starts_with('Z');
    lines.lines().filter(is_one).map(str::to_owned).collect()
}

#[test]
fn an_environment_in_a_child_is_evaluated_resumed_sharded_compared_and_verified() {
    let sprint = Sprint::new();
    let sampled = with_child(&sprint, "tasks sample tasks.json --env gym:none --count 6 --seed 3");
    assert_eq!(sampled.code, Some(0), "{}", sampled.stderr);
    assert!(sprint.read("tasks.json").contains("\"env\":\"gym:none\""));
    assert_eq!(sprint.run("tasks check tasks.json").code, Some(0));
    let ended = with_child(&sprint, "eval --tasks tasks.json --policy random --jobs 2 --out whole --json");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let summary: serde_json::Value = serde_json::from_str(ended.stdout.trim()).unwrap();
    assert_eq!(summary["episodes"], 6);
    assert!(summary["return"]["mean"].as_f64().unwrap() > 0.9, "chance finds the end in 1000 steps: {summary}");
    let lines = sprint.read("whole/episodes.jsonl");
    let first: serde_json::Value = serde_json::from_str(lines.lines().next().unwrap()).unwrap();
    assert_eq!(first["instruction"], "go to the right end");
    assert!(first["trace"][0]["own"]["action"].is_string() && first["trace"][0].get("action").is_none());
    // One child or two, whole or interrupted or in shares: the same record.
    for share in ["1/2", "2/2"] {
        let ended =
            with_child(&sprint, &format!("eval --tasks tasks.json --policy random --out shared --shard {share}"));
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    }
    assert_eq!(sprint.run("merge shared").code, Some(0));
    assert_eq!(sprint.read("shared/episodes.jsonl"), lines);
    let kept: String = lines.lines().take(2).map(|line| format!("{line}\n")).collect();
    std::fs::write(sprint.path("whole/episodes.jsonl"), kept).unwrap();
    let ended = with_child(&sprint, "eval --tasks tasks.json --policy random --jobs 1 --out whole");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(sprint.read("whole/episodes.jsonl"), lines);
    let compared = sprint.run("compare whole shared");
    assert_eq!(compared.code, Some(0), "{}", compared.stderr);
    let verified = with_child(&sprint, "verify whole");
    assert_eq!((verified.code, verified.stdout.contains("equal")), (Some(0), true), "{}", verified.stdout);
    let changed = lines.replacen("\"seen\":\"", "\"seen\":\"0", 3);
    std::fs::write(sprint.path("whole/episodes.jsonl"), changed).unwrap();
    let verified = with_child(&sprint, "verify whole");
    assert_eq!(verified.code, Some(3), "{}{}", verified.stdout, verified.stderr);
    assert!(verified.stdout.contains("step 1: what is seen was 0"), "{}", verified.stdout);
}

#[test]
fn whatever_a_child_does_wrong_is_a_clear_error_and_leaves_no_process() {
    for (fault, told) in [
        ("dies", "its last words: Traceback (most recent call last): | RuntimeError: the physics exploded"),
        ("hangs", "did not answer within 1 s"),
        ("late", "did not answer within 1 s"),
        ("deaf", "did not answer within 1 s"),
    ] {
        let sprint = Sprint::new();
        let line = format!("eval --env gym:{fault} --env-timeout 1 --policy random --limit 3 --out run");
        let ended = with_child(&sprint, &line);
        assert_eq!(ended.code, Some(3), "{fault}: {}", ended.stderr);
        let lines = sprint.read("run/episodes.jsonl");
        assert_eq!(lines.lines().count(), 3, "{fault}: nothing is lost");
        let first: serde_json::Value = serde_json::from_str(lines.lines().next().unwrap()).unwrap();
        assert!(first["error"].as_str().unwrap().contains(told), "{fault}: {}", first["error"]);
        assert_eq!(first["steps"], 2, "{fault}: the steps before are recorded");
        assert_eq!(running(&format!("gym {fault} ")), Vec::<String>::new());
    }
}

#[test]
fn a_child_that_cannot_serve_is_refused_before_anything_is_written() {
    for (id, told) in [
        ("rubbish", "it said \"pygame 2.6.0 (SDL 2.28.4)\" in place of where it listens"),
        ("dies-at-start", "its last words: ModuleNotFoundError: No module named 'minigrid'"),
    ] {
        let sprint = Sprint::new();
        let ended = with_child(&sprint, &format!("eval --env gym:{id} --policy random --out run"));
        assert_eq!(ended.code, Some(1), "{}", ended.stderr);
        assert!(ended.stderr.contains(told) && ended.stderr.contains(&format!("gym:{id}")), "{}", ended.stderr);
        assert!(!sprint.path("run").exists());
        assert_eq!(running(&format!("gym {id} ")), Vec::<String>::new());
    }
    let sprint = Sprint::new();
    let ended = with_child(&sprint, "eval --env gym:none --policy expert --out run");
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(ended.stderr.contains("expert: it acts in House only, and has no use for the actions of gym:none"));
}

#[test]
fn what_a_child_forks_is_gone_too_and_so_is_a_child_whose_parent_was_killed() {
    let sprint = Sprint::new();
    let ended = with_child(&sprint, "eval --env gym:forks --policy random --limit 1 --out run");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(running("gym forks "), Vec::<String>::new());
    let line = "explore --env gym:no-snapshot --plain";
    let mut parent = sprint.command(line).env("SPRINT_PYTHON", SERVER).stdin(Stdio::piped()).spawn().unwrap();
    wait_until(|| !running("gym no-snapshot ").is_empty());
    parent.kill().unwrap();
    parent.wait().unwrap();
    wait_until(|| running("gym no-snapshot ").is_empty());
}

fn wait_until(happened: impl Fn() -> bool) {
    let began = Instant::now();
    while !happened() {
        assert!(began.elapsed() < Duration::from_secs(60), "it did not happen within a minute");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn an_environment_is_explored_saved_verified_and_opened_without_a_screen() {
    let sprint = Sprint::new();
    let lines = "step 3\nback\nact left\ninstruct go home\nact left\nsave run\nlook\n";
    let explored = piped(&sprint, "explore --env gym:no-snapshot --policy random --seed 4 --plain", lines);
    assert_eq!(explored.code, Some(0), "{}", explored.stdout);
    for told in
        ["instruction: go to the right end", "branch 2 begins", "instruction: Go home.", "going back: exact so far"]
    {
        assert!(explored.stdout.contains(told), "{told}: {}", explored.stdout);
    }
    let verified = with_child(&sprint, "verify run");
    assert_eq!((verified.code, verified.stdout.contains("equal")), (Some(0), true), "{}", verified.stdout);
    let exported = with_child(&sprint, "export run#2:1 film.gif seen.png told.txt page.html");
    assert_eq!(exported.code, Some(0), "{}", exported.stderr);
    assert!(std::fs::read(sprint.path("film.gif")).unwrap().starts_with(b"GIF89a"));
    assert!(sprint.read("told.txt").contains("Go home.") && sprint.read("page.html").contains("left"));
    let opened = piped(&sprint, "open run#2:1 --plain", "look\nstep\n");
    assert_eq!(opened.code, Some(0), "{}", opened.stdout);
    assert!(opened.stdout.contains("at step 1 of 4"), "{}", opened.stdout);
}

fn piped(sprint: &Sprint, line: &str, input: &str) -> Ended {
    std::fs::write(sprint.path("input"), input).unwrap();
    let input = std::fs::File::open(sprint.path("input")).unwrap();
    let output = sprint.command(line).env("SPRINT_PYTHON", SERVER).stdin(input).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
}

#[test]
fn a_served_environment_is_explored_on_a_screen() {
    let server = Server::start("none");
    let state = tempfile::tempdir().unwrap();
    let env = format!("openenv:{}", server.url);
    let arguments = ["--env", &env, "--seed", "2", "--graphics", "halfblocks"];
    let mut session = Session::open(state.path(), (80, 24), "explore", &arguments);
    session.see("asked: go to the right end");
    session.see("random acts");
    session.see("8 x 4");
    session.press("n");
    session.see("step 1/1");
    session.press("m");
    session.press("2");
    session.see("step 2/2");
    session.press("m");
    session.press("hn");
    session.see("step 2/2");
    session.press("h");
    session.see("step 1/2");
    session.press("igo home\r");
    session.see("instruction: Go home.");
    session.press("Bgo away\r");
    session.see("compared");
    session.press("\x1b");
    session.miss("compared");
    session.press("$");
    session.see("step 2/2");
    session.press(":goto 1\r");
    session.see("step 1/2");
    session.press(":fly\r");
    session.see("\"fly\" is none of");
    session.press("?");
    session.see("any key closes");
    session.press("?N");
    session.see("Not saved: 2 steps");
    session.press("N");
    session.see("seed 3");
    session.press(" ");
    session.see("over: done");
    session.press(":run on\r");
    session.see("run stands alone");
    session.press(":goto 999\r");
    session.see("there is no step 999");
    // Nothing is lost unasked.
    session.press("N");
    session.see("S saves, the same again forgets them");
    session.press("q");
    session.see("S saves, the same again leaves");
    session.press("h");
    session.miss("the same again");
    session.press(":quit\r");
    session.see("S saves, the same again leaves");
    session.press("q");
    assert_eq!(session.end(), 0);
    session.is_restored();
}

#[test]
fn a_refusal_stays_whatever_comes_of_what_was_asked_before() {
    let server = Server::start("late");
    let state = tempfile::tempdir().unwrap();
    let env = format!("openenv:{}", server.url);
    let mut session = Session::open(state.path(), (80, 24), "explore", &["--env", &env, "--seed", "2"]);
    session.see("asked: go to the right end");
    // The third step takes three seconds.
    session.press("nnn:fly\r");
    session.see("\"fly\" is none of");
    session.see("step 3/3");
    session.see("\"fly\" is none of");
    session.press("h");
    session.miss("\"fly\" is none of");
    session.press("qq");
    assert_eq!(session.end(), 0);
}

#[test]
fn a_screen_says_how_long_it_waits_and_leaves_at_once() {
    let server = Server::start("hangs");
    let state = tempfile::tempdir().unwrap();
    let env = format!("openenv:{}", server.url);
    let mut session = Session::open(state.path(), (80, 24), "explore", &["--env", &env]);
    session.see("asked: go to the right end");
    session.press("nnn");
    session.see("waiting for the environment");
    session.press("q");
    assert_eq!(session.end(), 0);
}
