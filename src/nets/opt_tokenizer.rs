//! The tokenizer of an OPT folder.

use std::path::Path;

use anyhow::{Context, anyhow, ensure};
use sha2::{Digest, Sha256};
use tokenizers::Tokenizer;
use tokenizers::models::bpe::BPE;
use tokenizers::pre_tokenizers::byte_level::ByteLevel;

use super::opt_config::OptConfig;
use crate::data::{plain_file, text_file};

/// The tokenizer, from `tokenizer.json` or from the older `vocab.json` and `merges.txt`, for which the start is put by hand.
pub(super) fn read(folder: &Path, config: &OptConfig, hash: &mut Sha256) -> anyhow::Result<(Tokenizer, Option<u32>)> {
    let path = folder.join("tokenizer.json");
    let (tokenizer, start, path) = if path.is_file() {
        let bytes = plain_file::read(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        hash.update(&bytes);
        let tokenizer = Tokenizer::from_bytes(text_file::content(&bytes)?);
        let mut tokenizer = tokenizer.map_err(|error| anyhow!("{}: not a tokenizer: {error}", path.display()))?;
        tokenizer.with_truncation(None).map_err(|error| anyhow!("{}: {error}", path.display()))?;
        tokenizer.with_padding(None);
        (tokenizer, None, path)
    } else {
        let (vocabulary, merges) = (folder.join("vocab.json"), folder.join("merges.txt"));
        ensure!(
            vocabulary.is_file() && merges.is_file(),
            "{} holds neither tokenizer.json nor vocab.json with merges.txt",
            folder.display()
        );
        for path in [&vocabulary, &merges] {
            hash.update(plain_file::read(path).with_context(|| format!("{} cannot be read", path.display()))?);
        }
        let [words, pairs] = [&vocabulary, &merges].map(|path| path.display().to_string());
        let model = BPE::from_file(&words, &pairs).build().map_err(|error| anyhow!("{words}: {error}"))?;
        let mut tokenizer = Tokenizer::new(model);
        tokenizer.with_pre_tokenizer(Some(ByteLevel::new(false, true, true)));
        tokenizer.with_decoder(Some(ByteLevel::default()));
        (tokenizer, config.bos_token_id, vocabulary)
    };
    let largest = tokenizer.get_vocab(true).into_values().max().unwrap_or(0).max(start.unwrap_or(0));
    ensure!(
        i64::from(largest) < config.vocab_size,
        "{}: the token {largest} lies beyond the model's vocabulary of {}",
        path.display(),
        config.vocab_size
    );
    Ok((tokenizer, start))
}
