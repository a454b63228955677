//! Who reads typed instructions, from the command line.

use std::sync::Arc;
use std::time::Duration;

use clap::Args;

use super::language_model::KEY;
use crate::episode::wish::ServedReader;

/// Seconds that an answer may take: a person waits for it.
const PATIENCE: u64 = 10;

/// A language model that reads what is typed.
#[derive(Args, Clone)]
pub(crate) struct WishReaderArgs {
    /// Let a language model on an OpenAI-compatible server say what an instruction asks for, as http:http://127.0.0.1:8080/v1#MODEL;
    /// its key, if it needs one, is read from the environment variable SPRINT_API_KEY. Where it does not answer, the program reads it
    /// [default: the program]
    #[arg(long, value_name = "http:URL#MODEL")]
    reader: Option<String>,
    /// How long the language model may take for each instruction
    #[arg(long, value_name = "SECONDS", default_value_t = PATIENCE, value_parser = clap::value_parser!(u64).range(1..=3600))]
    reader_timeout: u64,
}

impl Default for WishReaderArgs {
    /// The program reads.
    fn default() -> WishReaderArgs {
        WishReaderArgs { reader: None, reader_timeout: PATIENCE }
    }
}

impl WishReaderArgs {
    /// The language model, where one was named.
    ///
    /// # Errors
    /// When what was named is no server's address.
    pub(crate) fn open(&self) -> anyhow::Result<Option<Arc<ServedReader>>> {
        let key = std::env::var(KEY).ok().filter(|key| !key.is_empty());
        let timeout = Duration::from_secs(self.reader_timeout);
        let named = self.reader.as_deref().map(|name| ServedReader::named(name, key, timeout));
        named.transpose().map_err(|error| error.context("--reader"))
    }
}
