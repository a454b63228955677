//! What the terminal at the other end can show, how quickly it answers, and how it is asked.

use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

use termprofile::TermProfile;

use super::app::Graphics;
use super::graphics::{Protocol, detect};
use super::keyboard::Keyboard;
use super::theme::Ability;

/// What the terminal can show, from the environment.
pub(super) fn ability() -> Ability {
    let colours = TermProfile::detect(&io::stdout(), termprofile::DetectorSettings::new());
    let variable = |name: &str| std::env::var(name).ok();
    // tmux brings colours down to what its terminal has by itself; whoever says that there are all of them is believed.
    let all = matches!(variable("COLORTERM").as_deref(), Some("truecolor" | "24bit"));
    let in_tmux = variable("TERM_PROGRAM").as_deref() == Some("tmux");
    let colours = if all && in_tmux && colours >= TermProfile::Ansi256 { TermProfile::TrueColor } else { colours };
    Ability { colours, unicode: detect::shows_unicode(variable) }
}

/// Whether the terminal is at the other end of a link.
fn is_remote() -> bool {
    std::env::var_os("SSH_CONNECTION").is_some()
}

/// How long the first answer of a terminal is waited for: most answer at once, and a link takes its time.
pub(super) fn first_answer() -> Duration {
    if is_remote() { Duration::from_secs(3) } else { Duration::from_millis(300) }
}

/// Asks the terminal whether it shows sixels. An answer that comes later does no harm: it is no key.
fn has_sixel(keyboard: &mut Keyboard, patience: Duration) -> io::Result<bool> {
    let mut out = io::stdout();
    out.write_all(detect::QUESTION)?;
    out.flush()?;
    Ok(keyboard.attributes(patience)?.is_some_and(|numbers| numbers.contains(&detect::SIXEL)))
}

/// How to show pictures: as asked, or as the environment and the terminal's own answer suggest.
pub(super) fn graphics(
    asked: Option<Protocol>,
    ability: Ability,
    memory: Option<&Path>,
    keyboard: &mut Keyboard,
) -> Graphics {
    let cell_pixels = match crossterm::terminal::window_size() {
        Ok(window) if window.width > 0 && window.height > 0 => {
            ((window.width / window.columns.max(1)).max(1), (window.height / window.rows.max(1)).max(1))
        }
        _ => (10, 20),
    };
    let (protocol, reason) = match asked {
        Some(protocol) => (protocol, "asked for".to_string()),
        None => {
            let (protocol, reason) = detect::guess(|name| std::env::var(name).ok());
            let patience = Duration::from_millis(if is_remote() { 700 } else { 250 });
            let ask = || has_sixel(keyboard, patience).unwrap_or(false);
            let name =
                ["TERM", "TERM_PROGRAM", "COLORTERM"].map(|name| std::env::var(name).unwrap_or_default()).join("/");
            if reason == detect::UNKNOWN && detect::remembered(memory, &name, ask) {
                (Protocol::Sixel, "the terminal says that it has sixels".into())
            } else if protocol == Protocol::HalfBlocks && !ability.shades() {
                (Protocol::Ascii, "the terminal has few colours".into())
            } else {
                (protocol, reason)
            }
        }
    };
    let in_tmux = std::env::var_os("TMUX").is_some();
    Graphics { protocol, reason, cell_pixels, in_tmux }
}
