//! What the explorer can start with where nothing was named: found in the folders around, listed, and searched by a few letters.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use nucleo_matcher::pattern::{AtomKind, CaseMatching, Normalization, Pattern};
use nucleo_matcher::{Config, Matcher, Utf32Str};

use super::kept_session::KeptSession;
use super::session_file;
use crate::data::dataset::Dataset;
use crate::data::plain_file;
use crate::domain::Room;
use crate::language::count::counted;
use crate::run_dir::layout::MANIFEST;
use crate::run_dir::manifest::RunManifest;

/// Something to start with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    /// A session that was kept, from where it was left.
    Session(PathBuf),
    /// A generated house.
    House { room: Room, seed: u64 },
    /// Where a demonstration in this floor plan of the dataset began.
    FloorPlan(String),
    /// A task of a file, by its number from 1.
    Task { file: PathBuf, number: u64 },
    /// The default house, with this agent.
    Checkpoint(PathBuf),
    /// A recorded episode of a run, by its number from 1.
    Run { folder: PathBuf, number: u64 },
}

/// A line of the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct StartEntry {
    pub(crate) start: Start,
    /// Which of its kind.
    pub(crate) name: String,
    /// What more there is to say.
    pub(crate) note: String,
}

/// Where is looked.
pub(crate) struct StartFolders {
    /// The file of the last session.
    pub(crate) session: PathBuf,
    /// The dataset.
    pub(crate) data: PathBuf,
    /// Task files and `runs` are looked for in it.
    pub(crate) here: PathBuf,
    /// The agents at hand.
    pub(crate) checkpoints: Vec<PathBuf>,
}

impl Start {
    /// Its kind, in a word or two.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Start::Session(path) if session_file::is_broken_off(path) => "broken off",
            Start::Session(_) => "last session",
            Start::House { .. } => "house",
            Start::FloorPlan(_) => "floor plan",
            Start::Task { .. } => "tasks",
            Start::Checkpoint(_) => "checkpoint",
            Start::Run { .. } => "run",
        }
    }

    /// Whether it goes on where something was tried already: then nothing runs before a person wants it to.
    pub(crate) fn goes_on(&self) -> bool {
        matches!(self, Start::Session(_) | Start::Run { .. })
    }

    /// The same with another seed, task or episode; nothing where there is none to choose.
    fn numbered(&self, number: u64) -> Option<Start> {
        match self {
            Start::House { room, .. } => Some(Start::House { room: *room, seed: number }),
            Start::Task { file, .. } => Some(Start::Task { file: file.clone(), number }),
            Start::Run { folder, .. } => Some(Start::Run { folder: folder.clone(), number }),
            Start::Session(_) | Start::FloorPlan(_) | Start::Checkpoint(_) => None,
        }
    }
}

impl StartEntry {
    fn of(start: Start, name: impl Into<String>, note: impl Into<String>) -> StartEntry {
        StartEntry { start, name: name.into(), note: note.into() }
    }

    /// What is chosen of its kind: the seed, the task, the episode.
    pub(crate) fn choice(&self) -> String {
        match &self.start {
            Start::House { seed, .. } => format!("seed {seed}"),
            Start::Task { number, .. } => format!("task {number}"),
            Start::Run { number, .. } => format!("episode {number}"),
            Start::Session(_) | Start::FloorPlan(_) | Start::Checkpoint(_) => String::new(),
        }
    }
}

