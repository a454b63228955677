//! The subtasks: what is done, and what the current one waits for.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::panel::{panel, put, wrap};
use crate::episode::wish::{WishGrading, WishVerdict};
use crate::tui::app::App;
use crate::tui::keys::with_keys;
use crate::tui::theme::THEME;

/// The panel with the subtasks.
pub(crate) struct TaskPanel<'a>(pub(crate) &'a App);

impl Widget for TaskPanel<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let Some(now) = &self.0.session.now else {
            panel(buf, area, "Task", "");
            return;
        };
        let width = usize::from(area.width);
        let wish = now.wishes.last();
        let is_task = wish.is_none_or(|wish| wish.grading == WishGrading::Task);
        let title = if is_task { "Task" } else { "Wish" };
        let verdict = now.end.map(WishVerdict::short);
        let Some(progress) = &now.progress else {
            let beside = now.task_beside.map_or(String::new(), |(done, of)| format!(", task {done}/{of}"));
            let inner = panel(buf, area, title, &format!("{}{beside}", verdict.unwrap_or("not graded")));
            let why = wish.and_then(|wish| wish.ungraded.as_deref()).unwrap_or_default();
            let text = match verdict {
                Some(_) => "i gives the next instruction, from here on".to_string(),
                None => format!("{why}. It goes on until you say :done or :failed."),
            };
            for (row, line) in (0..).zip(wrap(&text, width, "")) {
                put(buf, inner, row, line, THEME.quiet);
            }
            return;
        };
        let done = progress.completed_at.len();
        let of = progress.subtasks.len();
        let right = match (verdict, wish.and_then(|wish| wish.expert_steps).filter(|_| !is_task)) {
            (Some(verdict), _) => format!("{verdict}, {done} of {of}"),
            (None, Some(expert)) => format!("{done} of {of} · expert {expert}"),
            (None, None) => format!("{done} of {of} done"),
        };
        let beside = now.task_beside.map_or(String::new(), |(done, of)| format!(", task {done}/{of}"));
        let both = format!("{right}{beside}");
        // Where there is no room for both, the wish in force comes first.
        let right = if both.width() + title.len() + 4 <= width { both } else { right };
        let mut lines: Vec<(String, Style)> = Vec::new();
        let advice = wish.and_then(|wish| wish.advice.as_deref()).map(with_keys);
        for (at, subtask) in progress.subtasks.iter().enumerate() {
            let (mark, style) = match at.cmp(&done) {
                std::cmp::Ordering::Less => ("[x]", THEME.good),
                std::cmp::Ordering::Equal => ("[>]", THEME.key),
                std::cmp::Ordering::Greater => ("[ ]", THEME.quiet),
            };
            let when = progress.completed_at.get(at).map_or(String::new(), |step| format!(" (step {step})"));
            let text = format!("{mark} {subtask}{when}");
            lines.extend(wrap(&text, width, "    ").into_iter().map(|line| (line, style)));
            let (next, style) = match &advice {
                Some(advice) => (advice.as_str(), THEME.bad),
                None => (progress.waits_for.as_str(), THEME.note),
            };
            if at == done && !next.is_empty() {
                lines.extend(wrap(next, width - 4, "  ").into_iter().map(|line| (format!("    {line}"), style)));
            }
        }
        // Done subtasks scroll away first: the current one must be in sight.
        let current = lines.iter().position(|(line, _)| line.starts_with("[>]")).unwrap_or(lines.len());
        let room = usize::from(area.height.saturating_sub(1));
        let skip = lines.len().saturating_sub(room).min(current);
        let hidden = (lines.len() - skip).saturating_sub(room);
        let right = match (hidden, verdict) {
            (0, _) => right,
            (hidden, Some(verdict)) => format!("{verdict} · ▼{hidden}"),
            (hidden, None) => format!("{done} of {of} · ▼{hidden}"),
        };
        let inner = panel(buf, area, title, &right);
        for (row, (line, style)) in (0..inner.height).zip(lines.into_iter().skip(skip)) {
            put(buf, inner, row, line, style);
        }
    }
}
