//! What the table of verbs consists of.

use super::line::VerbLine;
use super::{ExplorerPage, Verb};

/// A verb: how it is typed, what it does, and which keys do it.
pub(crate) struct VerbEntry {
    /// Its first word.
    pub(crate) name: &'static str,
    /// Other first words that mean the same.
    pub(crate) aliases: &'static [&'static str],
    /// What may follow.
    pub(crate) arguments: &'static str,
    /// One line on what it does.
    pub(crate) help: &'static str,
    /// It can be typed; other verbs have keys alone.
    pub(crate) is_typed: bool,
    /// The keys that do it, unless a person has set others.
    pub(crate) keys: &'static [DefaultKey],
    pub(super) read: Read,
}

/// Keys that do the same.
pub(crate) struct DefaultKey {
    /// Where they do.
    pub(crate) scope: KeyScope,
    /// Any of these, by the names that a person's own settings use.
    pub(crate) keys: &'static [&'static str],
    /// How the help names them; empty where the key before speaks for them too.
    pub(crate) label: &'static str,
    /// One line for the help.
    pub(crate) help: &'static str,
    /// What follows the verb.
    pub(crate) arguments: KeyArguments,
}

/// What follows the verb of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KeyArguments {
    /// Always the same.
    These(&'static str),
    /// What the person types then, on the line that opens.
    Typed,
}

/// Where a key means something. The more special comes before the more common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KeyScope {
    /// On that page, while a policy acts.
    ExplorerPage(ExplorerPage),
    /// On every page with a list: any but the main one.
    Lists,
    /// While a policy acts.
    Watch,
    /// While a person acts.
    Manual,
    /// While a policy or a person acts.
    Common,
    /// While an instruction or a verb is typed.
    Typing,
    /// While the help is open.
    Help,
    /// While wishes for this house are listed.
    WishList,
}

/// From what follows a verb to what is asked for.
pub(super) type Read = fn(&VerbLine<'_>) -> Result<Verb, String>;

pub(super) const fn verb(name: &'static str, arguments: &'static str, help: &'static str, read: Read) -> VerbEntry {
    VerbEntry { name, aliases: &[], arguments, help, is_typed: true, keys: &[], read }
}

/// A verb that no line says.
pub(super) const fn key_verb(
    name: &'static str,
    help: &'static str,
    read: Read,
    keys: &'static [DefaultKey],
) -> VerbEntry {
    VerbEntry { name, aliases: &[], arguments: "", help, is_typed: false, keys, read }
}

impl VerbEntry {
    pub(super) const fn or(self, aliases: &'static [&'static str]) -> VerbEntry {
        VerbEntry { aliases, ..self }
    }

    pub(super) const fn on(self, keys: &'static [DefaultKey]) -> VerbEntry {
        VerbEntry { keys, ..self }
    }
}

pub(super) const fn key(
    scope: KeyScope,
    label: &'static str,
    keys: &'static [&'static str],
    help: &'static str,
    arguments: &'static str,
) -> DefaultKey {
    DefaultKey { scope, keys, label, help, arguments: KeyArguments::These(arguments) }
}

/// A key that opens the line of verbs with its verb, for the rest to be typed.
pub(super) const fn opens(page: ExplorerPage, keys: &'static [&'static str], help: &'static str) -> DefaultKey {
    DefaultKey { scope: KeyScope::ExplorerPage(page), keys, label: keys[0], help, arguments: KeyArguments::Typed }
}

impl DefaultKey {
    /// What these keys of an entry do.
    ///
    /// # Errors
    /// When their arguments are none that the verb takes.
    pub(crate) fn verb(&self, entry: &VerbEntry) -> Result<Verb, String> {
        match self.arguments {
            KeyArguments::These(rest) => (entry.read)(&VerbLine { verb: entry.name, rest }),
            KeyArguments::Typed => Ok(Verb::Palette(format!("{} ", entry.name))),
        }
    }
}
