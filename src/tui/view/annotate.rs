//! The screen of annotation: the film or the strip, the numbered steps, and the line for the sentence.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Widget, Wrap};
use unicode_width::UnicodeWidthStr;

use super::annotate_layout::{AnnotateLayout, lines_of};
use super::frame::legend;
use super::panel::{fit, put, wrap};
use crate::explore::annotation::session::Answer;
use crate::report::shell_word::shell_word;
use crate::tui::annotate::KEYS;
use crate::tui::annotate::state::{AnnotatePage, AnnotateState};
use crate::tui::theme::THEME;

/// Columns of the names of keys.
const KEY: usize = 10;
const QUESTION: &str = "What is done here, in one sentence?";
const GUIDE: &str = "Write one sentence that asks for all of it, as you would at home, without naming each step: for \"take the \
    mug\" and \"put it in the coffee machine\" perhaps \"get a mug ready for coffee\". Skip what is no meaningful task.";

impl Widget for &AnnotateState {
    fn render(self, area: Rect, buf: &mut Buffer) {
        // The terminal has another size already, and its message is under way.
        if area.as_size() != self.screen.size {
            return;
        }
        match self.layout() {
            None => {
                let text = "This terminal is too small: 40 x 12 cells are needed. Make it larger, or leave by ctrl-c.";
                Paragraph::new(text).wrap(Wrap { trim: true }).render(area, buf);
            }
            Some(layout) => {
                header(self, area, buf);
                let page = Rect { y: area.y + 1, height: area.height - 2, ..area };
                match (self.page, self.session.span().is_some()) {
                    (AnnotatePage::Help, _) => help(page, buf),
                    (AnnotatePage::Agreement, _) => agreement(self, page, buf),
                    (AnnotatePage::Span, true) => span(self, &layout, buf),
                    (AnnotatePage::Span, false) => end(self, page, buf),
                }
                put(buf, layout.keys, 0, keys(self, area.width), THEME.quiet);
            }
        }
        self.screen.scheme.paint(buf);
        self.screen.ability.adapt(buf);
    }
}

fn header(state: &AnnotateState, area: Rect, buf: &mut Buffer) {
    let ((at, of), (written, skipped)) = (state.session.place(), state.session.counts());
    let place = if at < of { format!("{} of {of}", at + 1) } else { format!("all {of}") };
    let right = format!("{place}, {written} written, {skipped} skipped");
    let name = state.dataset.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let who = format!("{} in {name}", state.session.person());
    let room = usize::from(area.width).saturating_sub(right.width() + "ANNOTATE  ".width() + 2);
    Line::from(vec![Span::styled("ANNOTATE  ", THEME.title), Span::raw(fit(&who, room))]).render(area, buf);
    buf.set_string(area.right().saturating_sub(right.width() as u16), area.y, &right, THEME.quiet);
}

fn span(state: &AnnotateState, layout: &AnnotateLayout, buf: &mut Buffer) {
    match &state.picture {
        Some(picture) => {
            picture.render(layout.picture, buf);
            legend(&picture.legend, layout.legend, buf);
        }
        None => put(buf, layout.picture, layout.picture.height / 2, "  drawing ...", THEME.quiet),
    }
    let present = state.reel.as_ref().ok().filter(|_| !state.shows_strip).map(|reel| reel.film.step_at(state.shot));
    captions(state, layout.captions, buf);
    let area = layout.steps;
    let width = usize::from(area.width);
    let mut top = 0;
    for line in wrap(QUESTION, width, "") {
        put(buf, area, top, line, THEME.title);
        top += 1;
    }
    let under = under_the_steps(state);
    let room = usize::from(area.height.saturating_sub(top + under.len() as u16));
    let sentences = state.session.span().map(|span| span.sentences()).unwrap_or_default();
    let lines = lines_of(sentences, width);
    // Where not all of them fit, those of the step that is shown do.
    let last = lines.iter().rposition(|(step, _)| Some(*step) == present).map_or(0, |at| at + 1);
    let first = lines.len().saturating_sub(room).min(last.saturating_sub(room));
    let shown = lines.iter().enumerate().skip(first).take(room);
    for (at, (step, line)) in shown {
        let is_present = Some(*step) == present;
        let begins = at == 0 || lines[at - 1].0 != *step;
        let (mark, style) = match (is_present, begins) {
            (true, true) => ("> ", THEME.chosen),
            (true, false) => ("  ", THEME.chosen),
            (false, _) => ("  ", Style::new()),
        };
        put(buf, area, top, format!("{mark}{line}"), style);
        top += 1;
    }
    if first + room < lines.len() {
        put(buf, area, top, "  ▼ more: tab", THEME.note);
    }
    for (text, style) in under {
        put(buf, area, top, text, style);
        top += 1;
    }
    sentence(state, layout.sentence, buf);
    if let Some((text, style)) = &state.message {
        put(buf, layout.message, 0, text.as_str(), *style);
    } else if let Some(Answer::Skipped) = state.session.answer() {
        put(buf, layout.message, 0, "you skipped this one; enter keeps a sentence in place of that", THEME.note);
    }
}

