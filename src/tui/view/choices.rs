//! The page of the mind: every legal choice with its probability and values, and how they went over the episode.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::panel::{bar, fit, panel, put, share, unsigned_zero, wrap};
use crate::domain::Class;
use crate::explore::choices::{Choice, choices};
use crate::explore::exploration::SessionSnapshot;
use crate::explore::timeline::TimelineStep;
use crate::language::count::counted;
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The page: every legal choice, curves over the branch, and the instruction as it is read.
pub(crate) struct ChoicesView<'a>(pub(crate) &'a App);

/// A number of a step, where there is one.
type Curve<'a> = &'a dyn Fn(&TimelineStep) -> Option<f32>;

/// Rows of the curves under the table: a title and a line each.
const CURVES: u16 = 6;

impl Widget for ChoicesView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let Some(now) = &app.session.now else { return };
        let read = 3;
        let table = Rect { height: area.height - CURVES - read, ..area };
        self.table(now, table, buf);
        curves(now, Rect { y: table.bottom(), height: CURVES, ..area }, buf);
        self.reading(now, Rect { y: table.bottom() + CURVES, height: read, ..area }, buf);
    }
}

impl ChoicesView<'_> {
    fn table(&self, now: &SessionSnapshot, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let Some((decision, words)) = &app.session.decision else {
            let inner = panel(buf, area, "Mind", &now.acts);
            let text = app
                .session
                .trouble
                .as_deref()
                .unwrap_or("nothing is being decided: the episode is over, or no policy is loaded");
            for (row, line) in (0..).zip(wrap(text, usize::from(inner.width), "")) {
                put(buf, inner, row, line, THEME.quiet);
            }
            return;
        };
        let entropy = decision
            .distribution
            .as_ref()
            .map_or(String::new(), |distribution| format!(" · entropy {:.2}", distribution.entropy));
        let value = match &app.session.values {
            Some(values) => format!("V {:.2}", unsigned_zero(values.state)),
            None => "this checkpoint has no critic".into(),
        };
        let right = format!("{} · {value}{entropy} · by {}", now.acts, app.mind.sort.name());
        let inner = panel(buf, area, "Mind", &right);
        let width = usize::from(inner.width).saturating_sub(56);
        let head =
            format!("  {:<11} {:<18} {:>5} {:<width$} {:>6} {:>9}", "action", "object", "p", "", "min Q", "advantage");
        put(buf, inner, 0, head, THEME.quiet);
        let rows = choices(now, decision, app.session.values.as_ref(), app.mind.sort);
        let room = usize::from(inner.height).saturating_sub(2);
        let first = app.mind.selected.min(rows.len().saturating_sub(room));
        for (row, choice) in (1..).zip(rows.iter().skip(first).take(room)) {
            line(choice, width).render(Rect { y: inner.y + row, height: 1, ..inner }, buf);
        }
        let hidden = rows.len().saturating_sub(first + room);
        let more = if hidden > 0 { format!(" ({hidden} more below: j)") } else { String::new() };
        let greedy = decision.distribution.as_ref().filter(|distribution| distribution.greedy != decision.action);
        let drawn = if greedy.is_some() { "; drawn by chance, + is the likeliest" } else { "" };
        put(buf, inner, inner.height - 1, format!("> {words}{drawn}{more}"), THEME.quiet);
    }

    /// What the sentence encoder reads.
    fn reading(&self, now: &SessionSnapshot, area: Rect, buf: &mut Buffer) {
        let words = now.instruction.split_whitespace().count();
        let right = match &now.reading {
            Some(reading) if reading.cut > 0 => {
                format!("{}, {} cut off", counted(reading.tokens, "token"), reading.cut)
            }
            Some(reading) => counted(reading.tokens, "token"),
            None => counted(words, "word"),
        };
        let inner = panel(buf, area, "Reads", &right);
        for (row, line) in (0..inner.height).zip(wrap(&now.instruction, usize::from(inner.width), "")) {
            put(buf, inner, row, line, THEME.instruction);
        }
    }
}

