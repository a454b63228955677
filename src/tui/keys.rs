//! The key map: a pure function from mode and key to verb, over one table that the help shows too.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::policies::PolicyKind;
use super::verb::Verb;
use crate::domain::ActionType;

/// What the keys mean at the moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// A policy acts; keys watch and steer.
    Watch,
    /// A person acts; keys move.
    Manual,
    /// Keys are text of an instruction.
    Typing,
    /// The help is open.
    Help,
}

/// Keys that do the same, how the help names them, and what they do.
pub struct Binding {
    /// Any of these.
    pub keys: &'static [KeyCode],
    /// In the help.
    pub label: &'static str,
    /// What they do.
    pub verb: Verb,
}

const fn bind(label: &'static str, keys: &'static [KeyCode], verb: Verb) -> Binding {
    Binding { keys, label, verb }
}

use KeyCode::{Backspace, Char, Down, Enter, Esc, F, Left, PageDown, PageUp, Right, Tab, Up};

/// Keys that mean the same whether a policy or a person acts.
const COMMON: &[Binding] = &[
    bind("space", &[Char(' ')], Verb::ToggleRun),
    bind("enter n .", &[Enter, Char('n'), Char('.')], Verb::Step),
    bind("i /", &[Char('i'), Char('/')], Verb::Edit),
    bind("m", &[Char('m')], Verb::ToggleManual),
    bind("1-9", &[Char('1')], Verb::Interact(1)),
    bind("tab", &[Tab], Verb::Page),
    bind("+ =", &[Char('+'), Char('=')], Verb::Faster),
    bind("-", &[Char('-')], Verb::Slower),
    bind("r", &[Char('r')], Verb::Reset),
    bind("N", &[Char('N')], Verb::Next),
    bind("p", &[Char('p')], Verb::NextPolicy),
    bind("g", &[Char('g')], Verb::Graphics),
    bind("b", &[Char('b')], Verb::Labels),
    bind("?", &[Char('?'), F(1)], Verb::Help),
    bind("q ctrl-c", &[Char('q')], Verb::Quit),
];

const WATCH: &[Binding] = &[
    bind("right", &[Right], Verb::Step),
    bind("a", &[Char('a')], Verb::Policy(PolicyKind::Agent)),
    bind("e", &[Char('e')], Verb::Policy(PolicyKind::Expert)),
    bind("x", &[Char('x')], Verb::Policy(PolicyKind::Random)),
];

const MANUAL: &[Binding] = &[
    bind("up w", &[Up, Char('w')], Verb::Navigate(ActionType::MoveAhead)),
    bind("left a", &[Left, Char('a')], Verb::Navigate(ActionType::RotateLeft)),
    bind("right d", &[Right, Char('d')], Verb::Navigate(ActionType::RotateRight)),
    bind("pgup u", &[PageUp, Char('u')], Verb::Navigate(ActionType::LookUp)),
    bind("pgdn down s", &[PageDown, Down, Char('s')], Verb::Navigate(ActionType::LookDown)),
    bind("esc", &[Esc], Verb::ToggleManual),
];

const TYPING: &[Binding] = &[
    bind("enter", &[Enter], Verb::Apply),
    bind("esc", &[Esc], Verb::Cancel),
    bind("up", &[Up], Verb::Earlier),
    bind("down", &[Down], Verb::Later),
];

const HELP: &[Binding] =
    &[bind("esc ? q", &[Esc, Char('?'), Char('q'), F(1), Enter, Backspace, Char(' ')], Verb::Cancel)];

/// The keys that mean something in `mode`, in the order of the help: those of the mode first.
pub fn bindings(mode: Mode) -> impl Iterator<Item = &'static Binding> {
    let (own, common): (&[Binding], &[Binding]) = match mode {
        Mode::Watch => (WATCH, COMMON),
        Mode::Manual => (MANUAL, COMMON),
        Mode::Typing => (TYPING, &[]),
        Mode::Help => (HELP, &[]),
    };
    own.iter().chain(common)
}

/// What a key means in `mode`; `None` for nothing, or for text while typing.
pub fn verb(mode: Mode, key: KeyEvent) -> Option<Verb> {
    let control = key.modifiers.intersects(KeyModifiers::CONTROL | KeyModifiers::ALT);
    if control {
        return (key.code == Char('c') && key.modifiers.contains(KeyModifiers::CONTROL)).then_some(Verb::Quit);
    }
    if let Char(digit @ '1'..='9') = key.code
        && matches!(mode, Mode::Watch | Mode::Manual)
    {
        return Some(Verb::Interact(digit as u8 - b'0'));
    }
    bindings(mode).find(|binding| binding.keys.contains(&key.code)).map(|binding| binding.verb)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(mode: Mode, code: KeyCode, expected: Option<Verb>) {
        assert_eq!(verb(mode, KeyEvent::new(code, KeyModifiers::NONE)), expected, "{mode:?} {code:?}");
    }

    #[test]
    fn keys_mean_what_the_mode_says() {
        check(Mode::Watch, Char(' '), Some(Verb::ToggleRun));
        check(Mode::Watch, Right, Some(Verb::Step));
        check(Mode::Manual, Right, Some(Verb::Navigate(ActionType::RotateRight)));
        check(Mode::Watch, Char('a'), Some(Verb::Policy(PolicyKind::Agent)));
        check(Mode::Manual, Char('a'), Some(Verb::Navigate(ActionType::RotateLeft)));
        check(Mode::Manual, Enter, Some(Verb::Step));
        check(Mode::Watch, Char('7'), Some(Verb::Interact(7)));
        check(Mode::Typing, Char('7'), None);
        check(Mode::Typing, Char('q'), None);
        check(Mode::Typing, Enter, Some(Verb::Apply));
        check(Mode::Help, Char('q'), Some(Verb::Cancel));
        check(Mode::Watch, Char('z'), None);
    }

    #[test]
    fn control_c_quits_in_every_mode() {
        for mode in [Mode::Watch, Mode::Manual, Mode::Typing, Mode::Help] {
            assert_eq!(verb(mode, KeyEvent::new(Char('c'), KeyModifiers::CONTROL)), Some(Verb::Quit));
            assert_eq!(verb(mode, KeyEvent::new(Char('x'), KeyModifiers::CONTROL)), None);
        }
    }

    #[test]
    fn no_key_means_two_things_in_one_mode() {
        for mode in [Mode::Watch, Mode::Manual, Mode::Typing, Mode::Help] {
            let keys: Vec<KeyCode> = bindings(mode).flat_map(|binding| binding.keys).copied().collect();
            for (at, key) in keys.iter().enumerate() {
                assert!(!keys[at + 1..].contains(key), "{mode:?}: {key:?} twice");
            }
        }
    }
}
