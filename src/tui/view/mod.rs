//! The screen: one widget a panel, drawn from the state alone.

mod branches;
mod chain;
mod compare;
mod frame;
mod ground;
pub mod hit;
mod help;
mod instruction;
mod log;
mod map;
mod mind;
mod palette;
mod reach;
#[cfg(test)]
mod screens;
mod status;
mod suggestions;
mod task;
mod thoughts;
mod time;
mod world;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Widget, Wrap};
use unicode_width::UnicodeWidthStr;

use super::app::App;
use super::keys::Mode;
use super::layout::SMALLEST;
use super::theme::THEME;
use crate::explore::verb::Page;

impl Widget for &App {
    fn render(self, area: Rect, buf: &mut Buffer) {
        // The terminal has another size already, and its message is under way.
        if area.as_size() != self.size {
            return;
        }
        let Some(layout) = self.layout() else {
            too_small(area, buf);
            return;
        };
        status::Header(self).render(layout.header, buf);
        match self.page {
            Page::Branches => branches::Branches(self).render(layout.page, buf),
            Page::Mind => thoughts::Thoughts(self).render(layout.page, buf),
            Page::World => world::World(self).render(layout.page, buf),
            Page::Compare => compare::Compare(self).render(layout.page, buf),
            Page::Chain => chain::ChainPage(self).render(layout.page, buf),
            Page::Main => {
                frame::Sees(self).render(layout.sees, buf);
                reach::Reach(self).render(layout.reach, buf);
                mind::MindPanel(self).render(layout.mind, buf);
                task::TaskPanel(self).render(layout.task, buf);
                log::Log(self).render(layout.log, buf);
                map::Map(self).render(layout.map, buf);
            }
        }
        time::Time(self).render(layout.time, buf);
        instruction::Instruction(self).render(layout.instruction, buf);
        status::Status(self).render(layout.status, buf);
        match self.mode {
            Mode::Help => help::Help(self).render(area, buf),
            Mode::Palette => palette::Palette(self).render(layout.page, buf),
            Mode::Typing => suggestions::Suggestions(self).render(layout.page, buf),
            Mode::Watch | Mode::Manual => {}
        }
        self.config.scheme.paint(buf);
        self.ability.adapt(buf);
    }
}

/// Draws the encoded frame, or says that it is under way. What is opened over the page stays uncovered by it.
fn picture(app: &App, area: Rect, buf: &mut Buffer) {
    // The help stands anywhere over it.
    if app.mode == Mode::Help && app.graphics.protocol.floats() {
        return;
    }
    match &app.picture {
        Some(picture) if picture.lies_over() => {
            let page = app.layout().map_or(area, |layout| layout.page);
            let top = match app.mode {
                Mode::Palette => palette::place(page).y,
                Mode::Typing => suggestions::place(app, page).map_or(area.bottom(), |area| area.y),
                Mode::Watch | Mode::Manual | Mode::Help => area.bottom(),
            };
            picture.render(Rect { height: area.height.min(top.saturating_sub(area.y)), ..area }, buf);
        }
        Some(picture) => picture.render(area, buf),
        None => put(buf, area, area.height / 2, "  drawing ...", THEME.quiet),
    }
}

fn too_small(area: Rect, buf: &mut Buffer) {
    let (width, height) = SMALLEST;
    let text = format!(
        "This terminal is too small: {} x {}. The explorer needs {width} x {height}. Make it larger, or press q to quit.",
        area.width, area.height
    );
    Paragraph::new(text).wrap(Wrap { trim: true }).render(area, buf);
}

/// Draws a panel's title over a rule, with something quiet at its right; returns the rest of the panel.
fn panel(buf: &mut Buffer, area: Rect, title: &str, right: &str) -> Rect {
    let width = usize::from(area.width);
    let right = fit(right, width.saturating_sub(title.width() + 4));
    let rule = width.saturating_sub(title.width() + 1 + if right.is_empty() { 0 } else { right.width() + 1 });
    let mut spans =
        vec![Span::styled(title.to_string(), THEME.title), Span::raw(" "), Span::styled("─".repeat(rule), THEME.quiet)];
    if !right.is_empty() {
        spans.extend([Span::raw(" "), Span::raw(right)]);
    }
    Line::from(spans).render(Rect { height: 1.min(area.height), ..area }, buf);
    Rect { y: area.y + 1, height: area.height.saturating_sub(1), ..area }
}

/// Text cut to `width` columns, the cut marked.
fn fit(text: &str, width: usize) -> String {
    if text.width() <= width {
        return text.to_string();
    }
    let mut short = String::new();
    for c in text.chars() {
        if short.width() + unicode_width::UnicodeWidthChar::width(c).unwrap_or(0) + 1 > width {
            break;
        }
        short.push(c);
    }
    if width > 0 {
        short.push('…');
    }
    short
}

/// Lines of at most `width` columns, broken at spaces; later lines start with `indent`.
fn wrap(text: &str, width: usize, indent: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let fresh = lines.len() > 1;
        let line = lines.last_mut().map_or("", |line| line.as_str());
        let start = if fresh { indent.width() } else { 0 };
        if line.width() > start && line.width() + 1 + word.width() > width {
            lines.push(format!("{indent}{word}"));
        } else if let Some(line) = lines.last_mut() {
            if line.width() > start {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines.iter().map(|line| fit(line, width)).collect()
}

/// A bar of `share` (0 to 1) of `width` columns, in eighths of a column.
fn bar(share: f32, width: usize) -> String {
    const EIGHTHS: [char; 8] = [' ', '▏', '▎', '▍', '▌', '▋', '▊', '▉'];
    let eighths = (share.clamp(0.0, 1.0) * 8.0 * width as f32).round() as usize;
    let mut bar = "█".repeat(eighths / 8);
    if !eighths.is_multiple_of(8) {
        bar.push(EIGHTHS[eighths % 8]);
    }
    format!("{bar:<width$}")
}

/// A probability in three columns: `.07`, `1.0`.
fn share(p: f32) -> String {
    if p >= 0.995 { "1.0".into() } else { format!("{p:.2}").trim_start_matches('0').to_string() }
}

/// A line of text at a row of an area.
fn put(buf: &mut Buffer, area: Rect, row: u16, text: impl Into<String>, style: Style) {
    if row < area.height {
        let line = Rect { y: area.y + row, height: 1, ..area };
        Line::styled(fit(&text.into(), usize::from(area.width)), style).render(line, buf);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_grow_by_eighths() {
        assert_eq!(bar(0.0, 4), "    ");
        assert_eq!(bar(1.0, 4), "████");
        assert_eq!(bar(0.5, 4), "██  ");
        assert_eq!(bar(0.28, 4), "█▏  ");
        assert_eq!((share(0.071), share(1.0), share(0.0)), (".07".into(), "1.0".into(), ".00".into()));
    }

    #[test]
    fn long_text_is_broken_at_spaces_and_cut_visibly() {
        assert_eq!(wrap("put the apple in the fridge", 12, "  "), ["put the", "  apple in", "  the fridge"]);
        assert_eq!(fit("refrigerator", 6), "refri…");
        assert_eq!(fit("cup", 6), "cup");
    }
}
