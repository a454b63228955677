//! Under the instruction: how it is understood, what else it may mean, and what came of it.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::panel::fit;
use crate::episode::wish::{Wish, WishGrading};
use crate::language::reader::CERTAIN;
use crate::tui::app::App;
use crate::tui::keys::with_keys;
use crate::tui::theme::THEME;

/// The line under the instruction.
pub(crate) struct MeaningRow<'a>(pub(crate) &'a App);

impl Widget for MeaningRow<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        if let Some(complaint) = &self.0.input.complaint {
            Line::styled(fit(complaint, usize::from(area.width)), THEME.bad).render(area, buf);
            return;
        }
        let Some(now) = &self.0.session.now else { return };
        let Some(wish) = now.wishes.last() else { return };
        let width = usize::from(area.width);
        let mut spans: Vec<Span<'_>> = Vec::new();
        let mut used = 0;
        for (text, style) in parts(wish, now.graded) {
            let text = fit(&text, width.saturating_sub(used));
            used += text.width();
            spans.push(Span::styled(text, style));
        }
        Line::from(spans).render(area, buf);
    }
}

/// The line in pieces, what matters most first.
fn parts(wish: &Wish, graded: Option<(usize, usize)>) -> Vec<(String, Style)> {
    if let Some(verdict) = wish.verdict {
        let style = if verdict.is_fulfilled() { THEME.good } else { THEME.bad };
        let agent = wish.agent_in_words().map_or(String::new(), |words| format!("; {words}"));
        let next = match &wish.advice {
            Some(advice) => format!(": {}", with_keys(advice)),
            None => format!(", after {}; i: the next wish", steps(wish.steps)),
        };
        return vec![(format!("  {}", verdict.words()), style), (agent, THEME.note), (next, THEME.quiet)];
    }
    if let Some(agent) = wish.agent_in_words() {
        let grader = match graded {
            None => "; it is not graded".to_string(),
            Some((done, of)) => format!("; the grader: {done} of {of}"),
        };
        let next = "; space goes on, :done or :failed ends it";
        return vec![(format!("  {agent}"), THEME.note), (grader, THEME.key), (next.into(), THEME.quiet)];
    }
    if wish.grading == WishGrading::Task {
        return vec![("  the task's own words".into(), THEME.quiet)];
    }
    if let Some(why) = &wish.ungraded {
        let judge = if wish.is_told() { "; :done or :failed when it is" } else { ": i gives an instruction" };
        let style = if wish.is_told() { THEME.bad } else { THEME.quiet };
        let head = if wish.is_told() { "  not graded: " } else { "  " };
        let mut parts = vec![(format!("{head}{why}"), style)];
        if wish.is_unsure() {
            let meant = if wish.readings.len() == 1 { "z" } else { ":meant 1" };
            parts.push((format!("; {meant}: it does"), THEME.key));
        }
        parts.extend(others(wish));
        parts.push((judge.into(), THEME.quiet));
        return parts;
    }
    let sure = wish.confidence.filter(|&confidence| confidence < CERTAIN && wish.picked == 0);
    let sure = sure.map_or(String::new(), |confidence| format!(" ({:.0} % sure)", 100.0 * confidence));
    let by = wish.read_by.as_ref().map_or(String::new(), |name| format!(" by {name}"));
    let head = format!("  understood{by}{sure}: ");
    let mut parts = vec![(head, THEME.quiet), (wish.understood.clone(), THEME.note)];
    if wish.unasked.is_some() {
        parts.push(("  by the program itself, as the log says".into(), THEME.bad));
    }
    if !wish.unread.is_empty() {
        parts.push((format!("  not understood: {}", wish.unread.join(" ")), THEME.bad));
    }
    parts.extend(others(wish));
    if wish.expert_steps.is_none() {
        parts.push(("  the expert sees no way".into(), THEME.bad));
    }
    parts
}

/// What else it may mean.
fn others(wish: &Wish) -> Option<(String, Style)> {
    let others: Vec<String> =
        wish.alternatives().into_iter().map(|(number, words)| format!("{number} {words}")).collect();
    (!others.is_empty()).then(|| (format!("  or z: {}", others.join(", ")), THEME.key))
}

fn steps(many: u32) -> String {
    if many == 1 { "1 step".into() } else { format!("{many} steps") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn that_the_agent_says_done_is_shown_on_a_task_too_with_what_its_grader_has() {
        let text = |wish: &Wish| parts(wish, Some((1, 2))).into_iter().map(|(text, _)| text).collect::<String>();
        let task = Wish::task("Put the mug in the sink.", 12);
        assert_eq!(text(&task), "  the task's own words");
        let said = text(&Wish { agent_done: Some(7), ..task });
        assert!(said.starts_with("  the agent: done at step 7; the grader: 1 of 2;"), "{said}");
    }
}
