//! The page of a chain: how each link came out, and how warm each was over time.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;

use super::{fit, panel, put, wrap};
use crate::run::chain::{Outcome, Play, Rate};
use crate::tui::app::App;
use crate::tui::chained::Chained;
use crate::tui::inspect::{changes, stands};
use crate::tui::theme::THEME;

/// Rows that the selected link takes at least.
const LINK: u16 = 5;

/// The page.
pub struct ChainPage<'a>(pub &'a App);

impl Widget for ChainPage<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let Some(chain) = &app.chain else {
            let inner = panel(buf, area, "Chain", app.working.as_deref().unwrap_or(""));
            let text = "A chain is a list of instructions that are followed one after the other from this state. Press enter \
                        and type one (take the knife; slice the tomato), or nothing for the steps of the task. w then shows \
                        which link breaks.";
            for (row, line) in (0..).zip(wrap(text, usize::from(inner.width), "")) {
                put(buf, inner, row, line, THEME.quiet);
            }
            return;
        };
        let many = chain.links.len() as u16;
        let tall = (many + 4).min(area.height / 2);
        self.links(chain, Rect { height: tall, ..area }, buf);
        let warm = (many + 2).min(area.height - tall - LINK);
        heat(chain, Rect { y: area.y + tall, height: warm, ..area }, buf);
        let below = area.y + tall + warm;
        self.link(chain, Rect { y: below, height: area.bottom() - below, ..area }, buf);
    }
}

impl ChainPage<'_> {
    fn links(&self, chain: &Chained, area: Rect, buf: &mut Buffer) {
        let acts = chain.by_link.as_ref().map_or("", |play| play.acts.as_str());
        let graded = if chain.graded { "graded by the task" } else { "nobody grades these links" };
        let right = match &self.0.working {
            Some(working) => format!("{working} ..."),
            None => format!("{acts} · {graded}"),
        };
        let inner = panel(buf, area, "Chain", &right);
        let before = self.0.chain_before.as_ref().and_then(|chain| chain.by_link.as_ref());
        let other = before.map_or(String::new(), |play| format!("{:<12}", fit(&play.acts, 11)));
        let width = usize::from(inner.width).saturating_sub(3 + 13 + 13 + 26 + other.len());
        let head = format!(
            "   {:<width$}{:<13}{other}{:<13}{:<12} {:<12}",
            "link", "by link", "as one", "from expert", "from own"
        );
        put(buf, inner, 0, head, THEME.quiet);
        let weakest = chain.trials.as_ref().and_then(|trials| trials.weakest());
        let of = |play: Option<&Play>, at: usize| play.and_then(|play| play.outcomes.get(at)).cloned();
        let rows = usize::from(inner.height).saturating_sub(2);
        let first = (self.0.selected + 1).saturating_sub(rows);
        for (row, (at, link)) in (1u16..).zip(chain.links.iter().enumerate().skip(first).take(rows)) {
            let weak = weakest == Some(at);
            let selected = at == self.0.selected;
            let number = if selected { THEME.chosen } else { THEME.key };
            let mut spans = vec![
                Span::styled(format!("{}{:<2}", if selected { ">" } else { " " }, at + 1), number),
                Span::styled(
                    format!("{:<width$}", fit(link, width.saturating_sub(1))),
                    if weak { THEME.bad } else { Style::new() },
                ),
            ];
            spans.push(outcome(of(chain.by_link.as_ref(), at), 13));
            if before.is_some() {
                spans.push(outcome(of(before, at), 12));
            }
            spans.push(outcome(of(chain.as_one.as_ref(), at), 13));
            if let Some(trials) = &chain.trials {
                spans.push(Span::styled(format!("{:<12} ", rate(trials.expert.get(at))), Style::new()));
                spans.push(Span::styled(
                    format!("{:<12}", rate(trials.own.get(at))),
                    if weak { THEME.bad } else { Style::new() },
                ));
            }
            Line::from(spans).render(Rect { y: inner.y + row, height: 1, ..inner }, buf);
        }
        let note = match (weakest, &chain.trials) {
            (Some(at), _) => format!("link {} breaks the chain", at + 1),
            (None, Some(_)) => "no link breaks".into(),
            (None, None) => handovers(chain.by_link.as_ref()),
        };
        put(buf, inner, inner.height - 1, note, if weakest.is_some() { THEME.bad } else { THEME.quiet });
    }
}

impl ChainPage<'_> {
    /// In which state the selected link began and ended, link by link.
    fn link(&self, chain: &Chained, area: Rect, buf: &mut Buffer) {
        let at = self.0.selected.min(chain.links.len().saturating_sub(1));
        let inner = panel(buf, area, &format!("Link {}", at + 1), "entry and exit, told link by link");
        let (Some(now), Some(link)) = (&self.0.now, chain.links.get(at)) else { return };
        put(buf, inner, 0, link.as_str(), THEME.instruction);
        let Some(outcome) = chain.by_link.as_ref().and_then(|play| play.outcomes.get(at)) else { return };
        if !outcome.reached {
            put(buf, inner, 1, "not reached: a link before it failed", THEME.quiet);
            return;
        }
        put(buf, inner, 1, format!("entry   {}", stands(&now.scene, &outcome.entry)), Style::new());
        put(buf, inner, 2, format!("exit    {}", stands(&now.scene, &outcome.exit)), Style::new());
        let changes = changes(&now.scene, &outcome.entry, &outcome.exit);
        let text = if changes.is_empty() { "nothing".to_string() } else { changes.join(", ") };
        for (row, line) in (3..).zip(wrap(&format!("changed {text}"), usize::from(inner.width), "        ")) {
            put(buf, inner, row, line, THEME.note);
        }
    }
}