/// What is said under the steps: where the film is, or why there is none.
fn under_the_steps(state: &AnnotateState) -> Vec<(String, Style)> {
    match &state.reel {
        Err(problem) => vec![(String::new(), Style::new()), (problem.clone(), THEME.bad)],
        Ok(_) if state.shows_strip => Vec::new(),
        Ok(reel) => {
            let did = reel.film.shots.get(state.shot).map_or("", |shot| shot.did.as_str());
            let did = if did.is_empty() { "the start" } else { did };
            let plays = if state.is_playing() { "playing" } else { "paused" };
            let place = format!("frame {} of {}, {plays}", state.shot, reel.film.last());
            vec![(String::new(), Style::new()), (place, THEME.quiet), (did.to_owned(), THEME.quiet)]
        }
    }
}

/// The names of the strip's frames, each under its own.
fn captions(state: &AnnotateState, area: Rect, buf: &mut Buffer) {
    let Ok(reel) = &state.reel else { return };
    if area.height == 0 {
        return;
    }
    let many = reel.film.strip().len() as u16;
    for place in 0..many {
        let text = if place == 0 { "the start".to_owned() } else { format!("after {place}") };
        let x = area.x + area.width * place / many;
        let room = usize::from(area.width / many).saturating_sub(1);
        buf.set_string(x, area.y, fit(&text, room), THEME.quiet);
    }
}

fn sentence(state: &AnnotateState, area: Rect, buf: &mut Buffer) {
    let prompt = "Sentence > ";
    buf.set_string(area.x, area.y, prompt, THEME.title);
    let left = prompt.width() as u16;
    state.editor.area().render(Rect { x: area.x + left, width: area.width - left, ..area }, buf);
}

fn keys(state: &AnnotateState, width: u16) -> String {
    let all: &[&str] = match (state.page, state.session.span().is_some()) {
        (AnnotatePage::Help | AnnotatePage::Agreement, _) => &["any key goes back", "ctrl-c leave"],
        (AnnotatePage::Span, false) => &["enter the first open one, or leave", "pgup back", "ctrl-c leave"],
        (AnnotatePage::Span, true) => &[
            "enter keep",
            "ctrl-s skip",
            "pgup back",
            "F1 keys",
            "ctrl-c leave",
            "tab next step",
            "space play",
            "F2 agreement",
        ],
    };
    let mut line = String::new();
    for key in all {
        if line.width() + key.width() + 2 > usize::from(width) {
            break;
        }
        line += key;
        line += "  ";
    }
    line.trim_end().to_owned()
}

fn help(area: Rect, buf: &mut Buffer) {
    let width = usize::from(area.width);
    let mut top = 0;
    for (key, does) in KEYS {
        for (at, line) in wrap(does, width.saturating_sub(KEY), "").into_iter().enumerate() {
            let name = if at == 0 { key } else { "" };
            put(buf, area, top, format!("{name:<KEY$}{line}"), Style::new());
            buf.set_style(Rect { width: KEY as u16, height: 1, y: area.y + top, ..area }, THEME.key);
            top += 1;
        }
    }
    top += u16::from(area.height > top + 6);
    for line in wrap(GUIDE, width, "") {
        put(buf, area, top, line, THEME.quiet);
        top += 1;
    }
}

fn lines(text: &[String], area: Rect, mut top: u16, buf: &mut Buffer) {
    for text in text {
        for line in wrap(text, usize::from(area.width), "  ") {
            put(buf, area, top, line, Style::new());
            top += 1;
        }
    }
}

fn agreement(state: &AnnotateState, area: Rect, buf: &mut Buffer) {
    put(buf, area, 1, "How far people agree", THEME.title);
    lines(&state.agreement, area, 3, buf);
}

fn end(state: &AnnotateState, area: Rect, buf: &mut Buffer) {
    let ((_, of), (written, skipped)) = (state.session.place(), state.session.counts());
    let open = of - written - skipped;
    let title = match open {
        0 => format!("That was all: {written} written, {skipped} skipped."),
        1 => "1 is open still; enter goes to it.".into(),
        open => format!("{open} are open still; enter goes to the first."),
    };
    put(buf, area, 1, title, THEME.title);
    let mut text = state.agreement.clone();
    text.push(String::new());
    let data = shell_word(&state.dataset.display().to_string());
    text.push(format!("As labels: sprint annotate {data} --labels"));
    text.push(format!("As tasks: sprint annotate {data} --tasks FILE"));
    lines(&text, area, 3, buf);
}

#[cfg(test)]
mod tests {
    use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use ratatui::layout::Size;
    use termprofile::TermProfile;

    use super::*;
    use crate::episode::scenes::Scenes;
    use crate::explore::annotation::session::AnnotationSession;
    use crate::explore::annotation::testing;
    use crate::tui::annotate::state::ScreenFacts;
    use crate::tui::app::Graphics;
    use crate::tui::graphics::{Picture, Protocol};
    use crate::tui::theme::{Ability, Scheme};
    use crate::tui::view::tests::check;

