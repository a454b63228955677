//! A session with an environment in another process: its connection, its child where it has one, and what it can do.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use serde_json::{Value, json};

use super::capabilities::Capabilities;
use super::child::{self, Child};
use super::connection::{self, Connection};
use crate::domain::{Action, EnvironmentName};
use crate::env::action_space::ActionSpace;
use crate::env::observation::RemoteObservation;

/// How often an idle connection answers the other side's pings.
const HEARTBEAT: Duration = Duration::from_secs(5);

/// How long is waited for an environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Patience {
    /// For a child to listen: it may have much to load.
    pub(crate) start: Duration,
    /// For a connection.
    pub(crate) connect: Duration,
    /// For each answer.
    pub(crate) answer: Duration,
}

impl Patience {
    /// As long as `OpenEnv`'s own client waits for an answer.
    pub(crate) const USUAL: Patience =
        Patience { start: Duration::from_secs(180), connect: Duration::from_secs(10), answer: Duration::from_secs(60) };
}

/// A session. What goes wrong in it ends it: a broken one answers nothing more.
pub(crate) struct Session {
    /// How it is named.
    pub(crate) name: EnvironmentName,
    /// What can be done there.
    pub(crate) space: Arc<ActionSpace>,
    /// What it can do.
    pub(crate) capabilities: Capabilities,
    patience: Patience,
    link: Arc<Mutex<Link>>,
}

struct Link {
    /// Nothing once it broke.
    connection: Option<Connection>,
    child: Option<Child>,
    /// How pictures travel here was chosen.
    has_format: bool,
}

/// What a request was answered with.
enum Answer {
    Data(Value),
    /// The server understood, and refused.
    Refused(String),
}

fn lock(link: &Mutex<Link>) -> MutexGuard<'_, Link> {
    link.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Session {
    /// Starts or reaches an environment, and asks what it can do.
    ///
    /// # Errors
    /// When it cannot be reached, or is none that can be acted in; with what a child said last.
    pub(crate) fn open(name: &EnvironmentName, patience: Patience) -> anyhow::Result<Session> {
        Session::begin(name, patience).with_context(|| name.to_string())
    }

    fn begin(name: &EnvironmentName, patience: Patience) -> anyhow::Result<Session> {
        let (child, address) = match name {
            EnvironmentName::House => bail!("House is no other process"),
            EnvironmentName::OpenEnv(address) => (None, address.clone()),
            EnvironmentName::Gym(id) => {
                let (child, address) = Child::start(child::gym(id, child::package()), patience.start)?;
                (Some(child), address)
            }
        };
        let mut link = Link { connection: None, child, has_format: false };
        link.connection = Some(Connection::open(&address, patience.connect).map_err(|error| link.explained(&error))?);
        // The first question may be answered late: an environment is made for it.
        let (capabilities, space) = match link.ask(&json!({"type": "capabilities"}), patience.start)? {
            Answer::Data(data) => Capabilities::read(data)?,
            Answer::Refused(_) => {
                let page = connection::page(&address, "/schema", patience.answer)
                    .context("it does not say what it can do, and its schema cannot be read")?;
                let schema = serde_json::from_str(&page).context("/schema")?;
                Capabilities::of_schema(&schema, name.to_string())?
            }
        };
        let link = Arc::new(Mutex::new(link));
        keep_alive(Arc::downgrade(&link))?;
        Ok(Session { name: name.clone(), space: Arc::new(space), capabilities, patience, link })
    }

    /// Whether something went wrong in it.
    pub(crate) fn is_broken(&self) -> bool {
        lock(&self.link).connection.is_none()
    }

    /// Goes to the start of the episode of that seed.
    ///
    /// # Errors
    /// When it breaks or refuses.
    pub(super) fn reset(&self, seed: u64) -> anyhow::Result<RemoteObservation> {
        let observation = self.observed(&json!({"type": "reset", "data": {"seed": seed}}))?;
        self.choose_format()?;
        Ok(observation)
    }

    /// Acts; `None` where the environment refuses the action, which changes nothing then.
    ///
    /// # Errors
    /// When it breaks.
    pub(super) fn step(&self, action: Action) -> anyhow::Result<Option<RemoteObservation>> {
        let data = self.capabilities.step(&self.space, action)?;
        match self.ask(&json!({"type": "step", "data": data}))? {
            Answer::Data(data) => self.read(data).map(Some),
            Answer::Refused(why) => {
                tracing::info!("{}: {} was refused: {why}", self.name, self.space.words(action));
                Ok(None)
            }
        }
    }

    /// The present state's name in this session.
    ///
    /// # Errors
    /// When it breaks or refuses.
    pub(super) fn snapshot(&self) -> anyhow::Result<String> {
        let data = self.data(&json!({"type": "snapshot"}))?;
        let id = data.get("id").and_then(Value::as_str).context("snapshot: no id came")?;
        Ok(id.to_owned())
    }

    /// Goes back to a state of this session.
    ///
    /// # Errors
    /// When it breaks or refuses.
    pub(super) fn restore(&self, id: &str) -> anyhow::Result<RemoteObservation> {
        self.observed(&json!({"type": "restore", "data": {"id": id}}))
    }

    fn observed(&self, request: &Value) -> anyhow::Result<RemoteObservation> {
        let data = self.data(request)?;
        self.read(data)
    }

    fn data(&self, request: &Value) -> anyhow::Result<Value> {
        let kind = request.get("type").and_then(Value::as_str).unwrap_or_default();
        match self.ask(request)? {
            Answer::Data(data) => Ok(data),
            Answer::Refused(why) => bail!("{}: {kind} was refused: {why}", self.name),
        }
    }

    /// What cannot be read is the end of the session: nothing more is known of the state.
    fn read(&self, data: Value) -> anyhow::Result<RemoteObservation> {
        RemoteObservation::read(data, &self.space).map_err(|error| {
            lock(&self.link).connection = None;
            error.context(format!("{} sent what cannot be read", self.name))
        })
    }

    fn ask(&self, request: &Value) -> anyhow::Result<Answer> {
        lock(&self.link).ask(request, self.patience.answer).with_context(|| self.name.to_string())
    }

    /// Measures once in which format pictures come soonest here, and asks for that: they are the same in each.
    fn choose_format(&self) -> anyhow::Result<()> {
        let formats: Vec<&str> = self.capabilities.formats.iter().map(String::as_str).collect();
        let known: Vec<&str> = ["raw", "png"].into_iter().filter(|it| formats.contains(it)).collect();
        if std::mem::replace(&mut lock(&self.link).has_format, true) || known.len() < 2 {
            return Ok(());
        }
        let mut best: Option<(Duration, &str)> = None;
        for format in known {
            let request = json!({"type": "format", "data": {"format": format}});
            let mut shortest = Duration::MAX;
            for _ in 0..3 {
                let asked = Instant::now();
                self.observed(&request)?;
                shortest = shortest.min(asked.elapsed());
            }
            if best.is_none_or(|(time, _)| shortest < time) {
                best = Some((shortest, format));
            }
        }
        if let Some((_, format)) = best {
            self.observed(&json!({"type": "format", "data": {"format": format}}))?;
        }
        Ok(())
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let mut link = lock(&self.link);
        if let Some(connection) = &mut link.connection {
            connection.close();
        }
        (link.connection, link.child) = (None, None);
    }
}

