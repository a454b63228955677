//! What is in the hand, and the interactions that are possible now, by number.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::panel::{fit, panel, put, wrap};
use crate::house::view::Candidate;
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The panel with hand and interactions.
pub(crate) struct ReachPanel<'a>(pub(crate) &'a App);

impl Widget for ReachPanel<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let Some(now) = &app.session.now else {
            panel(buf, area, "In reach", "");
            return;
        };
        let held = now.world.held.and_then(|held| now.world.object(held));
        let hand = held.map_or("hand empty".into(), |object| {
            let slice = if object.slice_of.is_some() { "a slice of " } else { "" };
            format!("hand: {slice}{}", object.class)
        });
        let pages = app.pages();
        let more = if pages > 1 { format!("tab {}/{pages}", app.main.interactions + 1) } else { String::new() };
        let both = format!("{more} · {hand}");
        // On a narrow screen the last row says it in place of a distance.
        let above = pages > 1 && both.width() + 12 <= usize::from(area.width);
        let is_narrow = hand.width() + "In reach".width() + 4 > usize::from(area.width);
        let hand =
            if is_narrow { hand.trim_start_matches("hand: ").trim_start_matches("hand ").to_owned() } else { hand };
        let inner = panel(buf, area, "In reach", if above { &both } else { &hand });
        let page = app.page_of_candidates();
        if page.is_empty() {
            let hint = if inner.width < 30 { "nothing: move or turn" } else { "nothing: move closer, or turn" };
            for (row, line) in (0..).zip(wrap(hint, usize::from(inner.width), "")) {
                put(buf, inner, row, line, THEME.quiet);
            }
            return;
        }
        let chosen = app.session.decision.as_ref().map(|(decision, _)| decision.action);
        let named = |candidate: &Candidate| format!("{} {}", candidate.kind, candidate.class.name());
        let longest = page.iter().map(|candidate| named(candidate).width()).max().unwrap_or(0);
        for ((at, candidate), place) in (0u16..).zip(page).zip(places(inner)) {
            let width = place.width;
            let style = if chosen == Some(candidate.action()) { THEME.chosen } else { THEME.key };
            let tells = pages > 1 && !above && usize::from(at) + 1 == page.len();
            let distance = format!("  {:.1} m", candidate.distance / 1000.0);
            // A name that would be cut needs the room more than its distance.
            let distance = if longest + 3 + 6 > usize::from(width) && !tells { String::new() } else { distance };
            let beside = if tells { more.width() + 2 } else { distance.width() };
            let room = longest.min(usize::from(width).saturating_sub(2 + beside));
            let spans = vec![
                Span::styled(format!("{} ", at + 1), style),
                Span::styled(
                    format!("{:<room$}", fit(&named(candidate), room)),
                    if chosen == Some(candidate.action()) { THEME.chosen } else { Default::default() },
                ),
                Span::styled(if tells { format!("  {more}") } else { distance }, THEME.quiet),
            ];
            Line::from(spans).render(place, buf);
        }
    }
}

/// Where the interactions are written, from the first on: down one column, then down the next where there is room for two.
pub(super) fn places(inner: Rect) -> impl Iterator<Item = Rect> {
    let columns: u16 = if inner.width >= 60 { 2 } else { 1 };
    let width = (inner.width - 2 * (columns - 1)) / columns;
    (0..columns).flat_map(move |column| {
        let left = inner.x + column * (width + 2);
        (0..inner.height).map(move |row| Rect { x: left, y: inner.y + row, width, height: 1 })
    })
}
