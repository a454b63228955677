//! Runs of policy servers and exported policies, verified and opened again: the policy is found, or a sentence says what to type.

#[path = "../src/agent/exported/testing.rs"]
mod models;

use std::path::Path;

use models::{always, onnx};

use crate::policy_server::Server;
use crate::program::{Ended, Sprint};
use crate::terminal::Session;

/// Writes a policy that turns left whatever it sees.
fn export(path: &Path) {
    std::fs::write(path, onnx(&always(1), "frames", &[1, 3, 2, 2])).unwrap();
    let spec = r#"{"format_version": 1, "frames": {"height": 2, "width": 2},
        "actions": ["LookDown", "RotateLeft", "MoveAhead"]}"#;
    std::fs::write(path.with_extension("json"), spec).unwrap();
}

fn sampled() -> Sprint {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 2);
    sprint
}

/// Every step was chosen again.
fn is_chosen_again(verified: &Ended) -> bool {
    let first = verified.stdout.lines().next().unwrap_or_default();
    let numbers: Vec<&str> = first.split(|c: char| !c.is_ascii_digit()).filter(|part| !part.is_empty()).collect();
    verified.code == Some(0) && numbers.len() == 3 && numbers[1] == numbers[2] && numbers[1] != "0"
}

/// What `open` says to a script.
fn opened(sprint: &Sprint, line: &str, verbs: &str) -> String {
    std::fs::write(sprint.path("verbs"), verbs).unwrap();
    let input = std::fs::File::open(sprint.path("verbs")).unwrap();
    let ended = sprint.command(&format!("open --plain {line}")).stdin(input).output().unwrap();
    String::from_utf8(ended.stdout).unwrap() + &String::from_utf8(ended.stderr).unwrap()
}

#[test]
fn an_exported_policy_is_found_by_its_file_and_digest() {
    let sprint = sampled();
    export(&sprint.path("left.onnx"));
    let evaluated = sprint.run("eval --tasks tasks.json --policy onnx:left.onnx --out run");
    assert_eq!(evaluated.code, Some(0), "{}", evaluated.stderr);
    let verified = sprint.run("verify run");
    assert!(is_chosen_again(&verified), "{}{}", verified.stdout, verified.stderr);
    let said = opened(&sprint, "run#1:3", "step 2\nsave again\nquit\n");
    assert!(said.contains("step 4: RotateLeft") && said.contains("step 5: RotateLeft"), "{said}");
    let verified = sprint.run("verify again");
    assert!(is_chosen_again(&verified), "{}{}", verified.stdout, verified.stderr);

    std::fs::rename(sprint.path("left.onnx"), sprint.path("moved.onnx")).unwrap();
    std::fs::rename(sprint.path("left.json"), sprint.path("moved.json")).unwrap();
    let gone = sprint.run("verify run");
    assert_eq!(gone.code, Some(0), "what the actions came to is compared");
    let sentence = "left.onnx: the run's policy is gone: name it with --policy onnx:FILE";
    assert!(gone.stderr.contains(sentence), "{}", gone.stderr);
    assert!(gone.stdout.contains("\"onnx:left\" is not at hand"), "{}", gone.stdout);
    assert!(opened(&sprint, "run#1", "step\nquit\n").contains(sentence));
    let verified = sprint.run("verify run --policy onnx:moved.onnx");
    assert!(is_chosen_again(&verified), "{}{}", verified.stdout, verified.stderr);

    std::fs::write(sprint.path("moved.onnx"), onnx(&always(2), "frames", &[1, 3, 2, 2])).unwrap();
    let other = sprint.run("verify run --policy onnx:moved.onnx");
    assert_eq!(other.code, Some(1), "it was named");
    assert!(other.stderr.contains("moved.onnx: not the policy that the run was made with"), "{}", other.stderr);
    let own = sprint.run("eval --tasks tasks.json --policy random --out chance");
    assert_eq!(own.code, Some(0), "{}", own.stderr);
    assert!(!sprint.path("chance/policies.json").exists());
    let refused = sprint.run("verify chance --policy onnx:moved.onnx");
    assert_eq!(refused.code, Some(1));
    assert!(refused.stderr.contains("this run's policy was random: leave it out"), "{}", refused.stderr);
}

#[test]
fn a_policy_server_is_found_where_it_was_or_where_it_is_named() {
    let sprint = sampled();
    let server = Server::bind(0);
    let port = server.port;
    server.serve(usize::MAX);
    let evaluated = sprint.run(&format!("eval --tasks tasks.json --policy ws:127.0.0.1:{port} --out run"));
    assert_eq!(evaluated.code, Some(0), "{}", evaluated.stderr);
    let verified = sprint.run("verify run");
    assert!(is_chosen_again(&verified), "{}{}", verified.stdout, verified.stderr);
    let said = opened(&sprint, "run#1:3", "step\nsave again\nquit\n");
    assert!(said.contains("step 4: MoveAhead"), "{said}");

    // The run says where a server was that is no longer there.
    let nobody = Server::bind(0).port;
    for run in ["run", "again"] {
        let places = sprint.read(&format!("{run}/policies.json"));
        assert!(places.contains(&format!("ws://127.0.0.1:{port}")), "{places}");
        let moved = places.replace(&port.to_string(), &nobody.to_string());
        std::fs::write(sprint.path(&format!("{run}/policies.json")), moved).unwrap();
    }
    let sentence =
        format!("no policy server answers at ws://127.0.0.1:{nobody}: start it, or name another with --policy");
    let down = sprint.run("verify run");
    assert_eq!(down.code, Some(0), "what the actions came to is compared");
    assert!(down.stderr.contains(&sentence) && down.stdout.contains("\"ws:walker\" is not at hand"), "{}", down.stderr);
    assert!(opened(&sprint, "run#1", "step\nquit\n").contains(&sentence));
    for run in ["run", "again"] {
        let verified = sprint.run(&format!("verify {run} --policy ws:127.0.0.1:{port}"));
        assert!(is_chosen_again(&verified), "{}{}", verified.stdout, verified.stderr);
    }

    let other = Server::bind(0);
    let port = other.port;
    other.serve_as("runner", usize::MAX);
    let refused = sprint.run(&format!("verify run --policy ws:127.0.0.1:{port}"));
    assert_eq!(refused.code, Some(1));
    assert!(
        refused.stderr.contains("this policy is ws:runner, the run's ws:walker: start that one"),
        "{}",
        refused.stderr
    );
    std::fs::remove_file(sprint.path("run/policies.json")).unwrap();
    let unknown = sprint.run("verify run");
    let sentence = "the run does not say where its policy ws:walker was: name it with --policy ws:HOST:PORT";
    assert!(unknown.stderr.contains(sentence), "{}", unknown.stderr);
}

#[test]
fn a_session_that_is_taken_up_goes_on_with_its_exported_policy() {
    let state = tempfile::tempdir().unwrap();
    let file = state.path().join("left.onnx");
    export(&file);
    let policy = format!("onnx:{}", file.display());
    let arguments = ["--policy", &policy, "--graphics", "ascii", "--seed", "3", "--paused"];
    let mut session = Session::open(state.path(), (120, 36), "explore", &arguments);
    session.see("step 0");
    session.see("Mind");
    session.press("n");
    session.see("main 1/1");
    session.signal("-KILL");
    session.end();

    let mut session = Session::open(state.path(), (120, 36), "explore", &["--graphics", "ascii", "--paused"]);
    session.see("broken off");
    session.press("\r");
    session.see("main 1/1");
    session.press("nnn");
    session.see("main 4/4");
    session.press("L");
    session.see("4 RotateLeft");
    session.leave();
}