impl Link {
    fn ask(&mut self, request: &Value, limit: Duration) -> anyhow::Result<Answer> {
        let connection = self.connection.as_mut().context("the connection broke before")?;
        let answered = connection.ask(&request.to_string(), limit);
        let read = answered.and_then(|text| answer(&text, request));
        read.map_err(|error| {
            self.connection = None;
            self.explained(&error)
        })
    }

    /// An error with how the child ended, where it did.
    fn explained(&mut self, error: &anyhow::Error) -> anyhow::Error {
        match &mut self.child {
            Some(child) => anyhow::anyhow!("{error:#}: {}", child.how_it_ended()),
            None => anyhow::anyhow!("{error:#}"),
        }
    }
}

/// Reads an answer to a request.
fn answer(text: &str, request: &Value) -> anyhow::Result<Answer> {
    let mut answer: Value = serde_json::from_str(text).map_err(|error| {
        let shown: String = text.chars().take(80).collect();
        anyhow::anyhow!("it answered with what is no JSON ({error}): {shown:?}")
    })?;
    let data = answer.get_mut("data").map(Value::take).unwrap_or_default();
    let asked = request.get("type").and_then(Value::as_str).unwrap_or_default();
    let wanted = match asked {
        "reset" | "step" | "format" | "restore" => "observation",
        other => other,
    };
    match answer.get("type").and_then(Value::as_str) {
        Some("error") => {
            let told = |name: &str| data.get(name).and_then(Value::as_str).unwrap_or("without a word").to_owned();
            let (message, code) = (told("message"), told("code"));
            // After these the session is over.
            ensure!(
                !["CAPACITY_REACHED", "FACTORY_ERROR", "SESSION_ERROR"].contains(&code.as_str()),
                "{message} ({code})"
            );
            Ok(Answer::Refused(message))
        }
        Some(kind) if kind == wanted => Ok(Answer::Data(data)),
        kind => bail!("it answered {asked} with {:?} in place of {wanted:?}", kind.unwrap_or("no type")),
    }
}

/// Answers pings while nobody asks anything, until the session is gone: a server takes a silent client for a dead one.
fn keep_alive(link: Weak<Mutex<Link>>) -> anyhow::Result<()> {
    let beat = move || {
        loop {
            thread::sleep(HEARTBEAT);
            let Some(link) = link.upgrade() else { break };
            let Ok(mut link) = link.try_lock() else { continue };
            let Some(connection) = &mut link.connection else { break };
            if !connection.idle() {
                link.connection = None;
                break;
            }
        }
    };
    thread::Builder::new().name("heartbeat".into()).spawn(beat).context("a thread could not be started")?;
    Ok(())
}
