//! `--checkpoint ORG/NAME`: a checkpoint of the Hub, for which a server here stands.

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;

use serde_json::json;
use sha2::{Digest, Sha256};

use crate::program::Sprint;

const COMMIT: &str = "0123456789abcdef0123456789abcdef01234567";
/// What lies there.
const SHIPPED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/checkpoints/sprint-memory");

fn hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A server with one repository, `org/agent`; its address.
fn stand_in() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    std::thread::spawn(move || listener.incoming().for_each(|stream| answer(stream.unwrap())));
    address
}

fn answer(mut stream: TcpStream) {
    let mut lines = BufReader::new(stream.try_clone().unwrap()).lines().map(Result::unwrap);
    let path = lines.next().unwrap().split(' ').nth(1).unwrap().to_owned();
    lines.take_while(|line| !line.is_empty()).for_each(drop);
    let read = |name: &str| std::fs::read(Path::new(SHIPPED).join(name)).unwrap();
    let told = |name: &str| {
        let content = read(name);
        json!({"rfilename": name, "size": content.len(), "lfs": {"sha256": hex(&content)}})
    };
    let body = match path.rsplit_once('/').unwrap() {
        ("/api/models/org/agent/revision", "main?blobs=true") => {
            let files = [told("README.md"), told("config.json"), told("model.safetensors")];
            Some(json!({"sha": COMMIT, "siblings": files}).to_string().into_bytes())
        }
        (folder, name) if folder == format!("/org/agent/resolve/{COMMIT}") => Some(read(name)),
        _ => None,
    };
    let status = if body.is_some() { "200 OK" } else { "404 Not Found" };
    let body = body.unwrap_or_default();
    let head = format!("HTTP/1.1 {status}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n", body.len());
    // Whoever asked may have left by now.
    let _ = stream.write_all(&[head.as_bytes(), &body].concat());
}

#[test]
fn an_agent_of_the_hub_is_fetched_once_and_explored_also_without_network() {
    let sprint = Sprint::new();
    std::fs::write(sprint.path("verbs"), "step 1\n").unwrap();
    let explore = |named: &str, endpoint: &str| {
        let mut command = sprint.command(&format!("explore --plain --seed 3 --checkpoint {named}"));
        command.env("HF_ENDPOINT", endpoint).env("HF_HOME", sprint.path("hf")).env_remove("HF_HUB_CACHE");
        let output = command.stdin(std::fs::File::open(sprint.path("verbs")).unwrap()).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let nobody = "http://127.0.0.1:1";
    let (code, _, said) = explore("org/agent", nobody);
    assert_eq!((code, said.trim_end().lines().count()), (Some(1), 1), "{said}");
    assert!(said.contains("org/agent: neither a folder here nor in the Hub's cache"), "{said}");
    assert!(said.contains("http://127.0.0.1:1 cannot be reached"), "{said}");
    let (code, shown, said) = explore("org/agent", &stand_in());
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("fetching org/agent: model.safetensors") && shown.contains("step 1: "), "{said}{shown}");
    let (code, again, said) = explore("org/agent", nobody);
    assert_eq!((code, again), (Some(0), shown), "{said}");
    assert!(said.contains("taken as it was fetched before"), "{said}");
    let (code, _, said) = explore(&format!("org/agent@{COMMIT}"), nobody);
    assert_eq!((code, said.as_str()), (Some(0), ""), "a whole commit needs no asking");
}
