//! What keys mean while a span is annotated. Letters are the sentence's; the rest is done by other keys.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AnnotateKey {
    Keep,
    Skip,
    Back,
    Forward,
    /// Frames forward, or back.
    Shot(isize),
    /// To where the next step begins, or the one before.
    Step(bool),
    Play,
    Strip,
    Graphics,
    Restore,
    Repaint,
    Help,
    Agreement,
    Stop,
    Leave,
}

/// The keys in the order in which the help lists them: how they are written, and what they do.
pub(crate) const KEYS: [(&str, &str); 12] = [
    ("enter", "keep the sentence, go to the next span"),
    ("ctrl-s", "skip: no meaningful task, or none for one sentence"),
    ("pgup pgdn", "back, to say it otherwise; on, leaving this open"),
    ("space", "on an empty line: play the film, or pause it"),
    ("up down", "one frame back, or on"),
    ("tab", "the next step; shift-tab: the one before"),
    ("ctrl-t", "the film, or the ends of all steps in a row"),
    ("ctrl-g", "show pictures another way"),
    ("esc", "the line as it was kept"),
    ("F2", "how far people agree"),
    ("F1 or ?", "on an empty line: this page"),
    ("ctrl-c", "leave; the same command goes on here"),
];

/// What a key asks for; nothing where it is text or moves in it.
pub(crate) fn meaning(key: KeyEvent, is_empty: bool) -> Option<AnnotateKey> {
    let control = key.modifiers.contains(KeyModifiers::CONTROL);
    Some(match (key.code, control) {
        (KeyCode::Char('c' | 'q'), true) => AnnotateKey::Leave,
        (KeyCode::Char('s'), true) => AnnotateKey::Skip,
        (KeyCode::Char('t'), true) => AnnotateKey::Strip,
        (KeyCode::Char('g'), true) => AnnotateKey::Graphics,
        (KeyCode::Char('l'), true) => AnnotateKey::Repaint,
        (KeyCode::Char('z'), true) => AnnotateKey::Stop,
        (KeyCode::Enter, _) => AnnotateKey::Keep,
        (KeyCode::PageUp, _) => AnnotateKey::Back,
        (KeyCode::PageDown, _) => AnnotateKey::Forward,
        (KeyCode::Up, _) => AnnotateKey::Shot(-1),
        (KeyCode::Down, _) => AnnotateKey::Shot(1),
        (KeyCode::Tab, _) => AnnotateKey::Step(true),
        (KeyCode::BackTab, _) => AnnotateKey::Step(false),
        (KeyCode::Esc, _) => AnnotateKey::Restore,
        (KeyCode::F(1), _) => AnnotateKey::Help,
        (KeyCode::F(2), _) => AnnotateKey::Agreement,
        (KeyCode::Char(' '), false) if is_empty => AnnotateKey::Play,
        (KeyCode::Char('?'), false) if is_empty => AnnotateKey::Help,
        _ => return None,
    })
}
