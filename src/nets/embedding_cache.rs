//! Embeddings on disk, by encoder and text: each text is embedded once, whoever asks.

use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use tch::{Device, Tensor};

use super::home;
use super::sentence::SentenceEncoder;
use crate::data::{folder, plain_file};

const FORMAT_VERSION: u32 = 1;

/// The first line of a cache file.
#[derive(Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(deny_unknown_fields)]
struct CacheHeader {
    format_version: u32,
    encoder: String,
    width: usize,
}

/// Bytes before and after a record's floats: the text's sha256, and a checksum of all before it.
const KEY: usize = 32;
const CHECK: usize = 8;
/// Bytes that are read at once while looking for keys.
const READ_AHEAD: usize = 1 << 20;

/// An append-only file of embeddings: a JSON line, then records of one length. Several processes may share it.
#[derive(Debug)]
pub struct EmbeddingCache {
    path: PathBuf,
    file: File,
    header: u64,
    width: usize,
    /// Where each text's record starts.
    records: HashMap<[u8; KEY], u64>,
    /// Up to where the file was read.
    end: u64,
}

impl EmbeddingCache {
    /// Opens the encoder's file in `folder`, or starts one. A record that was cut short, by a full disk or a lost
    /// connection, ends the file: it and what follows is dropped.
    ///
    /// # Errors
    /// When the file cannot be made or read, or was written by another version of the format; it may be deleted.
    pub fn open(folder: &Path, encoder: &str, width: usize) -> anyhow::Result<EmbeddingCache> {
        folder::make(folder).with_context(|| format!("{} cannot be made", folder.display()))?;
        let path = folder.join(format!("{}.embeddings", encoder.chars().take(16).collect::<String>()));
        let file = plain_file::append(&path);
        let file = file.with_context(|| format!("{} cannot be opened", path.display()))?;
        let mut cache = EmbeddingCache { path, file, header: 0, width, records: HashMap::new(), end: 0 };
        cache.file.lock()?;
        let outcome = cache.read_header(encoder).and_then(|()| cache.read_new());
        cache.file.unlock()?;
        outcome.with_context(|| format!("{} (a cache: it may be deleted)", cache.path.display()))?;
        Ok(cache)
    }

    fn read_header(&mut self, encoder: &str) -> anyhow::Result<()> {
        let expected = CacheHeader { format_version: FORMAT_VERSION, encoder: encoder.into(), width: self.width };
        let mut line = serde_json::to_vec(&expected)?;
        line.push(b'\n');
        if self.file.metadata()?.len() == 0 {
            self.file.write_all(&line)?;
        }
        let mut found = vec![0; line.len()];
        self.file.seek(SeekFrom::Start(0))?;
        let whole = self.file.read_exact(&mut found).is_ok();
        let text = String::from_utf8_lossy(&found);
        ensure!(
            whole && found == line,
            "its first line is {text:?}, not that of format_version {FORMAT_VERSION} for this encoder"
        );
        self.header = line.len() as u64;
        self.end = self.header;
        Ok(())
    }

    /// Finds the records that were appended since, by this process or another; call it with the lock held. What a record holds
    /// is checked when it is asked for.
    fn read_new(&mut self) -> anyhow::Result<()> {
        let (length, size) = (self.record() as u64, self.file.metadata()?.len());
        let mut file = BufReader::with_capacity(READ_AHEAD, self.file.try_clone()?);
        file.seek(SeekFrom::Start(self.end))?;
        while self.end + length <= size {
            let mut key = [0; KEY];
            file.read_exact(&mut key)?;
            file.seek_relative((length as usize - KEY) as i64)?;
            self.records.insert(key, self.end);
            self.end += length;
        }
        if self.end < size {
            self.file.set_len(self.end)?;
        }
        Ok(())
    }

    /// A record's length in bytes.
    fn record(&self) -> usize {
        KEY + self.width * size_of::<f32>() + CHECK
    }

