//! A language model on a server that may read wishes in the program's place; where it cannot, the program reads them itself.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use serde_json::json;

use crate::domain::Class;
use crate::language::instruction::visible;
use crate::language::reader::answered_by_model;
use crate::language::reader::{WishReading, answered_by_model::prompt};
use crate::nets::completion_server::{Completion, CompletionServer, Pace};

/// The most tokens of an answer: a list of a few steps.
const MOST_TOKENS: u32 = 400;
/// Failures in a row after which it is asked no more: each costs a person the time that an answer may take.
const GIVEN_UP: u32 = 3;

/// A server that reads wishes.
pub(crate) struct ServedReader {
    server: CompletionServer,
    model: Option<String>,
    /// What it is called.
    name: String,
    /// Failures since its last answer.
    failures: AtomicU32,
}

impl fmt::Debug for ServedReader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl ServedReader {
    /// The reader that `http:URL` or `http:URL#MODEL` names; its key goes along with every request. Nothing is asked yet.
    ///
    /// # Errors
    /// When that is no server's address.
    pub(crate) fn named(name: &str, key: Option<String>, timeout: Duration) -> anyhow::Result<Arc<ServedReader>> {
        let told = name.strip_prefix("http:").filter(|rest| rest.contains("://")).unwrap_or(name);
        let (url, model) = match told.split_once('#') {
            Some((url, model)) if !model.is_empty() => (url, Some(model.to_owned())),
            _ => (told.trim_end_matches('#'), None),
        };
        // A person waits: whatever is wrong, the program reads the wish itself at once.
        let pace = Pace { at_once: 1, per_minute: None, tries: 1, first_wait: Duration::ZERO, timeout };
        let server = CompletionServer::new(url, key, pace, Arc::default())?;
        let name = model.clone().unwrap_or_else(|| "the server's model".into());
        Ok(Arc::new(ServedReader { server, model, name, failures: AtomicU32::new(0) }))
    }

    /// What it is called.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Reads a text in a house, where that is known; `earlier` are the wishes before.
    ///
    /// # Errors
    /// Says why it could not.
    pub(crate) fn read(
        &self,
        text: &str,
        earlier: &[&str],
        house: Option<&BTreeSet<Class>>,
    ) -> Result<WishReading, String> {
        if self.failures.load(Ordering::Relaxed) >= GIVEN_UP {
            return Err(format!("{} failed {GIVEN_UP} times in a row and is asked no more", self.name));
        }
        let read = self.ask(text, earlier, house);
        match &read {
            Ok(_) => self.failures.store(0, Ordering::Relaxed),
            Err(_) => drop(self.failures.fetch_add(1, Ordering::Relaxed)),
        }
        read
    }

    fn ask(&self, text: &str, earlier: &[&str], house: Option<&BTreeSet<Class>>) -> Result<WishReading, String> {
        let mut request = json!({
            "prompt": prompt(text, earlier, house),
            "max_tokens": MOST_TOKENS,
            "temperature": 0.0,
            "stop": ["\n"],
        });
        if let Some(model) = &self.model {
            request["model"] = json!(model);
        }
        let body = self.server.ask(&request).map_err(|error| format!("{error:#}"))?.unwrap_or_default();
        let choice = Completion::first_of(&body);
        let said = || visible(&String::from_utf8_lossy(&body)).chars().take(100).collect::<String>();
        let choice = choice.ok_or_else(|| format!("the server's answer is no completion: {}", said()))?;
        answered_by_model::reading(&choice.text, text, house, &self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_is_named_by_its_servers_address_and_perhaps_a_model() {
        let named = |name: &str| ServedReader::named(name, None, Duration::from_secs(1));
        for name in ["http:http://127.0.0.1:1/v1#llama", "http://127.0.0.1:1/v1#llama", "http:https://far/v1#llama"] {
            assert_eq!(named(name).unwrap().name(), "llama", "{name}");
        }
        assert_eq!(named("http://127.0.0.1:1").unwrap().name(), "the server's model");
        for name in ["llama", "http:", "http:127.0.0.1:8080", "ftp://x"] {
            let error = named(name).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(error.contains("no server's address"), "{name}: {error}");
        }
    }
}
