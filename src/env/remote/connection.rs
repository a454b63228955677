//! A WebSocket on which request and answer alternate, each answer within its time.

use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use tungstenite::error::ProtocolError;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, WebSocket};

use crate::domain::environment_name::ServerAddress;

/// The longest message that is taken, as in `OpenEnv`'s own client.
const LONGEST: usize = 100 << 20;
/// The longest answer to a question about schemas.
const LONGEST_PAGE: u64 = 10 << 20;

/// A connected socket that gives up at an instant, however slowly the other side drips.
struct DeadlineStream {
    tcp: TcpStream,
    deadline: Instant,
}

impl DeadlineStream {
    fn left(&self) -> io::Result<Duration> {
        let left = self.deadline.saturating_duration_since(Instant::now());
        if left.is_zero() { Err(io::ErrorKind::TimedOut.into()) } else { Ok(left) }
    }
}

impl Read for DeadlineStream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.tcp.set_read_timeout(Some(self.left()?))?;
        self.tcp.read(buffer)
    }
}

impl Write for DeadlineStream {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.tcp.set_write_timeout(Some(self.left()?))?;
        self.tcp.write(buffer)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.tcp.flush()
    }
}

/// A connection.
pub(super) struct Connection {
    socket: WebSocket<DeadlineStream>,
}

fn dial(address: &ServerAddress, limit: Duration) -> anyhow::Result<DeadlineStream> {
    let deadline = Instant::now() + limit;
    let found = (address.host.as_str(), address.port).to_socket_addrs();
    let mut last = None;
    for at in found.with_context(|| format!("the host {} is not known", address.host))? {
        match TcpStream::connect_timeout(&at, limit) {
            Ok(tcp) => {
                tcp.set_nodelay(true)?;
                return Ok(DeadlineStream { tcp, deadline });
            }
            Err(error) => last = Some(error),
        }
    }
    match last {
        Some(error) => Err(error).with_context(|| format!("cannot connect to {address}")),
        None => bail!("the host {} has no address", address.host),
    }
}

impl Connection {
    /// Connects.
    ///
    /// # Errors
    /// When nobody answers there in time, or no WebSocket.
    pub(super) fn open(address: &ServerAddress, limit: Duration) -> anyhow::Result<Connection> {
        let config = WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
        let stream = dial(address, limit)?;
        let shaken = tungstenite::client::client_with_config(address.to_string(), stream, Some(config));
        let (socket, _) = shaken.map_err(|error| anyhow::anyhow!("{address} opens no WebSocket: {error}"))?;
        Ok(Connection { socket })
    }

    /// Sends a request and waits for its answer.
    ///
    /// # Errors
    /// When the connection breaks, the answer is no text or too long, or it does not come in time. The connection is of no use
    /// then: a late answer would be taken for that of a later request.
    pub(super) fn ask(&mut self, request: &str, limit: Duration) -> anyhow::Result<String> {
        self.socket.get_mut().deadline = Instant::now() + limit;
        self.socket.send(Message::text(request)).map_err(|error| broken(error, limit))?;
        loop {
            match self.socket.read().map_err(|error| broken(error, limit))? {
                Message::Text(text) => return Ok(text.as_str().to_owned()),
                Message::Binary(_) => bail!("it answered with bytes in place of text"),
                Message::Close(_) => bail!("it closed the connection"),
                Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => {}
            }
        }
    }

    /// Answers the other side's pings while nothing is asked. Whether the connection still holds.
    pub(super) fn idle(&mut self) -> bool {
        self.socket.get_mut().deadline = Instant::now() + Duration::from_millis(2);
        match self.socket.read() {
            Ok(Message::Ping(_) | Message::Pong(_)) => {
                self.socket.get_mut().deadline = Instant::now() + Duration::from_secs(1);
                self.socket.flush().is_ok()
            }
            Ok(_) => false,
            Err(Error::Io(error)) => matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut),
            Err(_) => false,
        }
    }

    /// Says that it is over, without waiting.
    pub(super) fn close(&mut self) {
        self.socket.get_mut().deadline = Instant::now() + Duration::from_millis(200);
        let _ = self.socket.send(Message::text(r#"{"type":"close"}"#));
        let _ = self.socket.close(None);
        let _ = self.socket.flush();
    }
}

/// Whether an error says that nobody is at the other end any more.
fn is_gone(kind: io::ErrorKind) -> bool {
    use io::ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset, UnexpectedEof};
    matches!(kind, ConnectionReset | ConnectionAborted | BrokenPipe | UnexpectedEof)
}

/// What broke, in words.
fn broken(error: Error, limit: Duration) -> anyhow::Error {
    match error {
        Error::Io(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
            anyhow::anyhow!("it did not answer within {} s", limit.as_secs_f64())
        }
        Error::Io(error) if is_gone(error.kind()) => anyhow::anyhow!("it closed the connection"),
        Error::Capacity(_) => anyhow::anyhow!("it answered with more than {} MiB", LONGEST >> 20),
        Error::ConnectionClosed
        | Error::AlreadyClosed
        | Error::Protocol(ProtocolError::ResetWithoutClosingHandshake) => anyhow::anyhow!("it closed the connection"),
        other => anyhow::anyhow!("the connection broke: {other}"),
    }
}

/// Reads a page from the same server by HTTP.
///
/// # Errors
/// When it does not answer with one in time.
pub(super) fn page(address: &ServerAddress, path: &str, limit: Duration) -> anyhow::Result<String> {
    let mut stream = dial(address, limit)?;
    write!(stream, "GET {path} HTTP/1.0\r\nHost: {}\r\nAccept: application/json\r\n\r\n", address.host)?;
    let mut answer = Vec::new();
    (&mut stream).take(LONGEST_PAGE).read_to_end(&mut answer).with_context(|| format!("{path} of {address}"))?;
    let answer = String::from_utf8_lossy(&answer);
    let (head, body) = answer.split_once("\r\n\r\n").context("it answered no HTTP")?;
    let status = head.split_whitespace().nth(1).unwrap_or_default();
    anyhow::ensure!(status == "200", "{path} of {address}: status {status}");
    Ok(body.to_owned())
}
