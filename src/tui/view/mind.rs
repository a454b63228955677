//! What the policy thinks: the probability of each action and of the object classes.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::panel::{bar, fit, panel, put, share, unsigned_zero, wrap};
use crate::agent::{ActionDistribution, Decision};
use crate::domain::{ActionType, Class};
use crate::explore::exploration::SessionSnapshot;
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The panel with the distribution.
pub(crate) struct MindPanel<'a>(pub(crate) &'a App);

/// Columns that the object classes get where there is room beside the actions.
const OBJECTS: u16 = 26;

impl Widget for MindPanel<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let distribution = app.session.decision.as_ref().and_then(|(decision, _)| decision.distribution.as_ref());
        let right = match (&app.session.busy, distribution) {
            (Some(busy), _) => format!("{busy} ..."),
            (None, Some(distribution)) => {
                let value = app
                    .session
                    .values
                    .as_ref()
                    .map_or(String::new(), |values| format!(" · V {:.2}", unsigned_zero(values.state)));
                let done = app.session.decision.as_ref().and_then(|(decision, _)| decision.end_in_words());
                let done = done.map_or(String::new(), |done| format!(" · {done}"));
                format!("{}{value} · entropy {:.2}{done}", app.session.policy.name(), distribution.entropy)
            }
            (None, None) if app.session.decision.is_some() => {
                format!("{} · no probabilities", app.session.policy.name())
            }
            (None, None) => app.session.policy.name().to_string(),
        };
        let inner = panel(buf, area, "Mind", &right);
        match (&app.session.decision, &app.session.now, &app.session.trouble) {
            (Some((decision, _)), Some(now), _) => DistributionTable { decision, distribution, now }.render(inner, buf),
            (_, _, Some(trouble)) => {
                let lines = wrap(trouble, usize::from(inner.width), "");
                let below = lines.len() as u16 + 1;
                for (row, line) in (0..).zip(lines) {
                    put(buf, inner, row, line, THEME.bad);
                }
                let whole = "e: the expert acts   x: chance acts   m: you act";
                let is_narrow = usize::from(inner.width) < whole.len();
                let keys = if is_narrow { "e: expert   x: chance   m: you act" } else { whole };
                put(buf, inner, below, keys, THEME.quiet);
            }
            _ => {}
        }
    }
}

/// The 12 actions, and the object classes where there is a distribution over them.
struct DistributionTable<'a> {
    decision: &'a Decision,
    distribution: Option<&'a ActionDistribution>,
    now: &'a SessionSnapshot,
}

impl Widget for DistributionTable<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let tall = area.height >= 12;
        let wide = tall && area.width >= 2 + 32 + OBJECTS;
        let rows = if tall { 12 } else { 6 };
        let beside = if wide { OBJECTS + 2 } else { 0 };
        let actions = Rect { width: area.width - beside, height: rows, ..area };
        let columns = ActionType::COUNT as u16 / rows;
        let width = (actions.width - 2 * (columns - 1)) / columns;
        for (at, kind) in (0u16..).zip(ActionType::ALL) {
            let (column, row) = (at / rows, at % rows);
            let place = Rect { x: actions.x + column * (width + 2), y: actions.y + row, width, height: 1 };
            self.action(place, buf, kind);
        }
        let Some(distribution) = self.distribution else { return };
        if wide {
            let objects = Rect { x: actions.right() + 2, width: OBJECTS, ..area };
            object_list(objects, buf, self.target_class(), distribution);
        } else {
            let objects = Rect { y: actions.bottom(), height: area.height.saturating_sub(rows), ..area };
            object_line(objects, buf, self.target_class(), distribution);
        }
    }
}

