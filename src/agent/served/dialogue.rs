//! What is said to a policy server and what it says, in vla-eval's words or openpi's.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::{anyhow, bail};
use rmpv::Value;

use super::address::PolicyAddress;
use super::array::field;
use super::connection::{Connection, Missing, quoted};
use super::server_gone::ServerGone;

/// The protocol that a server speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Protocol {
    /// Typed messages: hello, `episode_start`, observation, action, `episode_end`, error.
    VlaEval,
    /// The server tells about itself first; then an observation is answered by a map.
    Openpi,
}

/// A conversation with a policy server.
pub(super) struct Dialogue {
    connection: Connection,
    address: PolicyAddress,
    limit: Duration,
    pub(super) protocol: Protocol,
    /// What the server says of itself.
    pub(super) about: Value,
    sequence: u64,
}

/// The version of vla-eval's protocol.
const VERSION: u64 = 1;
/// A server that tells about itself unasked does so in this time.
const UNASKED: Duration = Duration::from_millis(250);

impl Dialogue {
    /// Connects and greets. Where `known` is nothing, the server's first words tell which protocol it speaks.
    ///
    /// # Errors
    /// When nobody answers there, or not in a known protocol.
    pub(super) fn open(address: &PolicyAddress, limit: Duration, known: Option<Protocol>) -> anyhow::Result<Dialogue> {
        let connection = Connection::open(address, limit)?;
        let (address, protocol, about) = (address.clone(), known.unwrap_or(Protocol::VlaEval), Value::Nil);
        let mut dialogue = Dialogue { connection, address, limit, protocol, about, sequence: 0 };
        let first = match known {
            None => dialogue.connection.receive_within(UNASKED),
            Some(Protocol::Openpi) => dialogue.connection.receive(),
            Some(Protocol::VlaEval) => Err(Missing::Late),
        };
        match first {
            Ok(about) if about.is_map() && field(&about, "type").is_none() => {
                (dialogue.protocol, dialogue.about) = (Protocol::Openpi, about);
            }
            Err(Missing::Late) if known != Some(Protocol::Openpi) => dialogue.greet()?,
            Ok(_) => bail!("{}", dialogue.strange("it spoke unasked, but not in a known protocol")),
            Err(missing) => return Err(dialogue.problem(missing, "when it was greeted")),
        }
        Ok(dialogue)
    }

    fn greet(&mut self) -> anyhow::Result<()> {
        let hello = map([
            ("harness_version", concat!("sprint ", env!("CARGO_PKG_VERSION")).into()),
            ("protocol_version", VERSION.into()),
        ]);
        let sequence = self.say("hello", hello).map_err(|missing| self.problem(missing, "when it was greeted"))?;
        self.about = self.answer("hello", sequence, "when it was greeted")?;
        match field(&self.about, "protocol_version").and_then(Value::as_u64) {
            Some(VERSION) => Ok(()),
            Some(other) => {
                bail!("{}", self.strange(&format!("it speaks version {other} of the protocol, not {VERSION}")))
            }
            None => bail!("{}", self.strange("its hello has no protocol_version")),
        }
    }

    /// The name that the server gives its policy.
    pub(super) fn policy_name(&self) -> Option<&str> {
        field(&self.about, "model_server").or_else(|| field(&self.about, "name"))?.as_str()
    }

    /// The hash that the server gives its policy's weights.
    pub(super) fn checkpoint_hash(&self) -> Option<&str> {
        field(&self.about, "checkpoint_hash")?.as_str()
    }

    /// Tells that an episode begins; openpi has no word for it.
    ///
    /// # Errors
    /// When the server is gone.
    pub(super) fn begin(&mut self, episode: Value) -> anyhow::Result<()> {
        if self.protocol == Protocol::Openpi {
            return Ok(());
        }
        self.say("episode_start", episode).map_err(|missing| self.problem(missing, "when an episode began"))?;
        Ok(())
    }

