//! Listens, and gives every connection a thread and a session of its own.

use std::net::{SocketAddr, TcpListener, ToSocketAddrs};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use anyhow::Context;
use tempfile::TempDir;

use super::episodes::Episodes;
use super::refusal::{ErrorCode, Refusal};
use super::session::Session;
use super::{local, websocket};

/// How many connections may play at a time.
const SESSIONS: usize = 256;

const AFTER_FAILURE: Duration = Duration::from_millis(50);

/// A server that listens; its socket is gone when it is dropped.
pub(crate) struct Server {
    sessions: Arc<Sessions>,
    web: TcpListener,
    socket: UnixListener,
    path: PathBuf,
    /// Only its owner may look into it.
    _folder: TempDir,
}

/// What every connection's session is made of.
struct Sessions {
    episodes: Arc<Episodes>,
    size: usize,
    open: AtomicUsize,
}

/// A session's place, given back with it.
struct Place(Arc<Sessions>);

impl Server {
    /// Listens at the address for WebSockets, and in a folder of its owner's for the local protocol. Frames have `size` pixels
    /// a side until a connection asks for another.
    ///
    /// # Errors
    /// When it cannot listen.
    pub(crate) fn listen(episodes: Episodes, size: usize, address: (&str, u16)) -> anyhow::Result<Server> {
        let (host, port) = address;
        let at = || format!("cannot listen at {host}:{port}");
        let web = TcpListener::bind(resolve(address).with_context(at)?).with_context(at)?;
        let folder =
            tempfile::Builder::new().prefix("sprint-").tempdir().context("cannot make a folder for a socket")?;
        let path = folder.path().join("house");
        let socket = UnixListener::bind(&path).with_context(|| format!("cannot listen at {}", path.display()))?;
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600))?;
        let sessions = Arc::new(Sessions { episodes: Arc::new(episodes), size, open: AtomicUsize::new(0) });
        Ok(Server { sessions, web, socket, path, _folder: folder })
    }

    /// Where WebSockets connect.
    ///
    /// # Errors
    /// When the system does not say.
    pub(crate) fn url(&self) -> anyhow::Result<String> {
        Ok(format!("ws://{}/ws", self.web.local_addr()?))
    }

    /// Where the local protocol is spoken.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Takes connections, from now on and beside whatever else happens.
    ///
    /// # Errors
    /// When a listener cannot be shared with a thread.
    pub(crate) fn start(&self) -> anyhow::Result<()> {
        let (web, sessions) = (self.web.try_clone()?, self.sessions.clone());
        each(
            move || Ok(web.accept()?.0),
            move |stream| {
                let open = || Ok((sessions.place()?, sessions.session()));
                websocket::serve(stream, open)
            },
        );
        let (socket, sessions) = (self.socket.try_clone()?, self.sessions.clone());
        each(
            move || Ok(socket.accept()?.0),
            move |stream| {
                let _place = sessions.place()?;
                Ok(local::serve(stream, sessions.session())?)
            },
        );
        Ok(())
    }
}

/// Takes connections in a thread, and serves each in a thread of its own.
fn each<S: Send + 'static>(
    accept: impl Fn() -> std::io::Result<S> + Send + 'static,
    serve: impl Fn(S) -> anyhow::Result<()> + Clone + Send + 'static,
) {
    std::thread::spawn(move || {
        loop {
            let Ok(stream) = accept() else {
                // For instance too many open files: it may pass.
                std::thread::sleep(AFTER_FAILURE);
                continue;
            };
            let serve = serve.clone();
            std::thread::spawn(move || {
                if let Err(error) = serve(stream) {
                    tracing::info!("a connection ended: {error:#}");
                }
            });
        }
    });
}

fn resolve(address: (&str, u16)) -> anyhow::Result<SocketAddr> {
    address.to_socket_addrs()?.next().context("there is no such address")
}

impl Sessions {
    fn session(&self) -> Session {
        Session::new(self.episodes.clone(), self.size)
    }

    fn place(self: &Arc<Sessions>) -> Result<Place, Refusal> {
        let place = Place(self.clone());
        if self.open.fetch_add(1, Ordering::Relaxed) >= SESSIONS {
            let message = format!("{SESSIONS} sessions are open already");
            return Err(Refusal { code: ErrorCode::CapacityReached, message });
        }
        Ok(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.open.fetch_sub(1, Ordering::Relaxed);
    }
}
