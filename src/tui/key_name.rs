//! The names of keys.

use crossterm::event::{KeyCode, KeyModifiers};

/// Reads `x`, `ctrl-x`, `alt-x`, `f5`, `space`, `enter`, `tab`, `left`, ...
pub(super) fn parse_key(name: &str) -> Option<(KeyCode, KeyModifiers)> {
    let (modifiers, name) = match name.split_once('-') {
        Some(("ctrl", rest)) if !rest.is_empty() => (KeyModifiers::CONTROL, rest),
        Some(("alt", rest)) if !rest.is_empty() => (KeyModifiers::ALT, rest),
        _ => (KeyModifiers::NONE, name),
    };
    let mut letters = name.chars();
    let code = match (letters.next(), letters.next(), name) {
        (Some(letter), None, _) => KeyCode::Char(letter),
        (_, _, "space") => KeyCode::Char(' '),
        (_, _, "enter") => KeyCode::Enter,
        (_, _, "esc") => KeyCode::Esc,
        (_, _, "tab") => KeyCode::Tab,
        (_, _, "backspace") => KeyCode::Backspace,
        (_, _, "left") => KeyCode::Left,
        (_, _, "right") => KeyCode::Right,
        (_, _, "up") => KeyCode::Up,
        (_, _, "down") => KeyCode::Down,
        (_, _, "home") => KeyCode::Home,
        (_, _, "end") => KeyCode::End,
        (_, _, "pageup") => KeyCode::PageUp,
        (_, _, "pagedown") => KeyCode::PageDown,
        (Some('f'), ..) => KeyCode::F(name[1..].parse().ok().filter(|number| (1..=12).contains(number))?),
        _ => return None,
    };
    Some((code, modifiers))
}
