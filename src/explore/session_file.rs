//! The file that an explorer keeps its session in: each has one of its own, which is locked as long as it is under way. What
//! ends as asked becomes the last session; what is broken off stays where it is, and is offered again.

use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use anyhow::Context;

use super::kept_session::KeptSession;
use crate::data::{atomic_file, plain_file};

/// The file of one explorer; copies are the same one's.
#[derive(Clone)]
pub(crate) struct SessionFile {
    /// Where the session is kept that ended last as asked; the others lie beside it.
    last: PathBuf,
    held: Arc<Mutex<Held>>,
}

/// What an explorer has of its own.
enum Held {
    /// Nothing was tried yet.
    Nothing,
    /// The lock goes with each new version of the file: it is never seen without.
    Locked { path: PathBuf, lock: File },
    /// It ended as asked; which file became the last session, if any was written.
    Ended(Option<u64>),
}

impl SessionFile {
    /// The file of a new session.
    pub(crate) fn beside(last: &Path) -> SessionFile {
        SessionFile::holding(last, Held::Nothing)
    }

    /// The file of a session that is taken up, which nobody else can take up from here on.
    ///
    /// # Errors
    /// When it is gone, or under way in another explorer.
    pub(crate) fn take(path: &Path, last: &Path) -> anyhow::Result<SessionFile> {
        let opened = File::options().read(true).write(true).open(path);
        let lock = opened.with_context(|| format!("cannot open {}", path.display()))?;
        let is_locked = matches!(lock.try_lock(), Err(TryLockError::WouldBlock));
        // Another explorer may have written a new version meanwhile.
        let is_it = path.metadata()?.ino() == lock.metadata()?.ino();
        anyhow::ensure!(!is_locked && is_it, "this session is under way in another explorer: leave it there first");
        Ok(SessionFile::holding(last, Held::Locked { path: path.to_owned(), lock }))
    }

