//! The small commands, through the real binary.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The program with a home of its own, so that a test neither reads nor writes the user's.
fn sprint(home: &Path) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("sprint"));
    command.env("SPRINT_HOME", home).env("XDG_STATE_HOME", home).current_dir(home);
    command
}

fn tiny_encoder() -> Option<PathBuf> {
    super::needed::shared("fixtures/tiny-mpnet")
}

#[test]
fn doctor_names_what_is_missing_with_the_remedy_and_exits_1() {
    let home = tempfile::tempdir().unwrap();
    let output = sprint(home.path()).args(["doctor", "--json"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["ok"], false);
    assert_eq!(report["libtorch"]["ok"], true);
    assert_eq!(report["encoder"]["ok"], false);
    assert!(report["encoder"]["remedy"].as_str().unwrap().contains("make setup"));
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(error.starts_with("error: ") && error.contains("encoder"), "{error}");
    let plain = sprint(home.path()).arg("doctor").output().unwrap();
    let plain = String::from_utf8(plain.stdout).unwrap();
    assert!(plain.contains("MISS encoder") && plain.contains("remedy: run `make setup`"), "{plain}");
}

#[test]
fn embed_answers_each_line_without_waiting_for_the_end_of_the_input() {
    let Some(encoder) = tiny_encoder() else { return };
    let home = tempfile::tempdir().unwrap();
    let mut program = sprint(home.path())
        .args(["embed", "--encoder"])
        .arg(encoder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = program.stdin.take().unwrap();
    let mut answers = BufReader::new(program.stdout.take().unwrap()).lines();
    let mut answer = || -> Vec<f32> { serde_json::from_str(&answers.next().unwrap().unwrap()).unwrap() };
    input.write_all(b"pick up the mug\r\n").unwrap();
    let mug = answer();
    assert_eq!(mug.len(), 32);
    input.write_all(b"\npick up the mug").unwrap();
    drop(input);
    assert_ne!(answer(), mug, "the empty line is a sentence, too");
    let again = answer();
    assert!(again.iter().zip(&mug).all(|(a, b)| (a - b).abs() < 1e-5), "the last line needs no end");
    assert!(program.wait().unwrap().success());
}

#[test]
fn embed_refuses_a_line_that_is_not_text_and_a_folder_that_is_not_there() {
    let Some(encoder) = tiny_encoder() else { return };
    let home = tempfile::tempdir().unwrap();
    let mut command = sprint(home.path());
    command
        .args(["embed", "--encoder"])
        .arg(encoder)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    let mut program = command.spawn().unwrap();
    program.stdin.take().unwrap().write_all(b"mug\n\xff\xfe\n").unwrap();
    let output = program.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("line 2 is not UTF-8"));
    let output = sprint(home.path()).args(["embed", "--encoder", "nowhere"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("nowhere is not there"));
}

#[test]
fn a_number_that_nothing_can_be_done_with_is_refused_before_anything_is_written() {
    let home = tempfile::tempdir().unwrap();
    for line in [
        "collect out --episodes 0",
        "collect out --episodes 18446744073709551615",
        "collect out --annotations 18446744073709551615",
        "collect out --noise nan",
        "pretrain none --preset l-bc --out out --parts 0",
        "pretrain none --preset l-bc --out out --parts 18446744073709551615",
        "relabel none --with rules --sample 0",
        "eval --tasks none --policy random --out out --seeds 0",
    ] {
        let output = sprint(home.path()).args(line.split(' ')).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(matches!(output.status.code(), Some(1 | 2)) && !said.contains("panicked"), "{line}: {said}");
        let number = line.rsplit(' ').next().unwrap().to_lowercase();
        assert!(said.to_lowercase().contains(&number), "{line}: {said}");
        assert!(!home.path().join("out").exists(), "{line}");
    }
}

#[test]
fn standard_output_that_takes_nothing_is_named() {
    let home = tempfile::tempdir().unwrap();
    for line in ["man", "completions bash", "schema tasks", "doctor", "explore --print-config"] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = sprint(home.path()).args(line.split(' ')).stdout(full).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{line}: {said}");
        assert!(said.contains("cannot write to standard output"), "{line}: {said}");
    }
}

#[test]
fn shells_and_man_get_their_pages() {
    let home = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish"] {
        let output = sprint(home.path()).args(["completions", shell]).output().unwrap();
        assert!(output.status.success() && String::from_utf8_lossy(&output.stdout).contains("doctor"), "{shell}");
    }
    let output = sprint(home.path()).arg("man").output().unwrap();
    let page = String::from_utf8(output.stdout).unwrap();
    assert!(page.contains(".TH sprint 1") && page.contains(".TH sprint-doctor 1"), "{page}");
}
