//! What a person has set: colours, the mouse, and keys of their own. A TOML file; every mistake in it is named.

use std::collections::BTreeMap;

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use serde::Deserialize;

use super::key_name::parse_key;
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

#[cfg(test)]
impl File {
    const FIELDS: [&str; 4] = ["format_version", "theme", "mouse", "keys"];
}

/// What a person has set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExplorerConfig {
    /// The colour scheme of the text.
    pub(crate) scheme: Scheme,
    /// The mouse is heard from the start.
    pub(crate) mouse: bool,
    /// Keys that mean something else.
    pub(crate) keys: Vec<Remapped>,
}

/// A key and what it means now.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Remapped {
    code: KeyCode,
    modifiers: KeyModifiers,
    /// The key and the line that the file says.
    pub(crate) name: String,
    pub(crate) line: String,
    /// What it does.
    pub(crate) verb: Verb,
}

impl ExplorerConfig {
    /// The format version that is read.
    pub(crate) const FORMAT: u32 = 1;

    /// Reads a file's text.
    ///
    /// # Errors
    /// Names the field, and the key or verb that is not one.
    pub fn parse(text: &str) -> anyhow::Result<ExplorerConfig> {
        let file: File = toml::from_str(text)?;
        let (found, known) = (file.format_version, ExplorerConfig::FORMAT);
        anyhow::ensure!(found == known, "format_version is {found}, this program reads {known}");
        let mut keys = Vec::new();
        for (name, line) in &file.keys {
            let (code, modifiers) = parse_key(name).ok_or_else(|| anyhow::anyhow!("keys: {name:?} is no key"))?;
            let verb = verb::parse(line).map_err(|complaint| anyhow::anyhow!("keys.{name}: {complaint}"))?;
            keys.push(Remapped { code, modifiers, name: name.clone(), line: line.clone(), verb });
        }
        Ok(ExplorerConfig { scheme: file.theme, mouse: file.mouse, keys })
    }

    /// A file that sets everything as it is without one, with a line on each.
    pub fn commented() -> String {
        let format = ExplorerConfig::FORMAT;
        format!(
            "# Settings of `sprint explore`: sprint/explorer.toml in the configuration folder.\n\
             format_version = {format}\n\n\
             # Colours: auto (legible on dark and on light backgrounds), dark, light, high-contrast, no-colour.\n\
             theme = \"auto\"\n\n\
             # Hear the mouse: clicks select, the wheel goes in time. The terminal's own selection then needs shift.\n\
             mouse = false\n\n\
             # Keys of your own: any verb of `:`, as it is typed there. They come before the program's own keys.\n\
             # Names: x, X, space, enter, tab, esc, left, home, pageup, f1 to f12; ctrl-x, alt-x.\n\
             [keys]\n\
             # ctrl-r = \"policy random\"\n\
             # f5 = \"run\"\n"
        )
    }

    /// What a key means by these settings.
    pub(crate) fn verb(&self, key: KeyEvent) -> Option<Verb> {
        let shift = KeyModifiers::SHIFT;
        let is =
            |remapped: &&Remapped| remapped.code == key.code && remapped.modifiers - shift == key.modifiers - shift;
        self.keys.iter().find(is).map(|remapped| remapped.verb.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::registry::PolicyKind;
    use crate::explore::session::SessionCommand;

    #[test]
    fn keys_and_colours_are_read() {
        let text = "format_version = 1\ntheme = \"high-contrast\"\nmouse = true\n[keys]\nctrl-r = \"policy random\"\nf5 = \"run\"\n";
        let config = ExplorerConfig::parse(text).unwrap();
        assert_eq!((config.scheme, config.mouse), (Scheme::HighContrast, true));
        assert!(!ExplorerConfig::default().mouse);
        let press = |code, modifiers| config.verb(KeyEvent::new(code, modifiers));
        assert_eq!(
            press(KeyCode::Char('r'), KeyModifiers::CONTROL),
            Some(Verb::Ask(SessionCommand::Choose(PolicyKind::Random)))
        );
        assert_eq!(press(KeyCode::F(5), KeyModifiers::NONE), Some(Verb::ToggleRun));
        assert_eq!(press(KeyCode::Char('r'), KeyModifiers::NONE), None);
    }

    #[test]
    fn the_commented_settings_are_what_holds_without_any_and_its_examples_are_settings() {
        let text = ExplorerConfig::commented();
        assert_eq!(ExplorerConfig::parse(&text).unwrap(), ExplorerConfig::default());
        let all = text.replace("# ctrl-r", "ctrl-r").replace("# f5", "f5");
        assert_eq!(ExplorerConfig::parse(&all).unwrap().keys.len(), 2);
        assert!(File::FIELDS.iter().all(|field| text.contains(field)), "{text}");
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
            let error = format!("{:#}", ExplorerConfig::parse(text).unwrap_err());
            assert!(error.contains(part), "{error}");
        }
    }
}
