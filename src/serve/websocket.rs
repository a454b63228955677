//! A WebSocket connection: a session at `/ws`, and pages for whoever asks over plain HTTP.

use std::io::{ErrorKind, Write};
use std::net::TcpStream;
use std::time::Duration;

use serde_json::Value;
use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::StatusCode;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, WebSocket};

use super::json::{Conversation, error};
use super::pages::page;
use super::refusal::Refusal;
use super::session::Session;

/// The longest first line of a request, and how often and how long its rest is waited for.
const LINE: usize = 2048;
const LOOKS: usize = 400;
const BETWEEN_LOOKS: Duration = Duration::from_millis(5);
/// No request is longer.
const LONGEST: usize = 16 << 20;

/// Answers whoever has connected until they leave. `open` makes the session, with what is held as long as it goes on, or says
/// why there is none.
///
/// # Errors
/// When the connection breaks, or speaks something else.
pub(super) fn serve<T>(stream: TcpStream, open: impl FnOnce() -> Result<(T, Session), Refusal>) -> anyhow::Result<()> {
    stream.set_nodelay(true)?;
    let path = requested(&stream)?;
    if let Some(page) = page(&path) {
        return show(stream, &page);
    }
    let config = WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
    let mut socket = tungstenite::accept_hdr_with_config(stream, only_sessions, Some(config))?;
    match open() {
        Ok((_held, session)) => converse(&mut socket, Conversation::new(session))?,
        Err(refusal) => socket.send(Message::text(error(&refusal)))?,
    }
    socket.close(None)?;
    // The goodbye is sent, and the other side's awaited, until the connection is closed.
    while socket.read().is_ok() {}
    Ok(())
}

fn converse(socket: &mut WebSocket<TcpStream>, mut conversation: Conversation) -> anyhow::Result<()> {
    loop {
        let answer = match socket.read()? {
            Message::Text(text) => conversation.answer(&text),
            Message::Binary(bytes) => conversation.answer(&String::from_utf8_lossy(&bytes)),
            Message::Close(_) => return Ok(()),
            Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => continue,
        };
        match answer {
            Some(text) => socket.send(Message::text(text))?,
            None => return Ok(()),
        }
    }
}

/// Sessions are at `/ws` alone.
#[allow(clippy::result_large_err)]
fn only_sessions(request: &Request, response: Response) -> Result<Response, ErrorResponse> {
    if request.uri().path() == "/ws" {
        return Ok(response);
    }
    let mut refused = ErrorResponse::new(Some("Sessions are at /ws.\n".to_owned()));
    *refused.status_mut() = StatusCode::NOT_FOUND;
    Err(refused)
}

/// The path of the request that lies ready, which stays there.
fn requested(stream: &TcpStream) -> anyhow::Result<String> {
    let mut seen = [0; LINE];
    for _ in 0..LOOKS {
        let length = stream.peek(&mut seen)?;
        let line = seen[..length].split(|&byte| byte == b'\n').next().unwrap_or_default();
        if line.len() < length || length == LINE {
            let path = String::from_utf8_lossy(line).split(' ').nth(1).unwrap_or_default().to_owned();
            return Ok(path.split('?').next().unwrap_or_default().to_owned());
        }
        if length == 0 {
            break;
        }
        std::thread::sleep(BETWEEN_LOOKS);
    }
    Err(std::io::Error::from(ErrorKind::UnexpectedEof).into())
}

fn show(mut stream: TcpStream, page: &Value) -> anyhow::Result<()> {
    let body = page.to_string();
    write!(
        stream,
        "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{body}",
        body.len()
    )?;
    // What is unread of the request must be read, or closing would break the connection off before the page has arrived.
    stream.shutdown(std::net::Shutdown::Write)?;
    stream.set_read_timeout(Some(BETWEEN_LOOKS * LOOKS as u32))?;
    std::io::copy(&mut stream, &mut std::io::sink())?;
    Ok(())
}