/// Everything that can be started with: the last session and those that were broken off first, then houses, floor plans, task
/// files, checkpoints, runs. What cannot be read is left out.
pub(crate) fn list(folders: &StartFolders) -> Vec<StartEntry> {
    let runs = runs(&folders.here.join("runs"));
    let broken_off =
        session_file::broken_off(&folders.session).into_iter().filter_map(|(when, path)| Some((when, session(&path)?)));
    let mut sessions: Vec<(SystemTime, StartEntry)> = broken_off.chain(last_session(&folders.session, &runs)).collect();
    sessions.sort_by_key(|(when, _)| std::cmp::Reverse(*when));
    let mut found: Vec<StartEntry> = sessions.into_iter().map(|(_, entry)| entry).collect();
    found.extend(
        session(&session_file::before(&folders.session))
            .map(|entry| StartEntry { note: format!("before that, {}", entry.note), ..entry }),
    );
    // As a person would name them: kitchens first.
    let rooms = [Room::Kitchen, Room::Bedroom, Room::LivingRoom, Room::Bathroom];
    found.extend(rooms.map(|room| StartEntry::of(Start::House { room, seed: 0 }, room.spoken(), "generated")));
    found.extend(floor_plans(&folders.data));
    for folder in [folders.data.join("tasks"), folders.here.clone()] {
        found.extend(task_files(&folder));
    }
    found.extend(folders.checkpoints.iter().map(|path| {
        let whole = path.parent().map_or_else(String::new, |folder| format!("in {}", folder.display()));
        StartEntry::of(Start::Checkpoint(path.clone()), file_name(path), whole)
    }));
    found.extend(runs.into_iter().map(|(_, entry)| entry));
    found
}

/// The session that ended last: kept by the explorer itself, or as a run by a person if that is newer.
fn last_session(kept: &Path, runs: &[(SystemTime, StartEntry)]) -> Option<(SystemTime, StartEntry)> {
    let own = session(kept).map(|entry| (modified(kept), entry));
    let explored = runs.iter().find(|(_, entry)| entry.name.starts_with("explored-"));
    let saved = explored.map(|(when, run)| {
        let note = format!("saved as {}", run.name);
        (*when, StartEntry { note, ..run.clone() })
    });
    own.into_iter().chain(saved).max_by_key(|(when, _)| *when)
}

/// A session in a file, where there is one.
fn session(kept: &Path) -> Option<StartEntry> {
    let read = kept.exists().then(|| KeptSession::read(kept))?;
    let session = read.inspect_err(|error| tracing::info!("{error:#}")).ok()?;
    let (name, note) = session.words();
    Some(StartEntry::of(Start::Session(kept.to_owned()), name, note))
}

fn floor_plans(data: &Path) -> Vec<StartEntry> {
    let names = if data.join("dataset.json").exists() {
        Dataset::open(data).and_then(|set| set.scene_names())
    } else {
        return Vec::new();
    };
    let names = names.inspect_err(|error| tracing::info!("{error:#}")).unwrap_or_default();
    let note = format!("in {}", data.display());
    names.into_iter().map(|name| StartEntry::of(Start::FloorPlan(name.clone()), name, note.clone())).collect()
}

/// The task files of a folder, by name. Only the beginning of a file is looked at: others that end in `.json` may be large.
fn task_files(folder: &Path) -> Vec<StartEntry> {
    let mut files = entries(folder);
    files.retain(|path| path.extension().is_some_and(|ending| ending == "json") && holds_tasks(path));
    let note = if folder.as_os_str().is_empty() || folder == Path::new(".") {
        String::new()
    } else {
        format!("in {}", folder.display())
    };
    let name = |path: &PathBuf| path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let entry =
        |path: PathBuf| StartEntry::of(Start::Task { file: path.clone(), number: 1 }, name(&path), note.clone());
    files.into_iter().map(entry).collect()
}

fn holds_tasks(path: &Path) -> bool {
    use std::io::Read;
    let mut beginning = Vec::new();
    let read = plain_file::open(path).and_then(|file| file.take(400).read_to_end(&mut beginning));
    let text = String::from_utf8_lossy(&beginning);
    read.is_ok() && text.contains("\"format_version\"") && text.contains("\"tasks\"")
}

