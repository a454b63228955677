//! What tests need from outside the sources. Where it is missing, a test says so and is skipped; where it is required, the
//! test fails.
//!
//! `SPRINT_REQUIRE_DATA` lists what is required, for instance `shared encoder agents slurm`. Unset, a machine that sets `CI`
//! requires all but Slurm and Python's packages.

// Unit tests and the tests of the program both include this file, and each uses a part of it.
#![allow(dead_code)]

use std::path::{Path, PathBuf};

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Need {
    /// The reference data beside the checkout.
    Shared,
    /// The sentence encoder that `make setup` fetches.
    Encoder,
    /// The agents under `checkpoints` and `tests/agents`.
    Agents,
    /// A Slurm to start on this machine.
    Slurm,
    /// Environments in Python.
    Python,
}

impl Need {
    fn word(self) -> &'static str {
        match self {
            Need::Shared => "shared",
            Need::Encoder => "encoder",
            Need::Agents => "agents",
            Need::Slurm => "slurm",
            Need::Python => "python",
        }
    }

    fn remedy(self) -> &'static str {
        match self {
            Need::Shared => {
                "put the reference data into `shared` beside the checkout, or name its folder in SPRINT_SHARED"
            }
            Need::Encoder => "run `make setup`",
            Need::Agents => "check out `checkpoints` and `tests/agents` whole",
            Need::Python => "run `make python-packages`",
            Need::Slurm => "install slurmctld, slurmd, slurm-client and munge, and run the tests as root",
        }
    }
}

fn is_required(need: Need, listed: Option<&str>, ci: bool) -> bool {
    match listed {
        Some(list) => list.split_whitespace().any(|word| word == need.word()),
        None => ci && ![Need::Slurm, Need::Python].contains(&need),
    }
}

/// Skips or fails a test that did not find what it needs.
pub(crate) fn missing(need: Need, what: &str) {
    let listed = std::env::var("SPRINT_REQUIRE_DATA").ok();
    let ci = std::env::var_os("CI").is_some_and(|value| !value.is_empty());
    let said = format!("{what} is missing; {}", need.remedy());
    assert!(!is_required(need, listed.as_deref(), ci), "{said}");
    eprintln!("skipped: {said}");
}

/// A path, where there is something.
fn existing(need: Need, path: PathBuf) -> Option<PathBuf> {
    if path.exists() {
        return Some(path);
    }
    missing(need, &path.display().to_string());
    None
}

fn shared_folder() -> PathBuf {
    let beside = || concat!(env!("CARGO_MANIFEST_DIR"), "/../shared").into();
    std::env::var_os("SPRINT_SHARED").map_or_else(beside, PathBuf::from)
}

/// A file or folder of the reference data.
pub(crate) fn shared(path: &str) -> Option<PathBuf> {
    existing(Need::Shared, shared_folder().join(path))
}

/// The sentence encoder, in the folder where it is looked for.
pub(crate) fn sentence_encoder(folder: &Path) -> Option<PathBuf> {
    existing(Need::Encoder, folder.join("model.safetensors")).map(|_| folder.to_owned())
}

/// An agent of the repository, by its folder there.
pub(crate) fn agent(folder: &str) -> Option<PathBuf> {
    existing(Need::Agents, Path::new(env!("CARGO_MANIFEST_DIR")).join(folder))
}

/// ALFRED as published: unpacked in the reference data, or from its archive once into the target folder.
pub(crate) fn alfred() -> Option<PathBuf> {
    let folder = shared_folder().join("alfred");
    if let Some(found) = [folder.join("alfred"), folder].into_iter().find(|folder| folder.join("data").is_dir()) {
        return Some(found);
    }
    let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("target");
    let unpacked = target.join("alfred");
    if unpacked.is_dir() {
        return Some(unpacked);
    }
    let archive = shared("alfred/alfred.tar.xz")?;
    std::fs::create_dir_all(&target).unwrap();
    let fresh = tempfile::tempdir_in(&target).unwrap();
    let tar = std::process::Command::new("tar").arg("-xJf").arg(&archive).arg("-C").arg(fresh.path()).status();
    assert!(tar.unwrap().success(), "tar could not unpack {}", archive.display());
    // Another test may have been faster.
    let _ = std::fs::rename(fresh.path().join("alfred"), &unpacked);
    assert!(unpacked.is_dir(), "{} could not be unpacked into {}", archive.display(), unpacked.display());
    Some(unpacked)
}

#[test]
fn what_is_listed_is_required_and_a_ci_machine_requires_all_but_slurm_and_python() {
    assert!(is_required(Need::Encoder, Some("encoder slurm"), false));
    assert!(!is_required(Need::Shared, Some("encoder slurm"), true));
    assert!(!is_required(Need::Shared, Some(""), true));
    assert!(is_required(Need::Shared, None, true) && !is_required(Need::Slurm, None, true));
    assert!(is_required(Need::Python, Some("python"), false) && !is_required(Need::Python, None, true));
    assert!(!is_required(Need::Agents, None, false));
}
