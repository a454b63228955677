//! How many of something there are, in words.

/// `1 mistake`, `2 mistakes`; the noun is regular.
pub(crate) fn counted(count: impl TryInto<u64>, noun: &str) -> String {
    let count = count.try_into().unwrap_or(u64::MAX);
    if count == 1 {
        return format!("1 {noun}");
    }
    match noun.strip_suffix('y') {
        Some(stem) if !stem.ends_with(['a', 'e', 'o', 'u']) => format!("{count} {stem}ies"),
        _ if noun.ends_with("ch") => format!("{count} {noun}es"),
        _ => format!("{count} {noun}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_one_and_others_are_several() {
        let of = |count: usize| ["mistake", "trajectory", "branch"].map(|noun| counted(count, noun));
        assert_eq!(of(1), ["1 mistake", "1 trajectory", "1 branch"]);
        assert_eq!(of(0), ["0 mistakes", "0 trajectories", "0 branches"]);
        assert_eq!(of(12), ["12 mistakes", "12 trajectories", "12 branches"]);
    }
}
