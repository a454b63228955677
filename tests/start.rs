//! The start page in a pseudo-terminal: what is listed, searched and opened, and the last session after the program was killed.

use std::path::Path;

use super::terminal::Session;

/// The explorer with nothing named, waiting for a key before the first step.
fn start(state: &Path, cells: (u16, u16)) -> Session {
    let data = state.join("data").display().to_string();
    let session = Session::open(state, cells, "explore", &["--graphics", "ascii", "--paused", "--data", &data]);
    session.see("Where do you want to start?");
    session
}

#[test]
fn a_house_is_found_by_a_few_letters_and_a_number() {
    let state = tempfile::tempdir().unwrap();
    let mut session = start(state.path(), (60, 20));
    session.see("house");
    session.see("ctrl-c leave");
    session.press("bdrm 7");
    session.see("seed 7");
    session.resize(100, 30);
    session.press("\r");
    session.see("bedroom-7");
    session.see("step 0");
    session.leave();
    session.is_restored();
}

#[test]
fn control_c_leaves_the_list_and_escape_opens_the_first() {
    let state = tempfile::tempdir().unwrap();
    let mut session = start(state.path(), (80, 24));
    session.press("\x03");
    assert_eq!(session.end(), 0);
    session.is_restored();
    let mut session = start(state.path(), (80, 24));
    session.press("\x1b");
    session.see("kitchen-0");
    session.leave();
}

#[test]
fn a_task_file_is_listed_and_one_that_is_broken_leaves_the_list_open() {
    let state = tempfile::tempdir().unwrap();
    let folder = state.path().join("data/tasks");
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("supper.json").display().to_string();
    let sample = ["tasks", "sample", &file, "--scenes", "generated", "--count", "2"];
    let output = assert_cmd::Command::new(env!("CARGO_BIN_EXE_sprint")).args(sample).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    std::fs::write(folder.join("torn.json"), br#"{"format_version": 1, "name": "torn", "tasks": ["#).unwrap();
    let mut session = start(state.path(), (80, 24));
    session.press("torn\r");
    session.see("cut off");
    session.press("\x15supper");
    session.see("task 1");
    session.press("\r");
    session.see("Mind");
    session.see("step 0/");
    session.leave();
}

#[test]
fn after_a_kill_the_last_session_comes_first_and_has_every_step_and_branch() {
    let state = tempfile::tempdir().unwrap();
    let arguments = ["--policy", "random", "--graphics", "ascii", "--seed", "3", "--paused"];
    let mut session = Session::open(state.path(), (120, 36), "explore", &arguments);
    session.see("Mind");
    session.see("step 0");
    for step in ["main 1/1", "main 2/2", "main 3/3"] {
        session.press("n");
        session.see(step);
    }
    session.press("0");
    session.see("main 0/3");
    session.press("m\x1b[D");
    session.see("b1 1/1");
    session.press("m");
    session.press("ifind the quince\r");
    session.see("instruction: Find the quince.");
    session.press("n");
    session.see("b1 2/2");
    // The question comes first: nothing is left by a slip.
    session.press("q");
    session.see("Not saved: 1 branch, 1 wish.");
    session.press("N");
    session.see("N again leaves");
    session.signal("-KILL");
    session.end();

    let mut session = start(state.path(), (120, 36));
    session.see("broken off");
    session.see("Find the quince.");
    session.press("\r");
    session.see("b1 2/2");
    session.see("Instruction > Find the quince.");
    session.see("2 branches");
    session.press("t");
    session.see("Side by side");
    session.press("\x1b");
    session.see("In reach");
    session.press(":branch main\r");
    session.see("main 2/3");
    session.leave();
    session.is_restored();
}

#[test]
fn two_explorers_at_once_keep_a_session_each_and_only_what_was_broken_off_is_offered() {
    let state = tempfile::tempdir().unwrap();
    let explore = |seed: &str| {
        let arguments = ["--policy", "random", "--graphics", "ascii", "--seed", seed, "--paused"];
        let mut session = Session::open(state.path(), (120, 36), "explore", &arguments);
        session.see("Mind");
        session.see("step 0");
        session.press("n");
        session.see("main 1/1");
        session
    };
    let offered = |wanted: &[&str]| {
        let mut session = start(state.path(), (120, 36));
        session.see("house");
        let text = session.text();
        let lines: Vec<&str> =
            text.lines().filter(|line| line.contains("last session") || line.contains("broken off")).collect();
        assert_eq!(lines.len(), wanted.len(), "{text}");
        assert!(lines.iter().zip(wanted).all(|(line, words)| line.contains(words)), "{text}");
        session.press("\x03");
        assert_eq!(session.end(), 0);
    };
    let (mut third, mut fourth) = (explore("3"), explore("4"));
    offered(&[]);
    third.press("n");
    third.see("main 2/2");
    fourth.signal("-KILL");
    fourth.end();
    offered(&["kitchen 4"]);
    // A link that drops.
    third.signal("-HUP");
    third.end();
    offered(&["kitchen 3", "kitchen 4"]);
    let mut again = start(state.path(), (120, 36));
    again.see("broken off");
    again.see("step 2");
    again.press("\r");
    again.see("kitchen-3");
    again.see("main 2/2");
    offered(&["kitchen 4"]);
    again.leave();
    offered(&["kitchen 3", "kitchen 4"]);
    let mut again = start(state.path(), (120, 36));
    again.press("\x1b[B\r");
    again.see("kitchen-4");
    again.see("main 1/1");
    again.leave();
}

#[test]
fn the_list_is_one_key_away_from_the_explorer_and_opens_another_house() {
    let state = tempfile::tempdir().unwrap();
    let arguments = ["--policy", "random", "--graphics", "ascii", "--seed", "3", "--paused"];
    let mut session = Session::open(state.path(), (80, 24), "explore", &arguments);
    session.see("Mind");
    session.see("step 0");
    session.press("n");
    session.see("main 1/1");
    session.press("H");
    session.see("Where do you want to start?");
    session.see("last session");
    session.press("bthrm 4\r");
    session.see("bathroom-4");
    session.see("main 0/0");
    session.press(":start\r");
    session.see("Where do you want to start?");
    session.press("kitchen 3\r");
    session.see("kitchen-3");
    session.press("n");
    session.see("main 1/1");
    session.leave();
    session.is_restored();
}

#[test]
fn a_wish_for_this_house_is_one_key_away() {
    let state = tempfile::tempdir().unwrap();
    let arguments = ["--policy", "expert", "--graphics", "ascii", "--seed", "7", "--paused"];
    let mut session = Session::open(state.path(), (80, 24), "explore", &arguments);
    session.see("Mind");
    session.see("step 0");
    session.press("w");
    session.see("Wishes for this house");
    session.press("\r");
    session.see("enter tell the agent");
    session.press("\r");
    session.see("understood");
    session.leave();
}

#[test]
fn a_checkpoint_is_named_as_the_list_names_it() {
    let ended = |name: &str| {
        let mut command = assert_cmd::Command::cargo_bin("sprint").unwrap();
        command.args(["explore", "--plain", "--checkpoint", name]).write_stdin("quit\n").output().unwrap()
    };
    if crate::program::encoder_home().is_none() {
        return;
    }
    let output = ended("alfred");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(!ended("no-such-checkpoint").status.success());
}
