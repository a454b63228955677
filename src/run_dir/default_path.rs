//! Where a run goes that was given no folder.

use std::path::{Path, PathBuf};
use std::time::Duration;

use time::UtcDateTime;

/// The folder of a run that was given none: `runs/NAME-YYYYMMDD-HHMMSS`, in universal time. Where there is one already,
/// of a run that began in the same second or before the clock was set back, a number is added.
pub(crate) fn default_path(name: &str, unix_seconds: u64, is_taken: &dyn Fn(&Path) -> bool) -> PathBuf {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let name: String = name.trim().trim_start_matches('.').chars().take(60).map(plain).collect();
    let first = Path::new("runs").join(format!("{name}-{}", timestamp(unix_seconds)));
    let numbered = (2..10_000).map(|number| PathBuf::from(format!("{}-{number}", first.display())));
    std::iter::once(first.clone()).chain(numbered).find(|path| !is_taken(path)).unwrap_or(first)
}

/// `YYYYMMDD-HHMMSS` in universal time.
fn timestamp(unix_seconds: u64) -> String {
    let now = UtcDateTime::UNIX_EPOCH + Duration::from_secs(unix_seconds);
    let (hour, minute, second) = now.as_hms();
    format!("{:04}{:02}{:02}-{hour:02}{minute:02}{second:02}", now.year(), u8::from(now.month()), now.day())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_default_folder_is_named_by_set_and_time() {
        let first = Path::new("runs/eval-100-x-19700101-000000");
        assert_eq!(default_path("eval 100/x", 0, &|_| false), first);
        let second = default_path("eval 100/x", 0, &|path| path == first);
        assert_eq!(
            second,
            Path::new("runs/eval-100-x-19700101-000000-2"),
            "a clock that was set back finds no old folder"
        );
        assert_eq!(timestamp(951_826_153), "20000229-120913");
        assert_eq!(timestamp(1_767_225_599), "20251231-235959");
    }
}
