//! What the policy thinks: the probability of each action and of the object classes.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::{bar, fit, panel, put, share, wrap};
use crate::agent::{Decision, Mind};
use crate::domain::{ActionType, World};
use crate::tui::app::App;
use crate::tui::theme::THEME;

/// The panel with the distribution.
pub struct MindPanel<'a>(pub &'a App);

/// Columns that the object classes get where there is room beside the actions.
const OBJECTS: u16 = 26;

impl Widget for MindPanel<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let mind = app.thought.as_ref().and_then(|(decision, _)| decision.mind.as_ref());
        let right = match (&app.busy, mind) {
            (Some(busy), _) => format!("{busy} ..."),
            (None, Some(mind)) => format!("{} · entropy {:.2}", app.policy.name(), mind.entropy),
            (None, None) => app.policy.name().to_string(),
        };
        let inner = panel(buf, area, "Mind", &right);
        match (&app.thought, &app.trouble) {
            (Some((decision, _)), _) if mind.is_some() => {
                if let (Some(mind), Some(now)) = (mind, &app.now) {
                    distribution(inner, buf, decision, mind, &now.world);
                }
            }
            (_, Some(trouble)) => {
                let lines = wrap(trouble, usize::from(inner.width), "");
                let below = lines.len() as u16 + 1;
                for (row, line) in (0..).zip(lines) {
                    put(buf, inner, row, line, THEME.bad);
                }
                put(buf, inner, below, "e: the expert acts   x: chance acts   m: you act", THEME.quiet);
            }
            (Some((_, words)), None) => {
                Line::from(vec![Span::raw("next  "), Span::styled(format!("> {words}"), THEME.chosen)])
                    .render(inner, buf);
                let text = format!("The {} policy has no probabilities to show.", app.policy.name());
                put(buf, inner, 2, text, THEME.quiet);
            }
            (None, None) => {}
        }
    }
}

fn distribution(area: Rect, buf: &mut Buffer, decision: &Decision, mind: &Mind, world: &World) {
    let wide = area.height >= 12 && area.width >= 2 + 32 + OBJECTS;
    let (actions, objects) = if area.height >= 12 {
        let beside = if wide { OBJECTS } else { 0 };
        let actions = Rect { width: area.width - beside - 2 * u16::from(wide), height: 12, ..area };
        (
            actions,
            if wide {
                Rect { x: actions.right() + 2, width: OBJECTS, ..area }
            } else {
                Rect { y: area.y + 12, height: area.height - 12, ..area }
            },
        )
    } else {
        (Rect { height: 6, ..area }, Rect { y: area.y + 6, height: area.height.saturating_sub(6), ..area })
    };
    let columns = ActionType::COUNT as u16 / actions.height;
    let width = (actions.width - 2 * (columns - 1)) / columns;
    for (at, kind) in (0u16..).zip(ActionType::ALL) {
        let (column, row) = (at / actions.height, at % actions.height);
        let place = Rect { x: actions.x + column * (width + 2), y: actions.y + row, width, height: 1 };
        action(place, buf, kind, decision, mind.actions[kind.index()], world);
    }
    if wide { object_list(objects, buf, decision, mind, world) } else { object_line(objects, buf, mind) }
}

fn action(area: Rect, buf: &mut Buffer, kind: ActionType, decision: &Decision, p: Option<f32>, world: &World) {
    let chosen = decision.action.kind == kind;
    let mark = if chosen { ">" } else { " " };
    let name = format!("{mark} {:<11} ", kind.name());
    let room = usize::from(area.width).saturating_sub(name.width());
    let line = match p {
        Some(p) => {
            let style = if chosen { THEME.chosen } else { ratatui::style::Style::new() };
            Line::from(vec![
                Span::styled(name, style),
                Span::styled(bar(p, room.saturating_sub(4)), if chosen { THEME.chosen } else { THEME.bar }),
                Span::styled(format!(" {:>3}", share(p)), style),
            ])
        }
        None => Line::styled(format!("{name}{}", fit(&masked(kind, world, room), room)), THEME.masked),
    };
    line.render(area, buf);
}

/// Why an action cannot be chosen now, in at most about `room` columns.
fn masked(kind: ActionType, world: &World, room: usize) -> String {
    let (long, short) = match kind {
        ActionType::Pickup if world.held.is_some() => ("masked: the hand is full", "hand full"),
        ActionType::Pickup => ("masked: nothing to pick up in reach", "no thing"),
        ActionType::Put if world.held.is_none() => ("masked: the hand is empty", "hand empty"),
        ActionType::Put => ("masked: no place for it in reach", "no place"),
        ActionType::Open => ("masked: nothing to open in reach", "no door"),
        ActionType::Close => ("masked: nothing open in reach", "none open"),
        ActionType::ToggleOn => ("masked: nothing to switch on in reach", "no switch"),
        ActionType::ToggleOff => ("masked: nothing on in reach", "none on"),
        ActionType::Slice => ("masked: needs a knife and something to cut", "no knife"),
        _ => ("masked", "masked"),
    };
    if long.width() <= room { long.into() } else { short.into() }
}

/// One class a row, with bars.
fn object_list(area: Rect, buf: &mut Buffer, decision: &Decision, mind: &Mind, world: &World) {
    put(buf, area, 0, "object", THEME.quiet);
    let target = decision.action.target.and_then(|instance| match instance {
        crate::domain::Instance::Object(index) => world.object(index).map(|object| object.class),
        crate::domain::Instance::Fixture(_) => None,
    });
    for (row, &(class, p, candidate)) in (1..area.height).zip(&mind.objects) {
        let chosen = target == Some(class);
        let style = match (chosen, candidate) {
            (true, _) => THEME.chosen,
            (false, true) => ratatui::style::Style::new(),
            (false, false) => THEME.masked,
        };
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

/// As many classes as fit in a few lines.
fn object_line(area: Rect, buf: &mut Buffer, mind: &Mind) {
    let mut lines = vec![Line::default()];
    let mut used = 0;
    for &(class, p, candidate) in &mind.objects {
        let text = format!("{} {}  ", class.spoken(), share(p));
        if used + text.width() > usize::from(area.width) {
            if lines.len() >= usize::from(area.height) {
                break;
            }
            lines.push(Line::default());
            used = 0;
        }
        used += text.width();
        let style = if candidate { ratatui::style::Style::new() } else { THEME.masked };
        if let Some(line) = lines.last_mut() {
            line.push_span(Span::styled(text, style));
        }
    }
    for (row, line) in area.rows().zip(lines) {
        line.render(row, buf);
    }
}
