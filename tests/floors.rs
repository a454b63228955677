//! The floors: imports point down only, and each outside library stays on the floors that need it. Read from the sources' text.

use std::path::{Path, PathBuf};

/// Ground floor first.
const FLOORS: [&str; 16] = [
    "domain", "language", "house", "data", "nets", "algo", "agent", "episode", "run_dir", "report", "eval", "train",
    "analysis", "explore", "tui", "cli",
];

/// Libraries, and the floors that may use them.
const LIBRARIES: [(&str, &[&str]); 4] =
    [("tch", &["nets", "algo", "agent", "train"]), ("ratatui", &["tui"]), ("crossterm", &["tui"]), ("clap", &["cli"])];

/// A source file: its floor and its lines that are code.
struct Source {
    path: PathBuf,
    floor: &'static str,
    code: Vec<(usize, String)>,
}

fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    for floor in FLOORS {
        let mut folders = vec![root.join(floor)];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|extension| extension == "rs") {
                    // Tests may look up: what they build is not part of the floor.
                    let text = std::fs::read_to_string(&path).unwrap();
                    let text = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
                    let numbered = text.lines().enumerate().map(|(i, line)| (i + 1, line.to_owned()));
                    let code = numbered.filter(|(_, line)| !line.trim_start().starts_with("//")).collect();
                    found.push(Source { path, floor, code });
                }
            }
        }
    }
    assert!(found.len() > 20, "the sources were not found");
    found
}

/// The modules that a line names behind `crate::`, a braced list of them included.
fn crate_paths(line: &str) -> Vec<&str> {
    let mut named = Vec::new();
    for (at, _) in line.match_indices("crate::") {
        // `some_crate::` is another word.
        if line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let rest = &line[at + "crate::".len()..];
        let parts = match rest.strip_prefix('{') {
            Some(list) => list.split(',').map(str::trim).collect(),
            None => vec![rest],
        };
        let word = |part: &'_ str| part.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(part.len());
        named.extend(parts.into_iter().map(|part| &part[..word(part)]));
    }
    named
}

fn rank(floor: &str) -> Option<usize> {
    FLOORS.iter().position(|&known| known == floor)
}

#[test]
fn imports_point_down_only() {
    let mut upward = Vec::new();
    for source in sources() {
        for (number, line) in &source.code {
            for target in crate_paths(line) {
                if rank(target) > rank(source.floor) {
                    upward.push(format!("{}:{number}: {} imports {target}", source.path.display(), source.floor));
                }
            }
        }
    }
    assert!(upward.is_empty(), "{}", upward.join("\n"));
}

#[test]
fn each_library_stays_on_its_floors() {
    let mut strays = Vec::new();
    for source in sources() {
        for (library, floors) in LIBRARIES {
            if floors.contains(&source.floor) {
                continue;
            }
            let uses = |line: &str| {
                let path = format!("{library}::");
                line.match_indices(&path)
                    .any(|(at, _)| !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_'))
            };
            for (number, line) in source.code.iter().filter(|(_, line)| uses(line)) {
                strays.push(format!("{}:{number}: {library} in {}: {line}", source.path.display(), source.floor));
            }
        }
    }
    assert!(strays.is_empty(), "{}", strays.join("\n"));
}

#[test]
fn the_reader_of_imports_sees_them() {
    assert_eq!(crate_paths("use crate::house::{Outcome, House};"), ["house"]);
    assert_eq!(crate_paths("use crate::{agent, run::stats};"), ["agent", "run"]);
    assert_eq!(crate_paths("    crate::language::instruction::normalise(crate::domain::x)"), ["language", "domain"]);
    assert!(crate_paths("other_crate::tui::x").is_empty());
    assert!(rank("cli") > rank("domain") && rank("serde").is_none());
}

#[test]
fn no_tracked_file_names_a_path_of_one_machine() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let listed = std::process::Command::new("git").args(["ls-files", "-z"]).current_dir(root).output();
    let Some(listed) = listed.ok().filter(|output| output.status.success()) else {
        eprintln!("skipped: tracked files are known only in a git checkout");
        return;
    };
    // Put together here so that this file does not name them either.
    let homes = ["root", "home", "work", "Users"].map(|folder| format!("/{folder}/"));
    let mut found = Vec::new();
    for name in listed.stdout.split(|&byte| byte == 0).filter(|name| !name.is_empty()) {
        let name = std::str::from_utf8(name).unwrap();
        let Ok(text) = std::fs::read_to_string(root.join(name)) else { continue };
        for (number, line) in text.lines().enumerate() {
            let at_start = |home: &String| {
                let before = |at: usize| line[..at].chars().next_back();
                // A path begins here: not in the middle of a longer one such as `src/home/`.
                line.match_indices(home.as_str())
                    .any(|(at, _)| before(at).is_none_or(|c| !(c.is_alphanumeric() || "_-./~}>$".contains(c))))
            };
            if homes.iter().any(at_start) {
                found.push(format!("{name}:{}: {}", number + 1, line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
