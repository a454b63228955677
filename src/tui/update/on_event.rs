//! Takes in what the session tells.

use std::sync::Arc;

use super::effect::Effect;
use super::lines::uncover;
use super::pages::turn_to;
use crate::episode::wish::{Wish, WishVerdict};
use crate::explore::exploration::SessionSnapshot;
use crate::explore::inspect::changes;
use crate::explore::session::{SessionCommand, SessionEvent};
use crate::explore::verb::ExplorerPage;
use crate::tui::app::App;
use crate::tui::graphics::letters::{self, Letters};
use crate::tui::keys::{Mode, with_keys};
use crate::tui::log::{LogEntry, Tone};

/// Changes the state by what the session tells.
pub(crate) fn on_event(app: &mut App, event: SessionEvent) -> Vec<Effect> {
    match event {
        SessionEvent::State(snapshot) => {
            let new_episode = app.session.now.as_ref().is_none_or(|now| now.episode != snapshot.episode);
            if new_episode {
                app.frame.letters = Arc::new(Letters::of(&snapshot.scene, &snapshot.world));
                app.session.examples.clone_from(&snapshot.examples);
                app.session.replaced = None;
                app.session.decision = None;
                app.enter_episode();
                let known = app.session.now.as_ref().is_some_and(|now| now.instruction == snapshot.instruction);
                if !known {
                    app.input.editor.remember(&snapshot.instruction);
                }
            }
            app.frame.names = Arc::new(letters::names(&snapshot.scene, &snapshot.world));
            app.session.trouble = None;
            app.session.policy = snapshot.policy;
            app.main.interactions = 0;
            app.input.newcomer &= snapshot.step < NEW;
            let before = app.session.now.replace(snapshot);
            if let Some(note) = app.session.now.as_ref().and_then(|now| arrival(before.as_deref(), now, new_episode)) {
                let step = app.session.now.as_ref().map(|now| now.step);
                app.log.write(LogEntry { step, text: note, outcome: String::new(), tone: Tone::Note });
            }
            let mut effects = vec![Effect::Encode];
            effects.extend(asked_again(app, before.as_deref()));
            effects
        }
        SessionEvent::Stepped(step) => {
            let event = *step;
            let action = if event.by_hand { format!("{} (you)", event.action) } else { event.action };
            let tone = if event.outcome.is_done() { Tone::Done } else { Tone::Impossible };
            let step = Some(event.step);
            if let Some(forked) = event.forked {
                let text = format!("branch {forked}");
                app.log.write(LogEntry {
                    step: step.map(|step| step - 1),
                    text,
                    outcome: String::new(),
                    tone: Tone::Note,
                });
            }
            app.log.write(LogEntry { step, text: action, outcome: event.outcome.to_string(), tone });
            if let Some(subtask) = event.completed {
                app.log.write(LogEntry {
                    step,
                    text: format!("done: {subtask}"),
                    outcome: String::new(),
                    tone: Tone::Good,
                });
            }
            vec![]
        }
        SessionEvent::Decided(decision, words, values) => {
            app.session.decision = Some((decision, words));
            app.session.values = values;
            if app.session.run_mode.is_some() { vec![] } else { vec![Effect::Encode] }
        }
        SessionEvent::Running(mode) => {
            app.session.run_mode = mode;
            vec![Effect::Encode]
        }
        SessionEvent::Busy(busy) => {
            app.session.busy = busy;
            vec![]
        }
        SessionEvent::Instructed { old, new, note } => {
            app.input.editor.remember(&new);
            app.note(Tone::Note, format!("instruction: {new} ({note})"));
            app.session.decision = None;
            let effects = vec![Effect::Remember(new.clone())];
            app.session.replaced = (old != new).then_some(old);
            effects
        }
        SessionEvent::Read(wish) => {
            // The line under the instruction says the same, where there is one.
            let is_shown = app.layout().is_some() && !app.is_frame_alone();
            for (tone, text) in reading(&wish) {
                if is_shown { app.write(tone, text) } else { app.note(tone, text) }
            }
            if let Some(why) = &wish.unasked {
                app.note(Tone::Bad, format!("read by the program itself: {why}"));
            }
            vec![]
        }
        SessionEvent::AgentDone { likely, graded, .. } => {
            let grader = match graded {
                None => "it is not graded: :done or :failed".to_string(),
                Some((done, of)) => format!("the grader has {done} of {of}"),
            };
            app.note(Tone::Note, format!("the agent says done ({likely:.2}); {grader}"));
            vec![]
        }
        SessionEvent::Ended(wish) | SessionEvent::AlreadyOver(wish) => {
            let good = wish.verdict.is_some_and(WishVerdict::is_fulfilled);
            let tone = if good { Tone::Good } else { Tone::Bad };
            app.note(tone, format!("{}; i gives the next instruction", wish.verdict_in_words()));
            if let Some(advice) = &wish.advice {
                app.note(Tone::Note, with_keys(advice));
            }
            app.session.decision = None;
            vec![]
        }
        SessionEvent::Stopped(why) => {
            app.note(Tone::Note, format!("stopped: {why}"));
            vec![]
        }
        SessionEvent::Breakpoints(conditions) => {
            let all: Vec<String> = conditions.iter().map(ToString::to_string).collect();
            let text = if all.is_empty() {
                "runs stop nowhere (:break CONDITION)".into()
            } else {
                format!("runs stop at: {}", all.join("; "))
            };
            app.note(Tone::Note, text);
            vec![]
        }
        SessionEvent::Actions(lines) => {
            app.actions.lines = lines;
            vec![]
        }
        SessionEvent::Diverged(divergence) => {
            if app.page == ExplorerPage::Branches {
                app.branches.divergence = Some(divergence);
            }
            vec![Effect::Encode]
        }
        SessionEvent::Compared(contrast) => {
            app.compare.contrast = Some(*contrast);
            app.compare.state = app.session.now.as_ref().map(|now| (now.time.branch, now.step));
            turn_to(app, ExplorerPage::Compare)
        }
        SessionEvent::ValueMap(map, step) => {
            // What was cancelled may still arrive.
            if app.value_map.is_painted {
                app.value_map.map = Some((map, step));
            }
            vec![]
        }
        SessionEvent::Chain(chain) => {
            app.chain.take_in(*chain);
            vec![]
        }
        SessionEvent::Examples(wishes) => {
            // Whoever does something else meanwhile is not disturbed.
            if app.input.mode != Mode::Watch {
                return vec![];
            }
            if wishes.is_empty() {
                app.note(Tone::Note, "no wish was found that can be fulfilled here now");
                return vec![];
            }
            (app.input.wishes, app.input.selected_wish) = (wishes, 0);
            app.input.open(Mode::WishList);
            uncover(app)
        }
        SessionEvent::Working(working) => {
            app.session.working = working;
            vec![]
        }
        // The state that follows shows them.
        SessionEvent::PolicyChosen(_)
        | SessionEvent::CheckpointChosen(_)
        | SessionEvent::Sampling(_)
        | SessionEvent::At(_) => vec![],
        SessionEvent::Noted(text) => {
            app.note(Tone::Good, text);
            vec![]
        }
        SessionEvent::Refused(reason) => {
            app.note(Tone::Bad, reason);
            vec![]
        }
        SessionEvent::Failed(reason) => {
            app.session.busy = None;
            app.note(Tone::Bad, reason.clone());
            app.session.trouble = Some(reason);
            vec![]
        }
    }
}

