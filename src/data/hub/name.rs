//! Names of checkpoints on the Hub.

use std::fmt;
use std::path::Path;

/// A checkpoint's name: `ORG/NAME[@REVISION]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct HubName {
    pub(super) repository: String,
    pub(super) revision: String,
}

/// The revision of a name without one.
const MAIN: &str = "main";

impl HubName {
    /// Reads a name; nothing where it is none, or begins with a folder that is here: a slip in a path is not looked for on the Hub.
    pub(crate) fn of_path(named: &Path) -> Option<HubName> {
        let is_here = named.components().next().is_some_and(|first| Path::new(&first).exists());
        named.to_str().filter(|_| !is_here).and_then(HubName::read)
    }

    fn read(text: &str) -> Option<HubName> {
        let (repository, revision) = text.split_once('@').unwrap_or((text, MAIN));
        let (org, name) = repository.split_once('/')?;
        let is_plain = |part: &str| {
            let fits = part.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c));
            fits && !part.starts_with(['.', '-']) && !part.is_empty()
        };
        let is_name = is_plain(org) && is_plain(name) && revision.split('/').all(is_plain);
        is_name.then(|| HubName { repository: repository.into(), revision: revision.into() })
    }

    /// Whether the revision is a whole commit, which never means anything else.
    pub(super) fn is_commit(&self) -> bool {
        is_hex(&self.revision, 40)
    }
}

/// Whether a text is so many hexadecimal digits.
pub(super) fn is_hex(text: &str, digits: usize) -> bool {
    text.len() == digits && text.bytes().all(|byte| byte.is_ascii_hexdigit() && !byte.is_ascii_uppercase())
}

impl fmt::Display for HubName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.revision == MAIN {
            true => f.write_str(&self.repository),
            false => write!(f, "{}@{}", self.repository, self.revision),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_an_organisation_and_maybe_a_revision_and_a_path_is_none() {
        let name = |repository: &str, revision: &str| {
            Some(HubName { repository: repository.into(), revision: revision.into() })
        };
        assert_eq!(HubName::read("org/red-ball"), name("org/red-ball", "main"));
        assert_eq!(HubName::read("org/red.ball@refs/pr/1"), name("org/red.ball", "refs/pr/1"));
        assert_eq!(HubName::read("org/red@v1").unwrap().to_string(), "org/red@v1");
        for path in ["checkpoint", "a/b/c", "./a", "../b", "/a/b", "a/", "a/b@", "a/b@../c", "a b/c"] {
            assert_eq!(HubName::read(path), None, "{path}");
        }
        assert_eq!(HubName::of_path(Path::new("src/data")), None, "there is such a folder");
        assert_eq!(
            HubName::of_path(Path::new("checkpoints/no-such-agent")),
            None,
            "a folder among those here is meant"
        );
    }
}
