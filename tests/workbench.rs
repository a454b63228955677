//! The explorer's workbench in a pseudo-terminal: forks, comparisons, chains, value maps, and a terminal with habits of its own.

use std::path::Path;

use super::terminal::Session;
use crate::program::encoder_home;

const RANDOM: [&str; 7] = ["--policy", "random", "--graphics", "halfblocks", "--seed", "3", "--paused"];

/// The explorer in a kitchen with a task of two subtasks, chance deciding.
fn random() -> Session {
    let session = Session::start(&RANDOM);
    session.see("Mind");
    session.see("step 0");
    session
}

fn leave(mut session: Session) {
    session.leave();
    session.is_restored();
}

#[test]
fn another_instruction_seed_and_policy_fork_and_the_tree_says_why() {
    let mut session = random();
    for step in ["main 1/1", "main 2/2", "main 3/3"] {
        session.press("n");
        session.see(step);
    }
    session.press("hh");
    session.see("main 1/3");
    session.press("iopen the fridge\r");
    session.see("instruction: Open the fridge.");
    session.press("n");
    session.see("b1 2/2");
    session.press(":branch main\r");
    session.see("main 2/3");
    session.press("h:sample 99\r");
    session.see("main 1/3");
    session.press("n");
    session.see("b2 2/2");
    session.press(":branch main\r");
    session.see("main 2/3");
    session.press("he");
    session.see("expert acts");
    session.press("n");
    session.see("b3 2/2");
    session.press("t");
    session.see("4 in all");
    session.see("instruction: Open the fridge.");
    session.see("random, drawn with seed 99 acts");
    // Both frames stand beside the steps, each under its branch and step.
    session.press("k");
    session.see("the same until step 1");
    session.see("b3 2");
    session.miss("drawing ...");
    leave(session);
}

#[test]
fn another_checkpoint_forks_too() {
    if encoder_home().is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let clone = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/agents/clone");
    let second = folder.path().join("second");
    std::fs::create_dir(&second).unwrap();
    for file in ["config.json", "model.safetensors"] {
        std::fs::copy(clone.join(file), second.join(file)).unwrap();
    }
    let path = second.display().to_string();
    let mut session = Session::start(&["--checkpoint", &path, "--graphics", "ascii", "--seed", "3", "--paused"]);
    session.see("second acts");
    session.see("entropy");
    for step in ["main 1/1", "main 2/2"] {
        session.press("n");
        session.see(step);
    }
    session.press("h:checkpoint alfred\r");
    session.see("alfred acts");
    session.press("n");
    session.see("b1 2/2");
    session.press("t");
    session.see("alfred acts");
    session.press(":checkpoint second\r");
    session.see("second acts");
    session.press("M");
    session.see("this checkpoint has no critic");
    session.see("tokens");
    leave(session);
}

#[test]
fn two_instructions_are_compared_and_the_other_one_adopted() {
    let mut session = random();
    session.press("B");
    session.see("Press enter and type another instruction");
    session.press("\ropen the fridge\r");
    session.see("A against B");
    session.see("Open the fridge.");
    session.see("bits");
    session.press("s");
    session.see("Instruction > Open the fridge.");
    leave(session);
}

#[test]
fn a_chain_is_followed_its_links_replayed_and_one_alone() {
    let mut session = random();
    session.press("C");
    session.see("A chain is a list of instructions");
    session.press("\r\r");
    session.see("by link");
    session.see("no critic: p of what was done");
    session.see("entry   cell");
    session.press(":links 1\r");
    session.see("/1 ");
    session.see("breaks");
    session.press("j");
    session.see("Link 2");
    session.press("k:link 1 2\r");
    session.see("/2 ");
    session.miss("plays of links");
    // Another agent follows the same chain beside it; the one that acts does so already.
    session.press("A");
    session.see(": against");
    session.press("expert\r");
    session.see("Heat, expert");
    session.see("Heat, random");
    session.press(":against random\r");
    session.see("random acts already");
    leave(session);
}