/// How what was told is understood, in the log's lines.
fn reading(wish: &Wish) -> Vec<(Tone, String)> {
    let mut lines = Vec::new();
    if !wish.understood.is_empty() {
        let by = wish.read_by.as_ref().map_or(String::new(), |name| format!(" by {name}"));
        lines.push((Tone::Note, format!("understood{by}: {}", wish.understood)));
    }
    if let Some(why) = &wish.ungraded {
        lines.push((Tone::Bad, format!("not graded: {why}")));
    } else if !wish.unread.is_empty() {
        lines.push((Tone::Bad, format!("not understood: {}", wish.unread.join(" "))));
    }
    lines
}

/// Steps after which nobody is a newcomer.
const NEW: u32 = 20;

/// What has to be asked again in a new state: how the branches beside each other part, and values for other words.
fn asked_again(app: &App, before: Option<&SessionSnapshot>) -> Vec<Effect> {
    let mut effects = Vec::new();
    let Some(now) = &app.session.now else { return effects };
    let other = app
        .branches
        .divergence
        .as_ref()
        .map(|divergence| &divergence.names[1])
        .filter(|_| app.page == ExplorerPage::Branches);
    effects.extend(other.map(|other| Effect::Send(SessionCommand::Diverge(other.clone()))));
    if app.page == ExplorerPage::Actions {
        effects.push(Effect::Send(SessionCommand::Actions));
    }
    let told = app.value_map.map.as_ref().is_some_and(|(values, _)| values.instruction != now.instruction);
    // Values are of a house: where something in it changed, they are others.
    let moved = app.value_map.is_painted
        && before.is_some_and(|before| {
            before.episode == now.episode && !changes(&now.scene, &before.world, &now.world).is_empty()
        });
    if app.value_map.is_painted && (told || moved) {
        effects.push(Effect::Send(SessionCommand::ValueMap));
    }
    effects
}

/// What is worth saying about a new state that was not stepped to.
fn arrival(before: Option<&SessionSnapshot>, now: &SessionSnapshot, new_episode: bool) -> Option<String> {
    let Some(before) = before else { return Some(now.scene.name.clone()) };
    if new_episode {
        return Some(now.scene.name.clone());
    }
    let name = |snapshot: &SessionSnapshot| {
        snapshot.time.branches.get(snapshot.time.branch).map_or_else(String::new, |branch| branch.name.clone())
    };
    let forked = now.time.branches.len() > before.time.branches.len();
    if before.time.branch != now.time.branch && !forked {
        return Some(format!("on {}", name(now)));
    }
    (now.step < before.step && now.step == 0).then(|| "back at the start".into())
}
