//! The first row (where, when, who) and the last (keys, and how pictures are shown).

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use unicode_width::UnicodeWidthStr;

use super::log::tone;
use super::panel::{fit, fit_parts};
use crate::explore::session::{RunMode, SessionCommand};
use crate::explore::verb::{ExplorerPage, Verb};
use crate::language::count::counted;
use crate::tui::app::App;
use crate::tui::keys::Mode;
use crate::tui::log::Tone;
use crate::tui::theme::THEME;

/// The first row.
pub(crate) struct HeaderRow<'a>(pub(crate) &'a App);

impl Widget for HeaderRow<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        let mut words = vec![];
        if let Some(now) = &app.session.now {
            let room = now.scene.room.spoken();
            words.push(now.scene.name.clone());
            if !now.scene.name.starts_with(room) {
                words.push(room.to_string());
            }
            words.push(match (now.horizon, now.expert_steps) {
                (Some(horizon), _) => format!("step {}/{horizon}", now.step),
                (None, Some(expert)) => format!("step {} (expert: {expert})", now.step),
                (None, None) => format!("step {}", now.step),
            });
            words.push(format!("seed {}", now.seed));
        }
        let who = if app.input.by_hand() {
            format!("you act ({} advises)", app.session.acts())
        } else {
            format!("{} acts", app.session.acts())
        };
        words.push(who);
        let (state, style) = match (&app.session.busy, app.session.run_mode) {
            (Some(busy), _) => (format!("{busy} ..."), THEME.note),
            (None, Some(RunMode::Policy)) => (format!("running {}", app.session.rate.name()), THEME.good),
            (None, Some(RunMode::Steps(left))) => (format!("{} to go", counted(left, "step")), THEME.good),
            (None, Some(RunMode::Replay)) => (format!("replaying {}", app.session.rate.name()), THEME.good),
            (None, None) if app.session.working.is_some() => {
                (app.session.working.clone().unwrap_or_default(), THEME.note)
            }
            (None, None) => (format!("paused ({})", app.session.rate.name()), THEME.quiet),
        };
        let width = usize::from(area.width);
        let state = fit(&state, width.saturating_sub(NAME.len() + 2));
        let room = width.saturating_sub(NAME.len() + state.width() + 2);
        let words = fit(&format!("  {}", said(words, room.saturating_sub(2))), room);
        let gap = width.saturating_sub(NAME.len() + words.width() + state.width());
        Line::from(vec![
            Span::styled(NAME, THEME.title),
            Span::raw(words),
            Span::raw(" ".repeat(gap)),
            Span::styled(state, style),
        ])
        .render(area, buf);
    }
}

/// The parts that fit whole: where there is no room for all, the seed goes first, then what is in brackets, then
/// the last.
fn said(mut words: Vec<String>, room: usize) -> String {
    while words.len() > 1 && words.join(" · ").width() > room {
        let seed = words.iter().position(|word| word.starts_with("seed "));
        let last = words.len() - 1;
        match (seed, words[last].split_once(" (").map(|(short, _)| short.to_owned())) {
            (Some(seed), _) => drop(words.remove(seed)),
            (None, Some(short)) => words[last] = short,
            (None, None) => drop(words.remove(last)),
        }
    }
    words.join(" · ")
}

/// The program's name, which the line begins with.
const NAME: &str = "SPRINT";

/// For whoever has never been here.
const WELCOME: &str = "New here? ?: keys · space: it acts, waits · w: wishes · i: tell it · h l: time";

/// How pictures are shown and what they cost, as much of it as there is room for.
fn pictures(app: &App, room: usize) -> String {
    let kilobytes = |bytes: u64| format!("{:.1} kB", bytes as f64 / 1000.0);
    let step = app.traffic.of_step.map_or(String::new(), |bytes| format!(" · {}/step", kilobytes(bytes)));
    let second = app
        .traffic
        .of_second
        .filter(|_| app.session.run_mode.is_some())
        .map(|bytes| format!(" · {}/s", kilobytes(bytes)));
    let second = second.unwrap_or_default();
    let (name, reason) = (app.terminal.graphics.protocol.name(), &app.terminal.graphics.reason);
    let forms = [
        format!("{name}: {reason}{step}{second}"),
        format!("{name}{step}{second}"),
        format!("{name}{step}"),
        name.into(),
    ];
    forms.into_iter().find(|form| form.width() <= room).unwrap_or_default()
}

/// What would be lost, and how to keep it or go on.
fn question(app: &App, verb: &Verb, room: usize) -> String {
    let unsaved = app.session.now.as_ref().map_or_else(String::new, |now| now.unsaved.words());
    let is_text = matches!(app.input.mode, Mode::Typing | Mode::Palette);
    let again = match verb {
        Verb::Quit if is_text => "ctrl-c again leaves (kept as the last session)",
        Verb::Quit => "q again leaves (kept as the last session)",
        Verb::List => "the same again goes to the list (kept as the last session)",
        Verb::Ask(SessionCommand::Next) => "N again leaves this house without",
        _ => "the same again leaves this house without",
    };
    let short = again.split(" (").next().unwrap_or_default();
    let whole = format!("Not saved: {unsaved}. S saves, {again}");
    if whole.width() <= room { whole } else { fit(&format!("Not saved: {unsaved}. S saves, {short}"), room) }
}

