//! The page: what is told, what is seen, what can be done and how likely it is, and what was done.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Clear, Widget};

use super::keys::KEYS;
use super::layout::{Areas, areas};
use super::state::{RemoteApp, RemoteMode, Typed};
use crate::explore::remote::view::{RemoteChoice, RemotePicture, StepMark};
use crate::tui::theme::THEME;
use crate::tui::view::panel::{fit, panel, wrap};

impl Widget for &RemoteApp {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let places = areas(area);
        match &self.shown {
            None => line(buf, places.head, vec![Span::raw("opening the environment ...")]),
            Some(shown) => self.page(shown, &places, buf),
        }
        self.waits(&places, buf);
        if self.mode == RemoteMode::Help {
            help(area, buf);
        }
        self.scheme.paint(buf);
        self.ability.adapt(buf);
    }
}

/// Hints as far as they fit whole, the first ones last on the line: those have to be seen.
fn whole(hints: &[&str], width: usize) -> String {
    let mut used = 0;
    let fitting = hints.iter().take_while(|hint| {
        used += hint.chars().count() + 2;
        used <= width + 2
    });
    let mut shown: Vec<&str> = fitting.copied().collect();
    let kept = hints.iter().take_while(|hint| ["? keys", "q leave"].contains(*hint)).count().min(shown.len());
    shown.rotate_left(kept);
    shown.join("  ")
}

fn line(buf: &mut Buffer, area: Rect, spans: Vec<Span<'_>>) {
    Line::from(spans).render(area, buf);
}

impl RemoteApp {
    fn page(&self, shown: &RemotePicture, places: &Areas, buf: &mut Buffer) {
        let who = format!("{} acts{}", shown.policy, if self.is_running { ", running" } else { "" });
        let name = format!("{}, seed {}", shown.name, shown.seed);
        let width = usize::from(places.head.width);
        let name = fit(&name, width.saturating_sub(who.chars().count() + 2));
        let gap = width.saturating_sub(name.chars().count() + who.chars().count());
        line(
            buf,
            places.head,
            vec![Span::styled(name, THEME.title), Span::raw(" ".repeat(gap)), Span::styled(who, THEME.note)],
        );
        self.told(shown, places.told, buf);
        self.seen(shown, places.left, buf);
        match &self.compared {
            Some(both) => compared(both, places.right, buf),
            None => self.choices(shown, places.right, buf),
        }
        timeline(shown, places.timeline, buf);
        last(shown, places.last, buf);
        let below = Rect { y: places.last.y + 1, ..places.last };
        let refused = self.refused.as_ref().map(|why| (true, why.clone()));
        let exact = match (refused.as_ref().or(self.said.as_ref()), &shown.undecided) {
            (Some((true, words)), _) => Span::styled(words.clone(), THEME.bad),
            (Some((false, words)), _) => Span::styled(words.clone(), THEME.good),
            (None, Some(problem)) => Span::styled(problem.clone(), THEME.bad),
            (None, None) => Span::styled(format!("going back is {}", shown.exactness), THEME.quiet),
        };
        line(buf, below, vec![Span::styled(fit(&exact.content, usize::from(below.width)), exact.style)]);
        let hints: &[&str] = match self.mode {
            RemoteMode::Choosing => &["? keys", "j k choose", "Enter does it", "m watches"],
            _ => &[
                "? keys",
                "q leave",
                "space runs",
                "n step",
                "h l time",
                "m act",
                "i tell",
                "B compare",
                "N next",
                "S save",
            ],
        };
        line(buf, places.keys, vec![Span::styled(whole(hints, usize::from(places.keys.width)), THEME.quiet)]);
    }

    fn told(&self, shown: &RemotePicture, area: Rect, buf: &mut Buffer) {
        let typing = match self.mode {
            RemoteMode::Typing(Typed::Instruction) => Some("tell: "),
            RemoteMode::Typing(Typed::Comparison) => Some("compare with: "),
            RemoteMode::Typing(Typed::Condition) => Some("stop at: "),
            RemoteMode::Typing(Typed::Command) => Some(": "),
            _ => None,
        };
        if let Some(label) = typing {
            line(buf, area, vec![Span::styled(label, THEME.key)]);
            let typed = area.width.saturating_sub(label.len() as u16);
            self.editor.area().render(Rect { x: area.x + area.width - typed, width: typed, ..area }, buf);
            return;
        }
        let label = if shown.is_told { "instruction: " } else { "asked: " };
        let words = if shown.instruction.is_empty() { "nothing" } else { &shown.instruction };
        let words = fit(words, usize::from(area.width).saturating_sub(label.len()));
        line(buf, area, vec![Span::styled(label, THEME.quiet), Span::styled(words, THEME.instruction)]);
    }

