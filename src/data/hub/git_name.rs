//! What the Hub calls a file by its content: large ones by their SHA-256, small ones as git does.

use std::io;
use std::path::Path;

use anyhow::Context;
use sha2::Sha256;

use super::name::is_hex;
use crate::data::{json, plain_file};

/// Whether a text is such a name.
pub(super) fn is_one(text: &str) -> bool {
    is_hex(text, 64) || is_hex(text, 40)
}

/// What a file's content is called, in the same way as `like`.
///
/// # Errors
/// When the file cannot be read.
pub(super) fn of(path: &Path, like: &str) -> anyhow::Result<String> {
    let named = || -> io::Result<String> {
        let mut file = plain_file::open(path)?;
        if is_hex(like, 64) {
            use sha2::Digest;
            let mut digest = Sha256::new();
            io::copy(&mut file, &mut digest)?;
            return Ok(json::hex(&digest.finalize()));
        }
        use sha1::Digest;
        let mut digest = sha1::Sha1::new_with_prefix(format!("blob {}\0", file.metadata()?.len()));
        let mut content = Vec::new();
        io::Read::read_to_end(&mut file, &mut content)?;
        digest.update(&content);
        Ok(json::hex(&digest.finalize()))
    };
    named().with_context(|| format!("cannot read {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_files_are_called_as_git_does_and_large_ones_by_their_sha_256() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, "hello\n").unwrap();
        // As `git hash-object` and `sha256sum` say.
        assert_eq!(of(&path, &"0".repeat(40)).unwrap(), "ce013625030ba8dba906f756967f9e9ca394464a");
        let sha256 = "5891b5b522d5df086d0ff0b110fbd9d21bb4fc7163af34d08286a2e846f6be03";
        assert_eq!(of(&path, sha256).unwrap(), sha256);
    }
}
