//! The floors: imports point down only, and each outside library stays on the floors that need it. Read from the sources' text.

use std::collections::BTreeSet;
use std::path::Path;

use super::imports::{Source, sources};

/// Ground floor first.
const FLOORS: [&str; 19] = [
    "domain", "language", "house", "env", "data", "control", "nets", "algo", "agent", "episode", "run_dir", "report",
    "eval", "train", "analysis", "serve", "explore", "tui", "cli",
];

/// Libraries, and the floors that may use them.
const LIBRARIES: [(&str, &[&str]); 10] = [
    ("tch", &["nets", "algo", "agent", "train"]),
    ("ratatui", &["tui"]),
    ("ratatui_textarea", &["tui"]),
    ("crossterm", &["tui"]),
    ("termprofile", &["tui"]),
    ("clap", &["cli"]),
    ("clap_complete", &["cli"]),
    ("clap_mangen", &["cli"]),
    ("indicatif", &["cli"]),
    ("ureq", &["data", "nets"]),
];

/// The commands that use a screen: those that open one, and the one that says what the terminal can draw.
const COMMANDS_WITH_A_SCREEN: [&str; 3] = ["cli::annotate", "cli::explore", "cli::doctor"];

fn rank(floor: &str) -> Option<usize> {
    FLOORS.iter().position(|&known| known == floor)
}

#[test]
fn imports_point_down_only() {
    let mut upward = Vec::new();
    for source in sources() {
        for named in &source.named {
            let Some(target) = source.below_crate(&named.segments).and_then(|path| path.first().cloned()) else {
                continue;
            };
            if rank(source.floor()).is_some() && rank(&target) > rank(source.floor()) {
                let (path, line) = (source.path.display(), named.line);
                upward.push(format!("{path}:{line}: {} imports {target}", source.floor()));
            }
        }
    }
    assert!(upward.is_empty(), "{}", upward.join("\n"));
}

#[test]
fn every_folder_of_the_sources_is_a_floor() {
    let floors: BTreeSet<String> = sources().iter().map(|source| source.floor().to_owned()).collect();
    let known = FLOORS.iter().copied().chain(["lib", "main"]).map(str::to_owned).collect();
    assert_eq!(floors, known);
    assert!(rank("cli") > rank("domain") && rank("serde").is_none());
}

#[test]
fn each_library_stays_on_its_floors() {
    let mut strays = Vec::new();
    for source in sources() {
        for (library, floors) in LIBRARIES {
            if floors.contains(&source.floor()) {
                continue;
            }
            for named in source.named.iter().filter(|named| named.segments[0] == library) {
                let (path, line) = (source.path.display(), named.line);
                strays.push(format!("{path}:{line}: {} in {}", named.segments.join("::"), source.floor()));
            }
        }
    }
    assert!(strays.is_empty(), "{}", strays.join("\n"));
}

#[test]
fn only_the_commands_that_open_a_screen_use_one() {
    let uses_screen = |source: &Source| {
        let mut paths = source.named.iter().filter_map(|named| source.below_crate(&named.segments));
        paths.any(|path| path.first().is_some_and(|floor| floor == "tui"))
    };
    // A command may be a file with a folder of its parts.
    let command = |source: &Source| source.module.split("::").take(2).collect::<Vec<_>>().join("::");
    let users: BTreeSet<String> =
        sources().iter().filter(|source| source.floor() == "cli" && uses_screen(source)).map(command).collect();
    assert_eq!(users, COMMANDS_WITH_A_SCREEN.map(str::to_owned).into());
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

/// The one file that may step an environment, and those that may step House or its rules behind the seam: the environment that
/// wraps it, and in the simulator itself the session, recorded actions, the expert and what makes or checks houses.
const STEPPERS: [(&str, &[&str]); 3] = [
    ("env.step(", &["src/episode/rollout.rs"]),
    ("house.step(", &["src/env/house.rs", "src/house/"]),
    ("rules::apply(", &["src/house/"]),
];

#[test]
fn nothing_but_the_rollout_steps_an_environment() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut strays = Vec::new();
    for source in sources() {
        let path = source.path.strip_prefix(root).unwrap_or(&source.path).display().to_string();
        let text = std::fs::read_to_string(&source.path).unwrap();
        // Tests may step what they test.
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        if path.ends_with("/tests.rs") || path.ends_with("/testing.rs") {
            continue;
        }
        for (call, owners) in STEPPERS {
            if code.contains(call) && !owners.iter().any(|owner| path.starts_with(owner)) {
                strays.push(format!("{path} calls {call}...)"));
            }
        }
    }
    assert!(strays.is_empty(), "{}", strays.join("\n"));
}