/// The last row.
pub(crate) struct StatusRow<'a>(pub(crate) &'a App);

impl Widget for StatusRow<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let app = self.0;
        if let Some(verb) = &app.input.asked {
            Line::styled(question(app, verb, usize::from(area.width)), THEME.bad).render(area, buf);
            return;
        }
        if app.input.newcomer && (app.input.mode, app.page) == (Mode::Watch, ExplorerPage::Main) {
            Line::styled(fit_parts(WELCOME, usize::from(area.width)), THEME.note).render(area, buf);
            return;
        }
        if let Some(notice) = app.notice.as_ref().filter(|notice| {
            // The log of the main page has room for what went well; what did not has to be seen whole.
            let has_log = app.page == ExplorerPage::Main && !app.is_frame_alone();
            matches!(app.input.mode, Mode::Watch | Mode::Manual) && (!has_log || notice.tone == Tone::Bad)
        }) {
            Line::styled(fit(&notice.text, usize::from(area.width)), tone(notice.tone)).render(area, buf);
            return;
        }
        let hints: &[(&str, &str)] = match (app.input.mode, app.page) {
            (Mode::Watch, ExplorerPage::Frame) => &[
                ("space", "run"),
                ("n", "step"),
                ("h l", "back, forward"),
                ("i", "instruct"),
                ("esc", "panels"),
                ("?", "keys"),
            ],
            (Mode::Watch, ExplorerPage::Main) => &[
                ("space", "run"),
                ("n", "step"),
                ("h l", "back, forward"),
                ("i", "instruct"),
                ("m", "take over"),
                ("?", "keys"),
            ],
            (Mode::Watch, ExplorerPage::Branches) => &[
                ("j k", "select"),
                ("enter", "go there"),
                ("R", "name"),
                ("T", "save as task"),
                ("esc", "panels"),
                ("?", "keys"),
            ],
            (Mode::Watch, ExplorerPage::Actions) => {
                &[("j k", "select"), ("enter", "go there"), ("h l", "back, forward"), ("esc", "panels"), ("?", "keys")]
            }
            (Mode::Watch, ExplorerPage::Mind) => {
                &[("G", "terms"), ("s", "sort"), ("h l", "back, forward"), ("esc", "panels"), ("?", "keys")]
            }
            (Mode::Watch, ExplorerPage::World) => {
                &[("j k", "select"), ("V", "value map"), ("v", "heading"), ("esc", "panels"), ("?", "keys")]
            }
            (Mode::Watch, ExplorerPage::Compare) => {
                &[("enter", "other instruction"), ("s", "swap"), ("esc", "panels"), ("?", "keys")]
            }
            (Mode::Watch, ExplorerPage::Chain) => &[
                ("enter", "new chain"),
                ("w", "which breaks"),
                ("x", "this one"),
                ("O", "open"),
                ("G", "terms"),
                ("A", "against"),
                ("esc", "panels"),
                ("?", "keys"),
            ],
            (Mode::Manual, _) => &[
                ("arrows", "move"),
                ("1-9", "act"),
                ("enter", "policy's choice"),
                ("i", "instruct"),
                ("m", "give back"),
                ("?", "keys"),
            ],
            (Mode::Typing, _) => {
                &[("enter", "tell the agent"), ("esc", "leave"), ("up", "earlier instructions"), ("tab", "complete")]
            }
            (Mode::Palette, _) => &[("enter", "do it"), ("tab", "fill in"), ("up down", "select"), ("esc", "leave")],
            (Mode::Help, _) => &[("tab", "more"), ("esc", "close the help")],
            (Mode::WishList, _) => &[("j k", "select"), ("enter", "put it on the line"), ("esc", "leave")],
        };
        let mut spans = Vec::new();
        let mut used = 0;
        // The way out and how to find all keys are said wherever that can be; of the others those that fit whole.
        let is_kept = |key: &str| key == "?" || key == "esc";
        let room_of = |(key, word): &(&str, &str)| key.width() + word.width() + 3;
        let mut kept: usize = hints.iter().filter(|hint| is_kept(hint.0)).map(room_of).sum();
        for (key, said) in hints {
            let word = if *key == "space" && app.session.run_mode.is_some() { "pause" } else { said };
            if is_kept(key) {
                kept -= room_of(&(*key, *said));
            }
            if used + key.width() + word.width() + 1 + kept > usize::from(area.width) {
                continue;
            }
            used += key.width() + word.width() + 3;
            spans.extend([Span::styled(*key, THEME.key), Span::styled(format!(" {word}  "), THEME.quiet)]);
        }
        let graphics = pictures(app, usize::from(area.width).saturating_sub(used));
        let gap = usize::from(area.width).saturating_sub(used + graphics.width());
        spans.extend([Span::raw(" ".repeat(gap)), Span::styled(graphics, THEME.quiet)]);
        Line::from(spans).render(area, buf);
    }
}