    fn seen(&self, shown: &RemotePicture, area: Rect, buf: &mut Buffer) {
        let size = shown.observation.picture.as_ref().map(|seen| format!("{} x {}", seen.width, seen.height));
        let inside = panel(buf, area, "seen", &size.unwrap_or_default());
        if let Some(picture) = &self.picture {
            // What floats over the cells would hide the list of keys.
            if !(self.mode == RemoteMode::Help && self.graphics.protocol.floats()) {
                picture.render(inside, buf);
            }
            return;
        }
        let text = shown.observation.text.as_deref().unwrap_or("neither a picture nor a text");
        let width = usize::from(inside.width);
        let lines: Vec<String> = text.lines().flat_map(|text| wrap(text, width, "")).collect();
        // The end of what is read is the newest.
        let first = lines.len().saturating_sub(usize::from(inside.height));
        for (row, text) in inside.rows().zip(&lines[first..]) {
            line(buf, row, vec![Span::raw(text.clone())]);
        }
    }

    fn choices(&self, shown: &RemotePicture, area: Rect, buf: &mut Buffer) {
        let parts = shown.observation.subtasks.len() as u16;
        let things = shown.observation.things.len() as u16;
        let below = (parts + if parts > 0 { 1 } else { 0 } + if things > 0 { 2 } else { 0 }).min(area.height / 2);
        let upper = Rect { height: area.height.saturating_sub(below), ..area };
        let right = format!("{} possible", shown.choices.len());
        let inside = panel(buf, upper, "actions", &right);
        let height = usize::from(inside.height);
        let first =
            if self.mode == RemoteMode::Choosing { self.marked.saturating_sub(height.saturating_sub(1)) } else { 0 };
        let rows = inside.rows().zip(shown.choices.iter().enumerate().skip(first));
        for (row, (place, choice)) in rows {
            let marked = self.mode == RemoteMode::Choosing && place == self.marked;
            line(buf, row, choice_line(place, choice, marked, usize::from(row.width)));
        }
        let mut rest = Rect { y: upper.bottom(), height: below, ..area };
        if things > 0 && rest.height > 1 {
            let inside = panel(buf, Rect { height: 2, ..rest }, "in view", "");
            let names: Vec<&str> = shown.observation.things.iter().map(|thing| thing.name.as_str()).collect();
            line(buf, inside, vec![Span::raw(fit(&names.join(", "), usize::from(inside.width)))]);
            rest = Rect { y: rest.y + 2, height: rest.height - 2, ..rest };
        }
        if parts > 0 && rest.height > 0 {
            let inside = panel(buf, rest, "parts", "");
            for (row, part) in inside.rows().zip(&shown.observation.subtasks) {
                let (mark, style) = if part.is_done { ("✓ ", THEME.good) } else { ("· ", Style::new()) };
                let words = fit(&part.text, usize::from(row.width).saturating_sub(2));
                line(buf, row, vec![Span::styled(mark, style), Span::styled(words, style)]);
            }
        }
    }

    fn waits(&self, places: &Areas, buf: &mut Buffer) {
        let Some((since, _)) = self.waiting else { return };
        if self.waits_long() {
            let seconds = since.elapsed().as_secs_f32();
            let words = format!("waiting for the environment, {seconds:.0} s; q leaves");
            let area = Rect { y: places.keys.y, ..places.keys };
            Clear.render(area, buf);
            line(buf, area, vec![Span::styled(words, THEME.note)]);
        }
    }
}

fn choice_line(place: usize, choice: &RemoteChoice, marked: bool, width: usize) -> Vec<Span<'static>> {
    let number = if place < 9 { format!("{} ", place + 1) } else { "  ".into() };
    let bar = 8;
    let share = choice.probability.unwrap_or(0.0).clamp(0.0, 1.0);
    let filled = (share * bar as f32).round() as usize;
    let words = fit(&choice.words, width.saturating_sub(bar + 10));
    let pad = width.saturating_sub(bar + 10).saturating_sub(words.chars().count());
    let style = match (marked, choice.is_chosen) {
        (true, _) => THEME.key.add_modifier(ratatui::style::Modifier::REVERSED),
        (false, true) => THEME.chosen,
        (false, false) => Style::new(),
    };
    let shown = choice.probability.map_or("     ".to_owned(), |share| format!("{share:.3}"));
    vec![
        Span::styled(number, THEME.quiet),
        Span::styled(words, style),
        Span::raw(" ".repeat(pad + 1)),
        Span::raw(shown),
        Span::raw(" "),
        Span::styled("█".repeat(filled), THEME.bar),
    ]
}

