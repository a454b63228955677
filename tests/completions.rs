//! A small server of completions for tests: real HTTP over a real socket, answers by a function.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};

use serde_json::{Value, json};

/// A request as it came.
#[derive(Clone)]
pub(crate) struct Asked {
    pub(crate) path: String,
    pub(crate) head: String,
    pub(crate) body: Value,
}

impl Asked {
    /// The steps that are to be summed up.
    pub(crate) fn steps(&self) -> String {
        let prompt = self.body["prompt"].as_str().unwrap();
        prompt.rsplit("Task Steps:\n").next().unwrap().to_owned()
    }
}

/// What the server does with a request.
pub(crate) enum Reply {
    /// An answer in the form of a completion.
    Text(String),
    /// Another status, with headers and a body.
    Other(u16, &'static str, String),
    /// The connection is closed without a word.
    Nothing,
}

/// A server that runs until the tests end.
pub(crate) struct Completions {
    pub(crate) url: String,
    asked: Arc<Mutex<Vec<Asked>>>,
}

impl Completions {
    /// Answers each request by how many came before it.
    pub(crate) fn start(reply: impl Fn(usize, &Asked) -> Reply + Send + Sync + 'static) -> Completions {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/v1", listener.local_addr().unwrap());
        let asked = Arc::new(Mutex::new(Vec::new()));
        let (all, reply) = (asked.clone(), Arc::new(reply));
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let (all, reply) = (all.clone(), reply.clone());
                std::thread::spawn(move || {
                    let Some((mut stream, asked)) = read(stream.unwrap()) else { return };
                    let before = {
                        let mut all = all.lock().unwrap();
                        all.push(asked.clone());
                        all.len() - 1
                    };
                    let (status, headers, body) = match reply(before, &asked) {
                        Reply::Nothing => return,
                        Reply::Other(status, headers, body) => (status, headers, body),
                        Reply::Text(text) => {
                            let choice = json!({"index": 0, "text": text, "finish_reason": "stop"});
                            (200, "", json!({"id": "1", "object": "text_completion", "choices": [choice]}).to_string())
                        }
                    };
                    let length = body.len();
                    // Whoever asked may be gone.
                    let _ = write!(
                        stream,
                        "HTTP/1.1 {status} Said\r\nContent-Length: {length}\r\nConnection: close\r\n{headers}\r\n{body}"
                    );
                });
            }
        });
        Completions { url, asked }
    }

    /// All requests until now.
    pub(crate) fn asked(&self) -> Vec<Asked> {
        self.asked.lock().unwrap().clone()
    }
}

fn read(stream: TcpStream) -> Option<(TcpStream, Asked)> {
    let mut reader = BufReader::new(stream);
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        if reader.read_line(&mut head).ok()? == 0 {
            return None;
        }
    }
    let lower = head.to_lowercase();
    let length = lower.split("content-length:").nth(1)?.lines().next()?.trim().parse().ok()?;
    let mut body = vec![0; length];
    reader.read_exact(&mut body).ok()?;
    let path = head.split(' ').nth(1)?.to_owned();
    let body = serde_json::from_slice(&body).ok()?;
    Some((reader.into_inner(), Asked { path, head, body }))
}
