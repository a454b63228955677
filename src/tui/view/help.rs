//! The help over the screen: the keys of the page under it, those that a person has set, and what the terms mean.

use ratatui::buffer::Buffer;
use ratatui::layout::{Rect, Size};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Padding, Widget};

use super::panel::{fit, wrap};
use crate::explore::terms::TERMS;
use crate::tui::app::App;
use crate::tui::keys::{self, Mode};
use crate::tui::theme::THEME;

/// The overlay with the keys, or the terms.
pub(crate) struct HelpOverlay<'a>(pub(crate) &'a App);

/// Columns that the names of keys take, and terms.
const KEY: usize = 9;
const TERM: usize = 12;
/// Columns that a key takes with what it does.
const WIDEST: u16 = 40;
/// Columns of the terms at most.
const WIDEST_TERMS: u16 = 100;

/// What the help says, in lines of a name and words, and how many columns of them fit.
struct Content {
    lines: Vec<(String, String)>,
    columns: usize,
    /// Columns that names take.
    names: usize,
    width: u16,
}

impl Content {
    /// Lines that fit on a screen of that height.
    fn most(&self, screen: Size) -> usize {
        usize::from(screen.height.saturating_sub(2)).max(1) * self.columns
    }
}

fn content(app: &App, screen: Size) -> Content {
    if app.input.help.shows_terms {
        let width = WIDEST_TERMS.min(screen.width);
        let room = usize::from(width).saturating_sub(5 + TERM).max(1);
        let lines = TERMS.iter().flat_map(|(term, meaning)| {
            let words = wrap(meaning, room, "").into_iter().enumerate();
            words.map(move |(at, line)| (if at == 0 { (*term).to_string() } else { String::new() }, line))
        });
        return Content { lines: lines.collect(), columns: 1, names: TERM, width };
    }
    // A key that the one before it speaks for has no line of its own.
    let bindings = keys::bindings_in_force(under(app), app.page).filter(|binding| !binding.label.is_empty());
    let own = app.config.keys.iter().map(|key| (key.name.clone(), format!("{} (your own)", key.line)));
    let lines: Vec<_> =
        bindings.map(|binding| (binding.label.to_string(), binding.help.to_string())).chain(own).collect();
    // As many columns as it takes, and as there is room for.
    let rows = usize::from(screen.height.saturating_sub(2)).max(1);
    let columns = lines.len().div_ceil(rows).clamp(1, (usize::from(screen.width) / (WIDEST as usize - 2)).max(1));
    let width = (WIDEST * columns as u16 + 4).min(screen.width);
    Content { lines, columns, names: KEY, width }
}

fn under(app: &App) -> Mode {
    if app.input.under == Mode::Help { Mode::Watch } else { app.input.under }
}

/// Shows the next part of the help: more of the same, then the terms after the keys and the keys after the terms.
pub(crate) fn turn_help(app: &mut App) {
    let content = content(app, app.terminal.size);
    let parts = content.lines.len().div_ceil(content.most(app.terminal.size)).max(1);
    let help = &mut app.input.help;
    help.part += 1;
    if help.part >= parts {
        (help.part, help.shows_terms) = (0, !help.shows_terms);
    }
}

impl Widget for HelpOverlay<'_> {
    fn render(self, screen: Rect, buf: &mut Buffer) {
        let app = self.0;
        let content = content(app, screen.as_size());
        let most = content.most(screen.as_size());
        let parts = content.lines.len().div_ceil(most).max(1);
        let part = app.input.help.part.min(parts - 1);
        let shown: Vec<&(String, String)> = content.lines.iter().skip(part * most).take(most).collect();
        let rows = shown.len().div_ceil(content.columns).max(1);
        let title = match (app.input.help.shows_terms, under(app)) {
            (true, _) => "Terms",
            (false, Mode::Manual) => "Keys while you act",
            (false, _) => "Keys while a policy acts",
        };
        let number = if parts > 1 { format!(" ({} of {parts})", part + 1) } else { String::new() };
        let more = if app.input.help.shows_terms { "tab: keys" } else { "tab: terms" };
        let title = format!(" {title}{number}; {} ", if part + 1 < parts { "tab: more" } else { more });
        let room = usize::from(content.width.saturating_sub(4)) / content.columns;
        let lines = (0..rows).map(|row| {
            let shown = shown.iter().skip(row).step_by(rows).take(content.columns);
            Line::from_iter(shown.flat_map(|(name, words)| {
                let words = fit(words, room.saturating_sub(content.names + 1));
                let words = format!("{words:<width$}", width = room.saturating_sub(content.names));
                let name = format!("{:<width$}", fit(name, content.names - 1), width = content.names);
                [Span::styled(name, THEME.chosen), Span::raw(words)]
            }))
        });
        let height = (rows as u16 + 2).min(screen.height);
        let width = content.width;
        let area = Rect {
            x: screen.x + (screen.width - width) / 2,
            y: screen.y + (screen.height - height) / 2,
            width,
            height,
        };
        Clear.render(area, buf);
        let block = Block::bordered().title(Line::styled(title, THEME.title)).padding(Padding::horizontal(1));
        let inner = block.inner(area);
        block.render(area, buf);
        for (row, line) in inner.rows().zip(lines) {
            line.render(row, buf);
        }
    }
}
