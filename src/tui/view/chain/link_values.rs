//! Strips of link values: one row a link, one column a step, a colour and a digit for how warm the link was. The strips of two
//! policies stand over each other on the same scale and the same time.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::widgets::Widget;

use crate::analysis::chain::ChainRun;
use crate::explore::chain_report::ChainReport;
use crate::language::count::counted;
use crate::tui::theme::THEME;
use crate::tui::view::panel::{fit, unsigned_zero};
use crate::tui::view::panel::{panel, put};
use crate::tui::view::value_colour::value_colour;

/// The strips, one a policy.
pub(super) struct LinkValueStrips<'a> {
    pub(super) sides: &'a [&'a ChainReport],
    pub(super) selected: usize,
}

/// Columns before a strip, on a screen of 80 columns and on a wide one.
const LABEL: u16 = 20;
const WIDE_LABEL: u16 = 40;
/// Columns of a wide one.
const WIDE: u16 = 100;

impl Widget for LinkValueStrips<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let many = self.sides.len() as u16;
        let steps =
            self.sides.iter().filter_map(|side| Some(side.by_link.as_ref()?.link_values.len())).max().unwrap_or(0);
        let before = if area.width < WIDE { LABEL } else { WIDE_LABEL };
        let (height, width) = ((area.height - 1) / many, area.width.saturating_sub(before));
        for (at, side) in (0u16..).zip(self.sides) {
            let place = Rect { y: area.y + at * height, height, ..area };
            let Some(play) = &side.by_link else {
                panel(buf, place, &title(side), "waits");
                continue;
            };
            let inner = panel(
                buf,
                place,
                &title(side),
                &format!("{} · {}", measure(play), counted(play.link_values.len(), "step")),
            );
            let (low, high) = range(self.sides.iter().filter_map(|side| side.by_link.as_ref()), play.by_value);
            let rows = usize::from(inner.height);
            let first = (self.selected + 1).saturating_sub(rows).min(side.links.len().saturating_sub(rows));
            for (row, (link, words)) in inner.rows().zip(side.links.iter().enumerate().skip(first)) {
                let label = format!("{:>2} {}", link + 1, fit(words, usize::from(before) - 4));
                put(buf, row, 0, label, if link == self.selected { THEME.chosen } else { THEME.quiet });
                let strip = Rect { x: row.x + before.min(row.width), width, ..row };
                for (column, place) in strip.positions().take(steps.min(usize::from(width))).enumerate() {
                    let step = if steps <= usize::from(width) { column } else { column * steps / usize::from(width) };
                    let Some(value) = play.link_values.get(step).and_then(|values| values.get(link)) else { continue };
                    let share = if high > low { (value - low) / (high - low) } else { 0.0 };
                    // A digit says it without colours too.
                    let digit = char::from_digit((share * 9.0).round() as u32, 10).unwrap_or('9');
                    let ink = if share > 0.55 { Color::Rgb(0, 0, 0) } else { Color::White };
                    let style = Style::new().fg(ink).bg(value_colour(share));
                    let in_force = play.in_force.get(step) == Some(&link);
                    let force = if in_force { Modifier::BOLD | Modifier::UNDERLINED } else { Modifier::empty() };
                    buf[place].set_char(digit).set_style(style.add_modifier(force));
                }
            }
        }
        let foot = Rect { y: area.bottom() - 1, height: 1, ..area };
        put(buf, foot, 0, format!("{:width$}{}", "", legend(self.sides), width = usize::from(before)), THEME.quiet);
    }
}

fn title(side: &ChainReport) -> String {
    format!("Heat, {}", side.who.name)
}

/// What is shown of a play.
fn measure(play: &ChainRun) -> &'static str {
    if play.by_value { "V of every link" } else { "no critic: p of what was done, by every link" }
}

/// The lowest and the highest of all plays that show the same measure: their digits mean the same.
fn range<'a>(plays: impl Iterator<Item = &'a ChainRun>, by_value: bool) -> (f32, f32) {
    let all = plays.filter(|play| play.by_value == by_value).flat_map(|play| play.link_values.iter().flatten());
    all.fold((f32::MAX, f32::MIN), |(low, high), &x| (low.min(x), high.max(x)))
}

/// What the digits and the marks mean.
fn legend(sides: &[&ChainReport]) -> String {
    let plays = || sides.iter().filter_map(|side| side.by_link.as_ref()).filter(|play| !play.link_values.is_empty());
    let Some(first) = plays().next() else { return String::new() };
    let words = |by_value: bool| {
        let (low, high) = range(plays(), by_value);
        let (low, high) = (unsigned_zero(low), unsigned_zero(high));
        format!("{low:.2} to {high:.2}")
    };
    let scale = match plays().all(|play| play.by_value == first.by_value) {
        true => words(first.by_value),
        false => format!("V {}, p {}", words(true), words(false)),
    };
    format!("0-9: {scale}; underlined: in force")
}
