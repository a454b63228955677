//! The page of branches: the tree of what was tried, and how the selected branch and the one in hand part.

use std::sync::Arc;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::panel::{fit, panel, put, wrap};
use super::picture::picture;
use crate::episode::wish::{Wish, WishVerdict};
use crate::explore::timeline::{Divergence, Timeline};
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The page: the tree of branches, and two of them side by side.
pub(crate) struct BranchesView<'a>(pub(crate) &'a App);

impl Widget for BranchesView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let (Some(now), Some(layout)) = (&app.session.now, app.layout()) else { return };
        let parts = layout.branches(app.rows(), now.wishes.len(), app.terminal.graphics.cell_pixels);
        debug_assert_eq!(layout.page, area);
        self.list(&now.time, parts.list, buf);
        wishes(&now.wishes, now.step, parts.wishes, buf);
        match &app.branches.divergence {
            Some(divergence) if divergence.names[0] != divergence.names[1] => {
                let right = format!("the same until step {}", divergence.shared);
                panel(buf, parts.below, "Side by side", &right);
                let steps = Rect { y: parts.steps.y + 1, height: parts.steps.height - 1, ..parts.steps };
                side_by_side(divergence, now.time.at, steps, buf);
                self.sights(divergence, parts.frames, buf);
            }
            divergence => {
                let inner = panel(buf, parts.below, "Side by side", "");
                let hint = match (app.rows(), divergence) {
                    (1, _) => "one branch so far: go back (h) and do something else, and a second one begins",
                    (_, Some(_)) => "this is the branch in hand; select another one (j k)",
                    (_, None) => "select a branch (j k) to see where it parts from the one in hand",
                };
                for (row, line) in (0..).zip(wrap(hint, usize::from(inner.width), "")) {
                    put(buf, inner, row, line, THEME.quiet);
                }
            }
        }
    }
}

impl BranchesView<'_> {
    fn list(&self, time: &Timeline, area: Rect, buf: &mut Buffer) {
        let right = format!("{} in all, * is in hand", time.branches.len());
        let inner = panel(buf, area, "Branches", &right);
        let rows = usize::from(inner.height);
        let first = (self.0.branches.selected + 1).saturating_sub(rows);
        for (row, (at, branch)) in time.branches.iter().enumerate().skip(first).take(rows).enumerate() {
            let depth = depth(time, at);
            let tree = if depth == 0 { String::new() } else { format!("{}└ ", "  ".repeat(depth - 1)) };
            let mark = if at == time.branch { "*" } else { " " };
            let from = branch.left.and_then(|(from, step)| Some((&time.branches.get(from)?.name, step)));
            let from = from.map_or(String::new(), |(name, step)| format!("leaves {name} at {step}"));
            let width = if inner.width < 100 { 14 } else { 24 };
            let name = fit(&format!("{tree}{}", branch.name), width);
            let text = format!(
                "{mark} {:>2} {name:<width$} {:>4} steps {:>2} done  {from:<16}",
                at + 1,
                branch.last,
                branch.completed,
            );
            let has_room = usize::from(inner.width) > text.width() + 10;
            let text = if has_room { format!("{text} {}", branch.why) } else { text };
            let style = if at == self.0.branches.selected { THEME.chosen } else { Style::new() };
            let prefix = if at == self.0.branches.selected { ">" } else { " " };
            put(buf, inner, row as u16, format!("{prefix}{text}"), style);
        }
    }
}

impl BranchesView<'_> {
    /// What the agent saw on both, with the steps over the pictures.
    fn sights(&self, divergence: &Divergence, area: Rect, buf: &mut Buffer) {
        let Some((_, steps)) = &divergence.frames else { return };
        let half = area.width / 2;
        for (side, (name, step)) in (0u16..).zip(divergence.names.iter().zip(steps)) {
            let head = Rect { x: area.x + side * (half + 1), y: area.y - 1, width: half.saturating_sub(1), height: 1 };
            let step = format!(" {step}");
            let name = fit(name, usize::from(head.width).saturating_sub(step.width()));
            put(buf, head, 0, format!("{name}{step}"), THEME.quiet);
        }
        picture(self.0, area, buf);
    }
}

/// What was told on the way to the present state, a wish a row, the newest in sight.
fn wishes(wishes: &[Arc<Wish>], now: u32, area: Rect, buf: &mut Buffer) {
    let fulfilled = wishes.iter().filter(|wish| wish.verdict.is_some_and(WishVerdict::is_fulfilled)).count();
    let inner = panel(buf, area, "Wishes", &format!("{fulfilled} of {} fulfilled", wishes.len()));
    let first = wishes.len().saturating_sub(usize::from(inner.height));
    for (row, (at, wish)) in (0..inner.height).zip(wishes.iter().enumerate().skip(first)) {
        let next = wishes.get(at + 1);
        let over = match (wish.verdict, next) {
            (Some(_), _) => wish.began + wish.steps,
            (None, Some(next)) => next.began,
            (None, None) => now,
        };
        let (verdict, style) = match wish.verdict {
            Some(verdict) if verdict.is_fulfilled() => (verdict.words(), THEME.good),
            Some(verdict) => (verdict.words(), THEME.bad),
            None if next.is_some() => ("left", THEME.quiet),
            None => ("in force", THEME.key),
        };
        let steps = format!("{}-{over}", wish.began);
        let text = format!("  {:>2}. steps {steps:<8} {verdict:<16} {}", at + 1, wish.instruction);
        put(buf, inner, row, text, style);
    }
}

/// How many branches lie between a branch and the first.
fn depth(time: &Timeline, branch: usize) -> usize {
    let from = |&at: &usize| time.branches.get(at)?.left.map(|(from, _)| from);
    std::iter::successors(Some(branch), from).skip(1).take(8).count()
}

fn side_by_side(divergence: &Divergence, at: u32, inner: Rect, buf: &mut Buffer) {
    let [one, other] = &divergence.names;
    let width = usize::from(inner.width.saturating_sub(9)) / 2;
    put(buf, inner, 0, format!("{:>5}  {:<width$}  {}", "step", fit(one, width), fit(other, width)), THEME.quiet);
    let rows = usize::from(inner.height).saturating_sub(1);
    // The step in hand stays in sight.
    let here = divergence.rows.iter().position(|row| row.step >= at).unwrap_or(divergence.rows.len());
    let first = here.saturating_sub(rows / 2).min(divergence.rows.len().saturating_sub(rows));
    for (row, parted) in (1..).zip(divergence.rows.iter().skip(first).take(rows)) {
        let [left, right] = parted.sides.each_ref().map(|side| fit(side.as_deref().unwrap_or("-"), width));
        let mark = if parted.step == at { '>' } else { ' ' };
        let same = parted.sides[0] == parted.sides[1];
        let style = if same { THEME.quiet } else { Style::new() };
        let line = Line::from(vec![
            Span::styled(format!("{mark}{:>4}  ", parted.step), THEME.quiet),
            Span::styled(format!("{left:<width$}"), style),
            Span::styled(if parted.same { "= " } else { "  " }, THEME.good),
            Span::styled(right, style),
        ]);
        line.render(Rect { y: inner.y + row, height: 1, ..inner }, buf);
    }
}