    fn state(folder: &std::path::Path, size: (u16, u16), protocol: Protocol, ability: Ability) -> AnnotateState {
        let session = AnnotationSession::open(folder, "ann", testing::spans(folder)).unwrap();
        let graphics = Graphics { protocol, reason: String::new(), cell_pixels: (8, 16), in_tmux: false };
        let size = Size { width: size.0, height: size.1 };
        let screen = ScreenFacts { size, graphics, ability, scheme: Scheme::default() };
        let scenes = Scenes::in_folder(Some(folder.join("scenes")));
        AnnotateState::new(session, scenes, "houses".into(), screen, false)
    }

    fn screen(state: &mut AnnotateState) -> String {
        if let Some(drawing) = state.drawing() {
            state.picture = Some(Picture::encode(&drawing()));
        }
        let Size { width, height } = state.screen.size;
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| frame.render_widget(&*state, frame.area())).unwrap();
        terminal.backend().to_string()
    }

    fn press(state: &mut AnnotateState, code: KeyCode) {
        state.on_key(code.into());
    }

    fn write(state: &mut AnnotateState, text: &str) {
        text.chars().for_each(|c| press(state, KeyCode::Char(c)));
    }

    #[test]
    fn the_span_the_strip_the_help_and_the_end_have_room_at_every_size() {
        let folder = testing::dataset(&["a"], &[]);
        for size in [(80, 24), (60, 20)] {
            let (width, height) = size;
            let kept = folder.path().join("annotations");
            if kept.exists() {
                std::fs::remove_dir_all(kept).unwrap();
            }
            let bare = Ability { colours: TermProfile::NoColor, unicode: false };
            let mut state = state(folder.path(), size, Protocol::Ascii, bare);
            write(&mut state, "Wash the mug and put it away");
            press(&mut state, KeyCode::Tab);
            check(&format!("annotate-{width}x{height}"), &screen(&mut state));
            press(&mut state, KeyCode::Enter);
            state.on_key(KeyEvent::new(KeyCode::Char('t'), KeyModifiers::CONTROL));
            check(&format!("annotate-strip-{width}x{height}"), &screen(&mut state));
            press(&mut state, KeyCode::Char('?'));
            check(&format!("annotate-help-{width}x{height}"), &screen(&mut state));
            press(&mut state, KeyCode::Char('x'));
            press(&mut state, KeyCode::PageDown);
            press(&mut state, KeyCode::PageDown);
            check(&format!("annotate-end-{width}x{height}"), &screen(&mut state));
        }
    }

    #[test]
    fn every_kind_of_picture_and_every_size_can_be_drawn() {
        let folder = testing::dataset(&["a"], &[]);
        for protocol in Protocol::ALL {
            for size in [(1, 1), (39, 20), (40, 12), (80, 12), (60, 20), (200, 60)] {
                let mut state = state(folder.path(), size, protocol, Ability::FULL);
                screen(&mut state);
                state.on_key(KeyEvent::new(KeyCode::Char('t'), KeyModifiers::CONTROL));
                let shown = screen(&mut state);
                assert_eq!(size.0 >= 40 && size.1 >= 12, shown.contains("Sentence"), "{size:?}");
            }
        }
    }

    #[test]
    fn a_film_plays_to_its_end_and_keys_move_in_it() {
        let folder = testing::dataset(&["a"], &[]);
        let mut state = state(folder.path(), (80, 24), Protocol::HalfBlocks, Ability::FULL);
        assert!(!state.is_playing());
        press(&mut state, KeyCode::Char(' '));
        let last = state.reel.as_ref().unwrap().film.last();
        for _ in 0..last {
            assert!(state.is_playing());
            state.advance();
        }
        assert!(!state.is_playing() && state.shot == last);
        press(&mut state, KeyCode::Char(' '));
        assert!(state.is_playing() && state.shot == 0);
        press(&mut state, KeyCode::Down);
        assert!(!state.is_playing() && state.shot == 1);
        press(&mut state, KeyCode::BackTab);
        assert_eq!(state.shot, 0);
        write(&mut state, "Wash it");
        press(&mut state, KeyCode::Char(' '));
        assert_eq!((state.editor.text(), state.is_playing()), ("Wash it ", false), "a space in a sentence is one");
    }

    #[test]
    fn what_was_typed_and_not_kept_is_there_when_one_comes_back() {
        let folder = testing::dataset(&["a"], &[]);
        let mut state = state(folder.path(), (80, 24), Protocol::HalfBlocks, Ability::FULL);
        press(&mut state, KeyCode::Enter);
        assert!(screen(&mut state).contains("type one sentence"));
        write(&mut state, "Half a sen");
        press(&mut state, KeyCode::PageDown);
        write(&mut state, "Clean a mug");
        press(&mut state, KeyCode::Enter);
        press(&mut state, KeyCode::PageUp);
        assert_eq!(state.editor.text(), "Clean a mug");
        press(&mut state, KeyCode::PageUp);
        assert_eq!(state.editor.text(), "Half a sen");
        press(&mut state, KeyCode::Esc);
        assert_eq!(state.editor.text(), "");
    }
}
