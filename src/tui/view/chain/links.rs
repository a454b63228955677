//! The table of links: how each came out, by every policy that followed the chain, and what chaining would learn there.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;

use crate::analysis::chain::{ChainRun, Handover, LinkOutcome, LinkRate, LinkSuccess};
use crate::explore::chain_report::ChainReport;
use crate::language::count::counted;
use crate::tui::app::App;
use crate::tui::theme::THEME;
use crate::tui::view::panel::{fit, unsigned_zero};
use crate::tui::view::panel::{panel, put};

/// The table. The first side is the one whose links are replayed.
pub(super) struct Links<'a> {
    pub(super) app: &'a App,
    pub(super) sides: &'a [&'a ChainReport],
}

/// Columns of an outcome, of a rate, and of a value.
const OUTCOME: usize = 13;
const RATE: usize = 10;
const VALUE: usize = 7;
/// Columns that an instruction gets at least.
const LINK: usize = 19;

impl Widget for Links<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let own = self.sides[0];
        let graded = if own.graded { "graded by the task" } else { "these links are not graded" };
        let inner = panel(buf, area, "Chain", graded);
        let columns = Columns::fitting(usize::from(inner.width), self.sides);
        for (row, line) in (0..).zip(columns.head(self.sides)) {
            put(buf, inner, row, line, THEME.quiet);
        }
        let top = self.sides.len() as u16;
        let weakest = own.trials.as_ref().and_then(LinkSuccess::weakest);
        let rows = usize::from(inner.height.saturating_sub(top + 1));
        let first = (self.app.chain.selected + 1).saturating_sub(rows);
        for (row, (at, link)) in (top..).zip(own.links.iter().enumerate().skip(first).take(rows)) {
            let (weak, selected) = (weakest == Some(at), self.app.chain.selected == at);
            let mut spans = vec![
                Span::styled(
                    format!("{}{:<2}", if selected { ">" } else { " " }, at + 1),
                    if selected { THEME.chosen } else { THEME.key },
                ),
                Span::styled(
                    format!("{:<width$}", fit(link, columns.link - 1), width = columns.link),
                    if weak { THEME.bad } else { Style::new() },
                ),
            ];
            for side in self.sides {
                spans.push(outcome(side.by_link.as_ref(), at));
                spans.extend(columns.as_one.then(|| outcome(side.as_one.as_ref(), at)));
            }
            if columns.rates {
                let rate = |rates: fn(&LinkSuccess) -> &Vec<LinkRate>| {
                    own.trials.as_ref().and_then(|trials| rates(trials).get(at))
                };
                spans.push(Span::raw(rate_words(rate(|trials| &trials.expert))));
                let style = if weak { THEME.bad } else { Style::new() };
                spans.push(Span::styled(rate_words(rate(|trials| &trials.own)), style));
            }
            if columns.values {
                let handover = own.by_link.as_ref().and_then(|play| play.outcomes.get(at)?.handover);
                spans.push(Span::raw(handover.map_or(String::new(), values)));
            }
            Line::from(spans).render(Rect { y: inner.y + row, height: 1, ..inner }, buf);
        }
        let (note, style) = match (weakest, &own.trials) {
            (Some(at), _) => (format!("link {} breaks the chain", at + 1), THEME.bad),
            (None, Some(trials)) if trials.is_complete() => ("no link breaks".into(), THEME.good),
            (None, _) => (about(own.by_link.as_ref(), columns.values).to_string(), THEME.quiet),
        };
        put(buf, inner, inner.height.saturating_sub(1), note, style);
    }
}

/// Which columns there is room for, and what is left for the instruction.
struct Columns {
    link: usize,
    as_one: bool,
    rates: bool,
    values: bool,
}

impl Columns {
    fn fitting(width: usize, sides: &[&ChainReport]) -> Columns {
        let mut link = width.saturating_sub(3 + 2 * OUTCOME * sides.len());
        let mut take = |columns: usize| {
            let fits = link >= LINK + columns;
            link -= if fits { columns } else { 0 };
            fits
        };
        let mut rates = take(2 * RATE);
        // On a small screen what was asked for last takes the place of what was found before.
        let is_alone = sides.len() == 1 && sides[0].trials.is_some();
        let as_one = rates || !is_alone;
        if !as_one {
            (rates, link) = (true, link + OUTCOME - 2 * RATE);
            return Columns { link: link.max(1), as_one, rates, values: false };
        }
        let has_values = sides[0].by_link.as_ref().is_some_and(|play| play.by_value);
        let values = has_values && take(3 * VALUE);
        Columns { link: link.max(1), as_one, rates, values }
    }

    /// The names of the columns, and where there are two policies theirs above.
    fn head(&self, sides: &[&ChainReport]) -> Vec<String> {
        let width = self.link;
        let mut names = format!("   {:<width$}", "");
        let mut head = format!("   {:<width$}", "link");
        for side in sides {
            names.push_str(&format!("{:<w$}", fit(&side.who.name, 2 * OUTCOME - 2), w = 2 * OUTCOME));
            head.push_str(&format!("{:<OUTCOME$}", "by link"));
            if self.as_one {
                head.push_str(&format!("{:<OUTCOME$}", "as one"));
            }
        }
        if self.rates {
            let entry =
                if sides.len() > 1 { format!("{} from", fit(&sides[0].who.name, 2 * RATE - 6)) } else { String::new() };
            names.push_str(&format!("{:<w$}", entry, w = 2 * RATE));
            head.push_str(&format!("{:<RATE$}{:<RATE$}", "expert's", "own entry"));
        }
        if self.values {
            head.push_str(&format!("{:>VALUE$}{:>VALUE$}{:>VALUE$}", "target", "eq. 4", "eq. 5"));
        }
        if sides.len() > 1 { vec![names, head] } else { vec![head] }
    }
}

/// What the columns of values are, or why there are none.
fn about(play: Option<&ChainRun>, shown: bool) -> &'static str {
    match play {
        Some(play) if !play.by_value => "no chaining targets (eq. 4, eq. 5): there is no critic",
        Some(_) if shown => {
            "target: V for the next link where one ends, in 0 to 1; eq. 4 draws min Q for the next link to it, eq. 5 that for both"
        }
        Some(_) | None => "",
    }
}

fn values(handover: Handover) -> String {
    format!(
        "{:>VALUE$.2}{:>VALUE$.2}{:>VALUE$.2}",
        unsigned_zero(handover.target()),
        unsigned_zero(handover.next),
        unsigned_zero(handover.joined)
    )
}

fn outcome(play: Option<&ChainRun>, at: usize) -> Span<'static> {
    let (text, style) = match play.and_then(|play| play.outcomes.get(at)) {
        None => ("...".to_string(), THEME.quiet),
        Some(LinkOutcome { reached: false, .. }) => ("not reached".into(), THEME.quiet),
        Some(LinkOutcome { done: Some(true), steps, .. }) => (format!("done in {steps}"), THEME.good),
        Some(LinkOutcome { done: Some(false), steps, .. }) => (format!("failed, {steps}"), THEME.bad),
        Some(LinkOutcome { done: None, steps, .. }) => (counted(*steps, "step"), Style::new()),
    };
    Span::styled(format!("{:<OUTCOME$}", fit(&text, OUTCOME - 1)), style)
}

fn rate_words(rate: Option<&LinkRate>) -> String {
    let text = match rate {
        Some(LinkRate { done, of }) if *of > 0 => format!("{done}/{of} {}%", 100 * done / of),
        Some(_) => "-".into(),
        None => String::new(),
    };
    format!("{text:<RATE$}")
}
