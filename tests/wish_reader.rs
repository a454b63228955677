//! Wishes read by a language model on a server, over a real socket: `--reader` of `read`, `explore` and `eval`.

use serde_json::{Value, json};

use crate::completions::{Completions, Reply};
use crate::program::Sprint;
use crate::terminal::Session;

const PUT: &str = r#" [{"skill": "Put", "object": "Mug", "receptacle": "Sink"}]"#;

/// A server that reads everything as putting the mug into the sink.
fn wise() -> Completions {
    Completions::start(|_, _| Reply::Text(PUT.into()))
}

fn read(sprint: &Sprint, reader: &str, lines: &str) -> Vec<Value> {
    let mut command = assert_cmd::Command::from_std(sprint.command("read --scene kitchen:7 --reader"));
    let output = command.arg(reader).write_stdin(lines).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn a_line_is_read_by_the_model_and_by_the_program_where_that_fails() {
    let sprint = Sprint::new();
    let server = Completions::start(|number, _| match number {
        0 => Reply::Text(PUT.into()),
        1 => Reply::Text(" I would rather not.".into()),
        2 => Reply::Other(500, "", "out of order".into()),
        _ => Reply::Nothing,
    });
    let lines = "get my cup off to the washing up\npick up the mug\n\ntake the fork\nopen the fridge\ntake the knife\n";
    let read = read(&sprint, &format!("http:{}#wise", server.url), lines);
    assert_eq!(read[0]["words"], "put a mug in the sink");
    assert_eq!(read[0]["read_by"], "wise");
    assert_eq!(read[0]["subtasks"][0]["receptacle"], "Sink");
    assert_eq!(read[1]["words"], "pick up a mug", "the program's own reading");
    assert!(read[1]["unasked"].as_str().unwrap().contains("no list of steps") && read[1]["read_by"].is_null());
    assert!(read[2]["unasked"].is_null(), "an empty line asks for nothing");
    assert!(read[3]["unasked"].as_str().unwrap().contains("500: out of order"), "{}", read[3]);
    assert!(read[4]["unasked"].is_string());
    assert!(read[5]["unasked"].as_str().unwrap().contains("asked no more"), "{}", read[5]);
    let asked = server.asked();
    assert_eq!(asked.len(), 4);
    assert_eq!((asked[0].path.as_str(), &asked[0].body["model"]), ("/v1/completions", &json!("wise")));
    let prompt = asked[0].body["prompt"].as_str().unwrap();
    assert!(prompt.ends_with("Told: get my cup off to the washing up\nSteps:"), "{prompt}");
    assert!(prompt.contains("Fridge") && !prompt.rsplit("Things:").next().unwrap().contains("Bathtub"), "this house");
}

#[test]
fn the_screen_says_who_read_a_wish_and_offers_what_the_program_makes_of_it() {
    let (server, state) = (wise(), tempfile::tempdir().unwrap());
    let reader = format!("http:{}#wise", server.url);
    let arguments = ["--room", "kitchen", "--seed", "7", "--graphics", "ascii", "--paused", "--policy", "expert"];
    let arguments = [&arguments[..], &["--reader", &reader]].concat();
    let mut session = Session::open(state.path(), (80, 24), "explore", &arguments);
    session.see("Mind");
    session.press("itake the fork\r");
    session.see("understood by wise: put a mug in the sink");
    session.see("or z: 2");
    session.press("z");
    session.see("[>] pick up the fork");
    session.press("z+++++ ");
    session.see("[x] put the mug in the sink");
    session.see("done, after");
    session.leave();
}

#[test]
fn a_server_that_does_not_answer_in_time_costs_a_word_on_the_screen_and_nothing_else() {
    // It takes what it is asked, and never answers.
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let reader = format!("http:http://{}", listener.local_addr().unwrap());
    let state = tempfile::tempdir().unwrap();
    let arguments = ["--room", "kitchen", "--seed", "7", "--graphics", "ascii", "--paused", "--policy", "expert"];
    let arguments = [&arguments[..], &["--reader", &reader, "--reader-timeout", "1"]].concat();
    let mut session = Session::open(state.path(), (100, 24), "explore", &arguments);
    session.see("Mind");
    session.press("ipick up the mug\r");
    session.see("asking the server's model");
    session.see(": pick up a mug");
    session.see("by the program itself, as the log says");
    session.see("timeout");
    session.leave();
    drop(listener);
}

#[test]
fn an_evaluation_is_of_what_the_model_reads_and_says_so() {
    let (sprint, server) = (Sprint::new(), wise());
    let scene = json!({"generated": {"room": "kitchen", "seed": 7}});
    let task = json!({"id": "told", "scene": scene, "instruction": "see to the mug", "roles": [], "subtasks": [], "horizon": 60});
    let set = json!({"format_version": 1, "name": "told", "tasks": [task]});
    std::fs::write(sprint.path("told.json"), set.to_string()).unwrap();
    let line = "eval --tasks told.json --policy expert --out run";
    let ended = sprint.run(&format!("{line} --reader http:{}#wise", server.url));
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let record = sprint.read("run/episodes.jsonl");
    assert!(
        record.contains("\"understood\":\"put a mug in the sink\"") && record.contains("\"read_by\":\"wise\""),
        "{record}"
    );
    assert!(sprint.read("run/manifest.json").contains("\"reader\": \"wise\""));
    assert_eq!(sprint.run("verify run").code, Some(0));
    let other = sprint.run(line);
    assert_eq!(other.code, Some(1), "another reader makes another run");
    let nobody = sprint.run("eval --tasks told.json --policy expert --out other --reader http:http://127.0.0.1:9");
    assert!(nobody.stderr.contains("127.0.0.1:9"), "{}", nobody.stderr);
    let none = sprint.run("explore --plain --expect none --reader http:http://127.0.0.1:9");
    assert!(none.stderr.contains("leave out --reader"), "{}", none.stderr);
    assert!(sprint.run("read --reader llama").stderr.contains("--reader: \"llama\" is no server's address"));
}
