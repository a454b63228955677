//! `sprint embed`: a sentence a line in, a JSON array a line out.

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;

use super::exit_status::ExitStatus;
use super::streams;
use crate::agent::sentence_encoders;
use crate::data::text_file;
use crate::nets::device::best_device;
use crate::nets::sentence::{SentenceEncoder, default_folder};

/// Lines that are embedded together, when so many are waiting.
const TOGETHER: usize = 256;

/// Embeds sentences.
#[derive(Args)]
pub(crate) struct EmbedArgs {
    /// A sentence encoder's folder, as sentence-transformers publishes them, or its name in SPRINT_HOME/encoders [default:
    /// all-MiniLM-L6-v2, which `make setup` fetched]
    #[arg(long, value_name = "DIR|NAME")]
    encoder: Option<PathBuf>,
}

impl EmbedArgs {
    /// Embeds standard input to standard output. Answers as soon as no further line is waiting, so that a program can
    /// hold a conversation with it.
    ///
    /// # Errors
    /// When the encoder cannot be loaded or a line is not UTF-8.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let encoder = SentenceEncoder::load(
            &self.encoder.as_deref().map_or_else(default_folder, sentence_encoders::folder_of),
            best_device(),
        )?;
        for settings in encoder.unread_settings() {
            streams::say(&format!("settings of the sentence encoder that are not read: {settings}"));
        }
        let mut lines = BufReader::with_capacity(1 << 16, std::io::stdin());
        let mut out = streams::StandardOutput::lock();
        let mut number = 0;
        while let Some(first) = next_line(&mut lines, &mut number)? {
            let mut texts = vec![first];
            while texts.len() < TOGETHER && lines.buffer().contains(&b'\n') {
                texts.extend(next_line(&mut lines, &mut number)?);
            }
            let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
            for embedding in encoder.encode_rows(&texts)? {
                serde_json::to_writer(&mut out, &embedding)?;
                out.write_all(b"\n")?;
            }
            out.flush()?;
        }
        Ok(ExitStatus::Ok)
    }
}

/// The next line without its end, or `None` at the end of the input.
fn next_line(input: &mut impl BufRead, number: &mut usize) -> anyhow::Result<Option<String>> {
    let mut bytes = Vec::new();
    if input.read_until(b'\n', &mut bytes).context("standard input cannot be read")? == 0 {
        return Ok(None);
    }
    *number += 1;
    let line = String::from_utf8(bytes).with_context(|| format!("line {number} is not UTF-8 text"))?;
    Ok(Some(text_file::line(&line).trim_end_matches(['\n', '\r']).to_string()))
}