    /// How many texts are stored.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.records.len()
    }

    /// A text's embedding, if it is stored. A record that was damaged is forgotten, so that it is written anew.
    ///
    /// # Errors
    /// When the file cannot be read any more.
    pub fn get(&mut self, text: &str) -> anyhow::Result<Option<Vec<f32>>> {
        let key = key(text);
        let Some(&start) = self.records.get(&key) else { return Ok(None) };
        let mut bytes = vec![0; self.record()];
        self.file.read_exact_at(&mut bytes, start).with_context(|| self.path.display().to_string())?;
        let (checked, check) = bytes.split_at(bytes.len() - CHECK);
        if checksum(checked) != check {
            self.records.remove(&key);
            return Ok(None);
        }
        let floats = checked[KEY..].chunks_exact(4);
        let embedding: Vec<f32> = floats.map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]])).collect();
        if !embedding.iter().all(|number| number.is_finite()) {
            self.records.remove(&key);
            return Ok(None);
        }
        Ok(Some(embedding))
    }

    /// Appends embeddings; texts that are stored already are passed over.
    ///
    /// # Errors
    /// When an embedding has another width, or the file cannot be written; what it held before is untouched.
    pub fn add<'a>(&mut self, embeddings: impl IntoIterator<Item = (&'a str, &'a [f32])>) -> anyhow::Result<()> {
        self.file.lock()?;
        let outcome = self.read_new().and_then(|()| self.append(embeddings)).and_then(|()| self.read_new());
        self.file.unlock()?;
        outcome.with_context(|| format!("{} cannot be added to", self.path.display()))
    }

    fn append<'a>(&mut self, embeddings: impl IntoIterator<Item = (&'a str, &'a [f32])>) -> anyhow::Result<()> {
        let mut bytes = Vec::new();
        for (text, embedding) in embeddings {
            ensure!(embedding.len() == self.width, "an embedding has width {}, not {}", embedding.len(), self.width);
            let key = key(text);
            if self.records.contains_key(&key) {
                continue;
            }
            let start = bytes.len();
            bytes.extend(key);
            bytes.extend(embedding.iter().flat_map(|value| value.to_le_bytes()));
            let check = checksum(&bytes[start..]);
            bytes.extend(check);
        }
        Ok(self.file.write_all(&bytes)?)
    }
}

fn key(text: &str) -> [u8; KEY] {
    Sha256::digest(text).into()
}

fn checksum(bytes: &[u8]) -> [u8; CHECK] {
    let mut short = [0; CHECK];
    short.copy_from_slice(&Sha256::digest(bytes)[..CHECK]);
    short
}

/// A sentence encoder with its cache: what the rest of the program embeds instructions with.
pub struct Embedder {
    encoder: SentenceEncoder,
    cache: Option<EmbeddingCache>,
}

impl Embedder {
    /// Loads an encoder's folder and opens its cache in the user's cache folder. Without a cache (a read-only home, say)
    /// it works all the same, and the log says so.
    ///
    /// # Errors
    /// As [`SentenceEncoder::load`].
    pub(crate) fn open(folder: &Path, device: Device) -> anyhow::Result<Embedder> {
        let encoder = SentenceEncoder::load(folder, device)?;
        let cache = EmbeddingCache::open(&home::cache_folder().join("embeddings"), encoder.digest(), encoder.width());
        if let Err(error) = &cache {
            tracing::warn!("embeddings are not cached: {error:#}");
        }
        Ok(Embedder { encoder, cache: cache.ok() })
    }

    /// An encoder with the cache of one's choice, or none.
    pub fn new(encoder: SentenceEncoder, cache: Option<EmbeddingCache>) -> Embedder {
        Embedder { encoder, cache }
    }

    /// The encoder itself.
    pub(crate) fn encoder(&self) -> &SentenceEncoder {
        &self.encoder
    }

