//! Where an environment is found, as `--env` and task files name it.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// An environment, as it is named.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum EnvironmentName {
    /// The program's own simulator.
    House,
    /// A Gymnasium environment of that id, in a child process.
    Gym(String),
    /// A server that speaks `OpenEnv`, by the address of its WebSocket.
    OpenEnv(ServerAddress),
}

/// A WebSocket's address: `ws://HOST:PORT/PATH`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ServerAddress {
    /// The host's name or number.
    pub(crate) host: String,
    /// The port.
    pub(crate) port: u16,
    /// Begins with a slash.
    pub(crate) path: String,
}

impl FromStr for EnvironmentName {
    type Err = String;

    fn from_str(text: &str) -> Result<EnvironmentName, String> {
        if text == "house" {
            return Ok(EnvironmentName::House);
        }
        match text.split_once(':') {
            Some(("gym", id)) if !id.trim().is_empty() && !id.starts_with('-') && !id.contains(char::is_control) => {
                Ok(EnvironmentName::Gym(id.to_owned()))
            }
            Some(("gym", id)) => Err(format!("{id:?} is no id of an environment")),
            Some(("openenv", url)) => Ok(EnvironmentName::OpenEnv(url.parse()?)),
            _ => Err(format!("{text:?} is none of house, gym:ID, openenv:URL")),
        }
    }
}

impl TryFrom<String> for EnvironmentName {
    type Error = String;

    fn try_from(text: String) -> Result<EnvironmentName, String> {
        text.parse()
    }
}

impl From<EnvironmentName> for String {
    fn from(name: EnvironmentName) -> String {
        name.to_string()
    }
}

impl std::fmt::Display for EnvironmentName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            EnvironmentName::House => f.write_str("house"),
            EnvironmentName::Gym(id) => write!(f, "gym:{id}"),
            EnvironmentName::OpenEnv(address) => write!(f, "openenv:{address}"),
        }
    }
}

impl std::fmt::Display for ServerAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ServerAddress { host, port, path } = self;
        if host.contains(':') { write!(f, "ws://[{host}]:{port}{path}") } else { write!(f, "ws://{host}:{port}{path}") }
    }
}

impl FromStr for ServerAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<ServerAddress, String> {
        let wrong = |why: &str| format!("{text:?} is no address of a server (ws://HOST:PORT/ws): {why}");
        let (scheme, rest) = text.split_once("://").unwrap_or(("ws", text));
        match scheme {
            "ws" | "http" => {}
            "wss" | "https" => return Err(wrong("encrypted connections are not spoken; forward a port with ssh -L")),
            _ => return Err(wrong("it begins with ws://")),
        }
        let (authority, path) = match rest.find('/') {
            Some(at) => rest.split_at(at),
            None => (rest, "/ws"),
        };
        let (host, port) = match authority.strip_prefix('[') {
            Some(rest) => {
                let (host, port) = rest.split_once(']').ok_or_else(|| wrong("a bracket is open"))?;
                (host, port.strip_prefix(':'))
            }
            None => match authority.rsplit_once(':') {
                Some((host, port)) => (host, Some(port)),
                None => (authority, None),
            },
        };
        let port = port.map_or(Ok(80), str::parse).map_err(|_| wrong("the port is no number"))?;
        if host.is_empty() || text.contains(|c: char| c.is_whitespace() || c.is_control()) || host.contains('@') {
            return Err(wrong("the host is missing or malformed"));
        }
        let path = if path == "/" { "/ws" } else { path };
        Ok(ServerAddress { host: host.to_owned(), port, path: path.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_may_be_named_shortly() {
        for text in ["ws://127.0.0.1:8000/ws", "http://127.0.0.1:8000", "127.0.0.1:8000", "http://127.0.0.1:8000/"] {
            assert_eq!(text.parse::<ServerAddress>().unwrap().to_string(), "ws://127.0.0.1:8000/ws", "{text}");
        }
        assert_eq!("ws://[::1]:9/a/b".parse::<ServerAddress>().unwrap().to_string(), "ws://[::1]:9/a/b");
        assert_eq!("ws://node7/ws".parse::<ServerAddress>().unwrap().port, 80);
    }

    #[test]
    fn what_is_no_environment_is_refused_in_a_sentence() {
        for (text, told) in [
            ("atari", "none of house, gym:ID"),
            ("gym:", "no id"),
            ("gym:--port", "no id"),
            ("openenv:wss://there/ws", "ssh -L"),
            ("openenv:ftp://there", "begins with ws://"),
            ("openenv:there:x", "port"),
            ("openenv:ws://:1/", "host"),
        ] {
            let error = text.parse::<EnvironmentName>().unwrap_err();
            assert!(error.contains(told), "{text}: {error}");
        }
        assert_eq!(
            "gym:BabyAI-GoToLocal-v0".parse::<EnvironmentName>().unwrap().to_string(),
            "gym:BabyAI-GoToLocal-v0"
        );
    }
}
