//! How a few letters find a verb.

use nucleo_matcher::pattern::{Atom, AtomKind, CaseMatching, Normalization};
use nucleo_matcher::{Config, Matcher, Utf32Str};

use super::entry::VerbEntry;
use super::table::typed;

/// The typed verbs that fit what was typed so far, the best first: by their names, then by what they do.
pub(crate) fn matching(line: &str) -> Vec<&'static VerbEntry> {
    let word = line.split_whitespace().next().unwrap_or("");
    let atom = Atom::new(word, CaseMatching::Ignore, Normalization::Never, AtomKind::Fuzzy, false);
    let mut matcher = Matcher::new(Config::DEFAULT);
    let mut letters = Vec::new();
    let mut score = |text: &str| atom.score(Utf32Str::new(text, &mut letters), &mut matcher);
    let mut found: Vec<((bool, u16), &VerbEntry)> = typed()
        .filter_map(|entry| {
            let by_name = score(entry.name).map(|score| (true, score));
            let by_help = || score(entry.help).filter(|_| word.len() > 2).map(|score| (false, score));
            by_name.or_else(by_help).map(|rank| (rank, entry))
        })
        .collect();
    found.sort_by_key(|&(rank, _)| std::cmp::Reverse(rank));
    found.into_iter().map(|(_, entry)| entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typing_finds_verbs_by_their_letters() {
        assert_eq!(matching("exp")[0].name, "export");
        assert_eq!(matching("brk")[0].name, "break");
        assert_eq!(matching("seek 12")[0].name, "seek");
        assert_eq!(matching("clipboard")[0].name, "copy", "by what it does");
        assert_eq!(matching("").len(), typed().count());
        assert!(matching("qqq").is_empty());
    }
}
