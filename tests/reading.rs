//! `sprint read` through the program: wishes on standard input, JSON objects on standard output.

use assert_cmd::Command;
use serde_json::Value;

fn read(arguments: &[&str], text: &str) -> (Option<i32>, Vec<Value>, String) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("sprint"));
    let output = command.arg("read").args(arguments).write_stdin(text).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let lines = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    (output.status.code(), lines, String::from_utf8(output.stderr).unwrap())
}

#[test]
fn each_line_is_read_by_itself() {
    let (code, lines, _) = read(&[], "Put the mug in the sink and juggle the Vases\n\nslice it\n");
    assert_eq!((code, lines.len()), (Some(0), 3));
    let first = &lines[0];
    assert_eq!(first["text"], "Put the mug in the sink and juggle the Vases");
    assert_eq!(first["words"], "put a mug in the sink");
    let subtask = &first["subtasks"][0];
    assert_eq!([&subtask["skill"], &subtask["object"], &subtask["receptacle"]], ["Put", "Mug", "Sink"]);
    assert_eq!(first["unread"], serde_json::json!(["juggle", "Vases"]));
    assert!(first["confidence"].as_f64().unwrap() < 0.9);
    assert_eq!(first["absent"], serde_json::json!([]));
    assert_eq!(lines[1]["subtasks"], serde_json::json!([]));
    assert_eq!((&lines[2]["subtasks"][0]["object"], &lines[2]["confidence"]), (&Value::Null, &serde_json::json!(0.0)));
}

#[test]
fn with_a_scene_what_is_not_there_is_said() {
    let (code, lines, _) = read(&["--scene", "bathroom:3"], "put the soap in the fridge\n");
    assert_eq!((code, &lines[0]["absent"]), (Some(0), &serde_json::json!(["Fridge"])));
}

#[test]
fn what_cannot_be_read_is_refused_with_what_to_do() {
    for (arguments, text, says) in [
        (&["--scene", "kitchen:x"][..], "take the mug", "not a seed"),
        (&["--scene", "nowhere.json"], "take the mug", "neither a generated house (kitchen:7) nor a scene file"),
        (&[], &format!("take the mug\n{}", "take the mug ".repeat(200)), "line 2: the instruction has 2600 characters"),
    ] {
        let (code, _, errors) = read(arguments, text);
        assert_ne!(code, Some(0));
        assert!(errors.contains(says), "{errors}");
    }
}
