//! The key map: a pure function from mode and key to verb, over one table that the help shows too.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use crate::agent::registry::PolicyKind;
use crate::analysis::chain::Draws;
use crate::domain::ActionType;
use crate::explore::verb::{Page, TIMES, Verb};

/// What the keys mean at the moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
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
}

/// Keys that do the same, how the help names them, and what they do.
pub struct Binding {
    /// Any of these.
    pub keys: &'static [KeyCode],
    /// In the help; empty where the binding before says it too.
    pub label: &'static str,
    /// What they do.
    pub verb: Verb,
}

const fn bind(label: &'static str, keys: &'static [KeyCode], verb: Verb) -> Binding {
    Binding { keys, label, verb }
}

use KeyCode::{Backspace, Char, Down, End, Enter, Esc, F, Home, Left, PageDown, PageUp, Right, Tab, Up};

/// Keys that mean the same whether a policy or a person acts.
const COMMON: &[Binding] = &[
    bind("space", &[Char(' ')], Verb::ToggleRun),
    bind("n enter", &[Enter, Char('n'), Char('.')], Verb::Step(1)),
    bind("h l", &[Char('h')], Verb::Back(1)),
    bind("", &[Char('l')], Verb::Forward(1)),
    bind("0 $", &[Char('0'), Home], Verb::Seek(0)),
    bind("", &[Char('$'), End], Verb::Last),
    bind("[ ]", &[Char('[')], Verb::LastEvent),
    bind("", &[Char(']')], Verb::NextEvent),
    bind("}", &[Char('}')], Verb::NextBranch),
    bind("c", &[Char('c')], Verb::Continue),
    bind("i /", &[Char('i'), Char('/')], Verb::Edit),
    bind(":", &[Char(':')], Verb::Palette("")),
    bind("m", &[Char('m')], Verb::ToggleManual),
    bind("1-9", &[Char('1')], Verb::Interact(1)),
    bind("tab", &[Tab], Verb::Page),
    bind("+ -", &[Char('+'), Char('=')], Verb::Faster),
    bind("", &[Char('-')], Verb::Slower),
    bind("r", &[Char('r')], Verb::Reset),
    bind("N", &[Char('N')], Verb::Next),
    bind("p", &[Char('p')], Verb::NextPolicy),
    bind("t", &[Char('t')], Verb::Show(Page::Branches)),
    bind("M", &[Char('M')], Verb::Show(Page::Mind)),
    bind("W", &[Char('W')], Verb::Show(Page::World)),
    bind("B", &[Char('B')], Verb::Show(Page::Compare)),
    bind("C", &[Char('C')], Verb::Show(Page::Chain)),
    bind("V", &[Char('V')], Verb::ValueMap),
    bind("v", &[Char('v')], Verb::NextHeading),
    bind("o", &[Char('o')], Verb::Overlay),
    bind("b", &[Char('b')], Verb::Labels),
    bind("g", &[Char('g')], Verb::Graphics),
    bind("F", &[Char('F')], Verb::FullFrame),
    bind("S", &[Char('S')], Verb::Save(None)),
    bind("y", &[Char('y')], Verb::Copy),
    bind("?", &[Char('?'), F(1)], Verb::Help),
    bind("q", &[Char('q')], Verb::Quit),
];

const WATCH: &[Binding] = &[
    bind("", &[Left], Verb::Back(1)),
    bind("", &[Right], Verb::Forward(1)),
    bind("a e x", &[Char('a')], Verb::Policy(PolicyKind::Agent)),
    bind("", &[Char('e')], Verb::Policy(PolicyKind::Expert)),
    bind("", &[Char('x')], Verb::Policy(PolicyKind::Random)),
];

const MANUAL: &[Binding] = &[
    bind("up w", &[Up, Char('w')], Verb::Navigate(ActionType::MoveAhead)),
    bind("left a", &[Left, Char('a')], Verb::Navigate(ActionType::RotateLeft)),
    bind("right d", &[Right, Char('d')], Verb::Navigate(ActionType::RotateRight)),
    bind("pgup u", &[PageUp, Char('u')], Verb::Navigate(ActionType::LookUp)),
    bind("pgdn s", &[PageDown, Down, Char('s')], Verb::Navigate(ActionType::LookDown)),
    bind("esc", &[Esc], Verb::ToggleManual),
];

const TYPING: &[Binding] = &[
    bind("enter", &[Enter], Verb::Apply),
    bind("esc", &[Esc], Verb::Cancel),
    bind("tab", &[Tab], Verb::Complete),
    bind("up", &[Up], Verb::Earlier),
    bind("down", &[Down], Verb::Later),
];

const HELP: &[Binding] =
    &[bind("esc ? q", &[Esc, Char('?'), Char('q'), F(1), Enter, Backspace, Char(' ')], Verb::Cancel)];

