//! Times in copies of a mebibyte, beside those that are stored.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::io::ErrorKind;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context;
use serde::Serialize;

use crate::data::{atomic_file, text_file};

const MEBIBYTE: usize = 1 << 20;

/// Stored times, and what was compared with them.
pub struct Baselines {
    stored: BTreeMap<String, f64>,
    copy: f64,
    compared: Vec<Comparison>,
}

/// A time beside the stored one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// What was measured.
    pub name: String,
    /// How long it takes, in copies of a mebibyte.
    pub copies: f64,
    /// How many times as long as what is stored; nothing where nothing is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ratio: Option<f64>,
}

impl Baselines {
    /// Those that come with the program.
    ///
    /// # Errors
    /// When their file is damaged.
    pub fn shipped() -> anyhow::Result<Baselines> {
        let text = include_str!("../../../assets/bench_baselines.json");
        Baselines::parse(text).context("the stored baselines are damaged")
    }

    /// Those of a file.
    ///
    /// # Errors
    /// When it cannot be read, or is no table of names and numbers.
    pub fn read(path: &Path) -> anyhow::Result<Baselines> {
        let text = text_file::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
        Baselines::parse(&text).with_context(|| format!("{} is not a table of names and numbers", path.display()))
    }

    fn parse(text: &str) -> anyhow::Result<Baselines> {
        Ok(Baselines { stored: serde_json::from_str(text)?, copy: copy_seconds(), compared: Vec::new() })
    }

    /// Seconds for copying a mebibyte.
    pub(crate) fn copy_seconds(&self) -> f64 {
        self.copy
    }

    /// Counts a time in copies, and puts it beside what is stored under its name.
    pub fn compare(&mut self, name: &str, time: Duration) -> &Comparison {
        let copies = time.as_secs_f64() / self.copy;
        let ratio = self.stored.get(name).map(|stored| copies / stored);
        self.compared.push(Comparison { name: name.to_owned(), copies, ratio });
        &self.compared[self.compared.len() - 1]
    }

    /// What was compared, in that order.
    pub(crate) fn into_comparisons(self) -> Vec<Comparison> {
        self.compared
    }

    /// Stores what was compared beside what was stored already.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn store(compared: &[Comparison], path: &Path) -> anyhow::Result<()> {
        let mut table: BTreeMap<String, f64> = match text_file::read(path) {
            Ok(text) => serde_json::from_str(&text)
                .with_context(|| format!("{} is not a table of names and numbers", path.display()))?,
            Err(error) if error.kind() == ErrorKind::NotFound => BTreeMap::new(),
            Err(error) => return Err(error).with_context(|| format!("{} cannot be read", path.display())),
        };
        let rounded = |copies: f64| (copies * 1e3).round() / 1e3;
        table.extend(compared.iter().map(|one| (one.name.clone(), rounded(one.copies))));
        atomic_file::write(path, (serde_json::to_string_pretty(&table)? + "\n").as_bytes())
    }
}

/// The least that copying a mebibyte takes here, in seconds.
pub fn copy_seconds() -> f64 {
    let (from, mut to) = (vec![1u8; MEBIBYTE], vec![0u8; MEBIBYTE]);
    let mut once = || {
        let begun = Instant::now();
        to.copy_from_slice(black_box(&from));
        black_box(&mut to);
        begun.elapsed().as_secs_f64()
    };
    (0..2000).map(|_| once()).fold(f64::INFINITY, f64::min)
}

/// The least time of so many rounds of something.
pub(super) fn least<E>(rounds: usize, mut once: impl FnMut() -> Result<(), E>) -> Result<Duration, E> {
    let mut least = Duration::MAX;
    for _ in 0..rounds {
        let begun = Instant::now();
        once()?;
        least = least.min(begun.elapsed());
    }
    Ok(least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_stands_beside_the_stored_one_in_copies_and_what_is_stored_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("baselines.json");
        std::fs::write(&path, r#"{"a frame": 2.0, "kept": 7.5}"#).unwrap();
        let mut baselines = Baselines::read(&path).unwrap();
        let copy = Duration::from_secs_f64(baselines.copy_seconds());
        let frame = baselines.compare("a frame", 6 * copy).clone();
        assert!((frame.ratio.unwrap() - 3.0).abs() < 0.01, "{frame:?}");
        assert_eq!(baselines.compare("new", 4 * copy).ratio, None);
        Baselines::store(&baselines.into_comparisons(), &path).unwrap();
        let stored = Baselines::read(&path).unwrap().stored;
        assert_eq!(stored.keys().collect::<Vec<_>>(), ["a frame", "kept", "new"]);
        assert!((stored["a frame"] - 6.0).abs() < 0.01 && stored["kept"] == 7.5);
    }

    #[test]
    fn a_file_of_something_else_is_refused_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("baselines.json");
        std::fs::write(&path, "[1, 2]").unwrap();
        let refused = format!("{:#}", Baselines::read(&path).err().unwrap());
        assert!(refused.contains("baselines.json is not a table"), "{refused}");
        assert!(Baselines::shipped().is_ok());
    }
}