/// The run folders of a folder, the newest first.
fn runs(folder: &Path) -> Vec<(SystemTime, StartEntry)> {
    let mut found: Vec<(SystemTime, StartEntry)> = entries(folder)
        .into_iter()
        .filter(|path| path.join(MANIFEST).exists())
        .filter_map(|path| {
            let manifest = RunManifest::read(&path.join(MANIFEST)).ok()?;
            let note = format!("{} · {}, {}", manifest.policy, manifest.task_set, counted(manifest.tasks, "task"));
            let when = modified(&path.join(MANIFEST));
            Some((when, StartEntry::of(Start::Run { folder: path.clone(), number: 1 }, file_name(&path), note)))
        })
        .collect();
    found.sort_by_key(|(when, _)| std::cmp::Reverse(*when));
    found
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        folder.read_dir().into_iter().flatten().filter_map(Result::ok).map(|entry| entry.path()).collect();
    found.sort();
    found
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn modified(path: &Path) -> SystemTime {
    path.metadata().and_then(|file| file.modified()).unwrap_or(SystemTime::UNIX_EPOCH)
}

/// The entries that fit what was typed, the best first. A number at the end that belongs to no name is the seed, the task or
/// the episode: `bedroom 7`, `eval #3`.
pub(crate) fn matching(entries: &[StartEntry], typed: &str) -> Vec<StartEntry> {
    let typed = typed.trim();
    if typed.is_empty() {
        return entries.to_vec();
    }
    let mut matcher = Matcher::new(Config::DEFAULT);
    let whole = Pattern::new(typed, CaseMatching::Ignore, Normalization::Smart, AtomKind::Fuzzy);
    let (words, number) = split_number(typed);
    let without = Pattern::new(words, CaseMatching::Ignore, Normalization::Smart, AtomKind::Fuzzy);
    let mut letters = Vec::new();
    let mut score = |pattern: &Pattern, text: &str| pattern.score(Utf32Str::new(text, &mut letters), &mut matcher);
    let mut found: Vec<((bool, u32), StartEntry)> = Vec::new();
    for entry in entries {
        let name = format!("{} {}", entry.start.kind(), entry.name);
        let numbered = number.and_then(|number| entry.start.numbered(number));
        if let Some(start) = numbered
            && let Some(score) = score(&without, &name)
        {
            found.push(((true, score), StartEntry { start, ..entry.clone() }));
        } else if let Some(score) = score(&whole, &name) {
            found.push(((true, score), entry.clone()));
        } else if let Some(score) = score(&whole, &format!("{name} {}", entry.note)) {
            found.push(((false, score), entry.clone()));
        }
    }
    found.sort_by_key(|(rank, _)| std::cmp::Reverse(*rank));
    found.into_iter().map(|(_, entry)| entry).collect()
}

/// What was typed without the number at its end, and that number.
fn split_number(typed: &str) -> (&str, Option<u64>) {
    let (words, last) = typed.rsplit_once([' ', '#']).unwrap_or(("", typed));
    match last.parse() {
        Ok(number) => (words.trim_end_matches([' ', '#']), Some(number)),
        Err(_) => (typed, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::registry::Policies;
    use crate::data::json;
    use crate::explore::exploration::Exploration;
    use crate::explore::session_file::SessionFile;
    use crate::explore::testing;

    fn folders(root: &Path) -> StartFolders {
        StartFolders {
            session: root.join("state/session.json"),
            data: root.join("data"),
            here: root.to_owned(),
            checkpoints: vec![root.join("checkpoints/small")],
        }
    }

    fn lines(found: &[StartEntry]) -> Vec<String> {
        found.iter().map(|entry| format!("{} {} {}", entry.start.kind(), entry.name, entry.choice())).collect()
    }

    #[test]
    fn what_is_there_is_listed_with_the_last_session_first() {
        let folder = tempfile::tempdir().unwrap();
        let wanted = folders(folder.path());
        let houses =
            ["house kitchen seed 0", "house bedroom seed 0", "house living room seed 0", "house bathroom seed 0"];
        let bare = list(&wanted);
        assert_eq!(lines(&bare)[..4], houses);
        assert_eq!(lines(&bare)[4..], ["checkpoint small "]);
        let mut exploration = testing::exploration();
        exploration.instruct("pick up the mug").unwrap();
        json::write(&wanted.session, &exploration.as_kept()).unwrap();
        std::fs::create_dir_all(folder.path().join("data/tasks")).unwrap();
        let set = br#"{"format_version": 1, "name": "eval", "tasks": []}"#;
        std::fs::write(folder.path().join("data/tasks/eval_100.json"), set).unwrap();
        std::fs::write(folder.path().join("other.json"), b"[1]").unwrap();
        exploration.keep(Some(folder.path().join("runs/tried"))).unwrap();
        let found = list(&wanted);
        assert_eq!(found[0].start, Start::Session(wanted.session.clone()));
        assert!(found[0].note.ends_with("Pick up the mug."), "{:?}", found[0]);
        assert_eq!(lines(&found)[5..], ["tasks eval_100 task 1", "checkpoint small ", "run tried episode 1"]);
        json::write(&session_file::before(&wanted.session), &exploration.as_kept()).unwrap();
        let both = list(&wanted);
        assert_eq!(both[1].start, Start::Session(session_file::before(&wanted.session)));
        assert!(both[1].note.starts_with("before that, "), "{:?}", both[1]);
        std::fs::remove_file(session_file::before(&wanted.session)).unwrap();
        let other = SessionFile::beside(&wanted.session);
        other.write(&exploration.as_kept()).unwrap();
        assert_eq!(list(&wanted).len(), found.len(), "one that is under way is not offered");
        drop(other);
        let all = list(&wanted);
        assert_eq!((all.len(), &all[1].start), (found.len() + 1, &Start::Session(wanted.session.clone())));
        assert_eq!(all[0].start.kind(), "broken off");
        std::fs::remove_file(wanted.session.with_file_name("session-1.json")).unwrap();
        std::fs::write(&wanted.session, b"{ broken").unwrap();
        assert_eq!(lines(&list(&wanted))[..4], houses, "a broken session costs no more than itself");
    }

    #[test]
    fn a_few_letters_find_it_and_a_number_is_the_seed_or_the_task() {
        let folder = tempfile::tempdir().unwrap();
        let mut entries = list(&folders(folder.path()));
        entries.push(StartEntry::of(Start::Task { file: "eval_100.json".into(), number: 1 }, "eval_100", ""));
        entries.push(StartEntry::of(Start::FloorPlan("FloorPlan12".into()), "FloorPlan12", "in data"));
        let best = |typed: &str| lines(&matching(&entries, typed)).first().cloned().unwrap_or_default();
        assert_eq!(best("bdr"), "house bedroom seed 0");
        assert_eq!(best("lvroom 12"), "house living room seed 12");
        assert_eq!(best("eval #3"), "tasks eval_100 task 3");
        assert_eq!(best("eval_100"), "tasks eval_100 task 1");
        assert_eq!(best("FloorPlan12"), "floor plan FloorPlan12 ");
        assert_eq!(best("small"), "checkpoint small ");
        assert_eq!(best("7"), "house kitchen seed 7");
        assert_eq!(matching(&entries, "").len(), entries.len());
        assert!(matching(&entries, "zzzz").is_empty());
    }

    #[test]
    fn what_was_saved_as_a_run_later_comes_before_what_was_kept() {
        let folder = tempfile::tempdir().unwrap();
        let wanted = folders(folder.path());
        let mut exploration: Exploration = testing::exploration();
        json::write(&wanted.session, &exploration.as_kept()).unwrap();
        let earlier = SystemTime::now() - std::time::Duration::from_secs(60);
        std::fs::File::options().write(true).open(&wanted.session).unwrap().set_modified(earlier).unwrap();
        let run = folder.path().join("runs/explored-20000101-000000");
        exploration.keep(Some(run.clone())).unwrap();
        assert_eq!(list(&wanted)[0].start, Start::Run { folder: run, number: 1 });
        let kept = KeptSession::read(&wanted.session).unwrap();
        assert!(Exploration::take_up(&kept, Policies::new(Vec::new())).is_ok());
    }
}