impl DistributionTable<'_> {
    fn target_class(&self) -> Option<Class> {
        self.now.world.class_of(&self.now.scene, self.decision.action.target?)
    }

    fn action(&self, area: Rect, buf: &mut Buffer, kind: ActionType) {
        let chosen = self.decision.action.kind == kind;
        let style = if chosen { THEME.chosen } else { Style::new() };
        let name = format!("{} {:<11} ", if chosen { ">" } else { " " }, kind.name());
        let room = usize::from(area.width).saturating_sub(name.width());
        let possible = !kind.is_interaction() || self.now.candidates.iter().any(|candidate| candidate.kind == kind);
        let line = match (self.distribution.map(|distribution| distribution.actions[kind.index()]), possible || chosen)
        {
            (Some(Some(p)), _) => Line::from(vec![
                Span::styled(name, style),
                Span::styled(bar(p, room.saturating_sub(4)), if chosen { THEME.chosen } else { THEME.bar }),
                Span::styled(format!(" {:>3}", share(p)), style),
            ]),
            (None, true) => {
                let class = self.target_class().filter(|_| chosen).map_or("", Class::spoken);
                Line::styled(format!("{name}{}", fit(class, room)), style)
            }
            (Some(None), _) | (None, false) => {
                Line::styled(format!("{name}{}", fit(masked(kind, self.now, room), room)), THEME.masked)
            }
        };
        line.render(area, buf);
    }
}

/// Why an action cannot be chosen now, in words that fit where they can.
fn masked(kind: ActionType, now: &SessionSnapshot, room: usize) -> &'static str {
    let held = now.world.held.and_then(|held| now.world.object(held));
    let (long, short) = match kind {
        ActionType::Pickup if held.is_some() => ("masked: the hand is full", "hand full"),
        ActionType::Pickup => ("masked: nothing to pick up in reach", "none near"),
        ActionType::Put if held.is_none() => ("masked: the hand is empty", "hand empty"),
        ActionType::Put => ("masked: no place for it in reach", "no place"),
        ActionType::Open => ("masked: nothing to open in reach", "none near"),
        ActionType::Close => ("masked: nothing open in reach", "none open"),
        ActionType::ToggleOn => ("masked: nothing to switch on", "none near"),
        ActionType::ToggleOff => ("masked: nothing is on here", "none on"),
        ActionType::Slice if held.is_none_or(|held| !held.class.is_knife()) => {
            ("masked: no knife in the hand", "no knife")
        }
        ActionType::Slice => ("masked: nothing to slice in reach", "none near"),
        _ => ("masked: tried at this view", "tried here"),
    };
    [long, short].into_iter().find(|words| words.width() <= room).unwrap_or("-")
}

/// One class a row, with bars.
fn object_list(area: Rect, buf: &mut Buffer, target: Option<Class>, distribution: &ActionDistribution) {
    put(buf, area, 0, if distribution.objects.is_empty() { "" } else { "object" }, THEME.quiet);
    for (row, &(class, p, candidate)) in (1..area.height).zip(&distribution.objects) {
        let style = object_style(target == Some(class), candidate);
        let name = fit(class.spoken(), 13);
        let width = usize::from(area.width).saturating_sub(13 + 1 + 4);
        let line = Line::from(vec![
            Span::styled(format!("{name:<13} "), style),
            Span::styled(bar(p, width), if candidate { THEME.bar } else { THEME.masked }),
            Span::styled(format!(" {:>3}", share(p)), style),
        ]);
        line.render(Rect { y: area.y + row, height: 1, ..area }, buf);
    }
}

fn object_style(chosen: bool, candidate: bool) -> Style {
    match (chosen, candidate) {
        (true, _) => THEME.chosen,
        (false, true) => Style::new(),
        (false, false) => THEME.masked,
    }
}

/// As many classes as fit in a few lines.
fn object_line(area: Rect, buf: &mut Buffer, target: Option<Class>, distribution: &ActionDistribution) {
    let mut lines = vec![Line::default()];
    let mut used = 0;
    for &(class, p, candidate) in &distribution.objects {
        let text = format!("{} {}  ", class.spoken(), share(p));
        if used + text.width() > usize::from(area.width) {
            if lines.len() >= usize::from(area.height) {
                break;
            }
            lines.push(Line::default());
            used = 0;
        }
        used += text.width();
        let style = object_style(target == Some(class), candidate);
        if let Some(line) = lines.last_mut() {
            line.push_span(Span::styled(text, style));
        }
    }
    for (row, line) in area.rows().zip(lines) {
        line.render(row, buf);
    }
}
