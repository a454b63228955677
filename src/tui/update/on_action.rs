//! What a person asked for, done.

use super::lines::{complete, obey_line, open_line, uncover};
use super::pages::{select, show, turn_to};
use super::travel::{go_on, travel};
use super::{Effect, Farewell, send};
use crate::agent::registry::PolicyKind;
use crate::analysis::chain::Draws;
use crate::domain::{Action, Heading};
use crate::explore::verb;
use crate::explore::verb::{Page, TIMES, Verb};
use crate::explore::worker::{Command, Going, Pace};
use crate::tui::app::App;
use crate::tui::graphics::overlay::Overlay;
use crate::tui::keys::Mode;
use crate::tui::log::Tone;

/// Does what a person asked for.
pub fn perform(app: &mut App, verb: Verb) -> Vec<Effect> {
    match verb {
        Verb::ToggleRun | Verb::Continue => go_on(app, verb == Verb::Continue),
        Verb::Step(count @ 2..) => send(Command::Go(Some(Going::Steps(count)))),
        Verb::Step(_) => send(Command::Step),
        Verb::Faster => pace(app, app.pace.faster()),
        Verb::Slower => pace(app, app.pace.slower()),
        Verb::Reset => send(Command::Reset),
        Verb::Next => send(Command::Next),
        Verb::Seed(seed) => send(Command::Seed(seed)),
        Verb::Policy(kind) => choose(app, kind),
        Verb::NextPolicy => choose(app, app.policy.next()),
        Verb::Checkpoint(wanted) => send(Command::Checkpoint(wanted)),
        Verb::Sample(seed) => send(Command::Reseed(seed, true)),
        Verb::Greedy => send(Command::Reseed(app.now.as_ref().map_or(0, |now| now.seed), false)),
        Verb::Navigate(kind) => send(Command::Act(Action::navigate(kind))),
        Verb::Interact(number) => {
            let candidate = app.page_of_candidates().get(usize::from(number).wrapping_sub(1)).copied();
            match candidate {
                Some(candidate) => send(Command::Act(candidate.action())),
                None => {
                    app.note(Tone::Note, format!("no interaction has the number {number} now"));
                    vec![]
                }
            }
        }
        Verb::Page => {
            app.page_of_interactions = (app.page_of_interactions + 1) % app.pages().max(1);
            vec![Effect::Encode]
        }
        Verb::ToggleManual => {
            let mut effects = turn_to(app, Page::Main);
            app.mode = if app.mode == Mode::Manual { Mode::Watch } else { Mode::Manual };
            effects.extend(app.going.map(|_| Effect::Send(Command::Go(None))));
            effects
        }
        Verb::Instruct(text) => send(Command::Instruct(text)),
        Verb::Back(_)
        | Verb::Forward(_)
        | Verb::Seek(_)
        | Verb::Last
        | Verb::NextEvent
        | Verb::LastEvent
        | Verb::Subtask(_) => travel(app, &verb),
        Verb::NextBranch => {
            let Some(time) = app.now.as_ref().map(|now| now.time.clone()) else { return vec![] };
            send(Command::Switch(((time.branch + 1) % time.branches.len().max(1) + 1).to_string()))
        }
        Verb::Branch(wanted) => send(Command::Switch(wanted)),
        Verb::Name(name) => send(Command::Rename(name)),
        Verb::Diverge(wanted) => {
            let mut effects = turn_to(app, Page::Branches);
            effects.push(Effect::Send(Command::Diverge(wanted)));
            effects
        }
        Verb::Break(condition) => {
            match condition {
                None => app.breaks.clear(),
                Some(condition) if app.breaks.contains(&condition) => app.breaks.retain(|known| *known != condition),
                Some(condition) => app.breaks.push(condition),
            }
            let all: Vec<String> = app.breaks.iter().map(ToString::to_string).collect();
            let text =
                if all.is_empty() { "runs stop nowhere".into() } else { format!("runs stop at: {}", all.join("; ")) };
            app.note(Tone::Note, text);
            send(Command::Break(app.breaks.clone()))
        }
        Verb::Until(condition) => send(Command::Until(condition)),
        Verb::Show(page) => show(app, page),
        Verb::Select(by) => select(app, by),
        Verb::Take => match app.page {
            Page::Branches => send(Command::Switch((app.selected + 1).to_string())),
            _ => vec![],
        },
        Verb::Graphics => {
            app.graphics.protocol = app.graphics.protocol.next();
            app.graphics.reason = "chosen by key g".into();
            app.picture = None;
            vec![Effect::Encode, Effect::Repaint]
        }
        Verb::Overlay => {
            app.overlay = app.overlay.next();
            vec![Effect::Send(Command::LookBack(app.overlay == Overlay::Frames)), Effect::Encode]
        }
        Verb::Sort => {
            app.sort = app.sort.next();
            vec![]
        }
        Verb::Labels => {
            app.labels = !app.labels;
            vec![Effect::Encode]
        }
        Verb::Edit => {
            open_line(app, Mode::Typing);
            app.editor.open("");
            uncover(app)
        }
        Verb::Palette(text) => {
            open_line(app, Mode::Palette);
            app.selected = 0;
            app.palette.open(text);
            uncover(app)
        }
        Verb::Help => {
            open_line(app, Mode::Help);
            uncover(app)
        }
        Verb::Cancel => {
            app.mode = app.under;
            uncover(app)
        }
        Verb::Apply if app.mode == Mode::Palette => obey_line(app),
        Verb::Apply => {
            app.mode = app.under;
            let text = app.editor.text().trim().to_string();
            if text.is_empty() {
                return vec![];
            }
            send(Command::Instruct(text))
        }
        Verb::Earlier | Verb::Later if app.mode == Mode::Palette => {
            let by = if verb == Verb::Later { 1 } else { -1 };
            let most = verb::matching(app.palette.text()).len().saturating_sub(1);
            app.selected = app.selected.saturating_add_signed(by).min(most);
            vec![]
        }
        Verb::Earlier => {
            app.editor.travel(-1);
            vec![]
        }
        Verb::Later => {
            app.editor.travel(1);
            vec![]
        }
        Verb::Complete => {
            complete(app);
            vec![]
        }
        Verb::Branches => show(app, Page::Branches),
        Verb::Think => show(app, Page::Mind),
        Verb::Look | Verb::Candidates => show(app, Page::World),
        Verb::Quit => vec![Effect::Quit(Farewell::Asked)],
        Verb::Save(path) => send(Command::Save(path)),
        Verb::SaveTask(path) => send(Command::SaveTask(path)),
        Verb::Export(path) => send(Command::Export(path)),
        Verb::Compare(text) => {
            let mut effects = turn_to(app, Page::Compare);
            effects.push(Effect::Send(Command::Compare(text)));
            effects
        }
        Verb::Swap => match app.contrast.take() {
            Some(contrast) => {
                let [own, other] = contrast.sides.map(|side| side.instruction);
                vec![Effect::Send(Command::Instruct(other)), Effect::Send(Command::Compare(own))]
            }
            None => {
                app.note(Tone::Note, "there is nothing to swap: compare TEXT first");
                vec![]
            }
        },
        Verb::ValueMap => {
            app.paints_values = !app.paints_values;
            app.landscape = None;
            send(if app.paints_values { Command::Survey } else { Command::StopSurvey })
        }
        Verb::Facing(heading) => {
            app.heading = heading;
            if app.paints_values { vec![] } else { perform(app, Verb::ValueMap) }
        }
        Verb::NextHeading => {
            let next = match app.heading {
                None => Some(Heading::North),
                Some(Heading::West) => None,
                Some(heading) => Some(heading.right()),
            };
            // The first press only paints.
            perform(app, Verb::Facing(if app.paints_values { next } else { app.heading }))
        }
        Verb::Mouse => {
            app.mouse = !app.mouse;
            let text = if app.mouse { "the mouse is heard" } else { "the mouse is the terminal's again" };
            app.note(Tone::Note, text);
            vec![Effect::Mouse(app.mouse)]
        }
        Verb::ReplayLink => perform(app, Verb::WhichLink(Draws { times: TIMES, only: Some(app.selected) })),
        Verb::Chain(text) => {
            let mut effects = turn_to(app, Page::Chain);
            effects.push(Effect::Send(Command::Chain(text)));
            effects
        }
        Verb::WhichLink(draws) => {
            let mut effects = turn_to(app, Page::Chain);
            effects.push(Effect::Send(Command::WhichLink(draws)));
            effects
        }
        Verb::Against(wanted) => {
            let mut effects = turn_to(app, Page::Chain);
            effects.push(Effect::Send(Command::Against(wanted)));
            effects
        }
        Verb::Stop => send(Command::Stop),
        Verb::Bandwidth(kilobytes) => {
            app.bandwidth = (kilobytes > 0).then(|| 1000 * u64::from(kilobytes));
            app.coarseness = 0;
            vec![Effect::Encode]
        }
        Verb::FullFrame => {
            app.coarseness = 0;
            vec![Effect::Encode]
        }
        Verb::Copy => {
            let Some(now) = &app.now else { return vec![] };
            let last = app
                .log
                .done_at(now.step)
                .map_or(String::new(), |entry| format!(": {} · {}", entry.text, entry.outcome));
            let text = format!("{} | {} step {}{last}", now.instruction, now.scene.name, now.step);
            app.note(Tone::Note, "copied");
            vec![Effect::Copy(text)]
        }
    }
}

fn pace(app: &mut App, pace: Pace) -> Vec<Effect> {
    app.pace = pace;
    send(Command::Pace(pace))
}

fn choose(app: &mut App, kind: PolicyKind) -> Vec<Effect> {
    app.policy = kind;
    app.thought = None;
    app.trouble = None;
    send(Command::Choose(kind))
}