/// Keys of any page but the main one; they come before the common ones.
const LIST: &[Binding] = &[
    bind("j k", &[Char('j'), Down], Verb::Select(1)),
    bind("", &[Char('k'), Up], Verb::Select(-1)),
    bind("esc", &[Esc], Verb::Show(Page::Main)),
];
const BRANCHES: &[Binding] = &[
    bind("enter", &[Enter], Verb::Take),
    bind("R", &[Char('R')], Verb::Palette("name ")),
    bind("T", &[Char('T')], Verb::Palette("task ")),
    bind("E", &[Char('E')], Verb::Palette("export ")),
];
const MIND: &[Binding] = &[bind("s", &[Char('s')], Verb::Sort)];
const COMPARE: &[Binding] = &[bind("enter", &[Enter], Verb::Palette("compare ")), bind("s", &[Char('s')], Verb::Swap)];
const CHAIN: &[Binding] = &[
    bind("enter", &[Enter], Verb::Palette("chain ")),
    bind("w", &[Char('w')], Verb::WhichLink(Draws { times: TIMES, only: None })),
    bind("x", &[Char('x')], Verb::ReplayLink),
    bind("A", &[Char('A')], Verb::Palette("against ")),
    bind("s", &[Char('s')], Verb::Stop),
];

fn of_page(page: Page) -> [&'static [Binding]; 2] {
    match page {
        Page::Main => [&[], &[]],
        Page::Branches => [BRANCHES, LIST],
        Page::Mind => [MIND, LIST],
        Page::World => [&[], LIST],
        Page::Compare => [COMPARE, LIST],
        Page::Chain => [CHAIN, LIST],
    }
}

/// The keys that mean something in `mode` on `page`, in the order of the help: the page's first, then those of the mode.
pub fn bindings(mode: Mode, page: Page) -> impl Iterator<Item = &'static Binding> {
    let (own, common): (&[Binding], &[Binding]) = match mode {
        Mode::Watch => (WATCH, COMMON),
        Mode::Manual => (MANUAL, COMMON),
        Mode::Typing | Mode::Palette => (TYPING, &[]),
        Mode::Help => (HELP, &[]),
    };
    let [first, second] = if matches!(mode, Mode::Watch) { of_page(page) } else { [&[][..], &[]] };
    first.iter().chain(second).chain(own).chain(common)
}

/// What a key means in `mode` on `page`; `None` for nothing, or for text while typing.
pub fn verb(mode: Mode, page: Page, key: KeyEvent) -> Option<Verb> {
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return match key.code {
            Char('c') => Some(Verb::Quit),
            Char('p') if matches!(mode, Mode::Watch | Mode::Manual) => Some(Verb::Palette("")),
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
    bindings(mode, page).find(|binding| binding.keys.contains(&key.code)).map(|binding| binding.verb.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(mode: Mode, code: KeyCode, expected: Option<Verb>) {
        assert_eq!(verb(mode, Page::Main, KeyEvent::new(code, KeyModifiers::NONE)), expected, "{mode:?} {code:?}");
    }

    #[test]
    fn keys_mean_what_the_mode_says() {
        check(Mode::Watch, Char(' '), Some(Verb::ToggleRun));
        check(Mode::Watch, Right, Some(Verb::Forward(1)));
        check(Mode::Manual, Right, Some(Verb::Navigate(ActionType::RotateRight)));
        check(Mode::Watch, Char('a'), Some(Verb::Policy(PolicyKind::Agent)));
        check(Mode::Manual, Char('a'), Some(Verb::Navigate(ActionType::RotateLeft)));
        check(Mode::Manual, Enter, Some(Verb::Step(1)));
        check(Mode::Watch, Char('7'), Some(Verb::Interact(7)));
        check(Mode::Typing, Char('7'), None);
        check(Mode::Typing, Char('q'), None);
        check(Mode::Typing, Enter, Some(Verb::Apply));
        check(Mode::Help, Char('q'), Some(Verb::Cancel));
        check(Mode::Watch, Char('z'), None);
    }

    #[test]
    fn control_c_quits_in_every_mode() {
        for mode in [Mode::Watch, Mode::Manual, Mode::Typing, Mode::Palette, Mode::Help] {
            assert_eq!(verb(mode, Page::Main, KeyEvent::new(Char('c'), KeyModifiers::CONTROL)), Some(Verb::Quit));
            assert_eq!(verb(mode, Page::Main, KeyEvent::new(Char('x'), KeyModifiers::CONTROL)), None);
        }
    }

    #[test]
    fn a_page_has_keys_of_its_own_and_leaves_with_escape() {
        let on = |page, code| verb(Mode::Watch, page, KeyEvent::new(code, KeyModifiers::NONE));
        assert_eq!(on(Page::Branches, Enter), Some(Verb::Take));
        assert_eq!(on(Page::Main, Enter), Some(Verb::Step(1)));
        assert_eq!(on(Page::Mind, Char('s')), Some(Verb::Sort));
        for page in [Page::Branches, Page::Mind, Page::World, Page::Compare, Page::Chain] {
            assert_eq!(on(page, Esc), Some(Verb::Show(Page::Main)));
            assert_eq!(on(page, Char(' ')), Some(Verb::ToggleRun));
        }
    }

    #[test]
    fn no_key_means_two_things_among_those_of_one_mode() {
        for mode in [Mode::Watch, Mode::Manual, Mode::Typing, Mode::Help] {
            let keys: Vec<KeyCode> = bindings(mode, Page::Main).flat_map(|binding| binding.keys).copied().collect();
            for (at, key) in keys.iter().enumerate() {
                assert!(!keys[at + 1..].contains(key), "{mode:?}: {key:?} twice");
            }
        }
    }
}