    /// Tells that the episode is over, if anyone listens still.
    pub(super) fn end(&mut self) {
        if self.protocol == Protocol::VlaEval {
            let _ = self.say("episode_end", map([]));
        }
    }

    /// What the server answers to an observation.
    ///
    /// # Errors
    /// When it is gone, late, or says something else.
    pub(super) fn ask(&mut self, observation: Value, step: u32) -> anyhow::Result<Value> {
        let when = format!("at step {step}");
        if self.protocol == Protocol::VlaEval {
            let sequence = self.say("observation", observation).map_err(|missing| self.problem(missing, &when))?;
            return self.answer("action", sequence, &when);
        }
        let answer = self.connection.send(&observation).and_then(|()| self.connection.receive());
        match answer.map_err(|missing| self.problem(missing, &when))? {
            answer if answer.is_map() => Ok(answer),
            _ => bail!("{}", self.strange(&format!("{when} its answer is no map"))),
        }
    }

    fn say(&mut self, kind: &str, payload: Value) -> Result<u64, Missing> {
        self.sequence += 1;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let message = map([
            ("type", kind.into()),
            ("payload", payload),
            ("seq", self.sequence.into()),
            ("timestamp", now.as_secs_f64().into()),
        ]);
        self.connection.send(&message)?;
        Ok(self.sequence)
    }

    /// The payload of the next message, which must be of that kind and answer that one.
    fn answer(&mut self, kind: &str, sequence: u64, when: &str) -> anyhow::Result<Value> {
        let message = self.connection.receive().map_err(|missing| self.problem(missing, when))?;
        let said = field(&message, "type").and_then(|kind| kind.as_str()).unwrap_or("");
        let payload = field(&message, "payload").cloned().unwrap_or(Value::Nil);
        match said {
            "error" => {
                let why = field(&payload, "error").unwrap_or(&payload);
                let why = why.as_str().map_or_else(|| why.to_string(), str::to_owned);
                bail!("the policy server at {} failed {when}: {}", self.address, quoted(&why))
            }
            _ if said != kind => {
                bail!("{}", self.strange(&format!("{when} it answered with {} instead of {kind:?}", quoted(said))))
            }
            _ if field(&message, "seq").and_then(Value::as_u64) != Some(sequence) => {
                bail!("{}", self.strange(&format!("{when} it answered another question (its seq is not {sequence})")))
            }
            _ if !payload.is_map() => bail!("{}", self.strange(&format!("{when} its payload is no map"))),
            _ => Ok(payload),
        }
    }

    pub(super) fn strange(&self, what: &str) -> String {
        format!(
            "the policy server at {} is not understood: {what} (assets/docs/policies.md has what is expected)",
            self.address
        )
    }

    fn problem(&self, missing: Missing, when: &str) -> anyhow::Error {
        let address = self.address.to_string();
        match missing {
            Missing::Rubbish(what) => anyhow!(self.strange(&format!("{when} {what}"))),
            Missing::Late => anyhow!(
                "the policy server at {address} did not answer within {} s {when}: see what it does, or allow it more with \
                 --policy-timeout",
                self.limit.as_secs_f64()
            ),
            // It may have ended this conversation alone.
            Missing::Closed(why) => match Connection::open(&self.address, self.limit) {
                Ok(mut again) => {
                    again.close();
                    anyhow!("the policy server at {address} broke off {when} ({why}): its own log says more")
                }
                Err(error) => anyhow!(ServerGone { address, why: error.root_cause().to_string() }),
            },
        }
    }
}

impl Drop for Dialogue {
    fn drop(&mut self) {
        self.connection.close();
    }
}

/// A map of these fields.
pub(super) fn map<const N: usize>(fields: [(&str, Value); N]) -> Value {
    Value::Map(fields.into_iter().map(|(name, value)| (name.into(), value)).collect())
}
