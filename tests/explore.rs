//! The explorer in a pseudo-terminal: typing, time travel, signals, and a terminal that is left as it was found.

use super::terminal::Session;
use crate::program::encoder_home;

#[test]
fn an_instruction_is_typed_applied_and_stepped_and_the_terminal_is_given_back() {
    let mut session = Session::start(&["--policy", "random", "--graphics", "halfblocks", "--seed", "3", "--paused"]);
    session.see("Mind");
    session.see("step 0");
    assert!(session.is_taken());
    session.press("i");
    session.press("pick up the quince");
    session.see("now: ");
    session.press("\r");
    session.see("instruction: Pick up the quince.");
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
    session.leave();
    session.is_restored();
}

#[test]
fn without_options_the_agent_with_a_memory_acts_and_its_critic_is_shown_as_another_ones_is() {
    if encoder_home().is_none() {
        return;
    }
    let mut session = Session::start(&["--room", "kitchen"]);
    session.see("· sprint-memory");
    session.see("running");
    session.press(" M");
    session.see("agent · V 0.");
    session.see("advantage");
    session.press(":checkpoint alfred\r");
    session.see("alfred acts");
    session.see("by probability");
    session.miss("this checkpoint");
    session.leave();
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
    session.leave();

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
    for at in 0u16..120 {
        session.resize(1 + at * 37 % 211, 1 + at * 13 % 67);
    }
    for (cols, rows) in [(80, 24), (30, 10), (200, 60), (100, 30), (1, 1), (120, 36)] {
        session.resize(cols, rows);
    }
    // A screen that is too small takes no keys: it has to be large again first.
    session.see("esc leave");
    session.press("\x1b");
    session.see("space run");
    session.press("n");
    session.see("main 1/1");
    session.leave();
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
fn a_script_is_told_that_its_agent_cannot_be_loaded() {
    let script = |agent: &str| {
        let mut command = assert_cmd::Command::cargo_bin("sprint").unwrap();
        command.args(["explore", "--plain", "--checkpoint", agent]).write_stdin("quit\n").output().unwrap()
    };
    let ended = script("nowhere");
    let said = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(1), "{said}");
    assert!(said.contains("nowhere holds no checkpoint"), "{said}");
}

#[test]
fn plain_mode_takes_verbs_and_prints_a_line_a_step_without_escape_codes() {
    let verbs = "look\ncandidates\ninstruct find the quince\nstep 3\ndo RotateLeft\ndo 99\ndance\nreset\nquit\n";
    let output = assert_cmd::Command::new(env!("CARGO_BIN_EXE_sprint"))
        .args(["explore", "--plain", "--policy", "random", "--seed", "3"])
        .write_stdin(verbs)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(3), "two of its lines could not be obeyed");
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(!text.contains('\x1b') && !text.contains(", ,"), "{text}");
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
