//! Every format that the program reads, damaged at random: it is read or refused in words, soon, and with little memory.
//!
//! `cargo test` tries each a little. For minutes on each:
//! `SPRINT_FUZZ=all SPRINT_FUZZ_SECONDS=120 cargo test --release --test sprint -- --ignored --nocapture fuzz::for_long`,
//! or with the names of formats instead of `all`. It works on a stable toolchain: what guides it is not coverage but what the
//! readers say; an input that is refused in new words, or accepted, is damaged further. What was being read stays in the target
//! folder where a reader ends the whole process.

mod mutate;
mod targets;

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A reader, in a folder with whatever else it needs.
pub(crate) struct Target {
    /// The format.
    name: &'static str,
    /// The file that is damaged.
    file: &'static str,
    /// Fills the folder, and gives sound files.
    prepare: fn(&Path) -> Vec<Vec<u8>>,
    /// Reads it.
    read: fn(&Path) -> anyhow::Result<()>,
}

/// What came of trying a format.
#[derive(Debug, Default)]
struct Tried {
    executions: u64,
    accepted: u64,
    /// In how many ways the reader refused an input.
    words: BTreeSet<String>,
    slowest: Duration,
}

/// Reading one of these small files takes no longer.
const SLOW: Duration = Duration::from_secs(20);
/// A reader that takes so long hangs.
const HANGING: Duration = Duration::from_secs(60);
/// More memory than this is not needed for any of these files, in KiB. It is looked at where nothing else runs beside.
const MEMORY: u64 = 1 << 20;

/// Damages a format's files until `go_on` says no.
fn fuzz(target: &Target, seed: u64, is_alone: bool, mut go_on: impl FnMut(u64) -> bool) -> Tried {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz").join(target.name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let mut inputs = (target.prepare)(&folder);
    let path = folder.join(target.file);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    for (number, input) in inputs.iter().enumerate() {
        std::fs::write(&path, input).unwrap();
        (target.read)(&folder).unwrap_or_else(|error| panic!("{} {number} is not sound: {error:#}", target.name));
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut tried = Tried::default();
    let sound = inputs.len();
    while go_on(tried.executions) {
        let input = mutate::damaged(inputs.choose(&mut rng).unwrap(), inputs.choose(&mut rng).unwrap(), &mut rng);
        std::fs::write(&path, &input).unwrap();
        let outcome = watched(target, &folder, &path, is_alone, &mut tried);
        tried.executions += 1;
        let new = match outcome {
            Ok(()) => {
                tried.accepted += 1;
                rng.random_bool(0.02)
            }
            Err(error) => {
                let said: String = format!("{error:#}").chars().filter(|c| c.is_alphabetic()).take(120).collect();
                tried.words.len() < 5000 && tried.words.insert(said)
            }
        };
        if new && input.len() < 100_000 {
            let at = rng.random_range(sound..sound + 100);
            match inputs.get_mut(at) {
                Some(old) => *old = input,
                None => inputs.push(input),
            }
        }
    }
    tried
}

/// Reads a damaged file; a panic, a hang or a flood of memory ends the test and leaves the file.
fn watched(target: &Target, folder: &Path, path: &Path, is_alone: bool, tried: &mut Tried) -> anyhow::Result<()> {
    static READING: AtomicU64 = AtomicU64::new(0);
    let number = READING.fetch_add(1, Ordering::Relaxed);
    if number == 0 {
        std::thread::spawn(|| {
            let mut last = 0;
            loop {
                std::thread::sleep(HANGING);
                let now = READING.load(Ordering::Relaxed);
                if now == last && now % 2 == 1 {
                    eprintln!("a reader hangs; what it reads is in the target folder, under tmp/fuzz");
                    std::process::abort();
                }
                last = now;
            }
        });
    }
    let began = Instant::now();
    let read = catch_unwind(AssertUnwindSafe(|| (target.read)(folder)));
    READING.fetch_add(1, Ordering::Relaxed);
    let took = began.elapsed();
    tried.slowest = tried.slowest.max(took);
    let keep = |what: &str| -> PathBuf {
        let kept = folder.with_extension(what);
        std::fs::copy(path, &kept).unwrap();
        kept
    };
    assert!(took < SLOW, "{} took {took:?} for {}", target.name, keep("slow").display());
    assert!(!is_alone || memory() < MEMORY, "{} needed much memory for {}", target.name, keep("large").display());
    read.unwrap_or_else(|_| panic!("{} panicked over {}", target.name, keep("panicked").display()))
}

/// The most memory that this process had, in KiB.
fn memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0)
}

#[test]
fn damaged_files_of_every_format_are_read_or_refused_in_words() {
    for target in targets::ALL {
        let tried = fuzz(target, 1, false, |executions| executions < 12);
        assert!(tried.executions == 12 && !tried.words.is_empty(), "{}: {tried:?}", target.name);
    }
}

#[test]
#[ignore = "minutes a format; see the module's comment"]
fn for_long() {
    let number =
        |name: &str, otherwise: u64| std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise);
    let (wanted, seconds) = (std::env::var("SPRINT_FUZZ").unwrap_or_default(), number("SPRINT_FUZZ_SECONDS", 60));
    let seed = number("SPRINT_FUZZ_SEED", 2);
    for target in targets::ALL {
        if wanted != "all" && !wanted.split(',').any(|name| name == target.name) {
            continue;
        }
        let began = Instant::now();
        let tried = fuzz(target, seed, true, |_| began.elapsed().as_secs() < seconds);
        let Tried { executions, accepted, words, slowest } = tried;
        let words = words.len();
        eprintln!(
            "{}: {executions} executions, {accepted} accepted, refused in {words} ways, at most {slowest:?}",
            target.name
        );
    }
}
