//! A small environment in a thread: a corridor of eight cells, whose right end is the goal. It can misbehave.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use base64::Engine;
use serde_json::{Value, json};
use tungstenite::Message;

use crate::domain::EnvironmentName;

/// What it does wrong, from the third step on where it concerns steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    None,
    /// It says nothing of itself, and is found by its schema.
    Foreign,
    /// It answers what is no JSON.
    Rubbish,
    /// It closes the connection.
    Leaves,
    /// It never answers.
    Hangs,
    /// A byte comes now and then.
    Drips,
    /// The picture is smaller than it says.
    Short,
    /// The picture has another size: that is allowed.
    Resizes,
    /// It announces a message of two gigabytes.
    Huge,
    /// The same seed and actions show something else each time.
    Chance,
    /// It refuses the step.
    Refuses,
}

/// Serves until the process ends.
pub(crate) fn serve(fault: Fault) -> EnvironmentName {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let visits = Arc::new(Mutex::new(0));
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let visits = visits.clone();
            thread::spawn(move || converse(stream, fault, &visits));
        }
    });
    format!("openenv:127.0.0.1:{port}").parse().unwrap()
}

fn converse(mut stream: TcpStream, fault: Fault, visits: &Mutex<u64>) {
    let mut first = [0; 11];
    while stream.peek(&mut first).is_ok_and(|read| read < first.len()) {
        thread::sleep(Duration::from_millis(1));
    }
    if first.starts_with(b"GET /schema") {
        let schema = json!({"action": {"properties": {"move": {"enum": ["left", "right"]}}, "required": ["move"]}});
        let mut request = [0; 4096];
        let _ = stream.read(&mut request);
        let _ = write!(stream, "HTTP/1.0 200 OK\r\n\r\n{schema}");
        return;
    }
    let mut raw = stream.try_clone().unwrap();
    let mut socket = tungstenite::accept(stream).unwrap();
    let (mut cell, mut steps, mut visit) = (0, 0, 0);
    while let Ok(Message::Text(text)) = socket.read() {
        let request: Value = serde_json::from_str(text.as_str()).unwrap();
        let data = &request["data"];
        let seen = |cell: u64, steps: u64, visit: u64| {
            let (width, height) = if fault == Fault::Resizes && steps > 2 { (2, 5) } else { (4, 3) };
            let short = usize::from(fault == Fault::Short && steps > 2);
            let picture = vec![20 * cell as u8; width * height * 3 - short];
            let picture = base64::engine::general_purpose::STANDARD.encode(picture);
            let mut observation = json!({"frame": {"encoding": "raw", "width": width, "height": height, "data": picture},
                "mission": "go to\n the right end", "legal": [cell > 0, true], "success": cell == 7, "terminated": cell == 7,
                "truncated": false});
            if fault == Fault::Chance && steps > 2 {
                observation["noise"] = visit.into();
            }
            if fault == Fault::Foreign {
                observation = json!({"cell": cell});
            }
            json!({"type": "observation", "data": {"observation": observation, "reward": f64::from(u8::from(cell == 7)), "done": cell == 7}})
        };
        let answer = match request["type"].as_str().unwrap() {
            "capabilities" if fault != Fault::Foreign => json!({"type": "capabilities", "data": {"name": "Corridor",
                "actions": [{"name": "left", "argument": null}, {"name": "right", "argument": null}], "arguments": {},
                "seeds": true, "snapshot": fault != Fault::Chance, "deterministic": true, "frame": [4, 3], "formats": ["raw"]}}),
            "reset" => {
                (cell, steps) = (data["seed"].as_u64().unwrap_or(0) % 5, 0);
                *visits.lock().unwrap() += 1;
                visit = *visits.lock().unwrap();
                seen(cell, steps, visit)
            }
            "step" => {
                steps += 1;
                let late = steps > 2;
                match fault {
                    Fault::Leaves if late => return,
                    Fault::Hangs if late => thread::sleep(Duration::from_secs(3600)),
                    Fault::Drips if late => loop {
                        if raw.write_all(&[0x89, 0]).is_err() {
                            return;
                        }
                        thread::sleep(Duration::from_millis(20));
                    },
                    Fault::Huge if late => {
                        let mut head = vec![0x81, 127];
                        head.extend((2_u64 << 30).to_be_bytes());
                        let _ = raw.write_all(&head);
                        thread::sleep(Duration::from_secs(3600));
                    }
                    Fault::Rubbish if late => {
                        socket.send(Message::text("Traceback (most recent call last)")).unwrap();
                        continue;
                    }
                    Fault::Refuses if late => {
                        let error = json!({"type": "error", "data": {"message": "no", "code": "EXECUTION_ERROR"}});
                        socket.send(Message::text(error.to_string())).unwrap();
                        continue;
                    }
                    _ => {}
                }
                let named = data["action"].as_str().or(data["move"].as_str());
                cell = if named == Some("right") { cell + 1 } else { cell.saturating_sub(1) };
                seen(cell, steps, visit)
            }
            "snapshot" if fault != Fault::Foreign && fault != Fault::Chance => {
                json!({"type": "snapshot", "data": {"id": format!("{cell} {steps}")}})
            }
            "restore" if fault != Fault::Foreign => {
                let id = data["id"].as_str().unwrap().to_owned();
                let (at, taken) = id.split_once(' ').unwrap();
                (cell, steps) = (at.parse().unwrap(), taken.parse().unwrap());
                seen(cell, steps, visit)
            }
            "close" => return,
            other => {
                json!({"type": "error", "data": {"message": format!("Unknown message type: {other}"), "code": "UNKNOWN_TYPE"}})
            }
        };
        if socket.send(Message::text(answer.to_string())).is_err() {
            return;
        }
    }
}
