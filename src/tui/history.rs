//! The instructions that a person gave, kept from session to session: a line each in a file of the state folder. A file that
//! is broken costs what is broken in it, never the session.

use std::io::{self, Write};
use std::path::Path;

use crate::data::plain_file;
use crate::language::instruction::LONGEST;

/// The first line of the file.
const HEAD: &str = "# format_version = 1";
/// Instructions that are kept.
const MOST: usize = 500;

/// What earlier sessions left.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Remembered {
    /// The instructions, oldest first.
    pub(crate) instructions: Vec<String>,
    /// There was no earlier session.
    pub(crate) is_first: bool,
}

/// Reads what earlier sessions left; a file that has grown long is cut. Lines that are no instructions are passed over.
pub(crate) fn read(path: &Path) -> Remembered {
    let bytes = match plain_file::read(path) {
        Ok(bytes) => bytes,
        Err(error) => return Remembered { is_first: error.kind() == io::ErrorKind::NotFound, ..Remembered::default() },
    };
    let text = String::from_utf8_lossy(&bytes);
    let fit = |line: &&str| !line.starts_with('#') && !line.trim().is_empty() && line.len() <= LONGEST;
    let clean = |line: &&str| !line.chars().any(|c| c.is_control() || c == char::REPLACEMENT_CHARACTER);
    let mut found: Vec<String> = text.lines().filter(fit).filter(clean).map(str::to_string).collect();
    found.dedup();
    let many = found.len();
    let instructions = found.split_off(many.saturating_sub(MOST));
    if many > 2 * MOST {
        let kept = format!("{HEAD}\n{}\n", instructions.join("\n"));
        if let Err(error) = crate::data::atomic_file::write(path, kept.as_bytes()) {
            tracing::info!("{error:#}");
        }
    }
    Remembered { instructions, is_first: false }
}

/// Adds an instruction, if any, to the file, which is made where there is none.
///
/// # Errors
/// When the file cannot be written.
pub(crate) fn add(path: &Path, instruction: Option<&str>) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut file = plain_file::append(path)?;
    let head = if file.metadata()?.len() == 0 { format!("{HEAD}\n") } else { String::new() };
    let line = instruction.map_or(String::new(), |line| format!("{line}\n"));
    // One write, so that sessions side by side do not mix their lines.
    file.write_all(format!("{head}{line}").as_bytes())
}

/// Keeps an instruction; where that cannot be, the log says why and the session goes on.
pub(crate) fn keep(path: &Path, instruction: Option<&str>) {
    if let Err(error) = add(path, instruction) {
        tracing::info!("{}: {error}", path.display());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_come_back_in_order_and_the_first_session_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sprint").join("history");
        assert!(read(&path).is_first);
        add(&path, None).unwrap();
        assert_eq!(read(&path), Remembered::default());
        for line in ["Open the fridge.", "Take the mug.", "Take the mug."] {
            add(&path, Some(line)).unwrap();
        }
        assert_eq!(read(&path).instructions, ["Open the fridge.", "Take the mug."]);
        assert!(std::fs::read_to_string(&path).unwrap().starts_with("# format_version = 1\nOpen"));
    }

    #[test]
    fn a_broken_file_costs_only_what_is_broken_in_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history");
        let mut bytes = b"Take the mug.\n\xff\xfe nonsense\n\x1b[2J\n\n".to_vec();
        bytes.extend(vec![b'a'; 2 * LONGEST]);
        bytes.extend(b"\nOpen the fridge.");
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(read(&path).instructions, ["Take the mug.", "Open the fridge."]);
        assert!(!read(folder.path()).is_first, "a folder in its place is no history, and no first session");
    }

    #[test]
    fn a_long_history_is_cut_to_its_newest_lines() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history");
        let lines: Vec<String> = (0..3 * MOST).map(|number| format!("Go to {number}.")).collect();
        std::fs::write(&path, lines.join("\n")).unwrap();
        let found = read(&path).instructions;
        assert_eq!((found.len(), found[MOST - 1].as_str()), (MOST, "Go to 1499."));
        assert_eq!(read(&path).instructions, found);
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), MOST + 1);
    }
}
