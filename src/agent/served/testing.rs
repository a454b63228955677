//! A policy server in this process, for tests: a closure answers each message.

use std::net::TcpListener;
use std::thread::JoinHandle;

use rmpv::Value;
use tungstenite::{Message, WebSocket, accept};

use super::address::PolicyAddress;
use super::array::field;
use super::dialogue::map;

/// What is done with a message.
pub(super) enum Answer {
    /// These bytes are sent.
    Bytes(Vec<u8>),
    Nothing,
    /// The connection breaks off, without a goodbye.
    Close,
    /// Nothing listens there any more, either.
    Die,
}

impl Answer {
    pub(super) fn of(value: &Value) -> Answer {
        let mut bytes = Vec::new();
        rmpv::encode::write_value(&mut bytes, value).unwrap();
        Answer::Bytes(bytes)
    }

    /// A message of vla-eval's that answers this one.
    pub(super) fn to(message: &Value, kind: &str, payload: Value) -> Answer {
        let sequence = field(message, "seq").cloned().unwrap_or(Value::Nil);
        let fields = [("type", kind.into()), ("payload", payload), ("seq", sequence), ("timestamp", 0.0.into())];
        Answer::of(&map(fields))
    }
}

/// The type and payload of a message of vla-eval's.
pub(super) fn parts(message: &Value) -> (&str, &Value) {
    (field(message, "type").unwrap().as_str().unwrap(), field(message, "payload").unwrap())
}

/// A server of vla-eval's protocol: it greets, `act` answers observations, and every message is heard by `hear`.
pub(super) fn vla_eval(
    mut act: impl FnMut(&Value) -> Answer + Send + 'static,
    mut hear: impl FnMut(&str, &Value) + Send + 'static,
) -> (PolicyAddress, JoinHandle<()>) {
    serve(None, move |message| {
        let (kind, payload) = parts(message);
        hear(kind, payload);
        let hello = || map([("protocol_version", 1.into()), ("model_server", "Tester".into())]);
        match kind {
            "hello" => Answer::to(message, "hello", hello()),
            "observation" => act(message),
            _ => Answer::Nothing,
        }
    })
}

/// A server that says `first` unasked, and answers each message; connections come one after the other.
pub(super) fn serve(
    first: Option<Value>,
    mut answer: impl FnMut(&Value) -> Answer + Send + 'static,
) -> (PolicyAddress, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("ws:127.0.0.1:{}", listener.local_addr().unwrap().port()).parse().unwrap();
    let thread = std::thread::spawn(move || {
        for stream in listener.incoming() {
            let Ok(mut socket) = accept(stream.unwrap()) else { continue };
            if let Some(Answer::Bytes(bytes)) = first.as_ref().map(Answer::of) {
                socket.send(Message::binary(bytes)).unwrap();
            }
            if talk(&mut socket, &mut answer).is_none() {
                return;
            }
        }
    });
    (address, thread)
}

/// Answers until the other side leaves; nothing when the server is to die.
fn talk<S: std::io::Read + std::io::Write>(
    socket: &mut WebSocket<S>,
    answer: &mut impl FnMut(&Value) -> Answer,
) -> Option<()> {
    while let Ok(message) = socket.read() {
        let Message::Binary(bytes) = message else { continue };
        match answer(&rmpv::decode::read_value(&mut &bytes[..]).unwrap()) {
            Answer::Bytes(bytes) => drop(socket.send(Message::binary(bytes))),
            Answer::Nothing => {}
            Answer::Close => return Some(()),
            Answer::Die => return None,
        }
    }
    Some(())
}
