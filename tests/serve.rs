//! House served to other programs: the real program, and a client in Python that needs nothing but its standard library.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Stdio};

use serde_json::Value;

use crate::program::Sprint;

/// The program as it serves; killed when it is dropped.
struct Served {
    child: Child,
    input: Option<ChildStdin>,
    start: Value,
}

impl Served {
    fn start(sprint: &Sprint, options: &str) -> Served {
        let mut command = sprint.command(&format!("serve {options}"));
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let input = child.stdin.take();
        Served { child, input, start: serde_json::from_str(&line).unwrap() }
    }

    fn socket(&self) -> PathBuf {
        self.start["socket"].as_str().unwrap().into()
    }

    /// Plays an episode from Python, over both protocols at once.
    fn play(&self) -> Value {
        let client = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/serve_client.py");
        let mut command = std::process::Command::new("python3");
        let played = command.arg("-B").arg(client).arg(self.start["url"].as_str().unwrap()).arg(self.socket());
        let played = played.output().unwrap();
        assert!(played.status.success(), "{}", String::from_utf8_lossy(&played.stderr));
        serde_json::from_slice(&played.stdout).unwrap()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn an_episode_is_played_from_python_over_both_protocols_alike() {
    let sprint = Sprint::new();
    let mut served = Served::start(&sprint, "--rooms bathroom,kitchen --length 3 --size 64");
    assert_eq!((&served.start["protocol"], &served.start["version"]), (&"openenv".into(), &1.into()));
    let played = served.play();
    assert_eq!(played["health"], "healthy");
    assert!(played["steps"].as_u64().unwrap() > 5 && played["interactions"].as_u64().unwrap() > 0, "{played}");
    assert_ne!(played["over"][0], played["over"][1], "{played}");
    let socket = served.socket();
    assert!(socket.exists());
    // It learns by its standard input that whoever started it is gone.
    served.input = None;
    assert_eq!(served.child.wait().unwrap().code(), Some(0));
    assert!(!socket.exists());
}

#[test]
fn the_tasks_of_a_file_are_served_with_their_grader() {
    let sprint = Sprint::new();
    let sampled =
        sprint.run("tasks sample tasks.json --scenes generated --rooms bedroom --count 4 --length 2 --seed 5");
    assert_eq!(sampled.code, Some(0), "{}", sampled.stderr);
    let tasks: Value = serde_json::from_str(&sprint.read("tasks.json")).unwrap();
    let played = Served::start(&sprint, "--tasks tasks.json --size 32").play();
    assert_eq!(played["mission"], tasks["tasks"][3]["instruction"], "the seed counts through the tasks");
}

#[test]
fn what_cannot_be_served_is_said_before_anybody_connects() {
    let sprint = Sprint::new();
    for (options, part) in [
        ("--tasks nothing.json", "nothing.json"),
        ("--tasks nothing.json --rooms kitchen", "cannot be used with"),
        ("--host nowhere.invalid", "cannot listen at nowhere.invalid:0"),
    ] {
        let ended = sprint.run(&format!("serve {options}"));
        assert!(ended.code != Some(0) && ended.stderr.contains(part), "{options}: {}", ended.stderr);
        assert_eq!(ended.stdout, "");
    }
}
