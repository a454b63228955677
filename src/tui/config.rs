//! What a person has set: colours, the mouse, and keys of their own. A TOML file; every mistake in it is named.

use std::collections::BTreeMap;

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use serde::Deserialize;

use super::theme::Scheme;
use crate::explore::verb;
use crate::explore::verb::Verb;

/// The file's content.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format_version: u32,
    #[serde(default)]
    theme: Scheme,
    #[serde(default)]
    mouse: bool,
    #[serde(default)]
    keys: BTreeMap<String, String>,
}

/// What a person has set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// The colours.
    pub scheme: Scheme,
    /// The mouse is heard from the start.
    pub mouse: bool,
    /// Keys that mean something else.
    pub keys: Vec<Remapped>,
}

/// A key and what it means now.
#[derive(Clone, Debug, PartialEq)]
pub struct Remapped {
    code: KeyCode,
    modifiers: KeyModifiers,
    /// What it does.
    pub verb: Verb,
}

impl Config {
    /// The format version that is read.
    pub const FORMAT: u32 = 1;

    /// Reads a file's text.
    ///
    /// # Errors
    /// Names the field, and the key or verb that is not one.
    pub fn parse(text: &str) -> anyhow::Result<Config> {
        let file: File = toml::from_str(text)?;
        let (found, known) = (file.format_version, Config::FORMAT);
        anyhow::ensure!(found == known, "format_version is {found}, this program reads {known}");
        let mut keys = Vec::new();
        for (name, line) in &file.keys {
            let (code, modifiers) = key(name).ok_or_else(|| anyhow::anyhow!("keys: {name:?} is no key"))?;
            let verb = verb::parse(line).map_err(|complaint| anyhow::anyhow!("keys.{name}: {complaint}"))?;
            keys.push(Remapped { code, modifiers, verb });
        }
        Ok(Config { scheme: file.theme, mouse: file.mouse, keys })
    }

    /// What a key means by these settings.
    pub fn verb(&self, key: KeyEvent) -> Option<Verb> {
        let shift = KeyModifiers::SHIFT;
        let is =
            |remapped: &&Remapped| remapped.code == key.code && remapped.modifiers - shift == key.modifiers - shift;
        self.keys.iter().find(is).map(|remapped| remapped.verb.clone())
    }
}

/// Reads `x`, `ctrl-x`, `alt-x`, `f5`, `space`, `enter`, `tab`, `left`, ...
fn key(name: &str) -> Option<(KeyCode, KeyModifiers)> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::registry::PolicyKind;

    #[test]
    fn keys_and_colours_are_read() {
        let text = "format_version = 1\ntheme = \"high-contrast\"\nmouse = true\n[keys]\nctrl-r = \"policy random\"\nf5 = \"run\"\n";
        let config = Config::parse(text).unwrap();
        assert_eq!((config.scheme, config.mouse), (Scheme::HighContrast, true));
        assert!(!Config::default().mouse);
        let press = |code, modifiers| config.verb(KeyEvent::new(code, modifiers));
        assert_eq!(press(KeyCode::Char('r'), KeyModifiers::CONTROL), Some(Verb::Policy(PolicyKind::Random)));
        assert_eq!(press(KeyCode::F(5), KeyModifiers::NONE), Some(Verb::ToggleRun));
        assert_eq!(press(KeyCode::Char('r'), KeyModifiers::NONE), None);
    }

    #[test]
    fn mistakes_are_named() {
        for (text, part) in [
            ("", "format_version"),
            ("format_version = 2", "this program reads 1"),
            ("format_version = 1\ncolour = 3", "colour"),
            ("format_version = 1\ntheme = \"pink\"", "pink"),
            ("format_version = 1\n[keys]\nhyper-x = \"run\"", "hyper-x"),
            ("format_version = 1\n[keys]\nx = \"dance\"", "keys.x: unknown verb"),
        ] {
            let error = format!("{:#}", Config::parse(text).unwrap_err());
            assert!(error.contains(part), "{error}");
        }
    }
}
