//! A language model on a server that speaks OpenAI's completions (llama.cpp, vLLM, Ollama and others).

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::{Duration, Instant};

use anyhow::{anyhow, bail, ensure};
use serde::Deserialize;
use serde_json::Value;

use crate::language::instruction::visible;

/// What a model wrote, as far as it is read.
#[derive(Deserialize)]
pub(crate) struct Completion {
    pub(crate) text: String,
    /// Why it ended: `length` where it was cut off.
    #[serde(default)]
    pub(crate) finish_reason: Option<String>,
}

impl Completion {
    /// The first one of a server's answer; `None` where that has not the form of completions.
    pub(crate) fn first_of(answer: &[u8]) -> Option<Completion> {
        #[derive(Deserialize)]
        struct Completions {
            choices: Vec<Completion>,
        }
        let completions: Completions = serde_json::from_slice(answer).ok()?;
        completions.choices.into_iter().next()
    }
}

/// How often and how patiently a server is asked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    /// Requests that are under way at once.
    pub(crate) at_once: usize,
    /// Requests in a minute at most.
    pub(crate) per_minute: Option<u32>,
    /// Tries of one request before the work ends with an error.
    pub(crate) tries: u32,
    /// The wait before the second try; each further one is twice as long.
    pub(crate) first_wait: Duration,
    /// How long an answer may take.
    pub(crate) timeout: Duration,
}

/// No wait between two tries is longer, unless the server asks for it.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// A server that asks for a longer wait has refused.
const LONGEST_ASKED: Duration = Duration::from_secs(3600);

/// Tries of a connection before the server has ever answered: its address may be wrong.
const FIRST_TRIES: u32 = 3;

/// An answer has no more bytes.
const LARGEST_ANSWER: u64 = 16 << 20;

/// A server, the model asked for, and what may be asked when.
pub(crate) struct CompletionServer {
    agent: ureq::Agent,
    /// Where completions are asked for.
    url: String,
    key: Option<String>,
    pace: Pace,
    next_turn: Mutex<Option<Instant>>,
    has_answered: AtomicBool,
    stop: Arc<AtomicBool>,
}

/// Why a try gave nothing.
struct FailedTry {
    why: String,
    /// Whether nothing came back at all.
    is_connection: bool,
    /// How long the server asks to wait.
    asked_wait: Option<Duration>,
}

impl CompletionServer {
    /// A server by its address, with or without the `/v1` at its end; `key` goes along with every request. Nothing is asked yet.
    ///
    /// # Errors
    /// When the address is none.
    pub(crate) fn new(
        url: &str,
        key: Option<String>,
        pace: Pace,
        stop: Arc<AtomicBool>,
    ) -> anyhow::Result<CompletionServer> {
        let (scheme, rest) = url.split_once("://").unwrap_or_default();
        ensure!(
            ["http", "https"].contains(&scheme) && !rest.is_empty(),
            "{url:?} is no server's address: it should be like http://127.0.0.1:8080/v1"
        );
        ensure!(!rest.contains('@'), "the address holds a user name: put a key into the environment instead");
        let base = url.trim_end_matches('/').trim_end_matches("/completions");
        let has_path = base.splitn(4, '/').nth(3).is_some();
        let url = if has_path { format!("{base}/completions") } else { format!("{base}/v1/completions") };
        // A redirect is not followed: the key is for this server alone.
        let config = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .max_redirects(0)
            .max_redirects_will_error(false)
            .timeout_global(Some(pace.timeout))
            .user_agent(concat!("sprint/", env!("CARGO_PKG_VERSION")))
            .build();
        let agent = ureq::Agent::new_with_config(config);
        let (next_turn, has_answered) = (Mutex::new(None), AtomicBool::new(false));
        Ok(CompletionServer { agent, url, key, pace, next_turn, has_answered, stop })
    }

    /// Does so many things that need an answer each, several at once; `take` is given what `ask` makes of each, in the order in which
    /// answers come, unless the work was stopped before.
    ///
    /// # Errors
    /// The first error of either; the answers that are under way then are still taken: they are paid for.
    pub(crate) fn each<T: Send>(
        &self,
        count: usize,
        ask: &(dyn Fn(usize) -> anyhow::Result<Option<T>> + Sync),
        take: &mut dyn FnMut(usize, T) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let (next, ended) = (AtomicUsize::new(0), AtomicBool::new(false));
        let (send, receive) = mpsc::channel();
        std::thread::scope(|scope| {
            for _ in 0..self.pace.at_once.clamp(1, count.max(1)) {
                let (send, next, ended) = (send.clone(), &next, &ended);
                scope.spawn(move || {
                    while !ended.load(Ordering::Relaxed) {
                        let index = next.fetch_add(1, Ordering::Relaxed);
                        if index >= count {
                            break;
                        }
                        let Some(answer) = ask(index).transpose() else { break };
                        if answer.is_err() {
                            ended.store(true, Ordering::Relaxed);
                        }
                        // Nobody receives any more once the scope is left by a panic.
                        if send.send((index, answer)).is_err() {
                            break;
                        }
                    }
                });
            }
            drop(send);
            let mut outcome = Ok(());
            for (index, answer) in receive {
                if let Err(error) = answer.and_then(|answer| take(index, answer)) {
                    ended.store(true, Ordering::Relaxed);
                    outcome = outcome.and(Err(error));
                }
            }
            outcome
        })
    }

