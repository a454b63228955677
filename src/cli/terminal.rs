//! A guess at how the terminal can show pictures, from the environment alone (nothing is sent to the terminal).

/// How a picture can be shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// The kitty graphics protocol.
    Kitty,
    /// iTerm2's inline images.
    Iterm2,
    /// Sixel graphics.
    Sixel,
    /// Two coloured pixels a character cell.
    HalfBlocks,
    /// Characters only.
    Ascii,
}

impl Protocol {
    /// The name that `--graphics` takes.
    pub fn name(self) -> &'static str {
        match self {
            Protocol::Kitty => "kitty",
            Protocol::Iterm2 => "iterm2",
            Protocol::Sixel => "sixel",
            Protocol::HalfBlocks => "halfblocks",
            Protocol::Ascii => "ascii",
        }
    }
}

/// The likeliest protocol and why, given the environment's variables.
pub fn guess(variable: impl Fn(&str) -> Option<String>) -> (Protocol, String) {
    let get = |name: &str| variable(name).filter(|value| !value.is_empty());
    let term = get("TERM").unwrap_or_default();
    let program = get("TERM_PROGRAM").unwrap_or_default();
    if term.is_empty() || term == "dumb" {
        return (Protocol::Ascii, format!("TERM is {term:?}"));
    }
    if get("NO_COLOR").is_some() {
        return (Protocol::Ascii, "NO_COLOR is set".into());
    }
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().find_map(get).unwrap_or_default();
    if !locale.to_lowercase().replace('-', "").contains("utf8") {
        return (Protocol::Ascii, format!("the locale is {locale:?}, not UTF-8"));
    }
    if get("TMUX").is_some() || term.starts_with("screen") || term.starts_with("tmux") {
        return (Protocol::HalfBlocks, "inside tmux or screen, which may not pass pictures through".into());
    }
    if get("KITTY_WINDOW_ID").is_some() || term.contains("kitty") || term.contains("ghostty") || program == "ghostty" {
        return (Protocol::Kitty, format!("TERM is {term}"));
    }
    if program == "iTerm.app" || program == "WezTerm" || get("LC_TERMINAL").as_deref() == Some("iTerm2") {
        return (Protocol::Iterm2, format!("TERM_PROGRAM is {program:?}"));
    }
    if ["foot", "mlterm", "contour", "sixel"].iter().any(|name| term.contains(name)) {
        return (Protocol::Sixel, format!("TERM is {term}"));
    }
    let over = if get("SSH_CONNECTION").is_some() { ", over SSH" } else { "" };
    match get("COLORTERM").as_deref() {
        Some("truecolor" | "24bit") => (Protocol::HalfBlocks, format!("true colour, no sign of picture support{over}")),
        _ => (Protocol::HalfBlocks, format!("TERM is {term}, no sign of picture support{over}")),
    }
}

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
    }
}