/// The rewards that chaining would put at the hand-overs.
fn handovers(play: Option<&Play>) -> String {
    let Some(play) = play else { return String::new() };
    let found: Vec<String> = play
        .outcomes
        .iter()
        .zip(1..)
        .filter_map(|(outcome, link)| {
            let v = outcome.handover?;
            Some(format!("{link} to {}: eq. 4 {v:.2}, eq. 5 {:.2}", link + 1, v.clamp(0.0, 1.0)))
        })
        .collect();
    match found.is_empty() {
        true if play.by_value => String::new(),
        true => "chaining targets of eq. 4 and 5: this checkpoint has no critic".into(),
        false => format!("chaining targets at the hand-overs: {}", found.join("; ")),
    }
}

fn outcome(outcome: Option<Outcome>, width: usize) -> Span<'static> {
    let (text, style) = match outcome {
        None => ("...".to_string(), THEME.quiet),
        Some(Outcome { reached: false, .. }) => ("not reached".into(), THEME.quiet),
        Some(Outcome { done: Some(true), steps, .. }) => (format!("done in {steps}"), THEME.good),
        Some(Outcome { done: Some(false), steps, .. }) => (format!("failed, {steps}"), THEME.bad),
        Some(Outcome { done: None, steps, .. }) => (format!("{steps} steps"), Style::new()),
    };
    Span::styled(format!("{:<width$}", fit(&text, width.saturating_sub(1))), style)
}

fn rate(rate: Option<&Rate>) -> String {
    match rate {
        Some(Rate { done, of }) if *of > 0 => format!("{done} of {of}, {:>3}%", 100 * done / of),
        _ => "-".into(),
    }
}

/// One row a link, one column a step: how warm the link was. The one in force is marked.
fn heat(chain: &Chained, area: Rect, buf: &mut Buffer) {
    let Some(play) = &chain.by_link else {
        panel(buf, area, "Heat", "");
        return;
    };
    let what = if play.by_value { "V of every link" } else { "no critic: p of what was done, by every link" };
    let inner = panel(buf, area, "Heat", &format!("{what} · {} steps", play.heat.len()));
    let (label, room) = (20usize, usize::from(inner.width).saturating_sub(20));
    let steps = play.heat.len();
    let all = play.heat.iter().flatten().copied();
    let (low, high) = all.fold((f32::MAX, f32::MIN), |(low, high), x| (low.min(x), high.max(x)));
    for (at, link) in chain.links.iter().enumerate().take(usize::from(inner.height)) {
        let row = inner.y + at as u16;
        buf.set_string(inner.x, row, format!("{:>2} {}", at + 1, fit(link, label - 4)), THEME.quiet);
        for column in 0..steps.min(room) {
            let step = if steps <= room { column } else { column * steps / room };
            let share = if high > low { (play.heat[step][at] - low) / (high - low) } else { 0.0 };
            let cell = &mut buf[(inner.x + label as u16 + column as u16, row)];
            // A digit says it without colours too.
            let digit = char::from_digit((share * 9.0).round() as u32, 10).unwrap_or('9');
            let force = play.in_force[step] == at;
            let ink = if share > 0.55 { Color::Black } else { Color::White };
            cell.set_char(digit).set_style(Style::new().fg(ink).bg(warmth(share)));
            if force {
                cell.set_style(THEME.key.fg(ink).bg(warmth(share)).add_modifier(ratatui::style::Modifier::UNDERLINED));
            }
        }
    }
    let left = Rect { y: inner.y + chain.links.len() as u16, height: 1, ..inner };
    if left.y < inner.bottom() && steps > 0 {
        put(
            buf,
            left,
            0,
            format!("{:<label$}0 is {low:.2}, 9 is {high:.2}; underlined: the link in force", ""),
            THEME.quiet,
        );
    }
}

/// A colour from cold to hot for a share of 0 to 1, readable with the digits over it.
pub fn warmth(share: f32) -> Color {
    const STOPS: [[f32; 3]; 5] =
        [[26.0, 24.0, 60.0], [86.0, 32.0, 120.0], [180.0, 54.0, 96.0], [240.0, 130.0, 50.0], [252.0, 230.0, 120.0]];
    let at = share.clamp(0.0, 1.0) * 4.0;
    let (from, part) = ((at as usize).min(3), at - (at as usize).min(3) as f32);
    let mix = |i: usize| (STOPS[from][i] + (STOPS[from + 1][i] - STOPS[from][i]) * part) as u8;
    Color::Rgb(mix(0), mix(1), mix(2))
}
