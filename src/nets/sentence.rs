//! Sentence encoders: folders as sentence-transformers publishes them, computed by libtorch.

use std::path::{Path, PathBuf};

use anyhow::Context;
use sha2::{Digest, Sha256};

use super::home;

/// The files of the default encoder whose contents set-up vouches for, with their sha256.
const DEFAULT_FILES: [(&str, &str); 2] = [
    ("model.safetensors", "53aa51172d142c89d9012cce15ae4d6cc0ca6895895114379cacb4fab128d9db"),
    ("tokenizer.json", "be50c3628f2bf5bb5e3a7f17b1f74611b2561a3a27eeab05e5aa30f411572037"),
];

/// Where set-up puts the default encoder, all-MiniLM-L6-v2.
pub fn default_folder() -> PathBuf {
    home::cache_folder().join("encoders/all-MiniLM-L6-v2")
}

/// Checks that a folder holds the default encoder, unaltered.
///
/// # Errors
/// When a file is missing or has another sha256.
pub fn verify_default(folder: &Path) -> anyhow::Result<()> {
    for (name, expected) in DEFAULT_FILES {
        let path = folder.join(name);
        let bytes = std::fs::read(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        let found = format!("{:x}", Sha256::digest(&bytes));
        anyhow::ensure!(found == expected, "{} has sha256 {found}, not {expected}", path.display());
    }
    Ok(())
}