    /// The answer to a request, or nothing when the work was stopped before.
    ///
    /// # Errors
    /// When the server refuses, or does not answer in any of the tries.
    pub(crate) fn ask(&self, request: &Value) -> anyhow::Result<Option<Vec<u8>>> {
        let mut wait = self.pace.first_wait;
        for attempt in 1.. {
            if !self.wait_for_turn() {
                return Ok(None);
            }
            let failed = match self.attempt(request)? {
                Ok(answer) => {
                    self.has_answered.store(true, Ordering::Relaxed);
                    return Ok(Some(answer));
                }
                Err(failed) => failed,
            };
            let first = failed.is_connection && !self.has_answered.load(Ordering::Relaxed);
            let tries = if first { self.pace.tries.min(FIRST_TRIES) } else { self.pace.tries };
            if attempt >= tries {
                let tries = if attempt == 1 { String::new() } else { format!(" ({attempt} tries)") };
                bail!("{}: {}{tries}", self.url, failed.why);
            }
            tracing::warn!("{}: {}; try {attempt} of {tries}", self.url, failed.why);
            if !self.sleep(failed.asked_wait.unwrap_or(wait)) {
                return Ok(None);
            }
            wait = (wait * 2).min(LONGEST_WAIT);
        }
        Ok(None)
    }

    /// One try; the inner error may be mended by another one.
    fn attempt(&self, request: &Value) -> anyhow::Result<Result<Vec<u8>, FailedTry>> {
        let mut post = self.agent.post(&self.url).content_type("application/json");
        if let Some(key) = &self.key {
            post = post.header("Authorization", format!("Bearer {key}"));
        }
        let connection =
            |error: ureq::Error| FailedTry { why: error.to_string(), is_connection: true, asked_wait: None };
        let mut response = match post.send(serde_json::to_vec(request)?) {
            Ok(response) => response,
            Err(error @ (ureq::Error::BadUri(_) | ureq::Error::Http(_))) => bail!("{}: {error}", self.url),
            Err(error) => return Ok(Err(connection(error))),
        };
        let status = response.status().as_u16();
        let header = response.headers().get("retry-after").and_then(|value| value.to_str().ok());
        let asked_wait = header.and_then(|value| value.parse().ok()).map(Duration::from_secs);
        let body = match response.body_mut().with_config().limit(LARGEST_ANSWER).read_to_vec() {
            Ok(body) => body,
            Err(error) => return Ok(Err(connection(error))),
        };
        if status == 200 {
            return Ok(Ok(body));
        }
        let said: String = visible(&String::from_utf8_lossy(&body)).chars().take(300).collect();
        let why = format!("the server answers {status}: {said}");
        let may_pass = matches!(status, 408 | 409 | 425 | 429 | 500..=599);
        if may_pass && asked_wait.is_none_or(|wait| wait <= LONGEST_ASKED) {
            return Ok(Err(FailedTry { why, is_connection: false, asked_wait }));
        }
        Err(anyhow!(match status {
            401 | 403 => format!("{}: {why}: put its key into the environment as SPRINT_API_KEY", self.url),
            404 | 405 => format!("{}: {why}: the address of its completions, without that word, is needed", self.url),
            _ => format!("{}: {why}", self.url),
        }))
    }

    /// Waits until the rate allows a request; false when the work was stopped.
    fn wait_for_turn(&self) -> bool {
        let Some(per_minute) = self.pace.per_minute else { return !self.stop.load(Ordering::Relaxed) };
        let between = Duration::from_secs(60) / per_minute.max(1);
        let now = Instant::now();
        let turn = {
            let mut next = self.next_turn.lock().unwrap_or_else(PoisonError::into_inner);
            let turn = next.unwrap_or(now).max(now);
            *next = Some(turn + between);
            turn
        };
        self.sleep(turn - now)
    }

    /// Sleeps; false when the work was stopped.
    fn sleep(&self, time: Duration) -> bool {
        let until = Instant::now() + time;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            if self.stop.load(Ordering::Relaxed) || left.is_zero() {
                return !self.stop.load(Ordering::Relaxed);
            }
            std::thread::sleep(left.min(Duration::from_millis(50)));
        }
    }
}
