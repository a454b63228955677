//! A guess at how the terminal can show pictures: from the environment, and from one question that every terminal answers.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Protocol;
use crate::data::json;

/// The likeliest protocol and why, given the environment's variables.
pub(crate) fn guess(variable: impl Fn(&str) -> Option<String>) -> (Protocol, String) {
    let get = |name: &str| variable(name).filter(|value| !value.is_empty());
    let term = get("TERM").unwrap_or_default();
    let program = get("TERM_PROGRAM").unwrap_or_default();
    if term.is_empty() || term == "dumb" {
        return (Protocol::Ascii, format!("TERM is {term:?}"));
    }
    if get("NO_COLOR").is_some() {
        return (Protocol::Ascii, "NO_COLOR is set".into());
    }
    if !shows_unicode(&variable) {
        return (Protocol::Ascii, "the locale is not UTF-8".into());
    }
    for (inside, name) in [("TMUX", "tmux"), ("STY", "screen"), ("ZELLIJ", "zellij"), ("MOSH_CONNECTION", "mosh")] {
        if get(inside).is_some() || term.starts_with(name) {
            return (Protocol::HalfBlocks, format!("inside {name}"));
        }
    }
    // WezTerm and Konsole answer to kitty's name but draw its placeholders wrongly: they are asked for what they do well.
    if program == "WezTerm" || get("WEZTERM_EXECUTABLE").is_some() || term == "wezterm" {
        return (Protocol::Iterm2, "the terminal is WezTerm".into());
    }
    if get("KONSOLE_VERSION").is_some() {
        return (Protocol::HalfBlocks, "Konsole draws pictures unreliably".into());
    }
    if get("KITTY_WINDOW_ID").is_some() || term.contains("kitty") {
        return (Protocol::Kitty, "the terminal is kitty".into());
    }
    if term.contains("ghostty") || program == "ghostty" {
        return (Protocol::Kitty, "the terminal is Ghostty".into());
    }
    if program == "iTerm.app" || get("LC_TERMINAL").as_deref() == Some("iTerm2") {
        return (Protocol::Iterm2, "the terminal is iTerm2".into());
    }
    if program == "vscode" {
        return (Protocol::HalfBlocks, "VS Code shows pictures only where it is told to".into());
    }
    if get("WT_SESSION").is_some() {
        return (Protocol::Sixel, "the terminal is Windows Terminal".into());
    }
    if ["foot", "mlterm", "contour", "sixel"].iter().any(|name| term.contains(name)) {
        return (Protocol::Sixel, format!("TERM is {term}"));
    }
    (Protocol::HalfBlocks, UNKNOWN.into())
}

/// Whether characters beyond ASCII may be sent: the locale does not say otherwise.
pub(crate) fn shows_unicode(variable: impl Fn(&str) -> Option<String>) -> bool {
    let get = |name: &str| variable(name).filter(|value| !value.is_empty());
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().find_map(get).unwrap_or_default();
    let dumb = get("TERM").is_none_or(|term| term == "dumb");
    !dumb && (locale.is_empty() || locale.to_lowercase().replace('-', "").contains("utf8"))
}

/// The reason for half-blocks where nothing tells the terminal apart.
pub(crate) const UNKNOWN: &str = "no sign of picture support";

/// What terminals answered, by their names.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Answers {
    format_version: u32,
    has_sixel: BTreeMap<String, bool>,
}

/// What a terminal of that name answered before; `ask`s it only the first time. A memory that cannot be read or written is
/// passed over.
pub(crate) fn remembered(memory: Option<&Path>, name: &str, ask: impl FnOnce() -> bool) -> bool {
    let Some(path) = memory else { return ask() };
    let mut answers = json::read::<Answers>(path, 1).map(|found| found.value).unwrap_or_default();
    if let Some(&known) = answers.has_sixel.get(name) {
        return known;
    }
    let answer = ask();
    answers.format_version = 1;
    answers.has_sixel.insert(name.to_string(), answer);
    if let Err(error) = json::write(path, &answers) {
        tracing::info!("{error:#}");
    }
    answer
}

/// Asks a terminal what it is ("primary device attributes"); attribute 4 of its answer means sixel.
pub(crate) const QUESTION: &[u8] = b"\x1b[c";
/// The attribute of a terminal that shows sixels.
pub(crate) const SIXEL: u32 = 4;

#[cfg(test)]
mod tests {
    use super::*;

    fn check(variables: &[(&str, &str)], expected: Protocol) {
        let variable =
            |name: &str| variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_string());
        let (protocol, reason) = guess(variable);
        assert_eq!(protocol, expected, "{variables:?}: {reason}");
        assert!(!reason.is_empty());
    }

    #[test]
    fn the_environment_decides_and_doubt_means_plainer_pictures() {
        let utf8 = ("LANG", "en_US.UTF-8");
        check(&[], Protocol::Ascii);
        check(&[("TERM", "dumb"), utf8], Protocol::Ascii);
        check(&[("TERM", "xterm-256color"), ("LANG", "C")], Protocol::Ascii);
        check(&[("TERM", "xterm-kitty"), utf8], Protocol::Kitty);
        check(&[("TERM", "xterm-kitty"), ("NO_COLOR", "1"), utf8], Protocol::Ascii);
        check(
            &[("TERM", "tmux-256color"), ("TMUX", "/tmp/tmux-0"), ("KITTY_WINDOW_ID", "1"), utf8],
            Protocol::HalfBlocks,
        );
        check(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "iTerm.app"), utf8], Protocol::Iterm2);
        check(&[("TERM", "foot"), utf8], Protocol::Sixel);
        check(&[("TERM", "xterm-256color"), ("COLORTERM", "truecolor"), utf8], Protocol::HalfBlocks);
        check(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "WezTerm"), utf8], Protocol::Iterm2);
        check(&[("TERM", "xterm-256color"), ("WT_SESSION", "1"), utf8], Protocol::Sixel);
        check(&[("TERM", "xterm-256color")], Protocol::HalfBlocks);
    }

    #[test]
    fn a_terminal_is_asked_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("terminals.json");
        assert!(remembered(Some(&path), "xterm", || true));
        assert!(remembered(Some(&path), "xterm", || panic!("asked again")));
        assert!(!remembered(Some(&path), "vt100", || false));
        std::fs::write(&path, "nonsense").unwrap();
        assert!(!remembered(Some(&path), "xterm", || false), "what cannot be read is asked anew");
    }
}
