//! What the agent sees.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::panel::panel;
use super::picture::picture;
use crate::domain::Class;
use crate::tui::app::App;
use crate::tui::graphics::letters;
use crate::tui::theme::THEME;

/// The panel with the picture.
pub(crate) struct FramePanel<'a>(pub(crate) &'a App);

impl Widget for FramePanel<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let right = match &app.session.now {
            Some(now) => {
                let pose = now.world.agent;
                let heading = pose.heading.name();
                match pose.horizon {
                    0 => heading.to_string(),
                    up if up < 0 => format!("{heading}, {} up", -up),
                    down => format!("{heading}, {down} down"),
                }
            }
            None => String::new(),
        };
        panel(buf, area, app.main.overlay.title(), &right);
        let Some(picture_area) = app.picture_area() else { return };
        picture(app, picture_area, buf);
        if let Some(shown) = &app.frame.picture {
            let top = picture_area.bottom();
            legend(&shown.legend, Rect { y: top, height: area.bottom().saturating_sub(top), ..area }, buf);
        }
    }
}

/// What the letters of a picture mean, as far as there is room.
pub(super) fn legend(letters: &[(char, Class)], area: Rect, buf: &mut Buffer) {
    let mut lines: Vec<Line> = vec![Line::default()];
    let mut used = 0;
    for (letter, class) in letters {
        let word = class.spoken();
        let width = word.width() + 4;
        if used + width > usize::from(area.width) {
            if lines.len() == usize::from(area.height) {
                break;
            }
            lines.push(Line::default());
            used = 0;
        }
        used += width;
        if let Some(line) = lines.last_mut() {
            line.push_span(Span::styled(letter.to_string(), THEME.key.fg(letters::tint(*class))));
            line.push_span(Span::raw(format!(" {word}  ")));
        }
    }
    for (row, line) in area.rows().zip(lines) {
        line.render(row, buf);
    }
}
