//! What the agent sees.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::{panel, picture};
use crate::tui::app::App;
use crate::tui::graphics::{Protocol, classes};
use crate::tui::theme::THEME;

/// The panel with the picture.
pub struct Sees<'a>(pub &'a App);

impl Widget for Sees<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let right = match &app.now {
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
        panel(buf, area, app.overlay.title(), &right);
        let Some(picture_area) = app.picture_area() else { return };
        picture(app, picture_area, buf);
        if app.graphics.protocol == Protocol::Ascii {
            let top = picture_area.bottom();
            legend(app, Rect { y: top, height: area.bottom().saturating_sub(top), ..area }, buf);
        }
    }
}

fn legend(app: &App, area: Rect, buf: &mut Buffer) {
    let Some(now) = &app.now else { return };
    let mut lines: Vec<Line> = vec![Line::default()];
    let mut used = 0;
    for (letter, class) in classes::legend(&now.frame.ids, &app.names, &app.letters) {
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
            line.push_span(Span::styled(letter.to_string(), THEME.key.fg(classes::tint(class))));
            line.push_span(Span::raw(format!(" {word}  ")));
        }
    }
    for (row, line) in area.rows().zip(lines) {
        line.render(row, buf);
    }
}
