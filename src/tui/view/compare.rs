//! The page of comparison: two instructions in one state, side by side.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;

use super::panel::{bar, fit, panel, put, share, unsigned_zero, wrap};
use crate::analysis::instruction_ab::{Contrast, Row};
use crate::domain::Class;
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The page: two instructions and their distributions.
pub(crate) struct CompareView<'a>(pub(crate) &'a App);

/// Rows above the table: both instructions, values, and the scores.
const HEAD: u16 = 8;

impl Widget for CompareView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let Some(contrast) = &self.0.compare.contrast else {
            let inner = panel(buf, area, "Two instructions", "");
            let text = "Press enter and type another instruction: this page then shows what the policy would do under each, \
                        in this very state, and how much the words matter here.";
            for (row, line) in (0..).zip(wrap(text, usize::from(inner.width), "")) {
                put(buf, inner, row, line, THEME.quiet);
            }
            return;
        };
        head(contrast, &when(self.0), Rect { height: HEAD, ..area }, buf);
        table(contrast, self.0.compare.selected, Rect { y: area.y + HEAD, height: area.height - HEAD, ..area }, buf);
    }
}

/// In which state they were compared.
fn when(app: &App) -> String {
    match (&app.session.now, app.compare.state) {
        (Some(now), Some((branch, step))) if (now.time.branch, now.step) != (branch, step) => {
            let name = now.time.branches.get(branch).map_or("", |branch| branch.name.as_str());
            format!("as of step {step} on {name}")
        }
        _ => "in the same state".into(),
    }
}

fn head(contrast: &Contrast, when: &str, area: Rect, buf: &mut Buffer) {
    let inner = panel(buf, area, "Two instructions", when);
    let width = usize::from(inner.width);
    for (row, (name, side)) in [0, 2].into_iter().zip(["A", "B"].into_iter().zip(&contrast.sides)) {
        let line = Line::from(vec![
            Span::styled(format!("{name}  "), THEME.title),
            Span::styled(fit(&side.instruction, width - 3), THEME.instruction),
        ]);
        line.render(Rect { y: inner.y + row, height: 1, ..inner }, buf);
        let distribution = side.decision.distribution.as_ref();
        let entropy =
            distribution.map_or(String::new(), |distribution| format!(" · entropy {:.2}", distribution.entropy));
        let value = match &side.values {
            Some(values) => format!("V {:.2}{}", values.state, difference(contrast, row > 0)),
            None => "this checkpoint has no critic".into(),
        };
        put(buf, inner, row + 1, format!("   would {} · {value}{entropy}", side.decision.action.kind), THEME.quiet);
    }
    let score = |name: &str, x: f32, words: &str, row: u16, buf: &mut Buffer| {
        let line = Line::from(vec![
            Span::raw(format!("{name:<12}")),
            Span::styled(bar(x, 20), THEME.bar),
            Span::raw(format!(" {x:.2} bits  ")),
            Span::styled(fit(words, width.saturating_sub(46)), THEME.quiet),
        ]);
        line.render(Rect { y: inner.y + row, height: 1, ..inner }, buf);
    };
    score("A against B", contrast.divergence, verdict(contrast.divergence), 4, buf);
    score("language", contrast.sensitivity, "A against 8 other instructions, on average", 5, buf);
}

/// By how much B's V is more than A's, for B.
fn difference(contrast: &Contrast, is_other: bool) -> String {
    match contrast.sides.each_ref().map(|side| side.values.as_ref()) {
        [Some(a), Some(b)] if is_other => format!(", B - A {:+.2}", b.state - a.state),
        _ => String::new(),
    }
}

/// What a divergence means.
fn verdict(bits: f32) -> &'static str {
    match bits {
        x if x < 0.01 => "it does not listen here",
        x if x < 0.1 => "it hardly listens here",
        x if x < 0.4 => "it listens somewhat",
        _ => "it does something else",
    }
}

fn table(contrast: &Contrast, selected: usize, area: Rect, buf: &mut Buffer) {
    let inner = panel(buf, area, "Choices", "the largest difference first");
    let width = usize::from(inner.width).saturating_sub(48) / 2;
    let head =
        format!("{:<11} {:<16} {:>4} {:<width$} {:>4} {:<width$} {:>6}", "action", "object", "A", "", "B", "", "B - A");
    put(buf, inner, 0, head, THEME.quiet);
    let rows = usize::from(inner.height).saturating_sub(1);
    let first = selected.min(contrast.rows.len().saturating_sub(rows));
    for (row, choice) in (1..).zip(contrast.rows.iter().skip(first).take(rows)) {
        line(choice, contrast, width).render(Rect { y: inner.y + row, height: 1, ..inner }, buf);
    }
}

fn line(row: &Row, contrast: &Contrast, width: usize) -> Line<'static> {
    let [a, b] = row.shares;
    let takes = |side: usize| contrast.sides[side].decision.action.kind == row.kind;
    let style = |side: usize| if takes(side) { THEME.chosen } else { THEME.bar };
    let difference = match b - a {
        d if d > 0.005 => THEME.good,
        d if d < -0.005 => THEME.bad,
        _ => THEME.quiet,
    };
    let object = fit(row.class.map_or("", Class::spoken), 16);
    Line::from(vec![
        Span::styled(format!("{:<11} {object:<16} ", row.kind.name()), Style::new()),
        Span::styled(format!("{:>4} {} ", share(a), bar(a, width)), style(0)),
        Span::styled(format!("{:>4} {} ", share(b), bar(b, width)), style(1)),
        Span::styled(format!("{:>+6.2}", unsigned_zero(b - a)), difference),
    ])
}