fn line(choice: &Choice, width: usize) -> Line<'static> {
    let style = if choice.chosen { THEME.chosen } else { Style::new() };
    let mark = match (choice.chosen, choice.greedy) {
        (true, _) => ">",
        (false, true) => "+",
        (false, false) => " ",
    };
    let number = |x: Option<f32>| x.map_or_else(|| "-".to_string(), |x| format!("{:.2}", unsigned_zero(x)));
    let object = fit(choice.class.map_or("", Class::spoken), 18);
    let p = choice.probability.unwrap_or(0.0);
    let good = match choice.advantage {
        Some(a) if a > 0.0 => THEME.good,
        Some(a) if a < 0.0 => THEME.bad,
        _ => THEME.quiet,
    };
    Line::from(vec![
        Span::styled(
            format!(
                "{mark} {:<11} {object:<18} {:>5} ",
                choice.kind.name(),
                choice.probability.map_or("-".into(), share)
            ),
            style,
        ),
        Span::styled(bar(p, width), if choice.chosen { THEME.chosen } else { THEME.bar }),
        Span::styled(format!(" {:>6}", number(choice.q)), style),
        Span::styled(
            format!(" {:>9}", choice.advantage.map_or_else(|| "-".into(), |a| format!("{:+.2}", unsigned_zero(a)))),
            good,
        ),
    ])
}

/// The curves over the branch: what is low, what is high, and where subtasks were done.
fn curves(now: &SessionSnapshot, area: Rect, buf: &mut Buffer) {
    let steps = &now.time.steps;
    let inner = panel(buf, area, "Over the branch", &format!("{}; digits mark subtasks", counted(steps.len(), "step")));
    let has_values = steps.iter().any(|beat| beat.value.is_some());
    let entropy = |beat: &TimelineStep| beat.entropy;
    let chosen = |beat: &TimelineStep| beat.chosen;
    let value = |beat: &TimelineStep| beat.value;
    let q = |beat: &TimelineStep| beat.q;
    let rows: [(&str, Curve<'_>); 4] = [("V", &value), ("Q chosen", &q), ("p chosen", &chosen), ("entropy", &entropy)];
    for (row, (name, of)) in (0..).zip(rows) {
        let place = Rect { y: inner.y + row, height: 1, ..inner };
        if row < 2 && !has_values {
            put(buf, place, 0, format!("{name:<9} no critic"), THEME.quiet);
            continue;
        }
        spark(name, steps, now.time.at, of, place, buf);
    }
    let marks = Rect { y: inner.y + 4, height: 1, ..inner };
    let room = usize::from(inner.width).saturating_sub(LABEL);
    let mut text: Vec<char> = vec![' '; room];
    for (step, beat) in steps.iter().enumerate() {
        if let Some(number) = beat.completed
            && let Some(cell) = text.get_mut(column(step, steps.len(), room))
        {
            *cell = char::from_digit(number % 10, 10).unwrap_or('*');
        }
    }
    let marks_text: String = text.into_iter().collect();
    put(buf, marks, 0, format!("{:<LABEL$}{marks_text}", "subtasks"), THEME.good);
}

/// Columns before a curve.
const LABEL: usize = 24;

fn column(step: usize, steps: usize, room: usize) -> usize {
    if steps <= room { step } else { step * room / steps.max(1) }
}

fn spark(name: &str, steps: &[TimelineStep], at: u32, of: Curve<'_>, area: Rect, buf: &mut Buffer) {
    // Never a whole cell: the curve above keeps its own ground.
    const LEVELS: [char; 7] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇'];
    let found: Vec<f32> = steps.iter().filter_map(of).collect();
    let (low, high) = found.iter().fold((f32::MAX, f32::MIN), |(low, high), &x| (low.min(x), high.max(x)));
    let label = if found.is_empty() { format!("{name:<9}") } else { format!("{name:<9}{low:>5.2} to {high:.2}") };
    put(buf, area, 0, fit(&label, LABEL - 1), THEME.quiet);
    let room = usize::from(area.width).saturating_sub(LABEL);
    for (step, beat) in steps.iter().enumerate() {
        let Some(x) = of(beat) else { continue };
        let level = if high > low { ((x - low) / (high - low) * 6.0).round() as usize } else { 3 };
        let x = area.x + LABEL as u16 + column(step, steps.len(), room) as u16;
        let style = if step as u32 + 1 == at { THEME.chosen } else { THEME.bar };
        if x < area.right() {
            buf[(x, area.y)].set_char(LEVELS[level.min(6)]).set_style(style);
        }
    }
    debug_assert!(name.width() < LABEL);
}