    fn holding(last: &Path, held: Held) -> SessionFile {
        SessionFile { last: last.to_owned(), held: Arc::new(Mutex::new(held)) }
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Goes on with a session that was taken up: out of the way of those that end meanwhile.
    pub(crate) fn go_on_with(&self, taken: &SessionFile) {
        let held = std::mem::replace(&mut *taken.held(), Held::Nothing);
        let Held::Locked { path, lock } = held else { return };
        let path = match number(&path) {
            Some(_) => path,
            None => self.move_aside(&path).unwrap_or_else(|error| {
                tracing::warn!("{}: {error}", path.display());
                path
            }),
        };
        *self.held() = Held::Locked { path, lock };
    }

    /// Gives a file the first number that is free.
    fn move_aside(&self, path: &Path) -> io::Result<PathBuf> {
        for number in 1_u32.. {
            let free = self.numbered(number);
            match std::fs::hard_link(path, &free) {
                Ok(()) => return std::fs::remove_file(path).map(|()| free),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(ErrorKind::AlreadyExists.into())
    }

    fn numbered(&self, number: u32) -> PathBuf {
        self.last.with_file_name(format!("session-{number}.json"))
    }

    /// Writes the session whole or not at all. It is not forced onto the disk: it outlives the program, not the machine.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub(crate) fn write(&self, kept: &KeptSession) -> anyhow::Result<()> {
        let bytes = serde_json::to_vec(kept)?;
        self.write_bytes(&bytes).with_context(|| format!("cannot write a session beside {}", self.last.display()))
    }

    fn write_bytes(&self, bytes: &[u8]) -> io::Result<()> {
        let mut held = self.held();
        let mut file = atomic_file::begin(&self.last)?;
        file.write_all(bytes)?;
        match &mut *held {
            Held::Locked { path, lock } => {
                lock_new(file.as_file());
                *lock = file.persist(path)?;
            }
            Held::Nothing => {
                lock_new(file.as_file());
                let mut numbers = 1_u32..;
                let (path, lock) = loop {
                    let path = self.numbered(numbers.next().ok_or(ErrorKind::AlreadyExists)?);
                    match file.persist_noclobber(&path) {
                        Ok(lock) => break (path, lock),
                        Err(error) if error.error.kind() == ErrorKind::AlreadyExists => file = error.file,
                        Err(error) => return Err(error.error),
                    }
                };
                *held = Held::Locked { path, lock };
            }
            // The last words of a session that was left for the list.
            Held::Ended(inode) => {
                let is_ours = |inode: u64| self.last.metadata().is_ok_and(|now| now.ino() == inode);
                if is_live(&self.last) || inode.is_some_and(|inode| !is_ours(inode)) {
                    return Ok(());
                }
                if inode.is_none() {
                    put_aside(&self.last);
                }
                *inode = Some(file.persist(&self.last)?.metadata()?.ino());
            }
        }
        Ok(())
    }

    /// The session ended as asked: it is the last one from now on.
    pub(crate) fn end(&self) {
        let mut held = self.held();
        let Held::Locked { path, lock } = std::mem::replace(&mut *held, Held::Ended(None)) else { return };
        // Somebody takes the last one up at this very moment: then this one stays beside it.
        if path != self.last && is_live(&self.last) {
            return;
        }
        if path != self.last {
            put_aside(&self.last);
            if let Err(error) = std::fs::rename(&path, &self.last) {
                tracing::warn!("{}: {error}", path.display());
            }
        }
        *held = Held::Ended(lock.metadata().ok().map(|file| file.ino()));
    }
}

/// A file that nobody else knows yet. Where there are no locks, sessions under way are offered too.
fn lock_new(file: &File) {
    if let Err(error) = file.try_lock() {
        tracing::info!("a session without a lock: {error}");
    }
}

/// Whether an explorer has it under way.
fn is_live(path: &Path) -> bool {
    plain_file::open(path).is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

/// The number of a session's file; the last one and the one before have none.
fn number(path: &Path) -> Option<u32> {
    path.file_name()?.to_str()?.strip_prefix("session-")?.strip_suffix(".json")?.parse().ok()
}

/// Whether a session in that file was broken off.
pub(crate) fn is_broken_off(path: &Path) -> bool {
    number(path).is_some()
}

/// Where the session before the last is kept.
pub(crate) fn before(last: &Path) -> PathBuf {
    last.with_file_name("session-before.json")
}

/// Puts a session that nobody saved aside, as another one is about to take its place. What cannot be read is nothing to keep.
fn put_aside(last: &Path) {
    if KeptSession::read(last).is_ok_and(|kept| kept.is_unsaved)
        && let Err(error) = std::fs::rename(last, before(last))
    {
        tracing::warn!("{}: {error}", last.display());
    }
}

/// The sessions beside the last one that were broken off, the newest first.
pub(crate) fn broken_off(last: &Path) -> Vec<(SystemTime, PathBuf)> {
    let entries = last.parent().and_then(|folder| folder.read_dir().ok()).into_iter().flatten();
    let paths = entries.filter_map(Result::ok).map(|entry| entry.path());
    let mut found: Vec<(SystemTime, PathBuf)> = paths
        .filter(|path| number(path).is_some() && !is_live(path))
        .filter_map(|path| Some((path.metadata().and_then(|file| file.modified()).ok()?, path)))
        .collect();
    found.sort_by_key(|(when, path)| std::cmp::Reverse((*when, number(path))));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Action, ActionType};
    use crate::explore::testing;

    fn kept(steps: u32, is_unsaved: bool) -> KeptSession {
        let mut exploration = testing::exploration();
        for _ in 0..steps {
            exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        }
        KeptSession { is_unsaved, ..exploration.as_kept() }
    }

    fn steps(found: &[(SystemTime, PathBuf)]) -> Vec<u32> {
        found.iter().map(|(_, path)| KeptSession::read(path).unwrap().step).collect()
    }

    fn files(last: &Path) -> usize {
        last.parent().unwrap().read_dir().unwrap().count()
    }

    #[test]
    fn explorers_side_by_side_keep_a_session_each_and_what_is_broken_off_is_offered() {
        let folder = tempfile::tempdir().unwrap();
        let last = folder.path().join("state/session.json");
        let (first, second) = (SessionFile::beside(&last), SessionFile::beside(&last));
        for steps in 1..=3 {
            first.write(&kept(steps, false)).unwrap();
            second.write(&kept(steps + 3, true)).unwrap();
        }
        assert_eq!(broken_off(&last), [], "both are under way");
        drop(first);
        assert_eq!(steps(&broken_off(&last)), [3]);
        drop(second);
        assert_eq!(steps(&broken_off(&last)), [6, 3], "the newest first");
        assert!(!last.exists());
    }

    #[test]
    fn a_session_that_is_taken_up_is_one_explorers_alone() {
        let folder = tempfile::tempdir().unwrap();
        let last = folder.path().join("session.json");
        SessionFile::beside(&last).write(&kept(2, false)).unwrap();
        let (_, path) = broken_off(&last).remove(0);
        let taken = SessionFile::take(&path, &last).unwrap();
        let refusal = SessionFile::take(&path, &last).err().unwrap().to_string();
        assert!(refusal.contains("under way in another explorer"), "{refusal}");
        let own = SessionFile::beside(&last);
        own.go_on_with(&taken);
        drop(taken);
        own.write(&kept(3, false)).unwrap();
        assert!(SessionFile::take(&path, &last).is_err(), "the new version, too");
        own.end();
        assert_eq!((KeptSession::read(&last).unwrap().step, files(&last)), (3, 1));
        // The last one goes on; another one ends meanwhile.
        let again = SessionFile::beside(&last);
        again.go_on_with(&SessionFile::take(&last, &last).unwrap());
        let other = SessionFile::beside(&last);
        other.write(&kept(1, false)).unwrap();
        other.end();
        assert_eq!(KeptSession::read(&last).unwrap().step, 1);
        again.write(&kept(4, false)).unwrap();
        drop(again);
        assert_eq!((steps(&broken_off(&last)), files(&last)), (vec![4], 2));
    }

    #[test]
    fn what_ends_as_asked_leaves_the_last_session_and_one_before_that_nobody_saved() {
        let folder = tempfile::tempdir().unwrap();
        let last = folder.path().join("session.json");
        for (steps, is_unsaved) in [(1, false), (2, true), (3, false), (4, false)] {
            let file = SessionFile::beside(&last);
            file.write(&kept(steps, is_unsaved)).unwrap();
            file.end();
        }
        assert_eq!((KeptSession::read(&last).unwrap().step, KeptSession::read(&before(&last)).unwrap().step), (4, 2));
        let nothing_tried = SessionFile::beside(&last);
        nothing_tried.end();
        assert_eq!((files(&last), broken_off(&last)), (2, Vec::new()));
    }

    #[test]
    fn the_last_words_of_a_session_are_kept_unless_it_goes_on_already() {
        let folder = tempfile::tempdir().unwrap();
        let last = folder.path().join("session.json");
        let left = SessionFile::beside(&last);
        left.end();
        left.write(&kept(1, false)).unwrap();
        left.write(&kept(2, false)).unwrap();
        assert_eq!(KeptSession::read(&last).unwrap().step, 2);
        let again = SessionFile::beside(&last);
        again.go_on_with(&SessionFile::take(&last, &last).unwrap());
        left.write(&kept(3, false)).unwrap();
        assert!(!last.exists(), "it is no more the one that goes on");
        again.end();
        assert_eq!(KeptSession::read(&last).unwrap().step, 2);
    }
}
