//! What a terminal sends, byte by byte: keys, pastes, the mouse, and answers to what it was asked. An answer may come in pieces,
//! however far apart: it is never taken for keys.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind};

/// Something that a terminal sent.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum TerminalInput {
    /// A key was pressed.
    Key(KeyEvent),
    /// Text was pasted.
    Paste(String),
    /// The mouse was used.
    Mouse(MouseEvent),
    /// It is there, and has taken in all that was written before it was asked (the answer to `ESC [ 5 n`).
    Ready,
    /// What it is (the answer to `ESC [ c`).
    Attributes(Vec<u32>),
}

const ESC: u8 = 0x1b;
const PASTE_END: &[u8] = b"\x1b[201~";
/// No sequence is longer.
const LONGEST: usize = 4096;

/// Takes in bytes, gives out what they mean.
#[derive(Default)]
pub(crate) struct InputParser {
    /// What is not whole yet.
    held: Vec<u8>,
    pasting: bool,
}

impl InputParser {
    /// Takes in bytes as they come.
    pub(crate) fn take(&mut self, bytes: &[u8]) -> Vec<TerminalInput> {
        let mut found = Vec::new();
        for &byte in bytes {
            self.held.push(byte);
            if self.pasting {
                if self.held.ends_with(PASTE_END) {
                    let text = self.held.len() - PASTE_END.len();
                    found.push(TerminalInput::Paste(String::from_utf8_lossy(&self.held[..text]).into_owned()));
                    (self.pasting, self.held) = (false, Vec::new());
                }
                continue;
            }
            if self.held == [ESC, ESC] {
                found.push(press(KeyCode::Esc));
                self.held.pop();
                continue;
            }
            match read(&self.held) {
                Reading::More if self.held.len() < LONGEST => {}
                Reading::More | Reading::Nothing => self.held.clear(),
                Reading::PasteBegins => (self.pasting, self.held) = (true, Vec::new()),
                Reading::Whole(input) => {
                    found.push(input);
                    self.held.clear();
                }
            }
        }
        found
    }

    /// Whether what is held may be a key already.
    pub(crate) fn is_in_doubt(&self) -> bool {
        !self.pasting && matches!(self.held[..], [ESC] | [ESC, b'O'])
    }

    /// No more came for a while: what may be a key is one. The start of an answer goes on being held.
    pub(crate) fn settle(&mut self) -> Vec<TerminalInput> {
        if !self.is_in_doubt() {
            return Vec::new();
        }
        match std::mem::take(&mut self.held).len() {
            1 => vec![press(KeyCode::Esc)],
            _ => vec![key(KeyCode::Char('O'), KeyModifiers::ALT | KeyModifiers::SHIFT)],
        }
    }
}

/// What bytes are so far.
enum Reading {
    More,
    /// Something whole that nobody wants.
    Nothing,
    PasteBegins,
    Whole(TerminalInput),
}

fn read(bytes: &[u8]) -> Reading {
    match bytes {
        [] | [ESC] => Reading::More,
        [ESC, b'[', rest @ ..] => csi(rest),
        [ESC, b'O'] => Reading::More,
        [ESC, b'O', last] => code_of_letter(*last).map_or(Reading::Nothing, |code| Reading::Whole(press(code))),
        // Strings of a terminal (titles, colours, pictures) end with BEL or ESC \.
        [ESC, b']' | b'P' | b'_' | b'^', rest @ ..] => match rest {
            [.., 0x07] | [.., ESC, b'\\'] => Reading::Nothing,
            _ => Reading::More,
        },
        [ESC, rest @ ..] => match character(rest) {
            Some(Some(c)) => Reading::Whole(key(plain_key(c).0, plain_key(c).1 | KeyModifiers::ALT)),
            Some(None) => Reading::Nothing,
            None => Reading::More,
        },
        _ => match character(bytes) {
            Some(Some(c)) => Reading::Whole(key(plain_key(c).0, plain_key(c).1)),
            Some(None) => Reading::Nothing,
            None => Reading::More,
        },
    }
}

/// One character of UTF-8: `None` while it is not whole, `Some(None)` where it cannot become one.
fn character(bytes: &[u8]) -> Option<Option<char>> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Some(text.chars().next()),
        Err(error) if error.error_len().is_none() => None,
        Err(_) => Some(None),
    }
}