#[test]
fn values_are_painted_by_heading_cancelled_and_cached() {
    let mut session = random();
    session.press("W");
    session.see("Things");
    session.press("V");
    session.see("values ");
    session.see("best heading");
    // Cancelled half-way, begun again, and then to the end.
    session.press("V");
    session.miss("best heading");
    session.miss("values ");
    session.press("V");
    session.see("values ");
    session.miss("values ");
    session.see("best heading");
    session.press("v");
    session.see("north:");
    session.press("V");
    session.miss("north:");
    session.press("V");
    session.see("north:");
    assert!(!session.text().contains("values "), "what was computed is shown at once:\n{}", session.text());
    leave(session);
}

#[test]
fn a_terminal_that_never_answers_is_asked_once_and_a_late_answer_is_no_text() {
    let state = tempfile::tempdir().unwrap();
    let arguments = ["--policy", "random", "--seed", "3", "--paused"];
    let mut session = Session::open(state.path(), (80, 24), "explore", &arguments);
    session.see("Mind");
    session.see("step 0");
    assert!(session.has_written("\x1b[c"), "the terminal is asked what it is");
    session.press("i");
    session.see("now: ");
    session.press("\x1b[?62;4;22c");
    session.press("take the mug");
    session.see("Instruction > take the mug");
    session.press("\r");
    session.see("Instruction > Take the mug.");
    leave(session);
    let session = Session::open(state.path(), (80, 24), "explore", &arguments);
    session.see("Mind");
    session.see("step 0");
    assert!(!session.has_written("\x1b[c"), "and is not asked again");
    leave(session);
}

#[test]
fn a_newcomer_is_greeted_once_and_instructions_are_remembered() {
    let state = tempfile::tempdir().unwrap();
    let mut session = Session::open(state.path(), (120, 36), "explore", &RANDOM);
    session.see("New here?");
    session.press("i");
    session.see("now: ");
    session.press("find the quince\r");
    session.see("instruction: Find the quince.");
    session.miss("New here?");
    leave(session);
    let mut session = Session::open(state.path(), (120, 36), "explore", &RANDOM);
    session.see("space run");
    assert!(!session.text().contains("New here?"));
    session.press("ifind");
    session.see("Tab completes");
    session.press("\t");
    session.see("Instruction > Find the quince.");
    session.press("\x1b");
    session.see("space run");
    leave(session);
    // A history that is broken costs the history only.
    std::fs::write(state.path().join("sprint/history"), b"\xff\xfe\x00\nTake the mug.\n").unwrap();
    let mut session = Session::open(state.path(), (120, 36), "explore", &RANDOM);
    session.see("step 0");
    session.press("itake the m");
    session.see("Take the mug.");
    session.press("\x1b");
    session.see("space run");
    leave(session);
}

#[test]
fn the_mouse_is_heard_only_where_it_is_asked_for() {
    let state = tempfile::tempdir().unwrap();
    let mut session = Session::open(state.path(), (120, 36), "explore", &RANDOM);
    session.see("step 0");
    assert!(!session.has_written("\x1b[?1000h"));
    session.press(":mouse\r");
    session.see("the mouse is heard");
    assert!(session.has_written("\x1b[?1000h"));
    leave(session);
    std::fs::create_dir_all(state.path().join("sprint")).unwrap();
    std::fs::write(state.path().join("sprint/explorer.toml"), "format_version = 1\nmouse = true\n").unwrap();
    let mut session = Session::open(state.path(), (120, 36), "explore", &RANDOM);
    session.see("step 0");
    for step in ["main 1/1", "main 2/2"] {
        session.press("n");
        session.see(step);
    }
    // The wheel goes back, a click on the strip to a step of it, a click in the picture to the thing that is seen there.
    session.press("\x1b[<64;10;10M");
    session.see("main 1/2");
    session.press("\x1b[<65;10;10M");
    session.see("main 2/2");
    session.press("\x1b[<0;15;33M");
    session.see("main 0/2");
    leave(session);
}

#[test]
fn the_step_is_copied_through_the_terminal_and_the_budget_holds_from_the_start() {
    let arguments = [RANDOM.as_slice(), &["--bandwidth", "1"]].concat();
    let mut session = Session::start(&arguments);
    session.see("step 0");
    session.press("n");
    session.see("main 1/1");
    session.press("y");
    session.see("copied");
    assert!(session.has_written("\x1b]52;c;"));
    leave(session);
}
