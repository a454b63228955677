//! Typed wishes in a pseudo-terminal of 80 x 24: read, refused, meant otherwise, fulfilled, failed, and the next one.

use std::path::Path;

use super::terminal::Session;

const HOUSE: [&str; 7] = ["--room", "kitchen", "--seed", "7", "--graphics", "ascii", "--paused"];

fn explorer(state: &Path, policy: &str, more: &[&str]) -> Session {
    let arguments: Vec<&str> = HOUSE.iter().copied().chain(["--policy", policy]).chain(more.iter().copied()).collect();
    let session = Session::open(state, (80, 24), "explore", &arguments);
    session.see("Mind");
    session.see("step 0");
    session
}

/// Types a wish, and waits until it is told.
fn tell(session: &mut Session, text: &str, told: &str) {
    session.press("i");
    session.see("enter tell the agent");
    session.press(text);
    session.press("\r");
    session.see(&format!("Instruction > {told}"));
}

/// Runs at full speed.
fn run(session: &mut Session) {
    session.press("+++++ ");
}

fn sprint(arguments: &[&str]) -> String {
    let output = assert_cmd::Command::new(env!("CARGO_BIN_EXE_sprint")).args(arguments).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {text}");
    text
}

#[test]
fn a_wish_is_read_and_fulfilled_the_next_goes_on_from_there_and_both_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let kept = folder.path().join("run");
    let mut session = explorer(folder.path(), "expert", &[]);
    tell(&mut session, "please put the mug in the sink", "Please put the mug in the sink.");
    session.see(": put a mug in the sink");
    session.see("[>] put the mug in the sink");
    session.see("0 of 1 · expert 19");
    run(&mut session);
    session.see("done, after 19 steps");
    session.see("[x] put the mug in the sink");
    tell(&mut session, "now take the potato", "Now take the potato.");
    // The run had come to its end: it goes on by itself.
    session.see("[x] pick up the potato");
    session.press("t");
    session.see("2 of 2 fulfilled");
    session.see("1. steps 0-19");
    session.press("\x1b");
    session.see("In reach");
    session.press(&format!(":save {}\r", kept.display()));
    session.see("sprint open shows it");
    session.leave();

    let path = kept.display().to_string();
    let verified = sprint(&["verify", &path]);
    assert!(verified.contains("1 episodes") || verified.contains("1 episode"), "{verified}");
    sprint(&["report", &path]);
    let page = std::fs::read_to_string(kept.join("report.html")).unwrap();
    assert!(page.contains("Now take the potato.") && page.contains("understood: pick up a potato"), "no wishes on it");
    let mut session = Session::open(folder.path(), (80, 24), "open", &[&path, "--graphics", "ascii"]);
    session.see("Instruction > Please put the mug in the sink.");
    session.press("$t");
    session.see("2 of 2 fulfilled");
    session.leave();
}

#[test]
fn what_cannot_be_read_is_refused_with_the_reason_and_a_person_judges_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = explorer(folder.path(), "random", &[]);
    tell(&mut session, "dance for me", "Dance for me.");
    session.see("not graded: not understood: dance");
    session.press("n");
    session.see("main 1/1");
    session.press(":done\r");
    session.see("done, you say, after 1 step");
    session.press("n");
    session.see("done, you say; i gives");
    tell(&mut session, "pick up the baseball bat", "Pick up the baseball bat.");
    session.see("not graded: this house has no baseball bat");
    session.press("t");
    session.see("1 of 2 fulfilled");
    session.leave();
}

#[test]
fn what_may_mean_two_things_is_meant_otherwise_with_a_key_and_graded_anew() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = explorer(folder.path(), "expert", &[]);
    tell(&mut session, "grab a knife", "Grab a knife.");
    session.see("or z: 2 butter knife");
    session.press("z");
    session.see("understood: pick up a butter knife");
    session.see("[>] pick up the butter knife");
    run(&mut session);
    session.see("[x] pick up the butter knife");
    // Meant as the other knife, what was done no longer fulfils it.
    session.press("z");
    session.see("[>] pick up the knife");
    session.see("2 branches");
    session.leave();
}

