//! Messages to and from a policy server: MessagePack over a WebSocket, each within a time and a size.

use std::io::ErrorKind;
use std::net::TcpStream;
use std::time::Duration;

use anyhow::{Context, anyhow};
use rmpv::Value;
use tungstenite::client::client_with_config;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, HandshakeError, Message, WebSocket};

use super::address::PolicyAddress;
use super::deadline_stream::DeadlineStream;

/// The largest message that is taken; an answer is a few numbers.
const LARGEST: usize = 64 << 20;
/// How deep what a message holds may lie.
const DEEPEST: usize = 32;

/// An open connection to a policy server.
pub(super) struct Connection {
    socket: WebSocket<DeadlineStream>,
    limit: Duration,
}

/// Why nothing came.
#[derive(Debug)]
pub(super) enum Missing {
    /// The connection is closed.
    Closed(String),
    /// Nothing came in time.
    Late,
    /// What came is none of the protocol's messages.
    Rubbish(String),
}

impl Connection {
    /// Connects; `limit` is for each thing that is waited for.
    ///
    /// # Errors
    /// When nothing listens there, or it is no WebSocket server.
    pub(super) fn open(address: &PolicyAddress, limit: Duration) -> anyhow::Result<Connection> {
        let mut refused = anyhow!("it has no address");
        for socket in address.resolve()? {
            match TcpStream::connect_timeout(&socket, limit) {
                Ok(stream) => return Connection::shake_hands(stream, address, limit),
                Err(error) => refused = anyhow!(error),
            }
        }
        Err(refused.context(format!("no policy server answers at {address}: start it, or name another with --policy")))
    }

    fn shake_hands(stream: TcpStream, address: &PolicyAddress, limit: Duration) -> anyhow::Result<Connection> {
        stream.set_nodelay(true)?;
        let config = WebSocketConfig::default().max_message_size(Some(LARGEST)).max_frame_size(Some(LARGEST));
        let stream = DeadlineStream::new(stream, limit);
        let socket = client_with_config(address.to_string(), stream, Some(config)).map_err(|error| match error {
            HandshakeError::Failure(error) => anyhow!(error),
            HandshakeError::Interrupted(_) => anyhow!("it said nothing"),
        });
        let (socket, _) = socket.with_context(|| {
            format!("what listens at {address} is no WebSocket server (or takes no second connection: try --jobs 1)")
        })?;
        Ok(Connection { socket, limit })
    }

    /// Sends a message.
    pub(super) fn send(&mut self, message: &Value) -> Result<(), Missing> {
        let mut bytes = Vec::new();
        rmpv::encode::write_value(&mut bytes, message).map_err(|error| Missing::Rubbish(error.to_string()))?;
        self.socket.get_mut().allow(self.limit);
        self.socket.send(Message::binary(bytes)).map_err(|error| missing(&error))
    }

    /// The next message.
    pub(super) fn receive(&mut self) -> Result<Value, Missing> {
        self.receive_within(self.limit)
    }

    /// The next message, if it comes within that time.
    pub(super) fn receive_within(&mut self, limit: Duration) -> Result<Value, Missing> {
        self.socket.get_mut().allow(limit);
        loop {
            match self.socket.read().map_err(|error| missing(&error))? {
                Message::Binary(bytes) => return unpack(&bytes),
                Message::Text(text) => return Err(Missing::Rubbish(format!("it said {}", quoted(&text)))),
                Message::Close(frame) => {
                    let why = frame.map(|frame| frame.reason.to_string()).filter(|why| !why.is_empty());
                    let why = why.map_or(String::new(), |why| format!(", saying {}", quoted(&why)));
                    return Err(Missing::Closed(format!("it closed the connection{why}")));
                }
                Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => {}
            }
        }
    }

    /// Says goodbye, without waiting for an answer.
    pub(super) fn close(&mut self) {
        self.socket.get_mut().allow(Duration::from_millis(200));
        let _ = self.socket.close(None).and_then(|()| self.socket.flush());
    }
}

/// Reads a message.
fn unpack(bytes: &[u8]) -> Result<Value, Missing> {
    let mut rest = bytes;
    let read = rmpv::decode::read_value_with_max_depth(&mut rest, DEEPEST);
    match read {
        Ok(value) if rest.is_empty() => Ok(value),
        Ok(_) => Err(Missing::Rubbish(format!("{} bytes follow the MessagePack of its message", rest.len()))),
        Err(error) => Err(Missing::Rubbish(format!("its message of {} bytes is no MessagePack: {error}", bytes.len()))),
    }
}

fn missing(error: &Error) -> Missing {
    match error {
        Error::Io(error) if error.kind() == ErrorKind::TimedOut => Missing::Late,
        Error::Capacity(why) => Missing::Rubbish(format!("its message is larger than {} MB: {why}", LARGEST >> 20)),
        Error::Io(_) | Error::ConnectionClosed | Error::AlreadyClosed => Missing::Closed(error.to_string()),
        Error::Protocol(tungstenite::error::ProtocolError::ResetWithoutClosingHandshake) => {
            Missing::Closed("the connection broke off".into())
        }
        other => Missing::Rubbish(other.to_string()),
    }
}

/// The end of what a server said, where tracebacks say what is wrong, fit for one line of a terminal.
pub(super) fn quoted(text: &str) -> String {
    const LONGEST: usize = 300;
    let line: String = text.trim().chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let count = line.chars().count();
    let tail: String = line.chars().skip(count.saturating_sub(LONGEST)).collect();
    format!("\"{}{tail}\"", if count > LONGEST { "..." } else { "" })
}
