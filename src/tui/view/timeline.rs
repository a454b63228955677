//! The timeline: every step of the branch in hand in one row, with marks where something happened.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::panel::fit;
use crate::explore::timeline::{Timeline, TimelineStep};
use crate::tui::app::App;
use crate::tui::theme::THEME;

pub(crate) struct TimelineRow<'a>(pub(crate) &'a App);

impl Widget for TimelineRow<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let Some(now) = self.0.session.now.as_ref().filter(|_| area.height > 0) else { return };
        let time = &now.time;
        let (place, others) = around(time, area.width);
        let mut spans = vec![Span::styled(TITLE, THEME.title), Span::raw(place.clone())];
        spans.extend(
            strip(time, room(area, &place, &others))
                .into_iter()
                .map(|(symbol, style)| Span::styled(symbol.to_string(), style)),
        );
        Line::from(spans).render(area, buf);
        let left = area.right().saturating_sub(others.width() as u16);
        buf.set_string(left, area.y, others, THEME.quiet);
    }
}

const TITLE: &str = "Time ";

/// What stands left and right of the strip.
fn around(time: &Timeline, width: u16) -> (String, String) {
    let name = time.branches.get(time.branch).map_or("", |branch| branch.name.as_str());
    let others = match time.branches.len() {
        0 | 1 => String::new(),
        many => format!(" {many} branches"),
    };
    (format!("{} {}/{} ", fit(name, usize::from(width) / 6), time.at, time.steps.len()), others)
}

fn room(area: Rect, place: &str, others: &str) -> usize {
    usize::from(area.width).saturating_sub(TITLE.width() + place.width() + others.width() + 1)
}

/// The step that the strip shows in a column of the screen.
pub(super) fn step_at(app: &App, area: Rect, x: u16) -> Option<u32> {
    let time = &app.session.now.as_ref()?.time;
    let (place, others) = around(time, area.width);
    let places = time.steps.len() + 1;
    let columns = places.min(room(area, &place, &others).max(1));
    let column = usize::from(x).checked_sub(usize::from(area.x) + TITLE.width() + place.width())?;
    (column < columns).then(|| (column * places).div_ceil(columns) as u32)
}

/// A character for each step, the start first; several steps share one where there is no room.
fn strip(time: &Timeline, room: usize) -> Vec<(char, Style)> {
    let places = time.steps.len() + 1;
    let columns = places.min(room.max(1));
    let column = |step: usize| step * columns / places;
    let mut cells: Vec<(u8, char, Style)> = vec![(0, ' ', Style::new()); columns];
    let mut put = |step: usize, rank: u8, symbol: char, style: Style| {
        let cell = &mut cells[column(step)];
        if rank >= cell.0 {
            *cell = (rank, symbol, style);
        }
    };
    put(0, 2, if time.forks_at_start { '┬' } else { '|' }, THEME.quiet);
    for (step, beat) in (1..).zip(&time.steps) {
        let future = step as u32 > time.at;
        let (rank, symbol, style) = mark(beat);
        put(step, rank, symbol, if future && rank < 6 { THEME.quiet } else { style });
    }
    put(time.at as usize, 9, '●', THEME.chosen);
    cells.into_iter().map(|(_, symbol, style)| (symbol, style)).collect()
}

/// What a step looks like, and how much it matters where several share a character.
fn mark(beat: &TimelineStep) -> (u8, char, Style) {
    match beat {
        TimelineStep { completed: Some(number), .. } => {
            (7, char::from_digit(*number % 10, 10).unwrap_or('*'), THEME.good)
        }
        TimelineStep { done: false, .. } => (5, '×', THEME.bad),
        TimelineStep { instructed: true, .. } => (6, 'i', THEME.note),
        TimelineStep { forks: true, .. } => (4, '┬', THEME.note),
        TimelineStep { by_hand: true, .. } => (3, '○', Style::new()),
        TimelineStep { .. } => (1, '·', Style::new()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::ActionType;

    fn beat() -> TimelineStep {
        TimelineStep {
            kind: ActionType::MoveAhead,
            done: true,
            completed: None,
            by_hand: false,
            instructed: false,
            forks: false,
            entropy: None,
            chosen: None,
            value: None,
            q: None,
        }
    }

    fn check(room: usize, expected: &str) {
        let mut steps = vec![beat(); 12];
        steps[1].completed = Some(1);
        steps[4].done = false;
        steps[6].forks = true;
        steps[8].by_hand = true;
        let time = Timeline { at: 5, steps, ..Timeline::default() };
        let text: String = strip(&time, room).into_iter().map(|(symbol, _)| symbol).collect();
        assert_eq!(text, expected);
    }

    #[test]
    fn every_step_has_its_mark_and_crowded_ones_give_way_to_what_matters() {
        check(40, "|·1··●·┬·○···");
        check(6, "1·●┬○·");
        check(1, "●");
    }
}