#[test]
fn a_wish_that_fails_says_why_and_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = explorer(folder.path(), "random", &["--instruction", "put the potato in the fridge"]);
    session.see("Instruction > Put the potato in the fridge.");
    session.see("[>] put the potato in the");
    run(&mut session);
    session.see("out of time");
    session.wait("a reason", |session| {
        let text = session.text();
        ["never saw", "never got to it", "was in reach", "something else", "pushed on", "later step"]
            .iter()
            .any(|reason| text.contains(reason))
    });
    session.leave();
}

#[test]
fn nothing_is_expected_where_that_is_asked() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = explorer(folder.path(), "random", &["--expect", "none"]);
    tell(&mut session, "pick up the mug", "Pick up the mug.");
    session.see("not graded: not read (--expect none)");
    session.leave();
}

/// A task file whose one task only says an instruction.
fn told(folder: &Path, instruction: &str) -> String {
    let path = folder.join("told.json");
    let scene = r#"{"generated": {"room": "kitchen", "seed": 7}}"#;
    let task = format!(
        r#"{{"id": "told", "scene": {scene}, "instruction": "{instruction}", "roles": [], "subtasks": [], "horizon": 60}}"#
    );
    std::fs::write(&path, format!(r#"{{"format_version": 1, "name": "told", "tasks": [{task}]}}"#)).unwrap();
    path.display().to_string()
}

#[test]
fn a_task_that_only_says_an_instruction_is_evaluated_as_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run").display().to_string();
    let tasks = told(folder.path(), "put the mug in the sink");
    let summary = sprint(&["eval", "--tasks", &tasks, "--policy", "expert", "--out", &run, "--json"]);
    assert!(summary.contains("\"success\":1.0"), "{summary}");
    let record = std::fs::read_to_string(folder.path().join("run/episodes.jsonl")).unwrap();
    assert!(record.contains("\"understood\":\"put a mug in the sink\""), "{record}");
    sprint(&["verify", &run]);
    sprint(&["report", &run]);
    let plain = assert_cmd::Command::new(env!("CARGO_BIN_EXE_sprint"))
        .args(["explore", "--plain", "--policy", "expert", "--task", &format!("{tasks}#1")])
        .write_stdin("run\nwishes\n")
        .output()
        .unwrap();
    let text = String::from_utf8(plain.stdout).unwrap();
    assert!(text.contains("understood: put a mug in the sink") && text.contains("\"verdict\":\"done\""), "{text}");

    let tasks = told(folder.path(), "dance");
    let refused = assert_cmd::Command::new(env!("CARGO_BIN_EXE_sprint"))
        .args(["eval", "--tasks", &tasks, "--policy", "expert", "--out", &run])
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && error.contains("tasks[0].subtasks: none"), "{error}");
}

#[test]
fn an_opened_episode_failed_for_the_reason_that_its_evaluation_gave() {
    let sprint = crate::program::Sprint::new();
    sprint.sample("tasks.json", 1, 6);
    assert_eq!(sprint.run("eval --tasks tasks.json --policy random --out run").code, Some(0));
    let mut failed = 0;
    for (number, line) in (1..).zip(sprint.read("run/episodes.jsonl").lines()) {
        let record: serde_json::Value = serde_json::from_str(line).unwrap();
        let mut open = assert_cmd::Command::from_std(sprint.command(&format!("open run#{number} --plain")));
        let output = open.write_stdin("last\nwishes\n").output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        let wish = text.lines().find_map(|line| serde_json::from_str::<serde_json::Value>(line).ok()).unwrap();
        assert_eq!(wish["failure"], record["failure"], "episode {number}: {text}");
        failed += usize::from(!record["failure"].is_null());
    }
    assert!(failed > 2, "chance hardly ever does what is asked");
}