    /// Embeds texts: `[texts, width]` on the encoder's device. Each text that is not cached is computed once.
    ///
    /// # Errors
    /// When the encoder fails or the cache cannot be read; that the cache cannot be written is only logged.
    pub fn embed(&mut self, texts: &[&str]) -> anyhow::Result<Tensor> {
        let mut known: HashMap<&str, Vec<f32>> = HashMap::new();
        let mut missing: Vec<&str> = Vec::new();
        for text in texts.iter().copied().collect::<BTreeSet<&str>>() {
            match self.cache.as_mut().map(|cache| cache.get(text)).transpose()?.flatten() {
                Some(embedding) => drop(known.insert(text, embedding)),
                None => missing.push(text),
            }
        }
        if !missing.is_empty() {
            known.extend(missing.iter().copied().zip(self.encoder.encode_rows(&missing)?));
            let new = missing.iter().map(|&text| (text, known[text].as_slice()));
            if let Some(Err(error)) = self.cache.as_mut().map(|cache| cache.add(new)) {
                tracing::warn!("embeddings are not cached: {error:#}");
            }
        }
        let rows: Vec<f32> = texts.iter().flat_map(|text| known[text].iter().copied()).collect();
        let shape = [texts.len() as i64, self.encoder.width() as i64];
        Ok(Tensor::from_slice(&rows).f_reshape(shape)?.to_device(self.encoder.device()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_embedding_is_found_again_by_another_reader() {
        let folder = tempfile::tempdir().unwrap();
        let mut first = EmbeddingCache::open(folder.path(), "0123456789abcdef0", 3).unwrap();
        let mut second = EmbeddingCache::open(folder.path(), "0123456789abcdef0", 3).unwrap();
        first.add([("slice the apple", &[1.0f32, -0.5, f32::MIN_POSITIVE][..]), ("", &[0.0, 0.0, 1.0])]).unwrap();
        second.add([("slice the apple", &[9.0f32, 9.0, 9.0][..]), ("other", &[2.0, 2.0, 2.0])]).unwrap();
        assert_eq!(second.len(), 3, "the second writer sees what the first wrote, and does not write it again");
        let mut third = EmbeddingCache::open(folder.path(), "0123456789abcdef0", 3).unwrap();
        assert_eq!(third.get("slice the apple").unwrap(), Some(vec![1.0, -0.5, f32::MIN_POSITIVE]));
        assert_eq!(third.get("").unwrap(), Some(vec![0.0, 0.0, 1.0]));
        assert_eq!(third.get("slice the potato").unwrap(), None);
    }

    #[test]
    fn a_record_that_was_cut_short_is_dropped_and_written_anew() {
        let folder = tempfile::tempdir().unwrap();
        let open = || EmbeddingCache::open(folder.path(), "e", 2).unwrap();
        open().add([("a", &[1.0f32, 2.0][..]), ("b", &[3.0, 4.0])]).unwrap();
        let path = folder.path().join("e.embeddings");
        let whole = std::fs::metadata(&path).unwrap().len();
        std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(whole - 5).unwrap();
        let mut cache = open();
        assert_eq!((cache.get("a").unwrap(), cache.get("b").unwrap()), (Some(vec![1.0, 2.0]), None));
        cache.add([("b", &[3.0f32, 4.0][..])]).unwrap();
        assert_eq!(open().get("b").unwrap(), Some(vec![3.0, 4.0]));
        assert_eq!(std::fs::metadata(&path).unwrap().len(), whole);
    }

    #[test]
    fn a_damaged_record_is_not_believed_and_written_anew() {
        let folder = tempfile::tempdir().unwrap();
        let open = || EmbeddingCache::open(folder.path(), "e", 2).unwrap();
        open().add([("a", &[1.0f32, 2.0][..]), ("b", &[3.0, 4.0])]).unwrap();
        let path = folder.path().join("e.embeddings");
        let mut bytes = std::fs::read(&path).unwrap();
        let last = bytes.len() - CHECK - 1;
        bytes[last] ^= 1;
        std::fs::write(&path, &bytes).unwrap();
        let mut cache = open();
        assert_eq!((cache.get("a").unwrap(), cache.get("b").unwrap()), (Some(vec![1.0, 2.0]), None));
        cache.add([("b", &[3.0f32, 4.0][..])]).unwrap();
        assert_eq!((cache.get("b").unwrap(), open().get("b").unwrap()), (Some(vec![3.0, 4.0]), Some(vec![3.0, 4.0])));
    }

    #[test]
    fn another_format_or_encoder_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        drop(EmbeddingCache::open(folder.path(), "e", 2).unwrap());
        let error = format!("{:#}", EmbeddingCache::open(folder.path(), "e", 3).unwrap_err());
        assert!(error.contains("e.embeddings") && error.contains("may be deleted"), "{error}");
    }
}
