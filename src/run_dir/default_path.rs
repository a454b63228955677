//! Where a run goes that was given no folder.

use std::path::{Path, PathBuf};

/// The folder of a run that was given none: `runs/NAME-YYYYMMDD-HHMMSS`, in universal time. Where there is one already,
/// of a run that began in the same second or before the clock was set back, a number is added.
pub fn default_path(name: &str, unix_seconds: u64, is_taken: &dyn Fn(&Path) -> bool) -> PathBuf {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let name: String = name.trim().trim_start_matches('.').chars().take(60).map(plain).collect();
    let first = Path::new("runs").join(format!("{name}-{}", timestamp(unix_seconds)));
    let numbered = (2..10_000).map(|number| PathBuf::from(format!("{}-{number}", first.display())));
    std::iter::once(first.clone()).chain(numbered).find(|path| !is_taken(path)).unwrap_or(first)
}

/// `YYYYMMDD-HHMMSS` in universal time.
fn timestamp(unix_seconds: u64) -> String {
    let (days, second) = (unix_seconds / 86_400, unix_seconds % 86_400);
    // Howard Hinnant's calendar arithmetic, counting from 0000-03-01.
    let from_march = days + 719_468;
    let (era, day_of_era) = (from_march / 146_097, from_march % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    format!("{year:04}{month:02}{day:02}-{:02}{:02}{:02}", second / 3600, second / 60 % 60, second % 60)
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
