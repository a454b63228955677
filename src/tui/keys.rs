//! The key map: a pure function from mode and key to verb, made from the table of verbs that the help shows too.

use std::sync::LazyLock;

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use KeyCode::Char;

use super::key_name::parse_key;
use crate::explore::verb::entry::{KeyArguments, KeyScope};
use crate::explore::verb::table::VERBS;
use crate::explore::verb::{ExplorerPage, Verb};

/// What the keys mean at the moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    /// A policy acts; keys watch and steer.
    Watch,
    /// A person acts; keys move.
    Manual,
    /// Keys are text of an instruction.
    Typing,
    /// Keys are text of a verb.
    Palette,
    /// The help is open.
    Help,
    /// Wishes for this house are listed.
    WishList,
}

/// Keys that do the same, how the help names them, and what they do.
pub(crate) struct Binding {
    /// Any of these.
    pub(crate) codes: Vec<KeyCode>,
    /// In the help; empty where the binding before says it too.
    pub(crate) label: &'static str,
    /// One line for the help.
    pub(crate) help: &'static str,
    /// What they do.
    pub(crate) verb: Verb,
    scope: KeyScope,
}

/// The keys of the table of verbs, in its order.
static BINDINGS: LazyLock<Vec<Binding>> = LazyLock::new(|| {
    let keys = VERBS.iter().flat_map(|entry| entry.keys.iter().map(move |key| (entry, key)));
    keys.filter_map(|(entry, key)| {
        let codes = key.keys.iter().filter_map(|name| parse_key(name)).map(|(code, _)| code).collect();
        let verb = key.verb(entry).ok()?;
        Some(Binding { codes, label: key.label, help: key.help, verb, scope: key.scope })
    })
    .collect()
});

/// The keys that mean something in `mode` on `page`, in the order of the help: the page's first, then those of the mode.
pub(crate) fn bindings(mode: Mode, page: ExplorerPage) -> impl Iterator<Item = &'static Binding> {
    let scopes: Vec<KeyScope> = match mode {
        Mode::Watch if page == ExplorerPage::Main => vec![KeyScope::Watch, KeyScope::Common],
        Mode::Watch => vec![KeyScope::ExplorerPage(page), KeyScope::Lists, KeyScope::Watch, KeyScope::Common],
        Mode::Manual => vec![KeyScope::Manual, KeyScope::Common],
        Mode::Typing | Mode::Palette => vec![KeyScope::Typing],
        Mode::Help => vec![KeyScope::Help],
        Mode::WishList => vec![KeyScope::WishList],
    };
    scopes.into_iter().flat_map(|scope| BINDINGS.iter().filter(move |binding| binding.scope == scope))
}

/// The same without those that mean something else on this page.
pub(crate) fn bindings_in_force(mode: Mode, page: ExplorerPage) -> impl Iterator<Item = &'static Binding> {
    let mut taken: Vec<KeyCode> = Vec::new();
    bindings(mode, page).filter(move |binding| {
        let is_taken = binding.codes.iter().all(|code| taken.contains(code));
        taken.extend(&binding.codes);
        !is_taken
    })
}

/// What a key means in `mode` on `page`; `None` for nothing, or for text while typing.
pub(crate) fn verb(mode: Mode, page: ExplorerPage, key: KeyEvent) -> Option<Verb> {
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return match key.code {
            Char('c') => Some(Verb::Quit),
            Char('z') => Some(Verb::Suspend),
            Char('p') if matches!(mode, Mode::Watch | Mode::Manual) => Some(Verb::Palette(String::new())),
            _ => None,
        };
    }
    if key.modifiers.contains(KeyModifiers::ALT) {
        return None;
    }
    if let Char(digit @ '1'..='9') = key.code
        && matches!(mode, Mode::Watch | Mode::Manual)
    {
        return Some(Verb::Interact(digit as u8 - b'0'));
    }
    bindings(mode, page).find(|binding| binding.codes.contains(&key.code)).map(|binding| binding.verb.clone())
}

/// A text that names verbs between backticks, with their keys instead; a verb without one as it is typed.
pub(crate) fn with_keys(text: &str) -> String {
    let named = |(at, part): (usize, &str)| match at % 2 {
        0 => part.to_string(),
        _ => key_of(part).map_or_else(|| format!(":{part}"), str::to_string),
    };
    text.split('`').enumerate().map(named).collect()
}

/// The first key that does what a verb alone does.
fn key_of(verb: &str) -> Option<&'static str> {
    let entry = VERBS.iter().find(|entry| entry.name == verb)?;
    let key =
        entry.keys.iter().find(|key| key.scope == KeyScope::Common && key.arguments == KeyArguments::These(""))?;
    key.keys.first().copied()
}

