//! The instruction line while somebody types: one line of text with a history.

use crossterm::event::KeyEvent;
use ratatui_textarea::{CursorMove, TextArea};

/// A line editor with a history.
#[derive(Clone, Debug, Default)]
pub(crate) struct Editor {
    area: TextArea<'static>,
    history: Vec<String>,
    /// Which entry of the history is shown; its length for the draft.
    at: usize,
    draft: String,
}

impl Editor {
    /// Begins with `text`, the cursor at its end.
    pub(crate) fn open(&mut self, text: &str) {
        self.at = self.history.len();
        self.draft = text.to_string();
        self.show(text);
    }

    fn show(&mut self, text: &str) {
        let mut area = TextArea::new(vec![text.to_string()]);
        area.set_cursor_line_style(ratatui::style::Style::new());
        area.move_cursor(CursorMove::End);
        self.area = area;
    }

    /// What was typed.
    pub(crate) fn text(&self) -> &str {
        self.area.lines().first().map_or("", String::as_str)
    }

    /// What was given before, oldest first.
    pub(crate) fn history(&self) -> &[String] {
        &self.history
    }

    /// The widget's state.
    pub(crate) fn area(&self) -> &TextArea<'static> {
        &self.area
    }

    /// A key that is text or moves the cursor.
    pub(crate) fn key(&mut self, key: KeyEvent) {
        self.area.input(key);
        self.keep_one_line();
    }

    /// Pasted text; line breaks become spaces, other control characters go.
    pub(crate) fn paste(&mut self, text: &str) {
        let line: String = text
            .chars()
            .map(|c| if c.is_whitespace() { ' ' } else { c })
            .filter(|c| !c.is_control())
            .take(crate::language::instruction::LONGEST)
            .collect();
        self.area.insert_str(line);
        self.keep_one_line();
    }

    /// A control key of the widget may have broken the line.
    fn keep_one_line(&mut self) {
        if self.area.lines().len() > 1 {
            let text = self.area.lines().join(" ");
            self.show(&text);
        }
    }

    /// The line may have another width from now on: what was scrolled out of a narrow one comes back.
    pub(crate) fn refit(&mut self) {
        let (text, column) = (self.text().to_owned(), self.area.cursor().1);
        self.show(&text);
        self.area.move_cursor(CursorMove::Jump(0, u16::try_from(column).unwrap_or(u16::MAX)));
    }

    /// Remembers an instruction that was given.
    pub(crate) fn remember(&mut self, text: &str) {
        if self.history.last().is_none_or(|last| last != text) {
            self.history.push(text.to_string());
        }
        self.at = self.history.len();
    }

    /// Shows an earlier (-1) or later (+1) instruction.
    pub(crate) fn travel(&mut self, by: isize) {
        if self.at == self.history.len() {
            self.draft = self.text().to_string();
        }
        self.at = self.at.saturating_add_signed(by).min(self.history.len());
        let text = self.history.get(self.at).unwrap_or(&self.draft).clone();
        self.show(&text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crossterm::event::{KeyCode, KeyModifiers};

    #[test]
    fn history_goes_back_and_forth_and_keeps_the_draft() {
        let mut editor = Editor::default();
        editor.remember("one");
        editor.remember("two");
        editor.open("");
        editor.key(KeyEvent::new(KeyCode::Char('d'), KeyModifiers::NONE));
        editor.travel(-1);
        assert_eq!(editor.text(), "two");
        editor.travel(-1);
        editor.travel(-1);
        assert_eq!(editor.text(), "one");
        editor.travel(1);
        editor.travel(1);
        editor.travel(1);
        assert_eq!(editor.text(), "d");
    }

    #[test]
    fn a_line_that_was_narrow_for_a_while_is_seen_whole_again() {
        use ratatui::buffer::Buffer;
        use ratatui::layout::Rect;
        use ratatui::widgets::Widget;
        let seen = |editor: &Editor, width| {
            let mut buf = Buffer::empty(Rect::new(0, 0, width, 1));
            editor.area().render(buf.area, &mut buf);
            buf.content().iter().map(|cell| cell.symbol().to_owned()).collect::<String>()
        };
        let mut editor = Editor::default();
        editor.open("half a wish");
        editor.key(KeyEvent::new(KeyCode::Left, KeyModifiers::NONE));
        assert!(!seen(&editor, 5).contains("half"));
        editor.refit();
        assert!(seen(&editor, 40).starts_with("half a wish"));
        editor.key(KeyEvent::new(KeyCode::Char('X'), KeyModifiers::NONE));
        assert_eq!(editor.text(), "half a wisXh", "the cursor stays where it was");
    }

    #[test]
    fn a_paste_stays_on_one_line_without_control_characters() {
        let mut editor = Editor::default();
        editor.open("");
        editor.paste("put the\nmug\x1b[31m away\r\n");
        assert_eq!(editor.text().trim(), "put the mug[31m away");
        assert_eq!(editor.area().lines().len(), 1);
    }
}
