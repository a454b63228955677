//! `sprint eval --policy ws:...` with a policy server beside it: what it plays, and what becomes of a run whose server dies.

use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use rmpv::Value;
use tungstenite::{Message, accept};

use crate::program::Sprint;

/// A server of vla-eval's protocol that turns left and walks, by what it is told of the step; it dies before a message of some
/// number.
pub(crate) struct Server {
    pub(crate) port: u16,
    listener: TcpListener,
}

fn field<'a>(map: &'a Value, name: &str) -> &'a Value {
    &map.as_map().unwrap().iter().find(|(key, _)| key.as_str() == Some(name)).unwrap().1
}

fn map(fields: Vec<(&str, Value)>) -> Value {
    Value::Map(fields.into_iter().map(|(name, value)| (name.into(), value)).collect())
}

impl Server {
    pub(crate) fn bind(port: u16) -> Server {
        let listener = TcpListener::bind(("127.0.0.1", port)).unwrap();
        Server { port: listener.local_addr().unwrap().port(), listener }
    }

    /// Serves until so many messages came.
    pub(crate) fn serve(self, messages: usize) {
        self.serve_as("walker", messages);
    }

    /// The same under another name.
    pub(crate) fn serve_as(self, name: &'static str, messages: usize) {
        let (left, closed) = (Arc::new(AtomicUsize::new(messages)), Arc::new(AtomicBool::new(false)));
        std::thread::spawn(move || {
            self.listener.set_nonblocking(true).unwrap();
            while left.load(Ordering::Relaxed) > 0 {
                match self.listener.accept() {
                    Ok((stream, _)) => {
                        let (left, closed) = (left.clone(), closed.clone());
                        std::thread::spawn(move || talk(stream, name, &left, &closed));
                    }
                    Err(_) => std::thread::sleep(Duration::from_millis(1)),
                }
            }
            drop(self.listener);
            closed.store(true, Ordering::Relaxed);
        });
    }
}

fn talk(stream: TcpStream, name: &str, left: &AtomicUsize, closed: &AtomicBool) {
    stream.set_nonblocking(false).unwrap();
    let Ok(mut socket) = accept(stream) else { return };
    while let Ok(message) = socket.read() {
        let Message::Binary(bytes) = message else { continue };
        let told = rmpv::decode::read_value(&mut &bytes[..]).unwrap();
        if left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_err() {
            // Nobody reaches it any more when the conversation breaks off.
            while !closed.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(1));
            }
            return;
        }
        let (kind, payload) = match field(&told, "type").as_str().unwrap() {
            "hello" => ("hello", map(vec![("protocol_version", 1.into()), ("model_server", name.into())])),
            "observation" => {
                let step = field(field(&told, "payload"), "step").as_u64().unwrap();
                ("action", map(vec![("action", if step % 3 == 2 { "RotateLeft" } else { "MoveAhead" }.into())]))
            }
            _ => continue,
        };
        let fields = vec![
            ("type", kind.into()),
            ("payload", payload),
            ("seq", field(&told, "seq").clone()),
            ("timestamp", 0.0.into()),
        ];
        let mut answer = Vec::new();
        rmpv::encode::write_value(&mut answer, &map(fields)).unwrap();
        socket.send(Message::binary(answer)).unwrap();
    }
}

#[test]
fn a_run_whose_server_dies_keeps_what_was_played_and_goes_on_to_the_same_bytes() {
    let sprint = Sprint::new();
    sprint.sample("tasks.json", 1, 6);
    let server = Server::bind(0);
    let port = server.port;
    server.serve(usize::MAX);
    let line = |run: &str, port: u16| {
        format!("eval --tasks tasks.json --policy ws:127.0.0.1:{port} --seeds 2 --jobs 2 --out {run}")
    };
    let whole = sprint.run(&line("whole", port));
    assert_eq!(whole.code, Some(0), "{}", whole.stderr);
    let episodes = sprint.read("whole/episodes.jsonl");
    assert_eq!(episodes.lines().count(), 12);
    assert!(episodes.contains("MoveAhead") && episodes.contains("RotateLeft"));
    assert!(sprint.read("whole/manifest.json").contains("\"ws:walker\""));

    let dying = Server::bind(0);
    let port = dying.port;
    // More than one episode has steps, fewer than all.
    dying.serve(episodes.matches("\"action\"").count() * 2 / 3);
    let broken = sprint.run(&line("torn", port));
    assert_eq!(broken.code, Some(1));
    assert!(broken.stderr.contains("is gone (") && broken.stderr.contains("start it again"), "{}", broken.stderr);
    assert!(broken.stderr.contains("torn"), "the folder is named: {}", broken.stderr);
    let kept = sprint.read("torn/episodes.jsonl");
    assert!(!kept.is_empty() && kept.lines().count() < 12 && !kept.contains("\"error\":\""), "{kept}");
    // RemoteSettings, too: what it calls itself is what counts.
    let again = Server::bind(0);
    let port = again.port;
    again.serve(usize::MAX);
    assert_eq!(sprint.run(&line("torn", port)).code, Some(0));
    assert_eq!(sprint.sorted("torn/episodes.jsonl"), sprint.sorted("whole/episodes.jsonl"));
    for file in ["manifest.json", "summary.json"] {
        assert_eq!(sprint.read(&format!("torn/{file}")), sprint.read(&format!("whole/{file}")), "{file}");
    }
}

#[test]
fn the_explorer_lets_a_server_act_and_says_where_there_is_none() {
    let sprint = Sprint::new();
    let server = Server::bind(0);
    let port = server.port;
    server.serve(usize::MAX);
    std::fs::write(sprint.path("verbs"), "step 3\nback 1\nquit\n").unwrap();
    let explore = |port: u16| {
        let input = std::fs::File::open(sprint.path("verbs")).unwrap();
        let mut command = sprint.command(&format!("explore --plain --seed 3 --policy ws:127.0.0.1:{port}"));
        let ended = command.stdin(input).output().unwrap();
        (ended.status.code(), String::from_utf8(ended.stdout).unwrap() + &String::from_utf8(ended.stderr).unwrap())
    };
    let (code, said) = explore(port);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("step 1: MoveAhead") && said.contains("step 3: RotateLeft"), "{said}");
    let nobody = Server::bind(0).port;
    let (code, said) = explore(nobody);
    assert_eq!(code, Some(1));
    assert!(said.contains(&format!("no policy server answers at ws://127.0.0.1:{nobody}: start it")), "{said}");
}