fn compared(both: &[(String, Vec<RemoteChoice>)], area: Rect, buf: &mut Buffer) {
    let half = area.height / 2;
    for (i, (told, choices)) in both.iter().enumerate() {
        let area = Rect { y: area.y + half * i as u16, height: half, ..area };
        let inside = panel(buf, area, if i == 0 { "given" } else { "compared" }, "esc");
        let mut rows = inside.rows();
        if let Some(row) = rows.next() {
            line(buf, row, vec![Span::styled(fit(told, usize::from(row.width)), THEME.instruction)]);
        }
        for (row, (place, choice)) in rows.zip(choices.iter().enumerate()) {
            line(buf, row, choice_line(place, choice, false, usize::from(row.width)));
        }
    }
}

/// Each column stands for a stretch of steps; the most telling mark of them is shown.
fn timeline(shown: &RemotePicture, area: Rect, buf: &mut Buffer) {
    let label = format!("step {}/{} ", shown.step, shown.length);
    let width = usize::from(area.width).saturating_sub(label.len());
    let steps = shown.marks.len();
    let columns = width.min(steps.max(1));
    let mut spans = vec![Span::raw(label)];
    for column in 0..columns {
        let (from, to) = (column * steps / columns, ((column + 1) * steps / columns).max(column * steps / columns + 1));
        let marks = shown.marks.get(from..to.min(steps)).unwrap_or_default();
        let is_here = (from..to).contains(&(shown.step as usize).saturating_sub(1)) && shown.step > 0;
        let (mark, style) = match () {
            () if marks.contains(&StepMark::Done) => ("●", THEME.good),
            () if marks.contains(&StepMark::Earned) => ("+", THEME.good),
            () if marks.contains(&StepMark::Refused) => ("×", THEME.bad),
            () => ("─", THEME.quiet),
        };
        spans.push(if is_here {
            Span::styled(if mark == "─" { "┃" } else { mark }, THEME.chosen)
        } else {
            Span::styled(mark, style)
        });
    }
    line(buf, area, spans);
}

fn last(shown: &RemotePicture, area: Rect, buf: &mut Buffer) {
    let mut words = match &shown.taken {
        None => "at the start".to_owned(),
        Some(taken) if taken.outcome == "ok" => taken.action.clone(),
        Some(taken) => format!("{}: {}", taken.action, taken.outcome),
    };
    if let Some(reward) = shown.taken.as_ref().and_then(|taken| taken.reward).filter(|reward| *reward != 0.0) {
        words += &format!(", reward {reward:.3}");
    }
    if shown.earned != 0.0 {
        words += &format!(", earned {:.3}", shown.earned);
    }
    if let Some((done, of)) = shown.observation.grading() {
        words += &format!(", {done} of {of} done");
    }
    if let Some(end) = shown.end {
        words += &format!("; over: {end}");
    }
    if shown.branch.2 > 1 {
        words += &format!("; branch {} ({} of {})", shown.branch.0, shown.branch.1, shown.branch.2);
    }
    if !shown.conditions.is_empty() {
        words += &format!("; stops at {}", shown.conditions.join(", "));
    }
    line(buf, area, vec![Span::raw(fit(&words, usize::from(area.width)))]);
}

fn help(area: Rect, buf: &mut Buffer) {
    let (width, height) = (62.min(area.width), (KEYS.len() as u16 + 2).min(area.height));
    let place = Rect { x: area.x + (area.width - width) / 2, y: area.y + (area.height - height) / 2, width, height };
    Clear.render(place, buf);
    let inside = panel(buf, place, "keys", "any key closes");
    for (row, (key, effect)) in inside.rows().zip(KEYS) {
        let words = fit(effect, usize::from(row.width).saturating_sub(9));
        line(buf, row, vec![Span::styled(format!("{key:<8} "), THEME.key), Span::raw(words)]);
    }
}

#[cfg(test)]
mod tests {
    use super::whole;

    #[test]
    fn hints_are_whole_and_the_way_out_is_among_them() {
        let hints = ["? keys", "q leave", "space runs", "n step"];
        assert_eq!(whole(&hints, 40), "space runs  n step  ? keys  q leave");
        assert_eq!(whole(&hints, 34), "space runs  ? keys  q leave");
        assert_eq!(
            (whole(&hints, 15), whole(&hints, 6), whole(&hints, 5)),
            ("? keys  q leave".into(), "? keys".into(), String::new())
        );
        assert_eq!(whole(&["? keys", "j k choose"], 60), "j k choose  ? keys");
    }
}
