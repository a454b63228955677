//! The subtasks: what is done, and what the current one waits for.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::widgets::Widget;

use super::panel::{panel, put, wrap};
use crate::episode::rollout::End;
use crate::tui::app::App;
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
        let Some(progress) = &now.progress else {
            let inner = panel(buf, area, "Task", "none");
            let text = "Your own instruction: nobody grades it. Type the task's words (up arrow) and reset to be graded again.";
            for (row, line) in (0..).zip(wrap(text, width, "")) {
                put(buf, inner, row, line, THEME.quiet);
            }
            return;
        };
        let done = progress.completed_at.len();
        let right = match now.end {
            Some(End::Success) => "success".to_string(),
            Some(End::Timeout) => format!("out of time, {done} of {}", progress.subtasks.len()),
            None => format!("{done} of {} done", progress.subtasks.len()),
        };
        let inner = panel(buf, area, "Task", &right);
        let mut lines: Vec<(String, Style)> = Vec::new();
        for (at, subtask) in progress.subtasks.iter().enumerate() {
            let (mark, style) = match at.cmp(&done) {
                std::cmp::Ordering::Less => ("[x]", THEME.good),
                std::cmp::Ordering::Equal => ("[>]", THEME.key),
                std::cmp::Ordering::Greater => ("[ ]", THEME.quiet),
            };
            let when = progress.completed_at.get(at).map_or(String::new(), |step| format!(" (step {step})"));
            let text = format!("{mark} {subtask}{when}");
            lines.extend(wrap(&text, width, "    ").into_iter().map(|line| (line, style)));
            if at == done && !progress.waits_for.is_empty() {
                let waits = format!("    {}", progress.waits_for);
                lines.extend(wrap(&waits, width - 4, "  ").into_iter().map(|line| (format!("    {line}"), THEME.note)));
            }
        }
        // Done subtasks scroll away first: the current one must be in sight.
        let current = lines.iter().position(|(line, _)| line.starts_with("[>]")).unwrap_or(lines.len());
        let skip = lines.len().saturating_sub(usize::from(inner.height)).min(current);
        for (row, (line, style)) in (0..inner.height).zip(lines.into_iter().skip(skip)) {
            put(buf, inner, row, line, style);
        }
    }
}
