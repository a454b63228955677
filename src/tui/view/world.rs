//! The page of the world: the floor plan, and an inspector that says of each thing what can be done to it and why not.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::map;
use super::panel::{fit, panel, put, wrap};
use crate::explore::inspect::{Thing, things};
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The page: the floor plan, and every thing with what can be done to it.
pub(crate) struct WorldView<'a>(pub(crate) &'a App);

/// Rows that the details of the selected thing take.
const DETAILS: u16 = 7;

impl Widget for WorldView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let Some(now) = &app.session.now else { return };
        let [plan, list] = parts(area);
        map::MapPanel(app).render(plan, buf);
        let things = things(now);
        self.list(&things, list, buf);
        if let Some(thing) = things.get(app.world.selected) {
            details(thing, Rect { y: list.bottom(), height: DETAILS, ..list }, buf);
        }
    }
}

/// Where the floor plan and the list of things are.
pub(super) fn parts(page: Rect) -> [Rect; 2] {
    let width = (page.width * 45 / 100).min(2 * page.height + 10);
    let left = width + 2;
    [Rect { width, ..page }, Rect { x: page.x + left, width: page.width - left, height: page.height - DETAILS, ..page }]
}

impl WorldView<'_> {
    fn list(&self, things: &[Thing], area: Rect, buf: &mut Buffer) {
        let could = things.iter().filter(|thing| !thing.possible.is_empty()).count();
        let seen = things.iter().filter(|thing| thing.seen).count();
        let right = format!("{could} usable, {seen} seen, {} in all", things.len());
        let inner = panel(buf, area, "Things", &right);
        let rows = usize::from(inner.height);
        let first = (self.0.world.selected + 1).saturating_sub(rows);
        let room = usize::from(inner.width).saturating_sub(26);
        for (row, (at, thing)) in inner.rows().zip(things.iter().enumerate().skip(first)) {
            let selected = at == self.0.world.selected;
            let style = match (selected, thing.possible.is_empty(), thing.seen) {
                (true, ..) => THEME.chosen,
                (false, false, _) => THEME.key,
                (false, true, true) => Style::new(),
                (false, true, false) => THEME.quiet,
            };
            let verdict = match (thing.possible.is_empty(), thing.seen) {
                (true, false) if room < UNSEEN.width() => "unseen".into(),
                (true, false) => UNSEEN.into(),
                _ => thing.verdict(),
            };
            Line::from(vec![
                Span::styled(
                    format!("{} {:<14}", if selected { ">" } else { " " }, fit(thing.class.spoken(), 14)),
                    style,
                ),
                Span::styled(format!("{:>5.1} m   ", thing.metres), THEME.quiet),
                Span::styled(cut(&verdict, room), if thing.possible.is_empty() { THEME.quiet } else { THEME.good }),
            ])
            .render(row, buf);
        }
    }
}

/// What is said of a thing that cannot be seen.
const UNSEEN: &str = "not in view";
/// A reason of fewer columns says nothing.
const REASON: usize = 24;

/// A verdict whose reason has hardly any room is given without it: it stands below for the thing that is selected.
fn cut(verdict: &str, room: usize) -> String {
    match verdict.split_once(':') {
        Some((short, _)) if verdict.width() > room && room < REASON => short.to_owned(),
        _ => fit(verdict, room),
    }
}

fn details(thing: &Thing, area: Rect, buf: &mut Buffer) {
    let seen = if thing.seen { "in view" } else { "not in view" };
    let inner = panel(buf, area, thing.class.spoken(), &format!("{:.2} m, {seen}", thing.metres));
    let mut words = [thing.place.as_str(), thing.state.as_str()].join(", ");
    words = words.trim_matches([',', ' ']).to_string();
    let first = u16::from(!words.is_empty());
    put(buf, inner, 0, words, Style::new());
    let possible = thing.possible.iter().map(|kind| (kind, "possible now".to_string(), THEME.good));
    let impossible = thing.impossible.iter().map(|(kind, reason)| (kind, reason.clone(), THEME.quiet));
    let width = usize::from(inner.width);
    let lines = possible.chain(impossible).flat_map(|(kind, text, style)| {
        // Room for the longest kind, and the reason in as many lines as it needs.
        let lines = wrap(&text, width.saturating_sub(11), "");
        let kinds = std::iter::once(kind.name()).chain(std::iter::repeat(""));
        kinds.zip(lines).map(|(kind, line)| (format!("{kind:<10} {line}"), style)).collect::<Vec<_>>()
    });
    for (row, (line, style)) in (first..).zip(lines) {
        put(buf, inner, row, line, style);
    }
}