#[cfg(test)]
mod tests {
    use KeyCode::{Enter, Esc, Right};

    use super::*;
    use crate::agent::registry::PolicyKind;
    use crate::domain::{Action, ActionType};
    use crate::explore::session::SessionCommand;

    fn navigate(kind: ActionType) -> Option<Verb> {
        Some(Verb::Ask(SessionCommand::Act(Action::navigate(kind))))
    }

    #[test]
    fn every_key_of_the_table_has_a_name_and_a_verb() {
        for entry in VERBS {
            for key in entry.keys {
                assert!(key.keys.iter().all(|name| parse_key(name).is_some()), "{:?}", key.keys);
                assert!(key.verb(entry).is_ok(), "{}: {:?}", entry.name, key.arguments);
            }
        }
    }

    fn check(mode: Mode, code: KeyCode, expected: Option<Verb>) {
        assert_eq!(
            verb(mode, ExplorerPage::Main, KeyEvent::new(code, KeyModifiers::NONE)),
            expected,
            "{mode:?} {code:?}"
        );
    }

    #[test]
    fn keys_mean_what_the_mode_says() {
        check(Mode::Watch, Char(' '), Some(Verb::ToggleRun));
        check(Mode::Watch, Right, Some(Verb::Forward(1)));
        check(Mode::Manual, Right, navigate(ActionType::RotateRight));
        check(Mode::Watch, Char('a'), Some(Verb::Ask(SessionCommand::Choose(PolicyKind::Agent))));
        check(Mode::Manual, Char('a'), navigate(ActionType::RotateLeft));
        check(Mode::Manual, Enter, Some(Verb::Step(1)));
        check(Mode::Watch, Char('7'), Some(Verb::Interact(7)));
        check(Mode::Typing, Char('7'), None);
        check(Mode::Typing, Char('q'), None);
        check(Mode::Typing, Enter, Some(Verb::Apply));
        check(Mode::Help, Char('q'), Some(Verb::Cancel));
        check(Mode::Watch, Char('f'), Some(Verb::Show(ExplorerPage::Frame)));
        check(Mode::Watch, Char('Z'), None);
    }

    #[test]
    fn advice_names_keys_where_verbs_have_some() {
        let text = "try another house (`next`), or `values`; `manual` takes over, `compare` tries other words";
        let keys = "try another house (N), or V; m takes over, :compare tries other words";
        assert_eq!(with_keys(text), keys);
        assert_eq!(with_keys("no verb"), "no verb");
    }

    #[test]
    fn control_c_quits_in_every_mode() {
        for mode in [Mode::Watch, Mode::Manual, Mode::Typing, Mode::Palette, Mode::Help, Mode::WishList] {
            assert_eq!(
                verb(mode, ExplorerPage::Main, KeyEvent::new(Char('c'), KeyModifiers::CONTROL)),
                Some(Verb::Quit)
            );
            assert_eq!(verb(mode, ExplorerPage::Main, KeyEvent::new(Char('x'), KeyModifiers::CONTROL)), None);
        }
    }

    #[test]
    fn a_page_has_keys_of_its_own_and_leaves_with_escape() {
        let on = |page, code| verb(Mode::Watch, page, KeyEvent::new(code, KeyModifiers::NONE));
        assert_eq!(on(ExplorerPage::Branches, Enter), Some(Verb::Take));
        assert_eq!(on(ExplorerPage::Main, Enter), Some(Verb::Step(1)));
        assert_eq!(on(ExplorerPage::Mind, Char('s')), Some(Verb::Sort));
        for page in [
            ExplorerPage::Branches,
            ExplorerPage::Mind,
            ExplorerPage::World,
            ExplorerPage::Compare,
            ExplorerPage::Chain,
        ] {
            assert_eq!(on(page, Esc), Some(Verb::Show(ExplorerPage::Main)));
            assert_eq!(on(page, Char(' ')), Some(Verb::ToggleRun));
        }
    }

    #[test]
    fn no_key_means_two_things_among_those_of_one_mode() {
        for mode in [Mode::Watch, Mode::Manual, Mode::Typing, Mode::Help, Mode::WishList] {
            let keys: Vec<KeyCode> =
                bindings(mode, ExplorerPage::Main).flat_map(|binding| &binding.codes).copied().collect();
            for (at, key) in keys.iter().enumerate() {
                assert!(!keys[at + 1..].contains(key), "{mode:?}: {key:?} twice");
            }
        }
    }
}
