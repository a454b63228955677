//! Terminals with habits: slow ones, ones whose answers come in pieces, and a shell that stops the explorer and lets it go on.

use std::time::Duration;

use super::terminal::Session;

const RANDOM: [&str; 7] = ["--policy", "random", "--graphics", "halfblocks", "--seed", "3", "--paused"];
const QUESTION: &str = "\x1b[5n";
const ANSWER: &str = "\x1b[0n";

fn random() -> Session {
    let session = Session::start(&RANDOM);
    session.see("Mind");
    session.see("step 0");
    session
}

/// Answers until nothing is asked any more.
fn answer_all(session: &mut Session) {
    let mut answered = 0;
    let mut quiet = 0;
    while quiet < 10 {
        let asked = session.times_written(QUESTION);
        quiet = if asked > answered { 0 } else { quiet + 1 };
        for _ in answered..asked {
            session.press(ANSWER);
        }
        answered = answered.max(asked);
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn a_frame_is_sent_only_when_the_terminal_has_taken_in_the_one_before() {
    let mut session = random();
    session.wait("question", |session| session.times_written(QUESTION) > 0);
    answer_all(&mut session);
    let before = session.times_written("\x1b[?2026h");
    for _ in 0..6 {
        session.press("n");
        std::thread::sleep(Duration::from_millis(200));
    }
    assert!(session.times_written("\x1b[?2026h") <= before + 1, "one frame is on its way");
    assert!(!session.text().contains("main 6/6"));
    answer_all(&mut session);
    session.see("main 6/6");
    session.press("q");
    assert_eq!(session.end(), 0);
    session.is_restored();
}

#[test]
fn it_stops_and_goes_on_as_the_shell_says() {
    for by_signal in [false, true] {
        let mut session = random();
        if by_signal {
            session.signal("-TSTP");
        } else {
            session.press("\x1a");
        }
        session.wait("stop", Session::is_stopped);
        session.is_restored();
        assert!(session.takes_lines(), "the shell gets the terminal as it was");
        session.reset_modes();
        session.signal("-CONT");
        session.wait("alternate screen", Session::is_taken);
        session.see("step 0");
        session.see("Mind");
        session.press("n");
        session.see("main 1/1");
        session.press("q");
        assert_eq!(session.end(), 0);
        session.is_restored();
    }
}

#[test]
fn a_shell_that_took_the_terminal_without_asking_gives_it_back_too() {
    let mut session = random();
    session.signal("-STOP");
    session.wait("stop", Session::is_stopped);
    session.reset_modes();
    session.signal("-CONT");
    session.press("n");
    session.see("main 1/1");
    session.press("q");
    assert_eq!(session.end(), 0);
    session.is_restored();
}

#[test]
fn quitting_by_signal_and_aborting_restore_the_terminal() {
    for name in ["-QUIT", "-ABRT"] {
        let mut session = random();
        assert!(!session.takes_lines());
        session.signal(name);
        assert_ne!(session.end(), 0, "{name}");
        session.is_restored();
        assert!(session.takes_lines(), "{name}");
    }
}

#[test]
fn an_answer_in_two_pieces_is_no_key_and_keys_before_it_are_kept() {
    let state = tempfile::tempdir().unwrap();
    let arguments = ["--policy", "random", "--seed", "3", "--paused"];
    let mut session = Session::open(state.path(), (80, 24), "explore", &arguments);
    session.wait("question", |session| session.times_written("\x1b[c") > 0);
    session.press("n\x1b[?62;1;");
    std::thread::sleep(Duration::from_millis(1200));
    session.press("4;22c");
    session.see("main 1/1");
    session.press("n");
    session.see("main 2/2");
    assert!(session.text().contains("paused"), "{}", session.text());
    assert!(!session.text().contains("no interaction"), "{}", session.text());
    session.press("q");
    assert_eq!(session.end(), 0);
    session.is_restored();
}

#[test]
fn a_small_screen_shows_everything_a_smaller_one_the_frame_and_a_tiny_one_waits() {
    let state = tempfile::tempdir().unwrap();
    let arguments = ["--policy", "random", "--graphics", "halfblocks", "--seed", "3"];
    let mut session = Session::open(state.path(), (60, 20), "explore", &arguments);
    for panel in ["Mind", "In reach", "Task", "Log", "Map", "Instruction >", "running"] {
        session.see(panel);
    }
    // A pane of a terminal that tmux has split.
    session.resize(40, 23);
    session.miss("Mind");
    session.see("Instruction >");
    session.resize(20, 5);
    session.see("This terminal is too");
    session.press(" n");
    session.resize(80, 23);
    session.see("paused");
    session.see("Mind");
    session.press("f");
    session.miss("Mind");
    session.press("f");
    session.see("Mind");
    session.press("q");
    assert_eq!(session.end(), 0);
    session.is_restored();
}
