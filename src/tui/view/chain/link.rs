//! The selected link: in which state each policy began and ended it, and what chaining would learn from its end.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::widgets::Widget;

use crate::analysis::chain::{Handover, LinkOutcome};
use crate::domain::Action;
use crate::explore::chain_report::ChainReport;
use crate::explore::exploration::SessionSnapshot;
use crate::explore::inspect::{changes, stands};
use crate::house::Outcome;
use crate::tui::app::App;
use crate::tui::keys::with_keys;
use crate::tui::theme::THEME;
use crate::tui::view::panel::{panel, put, unsigned_zero, wrap};

/// The panel, with a column a policy.
pub(super) struct LinkPanel<'a> {
    pub(super) app: &'a App,
    pub(super) sides: &'a [&'a ChainReport],
}

impl Widget for LinkPanel<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let at = self.app.chain.selected.min(self.sides[0].links.len().saturating_sub(1));
        let inner = panel(buf, area, &format!("Link {}", at + 1), "entry and exit, link by link");
        let (Some(now), Some(link)) = (&self.app.session.now, self.sides[0].links.get(at)) else { return };
        put(buf, inner, 0, link.as_str(), THEME.instruction);
        let many = self.sides.len() as u16;
        let width = (inner.width - 2 * (many - 1)) / many;
        for (column, side) in (0u16..).zip(self.sides) {
            let place = Rect {
                x: inner.x + column * (width + 2),
                y: inner.y + 1,
                width,
                height: inner.height.saturating_sub(1),
            };
            let head = if many > 1 { Some(side.who.name.as_str()) } else { None };
            lines(side, at, head, now, place, buf);
        }
    }
}

fn lines(side: &ChainReport, at: usize, head: Option<&str>, now: &SessionSnapshot, area: Rect, buf: &mut Buffer) {
    let mut row = 0;
    let mut line = |label: &str, text: &str, style: Style| {
        for (at, part) in wrap(text, usize::from(area.width).saturating_sub(LABEL), "").into_iter().enumerate() {
            put(buf, area, row, format!("{:<LABEL$}{part}", if at == 0 { label } else { "" }), style);
            row += 1;
        }
    };
    if let Some(head) = head {
        line("by", head, THEME.title);
    }
    let Some(outcome) = side.by_link.as_ref().and_then(|play| play.outcomes.get(at)) else { return };
    if !outcome.reached {
        line("", "not reached: a link before it failed", THEME.quiet);
        return;
    }
    if let Some((failure, advice)) = &outcome.failure {
        line("why", &format!("{}: {}", failure.words(), with_keys(advice)), THEME.bad);
    }
    if outcome.done != Some(true) && !outcome.taken.is_empty() {
        line("last", &last_actions(outcome, now), Style::new());
    }
    line("entry", &stands(&now.scene, &outcome.entry), Style::new());
    line("exit", &stands(&now.scene, &outcome.exit), Style::new());
    let changes = changes(&now.scene, &outcome.entry, &outcome.exit);
    let changed = if changes.is_empty() { "nothing".to_string() } else { changes.join(", ") };
    line("changed", &changed, THEME.note);
    if let Some(handover) = outcome.handover {
        line("target", &words(handover, at + 1), Style::new());
    }
}

/// Actions that are shown of the end of a link.
const LAST: usize = 6;

/// What was done last, and what of it was impossible.
fn last_actions(outcome: &LinkOutcome, now: &SessionSnapshot) -> String {
    let words = |(action, came): &(Action, Outcome)| {
        let class = action.target.and_then(|target| outcome.exit.class_of(&now.scene, target));
        let class = class.map_or(String::new(), |class| format!(" {}", class.name()));
        let came = if came.is_done() { String::new() } else { format!(" ({came})") };
        format!("{}{class}{came}", action.kind)
    };
    let first = outcome.taken.len().saturating_sub(LAST);
    let before = if first > 0 { "... " } else { "" };
    format!("{before}{}", outcome.taken[first..].iter().map(words).collect::<Vec<_>>().join(", "))
}

/// Columns before what is said.
const LABEL: usize = 8;

/// What chaining would learn from the end of a link, from 1.
fn words(handover: Handover, link: usize) -> String {
    let Handover { worth, next, joined } = handover;
    let [target, worth, next, joined] = [handover.target(), worth, next, joined].map(unsigned_zero);
    let following = link + 1;
    format!(
        "{target:.2}, V for link {following} being {worth:.2}; eq. 4: min Q for {following} is {next:.2}; \
         eq. 5: min Q for {link} and {following} is {joined:.2}"
    )
}