fn plain_key(c: char) -> (KeyCode, KeyModifiers) {
    let none = KeyModifiers::NONE;
    match c {
        '\r' | '\n' => (KeyCode::Enter, none),
        '\t' => (KeyCode::Tab, none),
        '\x7f' | '\x08' => (KeyCode::Backspace, none),
        '\0' => (KeyCode::Char(' '), KeyModifiers::CONTROL),
        '\x01'..='\x1a' => (KeyCode::Char((c as u8 - 1 + b'a') as char), KeyModifiers::CONTROL),
        '\x1c'..='\x1f' => (KeyCode::Char((c as u8 - 0x1c + b'4') as char), KeyModifiers::CONTROL),
        c if c.is_uppercase() => (KeyCode::Char(c), KeyModifiers::SHIFT),
        c => (KeyCode::Char(c), none),
    }
}

/// What follows `ESC [`.
fn csi(rest: &[u8]) -> Reading {
    // The Linux console's function keys.
    if let [b'[', last] = rest {
        return match last {
            b'A'..=b'E' => Reading::Whole(press(KeyCode::F(last - b'A' + 1))),
            _ => Reading::Nothing,
        };
    }
    let Some((&last, parameters)) = rest.split_last() else { return Reading::More };
    if !(0x40..=0x7e).contains(&last) || (parameters.is_empty() && last == b'[') {
        return Reading::More;
    }
    let text = String::from_utf8_lossy(parameters).into_owned();
    let numbers: Vec<u32> = text
        .trim_start_matches(['?', '<', '>', '='])
        .split(';')
        .map(|part| part.split(':').next().and_then(|number| number.parse().ok()).unwrap_or(0))
        .collect();
    let modifiers = modifiers(numbers.get(1).copied().unwrap_or(1));
    let found = match (text.chars().next(), last) {
        (Some('?'), b'c') => Some(TerminalInput::Attributes(numbers)),
        (Some('<'), b'M' | b'm') => mouse(&numbers, last == b'm').map(TerminalInput::Mouse),
        (Some('?' | '<' | '>' | '='), _) => None,
        (_, b'n') if numbers == [0] => Some(TerminalInput::Ready),
        (_, b'~') if numbers == [200] => return Reading::PasteBegins,
        (_, b'~') => code_of_number(numbers.first().copied().unwrap_or(0)).map(|code| key(code, modifiers)),
        (_, b'u') => numbers.first().and_then(|&number| char::from_u32(number)).map(|c| match c {
            '\x1b' => key(KeyCode::Esc, modifiers),
            c => key(plain_key(c).0, plain_key(c).1 | modifiers),
        }),
        (_, b'Z') => Some(key(KeyCode::BackTab, KeyModifiers::SHIFT)),
        // A place of the cursor looks like a function key, but for its row.
        (_, b'R') if numbers.len() > 1 && numbers[0] != 1 => None,
        (_, letter) => code_of_letter(letter).map(|code| key(code, modifiers)),
    };
    found.map_or(Reading::Nothing, Reading::Whole)
}

fn code_of_letter(letter: u8) -> Option<KeyCode> {
    Some(match letter {
        b'A' => KeyCode::Up,
        b'B' => KeyCode::Down,
        b'C' => KeyCode::Right,
        b'D' => KeyCode::Left,
        b'F' => KeyCode::End,
        b'H' => KeyCode::Home,
        b'M' => KeyCode::Enter,
        b'P'..=b'S' => KeyCode::F(letter - b'P' + 1),
        _ => return None,
    })
}

fn code_of_number(number: u32) -> Option<KeyCode> {
    Some(match number {
        1 | 7 => KeyCode::Home,
        2 => KeyCode::Insert,
        3 => KeyCode::Delete,
        4 | 8 => KeyCode::End,
        5 => KeyCode::PageUp,
        6 => KeyCode::PageDown,
        11..=15 => KeyCode::F(number as u8 - 10),
        17..=21 => KeyCode::F(number as u8 - 11),
        23..=24 => KeyCode::F(number as u8 - 12),
        _ => return None,
    })
}

fn modifiers(number: u32) -> KeyModifiers {
    let bits = number.saturating_sub(1);
    [(1, KeyModifiers::SHIFT), (2, KeyModifiers::ALT), (4, KeyModifiers::CONTROL)]
        .into_iter()
        .filter(|(bit, _)| bits & bit != 0)
        .fold(KeyModifiers::NONE, |all, (_, modifier)| all | modifier)
}

/// The mouse in SGR form: what, column and row from 1.
fn mouse(numbers: &[u32], released: bool) -> Option<MouseEvent> {
    let [what, column, row] = *numbers else { return None };
    let button = match what & 3 {
        0 => MouseButton::Left,
        1 => MouseButton::Middle,
        _ => MouseButton::Right,
    };
    let kind = match (what & 64 != 0, what & 1, what & 32 != 0, released) {
        (true, 0, ..) => MouseEventKind::ScrollUp,
        (true, ..) => MouseEventKind::ScrollDown,
        (false, _, true, _) => return None,
        (false, _, false, true) => MouseEventKind::Up(button),
        (false, _, false, false) => MouseEventKind::Down(button),
    };
    let at = |number: u32| u16::try_from(number.saturating_sub(1)).unwrap_or(u16::MAX);
    Some(MouseEvent { kind, column: at(column), row: at(row), modifiers: KeyModifiers::NONE })
}

