//! The page before any house is open. It needs no more than 60 x 20 cells, and no colour.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Widget, Wrap};
use unicode_width::UnicodeWidthStr;

use super::panel::{fit, fit_end, put, wrap};
use crate::tui::start_page::StartPage;
use crate::tui::theme::{Ability, Scheme, THEME};

/// The page, in the person's colours.
pub(crate) struct StartView<'a> {
    pub(crate) page: &'a StartPage,
    pub(crate) scheme: Scheme,
    pub(crate) ability: Ability,
}

/// The smallest screen that is drawn.
const SMALLEST: (u16, u16) = (30, 8);
/// Columns of the kind of an entry.
const KIND: usize = 13;

impl Widget for StartView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        if area.width < SMALLEST.0 || area.height < SMALLEST.1 {
            let text = "This terminal is too small. Make it larger; enter starts, ctrl-c leaves.";
            Paragraph::new(text).wrap(Wrap { trim: true }).render(area, buf);
            return;
        }
        let page = self.page;
        let count = match page.typed().text() {
            "" => format!("{} to choose from", page.total()),
            _ => format!("{} of {}", page.found.len(), page.total()),
        };
        Line::from(vec![Span::styled("SPRINT", THEME.title), Span::raw("  Where do you want to start?")])
            .render(area, buf);
        let line = Rect { y: area.y + 1, height: 1, ..area };
        buf.set_string(line.x, line.y, "Search > ", THEME.title);
        let right = count.width() as u16;
        let typed = Rect { x: line.x + 9, width: line.width.saturating_sub(right + 11), ..line };
        page.typed().area().render(typed, buf);
        buf.set_string(area.right() - right, line.y, &count, THEME.quiet);
        let foot = foot(page, area.width);
        let list = Rect { y: area.y + 3, height: area.height - 4 - foot.len() as u16, ..area };
        entries(page, list, buf);
        for (row, (text, style)) in (0u16..).zip(&foot) {
            put(buf, area, area.height - foot.len() as u16 + row, text, *style);
        }
        self.scheme.paint(buf);
        self.ability.adapt(buf);
    }
}

fn entries(page: &StartPage, area: Rect, buf: &mut Buffer) {
    if page.found.is_empty() {
        put(buf, area, 0, "  nothing fits: esc lists everything again", THEME.note);
        return;
    }
    let room = usize::from(area.height);
    let first = (page.selected + 1).saturating_sub(room).min(page.found.len().saturating_sub(room));
    let width = usize::from(area.width);
    let names = page.found.iter().map(|entry| entry.name.width() + entry.choice().width() + 1).max().unwrap_or(0);
    let names = names.min(width.saturating_sub(KIND + 3) * 6 / 10).max(16);
    for (row, (at, entry)) in area.rows().zip(page.found.iter().enumerate().skip(first)) {
        let is_selected = at == page.selected;
        let (mark, style) = if is_selected { ("> ", THEME.chosen) } else { ("  ", Style::new()) };
        let name = fit(format!("{} {}", entry.name, entry.choice()).trim_end(), names);
        let room = width.saturating_sub(KIND + names + 4);
        let note = if entry.note.contains('/') { fit_end(&entry.note, room) } else { fit(&entry.note, room) };
        Line::from(vec![
            Span::styled(mark, style),
            Span::styled(format!("{:<KIND$} ", entry.start.kind()), THEME.quiet),
            Span::styled(format!("{name:<names$} "), style),
            Span::styled(note, THEME.quiet),
        ])
        .render(row, buf);
    }
}

/// What goes on, or what a number means, and the keys.
fn foot(page: &StartPage, width: u16) -> Vec<(String, Style)> {
    let width = usize::from(width);
    let mut lines: Vec<(String, Style)> = match (&page.opening, &page.complaint) {
        (Some(what), _) => vec![(format!("opening {what} ..."), THEME.note)],
        (None, Some(why)) => wrap(why, width, "  ").into_iter().take(3).map(|line| (line, THEME.bad)).collect(),
        (None, None) => {
            vec![("Letters search; a number: seed, task or episode (bedroom 7)".into(), THEME.quiet)]
        }
    };
    let keys = "enter open  up down select  tab next kind  esc first one  ctrl-c leave";
    let short = "enter open  up down  tab next kind  esc first  ctrl-c leave";
    lines.push((if width < keys.width() { short } else { keys }.into(), THEME.quiet));
    lines
}

#[cfg(test)]
mod tests {
    use crossterm::event::KeyCode;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use termprofile::TermProfile;

    use super::*;
    use crate::tui::start_page;
    use crate::tui::view::tests::check;

    /// The start page as text.
    fn start_screen(page: &StartPage, width: u16, height: u16, ability: Ability) -> String {
        let area = Rect::new(0, 0, width, height);
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        let view = || StartView { page, scheme: Scheme::default(), ability };
        terminal.draw(|frame| frame.render_widget(view(), area)).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn the_start_page_lists_what_there_is_and_searches_it() {
        for (width, height) in [(80, 24), (60, 20)] {
            let mut page = start_page::tests::page();
            check(&format!("start-{width}x{height}"), &start_screen(&page, width, height, Ability::FULL));
            start_page::tests::type_text(&mut page, "bed 7");
            check(&format!("start-search-{width}x{height}"), &start_screen(&page, width, height, Ability::FULL));
            start_page::tests::type_text(&mut page, "zzz");
            assert!(start_screen(&page, width, height, Ability::FULL).contains("nothing fits"));
        }
    }

    #[test]
    fn the_start_page_says_what_is_opened_and_what_could_not_be() {
        let mut page = start_page::tests::page();
        (0..4).for_each(|_| drop(page.on_key(KeyCode::Tab.into())));
        page.on_key(KeyCode::Enter.into());
        assert!(start_screen(&page, 60, 20, Ability::FULL).contains("opening alfred ..."));
        page.fail(
            "checkpoints/alfred holds no checkpoint: config.json is missing in it, and so is model.safetensors".into(),
        );
        let bare = Ability { colours: TermProfile::NoColor, unicode: false };
        check("start-failed-60x20", &start_screen(&page, 60, 20, bare));
        for (width, height) in [(1, 1), (29, 20), (30, 8), (60, 9), (200, 60)] {
            start_screen(&page, width, height, bare);
        }
    }
}
