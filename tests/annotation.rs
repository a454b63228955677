//! Annotation in a pseudo-terminal: a person writes, skips, goes back, leaves and goes on later, and loses no more to a kill than the
//! sentence that is being typed.

use std::path::Path;

use super::program::Sprint;
use super::terminal::Session;

const BACK: &str = "\x1b[5~";
const SKIP: &str = "\x13";
const LEAVE: &str = "\x03";

/// Some demonstrations of three skills each.
fn houses(sprint: &Sprint) -> String {
    let ended = sprint.run("collect houses --episodes 3 --seed 3 --lengths 3 --annotations 2 --noise 0");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    sprint.path("houses").display().to_string()
}

fn sit_down(state: &Path, cells: (u16, u16), houses: &str, person: &str, more: &[&str]) -> Session {
    let arguments = [&[houses, "--as", person, "--length", "2-3", "--count", "5"], more].concat();
    let session = Session::open(state, cells, "annotate", &arguments);
    session.see("Sentence >");
    session
}

#[test]
fn a_person_writes_two_skips_goes_back_leaves_and_goes_on_later() {
    let (sprint, state) = (Sprint::new(), tempfile::tempdir().unwrap());
    let houses = houses(&sprint);
    let mut session = sit_down(state.path(), (80, 24), &houses, "ann", &["--graphics", "halfblocks"]);
    session.see("1 of 5");
    session.see("What is done here");
    session.see("frame");
    session.press("Get the first one done.\r");
    session.see("2 of 5, 1 written, 0 skipped");
    session.press("\r");
    session.see("type one sentence");
    session.press("And the second.\r");
    session.see("3 of 5, 2 written");
    session.press(SKIP);
    session.see("4 of 5, 2 written, 1 skipped");
    session.press(BACK);
    session.see("you skipped this one");
    session.press(BACK);
    session.see("Sentence > And the second.");
    session.press(" Or better.\r");
    session.see("3 of 5, 2 written, 1 skipped");
    session.press("Half a sent");
    session.see("Half a sent");
    session.press(LEAVE);
    assert_eq!(session.end(), 0);
    session.is_restored();

    let mut session = sit_down(state.path(), (60, 20), &houses, "ann", &["--graphics", "ascii"]);
    session.see("4 of 5, 2 written, 1 skipped");
    session.press("Third.\r");
    session.see("5 of 5");
    session.press("Fourth.\r");
    session.see("That was all: 4 written, 1 skipped.");
    session.press("\r");
    assert_eq!(session.end(), 0);
    session.is_restored();

    let kept = std::fs::read_to_string(sprint.path("houses/annotations/ann.jsonl")).unwrap();
    assert_eq!(kept.lines().count(), 1 + 6, "a header, five answers and a correction:\n{kept}");
    assert!(kept.contains("And the second.\"") && kept.contains("And the second. Or better."));

    let said = sprint.run("annotate houses --as bob --length 2-3 --count 5 --plain");
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(said.stdout.contains("1 of 5:") && said.stdout.contains("0 written"), "{}", said.stdout);
    let told = sprint.run("annotate houses --agreement");
    assert!(told.stdout.contains("ann: 4 written, 1 skipped"), "{}", told.stdout);
    let labels = sprint.run("annotate houses --labels");
    assert!(labels.stderr.contains("4 labels, 4 of them new"), "{}", labels.stderr);
    assert_eq!(sprint.read("houses/labels.jsonl").matches("\"source\":\"people\"").count(), 4);
    assert_eq!(sprint.run("annotate houses --tasks people.json").code, Some(0));
    let shown = sprint.run("tasks show people.json");
    assert!(shown.stdout.contains("Get the first one done."), "{}", shown.stdout);
    let solved = sprint.run("tasks check people.json --jobs 1");
    assert!(solved.stdout.contains("4 tasks"), "{}{}", solved.stdout, solved.stderr);
    assert_ne!(sprint.run("annotate houses --tasks people.json").code, Some(0), "nothing is written over unasked");
}

#[test]
fn a_kill_takes_no_more_than_the_sentence_that_is_being_typed() {
    let (sprint, state) = (Sprint::new(), tempfile::tempdir().unwrap());
    let houses = houses(&sprint);
    for (number, protocol) in (1..).zip(["ascii", "kitty", "iterm2", "sixel"]) {
        let place = format!("{number} of 5");
        let mut session = sit_down(state.path(), (80, 24), &houses, "ann", &["--graphics", protocol, "--paused"]);
        session.see(&place);
        session.press(&format!("Sentence number {number}.\r"));
        session.see("kept: ");
        session.press("Never to be seen");
        session.see("Never to be seen");
        session.signal("-KILL");
        session.end();
    }
    let kept = sprint.read("houses/annotations/ann.jsonl");
    assert_eq!(kept.lines().count(), 1 + 4, "{kept}");
    assert!(!kept.contains("Never"), "{kept}");
}

#[test]
fn two_people_sit_at_once_one_person_only_once_and_both_are_held_against_each_other() {
    let (sprint, state) = (Sprint::new(), tempfile::tempdir().unwrap());
    let houses = houses(&sprint);
    let mut ann = sit_down(state.path(), (80, 24), &houses, "ann", &["--paused"]);
    let mut bob = sit_down(state.path(), (80, 24), &houses, "bob", &["--paused"]);
    let again = sprint.run("annotate houses --as ann --plain");
    assert!(again.stderr.contains("another process"), "{}", again.stderr);
    ann.press("Tidy the things up.\r");
    ann.see("2 of 5");
    bob.press("Tidy things up.\r");
    bob.see("2 of 5");
    bob.press("\x1b[12~");
    bob.see("ann and bob: 1 in common");
    bob.press(" ");
    bob.miss("in common");
    for session in [&mut ann, &mut bob] {
        session.press(LEAVE);
        assert_eq!(session.end(), 0);
    }
    let told = sprint.run("annotate houses --agreement --json");
    let told: serde_json::Value = serde_json::from_str(&told.stdout).unwrap();
    assert!(told["pairs"][0]["words"].as_f64().unwrap() > 0.8, "{told}");
    for (line, says) in [
        ("annotate houses --as ../ann --plain", "no annotator's name"),
        ("annotate houses --as ann --split valid --plain", "no split"),
        ("annotate houses --as ann --length 9 --plain", "no span"),
        ("annotate houses --as ann", "needs a terminal"),
        ("annotate nowhere --agreement", "is no dataset"),
    ] {
        let ended = sprint.run(line);
        assert!(ended.code == Some(1) && ended.stderr.contains(says), "{line}: {}", ended.stderr);
    }
}