fn press(code: KeyCode) -> TerminalInput {
    key(code, KeyModifiers::NONE)
}

fn key(code: KeyCode, modifiers: KeyModifiers) -> TerminalInput {
    TerminalInput::Key(KeyEvent::new(code, modifiers))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(bytes: &str, expected: &[TerminalInput]) {
        let mut parser = InputParser::default();
        let mut found = parser.take(bytes.as_bytes());
        found.extend(parser.settle());
        assert_eq!(found, expected, "{bytes:?} at once");
        let mut parser = InputParser::default();
        let mut found: Vec<_> = bytes.bytes().flat_map(|byte| parser.take(&[byte])).collect();
        found.extend(parser.settle());
        assert_eq!(found, expected, "{bytes:?} byte by byte");
    }

    #[test]
    fn keys_are_read_as_terminals_send_them() {
        let control = |c| key(KeyCode::Char(c), KeyModifiers::CONTROL);
        check("q", &[press(KeyCode::Char('q'))]);
        check(
            "Sé日",
            &[key(KeyCode::Char('S'), KeyModifiers::SHIFT), press(KeyCode::Char('é')), press(KeyCode::Char('日'))],
        );
        check(
            "\r\t\x7f\x1b",
            &[press(KeyCode::Enter), press(KeyCode::Tab), press(KeyCode::Backspace), press(KeyCode::Esc)],
        );
        check("\x03\x1a", &[control('c'), control('z')]);
        check(
            "\x1b[A\x1bOD\x1b[1;5C",
            &[press(KeyCode::Up), press(KeyCode::Left), key(KeyCode::Right, KeyModifiers::CONTROL)],
        );
        check(
            "\x1b[5~\x1bOP\x1b[15~\x1b[24~\x1b[[A\x1b[H",
            &[
                press(KeyCode::PageUp),
                press(KeyCode::F(1)),
                press(KeyCode::F(5)),
                press(KeyCode::F(12)),
                press(KeyCode::F(1)),
                press(KeyCode::Home),
            ],
        );
        check("\x1bx", &[key(KeyCode::Char('x'), KeyModifiers::ALT)]);
        check("\x1b\x1b[B", &[press(KeyCode::Esc), press(KeyCode::Down)]);
    }

    #[test]
    fn pastes_and_the_mouse_are_read() {
        check(
            "\x1b[200~q\x1b[A\r\n日\x1b[201~x",
            &[TerminalInput::Paste("q\x1b[A\r\n日".into()), press(KeyCode::Char('x'))],
        );
        let event =
            |kind, column, row| TerminalInput::Mouse(MouseEvent { kind, column, row, modifiers: KeyModifiers::NONE });
        check(
            "\x1b[<64;10;11M\x1b[<0;15;33M\x1b[<0;15;33m",
            &[
                event(MouseEventKind::ScrollUp, 9, 10),
                event(MouseEventKind::Down(MouseButton::Left), 14, 32),
                event(MouseEventKind::Up(MouseButton::Left), 14, 32),
            ],
        );
    }

    #[test]
    fn an_answer_in_two_pieces_is_no_key_however_late_the_second_comes() {
        let mut parser = InputParser::default();
        assert_eq!(parser.take(b"a\x1b[?62;1;"), [press(KeyCode::Char('a'))]);
        assert_eq!(parser.settle(), []);
        assert_eq!(parser.take(b"4;22cb"), [TerminalInput::Attributes(vec![62, 1, 4, 22]), press(KeyCode::Char('b'))]);
        check("\x1b[0n\x1b[?1;2c", &[TerminalInput::Ready, TerminalInput::Attributes(vec![1, 2])]);
        check("\x1b]11;rgb:0000/0000/0000\x07\x1b_Gi=1;OK\x1b\\\x1b[12;40Rq", &[press(KeyCode::Char('q'))]);
    }

    #[test]
    fn nothing_that_is_sent_stops_it() {
        let mut parser = InputParser::default();
        parser.take(&[ESC, b'[', 0xff, 0x00, b'9', b'z', 0xc3, 0x28, 0xf8, 0x80]);
        parser.take(&vec![b';'; 10_000]);
        parser.take(b"\x1b[");
        parser.take(&vec![b'1'; 10_000]);
        parser.take(b"\r\r");
        assert_eq!(parser.take(b"q"), [press(KeyCode::Char('q'))]);
    }
}
