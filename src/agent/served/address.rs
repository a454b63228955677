//! Where a policy server listens, as the command line names it.

use std::fmt;
use std::net::{IpAddr, SocketAddr, ToSocketAddrs};
use std::str::FromStr;

use anyhow::Context;

/// `ws:HOST[:PORT][/PATH]`, also with `//` before the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PolicyAddress {
    host: String,
    port: u16,
    path: String,
}

impl PolicyAddress {
    /// Where vla-eval's and openpi's servers listen unless they are told otherwise.
    const PORT: u16 = 8000;

    /// The socket addresses of the host.
    ///
    /// # Errors
    /// When its name is not known.
    pub(crate) fn resolve(&self) -> anyhow::Result<Vec<SocketAddr>> {
        let host = self.host.trim_matches(['[', ']']);
        let found = (host, self.port).to_socket_addrs();
        Ok(found.with_context(|| format!("the host {host:?} of the policy server is not known"))?.collect())
    }

    /// Whether pictures go over no network to it.
    pub(crate) fn is_local(&self) -> bool {
        let host = self.host.trim_matches(['[', ']']);
        host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
    }
}

impl fmt::Display for PolicyAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ws://{}:{}{}", self.host, self.port, self.path)
    }
}

impl FromStr for PolicyAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<PolicyAddress, String> {
        if text.starts_with("wss:") {
            return Err(
                "wss: (TLS) is not spoken: forward the server's port, for example with ssh -L, and name it as ws:"
                    .into(),
            );
        }
        let rest = text.strip_prefix("ws:").ok_or_else(|| format!("{text:?} does not begin with ws:"))?;
        let rest = rest.strip_prefix("//").unwrap_or(rest);
        let (place, path) = rest.find('/').map_or((rest, ""), |slash| rest.split_at(slash));
        // An IPv6 address has colons of its own, in brackets.
        let (host, port) = match place.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => (host, port.parse::<u16>().ok().filter(|&port| port > 0)),
            _ => (place, Some(PolicyAddress::PORT)),
        };
        let named = !host.is_empty() && !host.contains(char::is_whitespace) && !host.contains('@');
        match (named, port) {
            (true, Some(port)) => Ok(PolicyAddress { host: host.into(), port, path: path.into() }),
            _ => Err(format!("{text:?} names no server: it is ws:HOST:PORT, for example ws:127.0.0.1:8000")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_is_named_by_host_port_and_path() {
        for (text, whole) in [
            ("ws:127.0.0.1:8001", "ws://127.0.0.1:8001"),
            ("ws://node7:9000/policy/a", "ws://node7:9000/policy/a"),
            ("ws:localhost", "ws://localhost:8000"),
            ("ws:[::1]:8002", "ws://[::1]:8002"),
            ("ws:[::1]", "ws://[::1]:8000"),
        ] {
            assert_eq!(text.parse::<PolicyAddress>().unwrap().to_string(), whole);
        }
        let is_local = |text: &str| text.parse::<PolicyAddress>().unwrap().is_local();
        assert!(
            is_local("ws:localhost:1") && is_local("ws:[::1]") && is_local("ws:127.0.0.9") && !is_local("ws:node7")
        );
    }

    #[test]
    fn what_names_no_server_is_refused_with_an_example() {
        for text in ["ws:", "ws:host:port", "ws:host:0", "ws:host:70000", "ws::8000", "ws:a b", "ws:me@host"] {
            let refusal = text.parse::<PolicyAddress>().unwrap_err();
            assert!(refusal.contains("ws:127.0.0.1:8000"), "{text}: {refusal}");
        }
        assert!("wss://host:1".parse::<PolicyAddress>().unwrap_err().contains("ssh -L"));
    }
}
