//! Takes in what the worker says.

use std::sync::Arc;

use super::Effect;
use super::pages::turn_to;
use crate::episode::rollout::End;
use crate::explore::chained::Chained;
use crate::explore::verb::Page;
use crate::explore::worker::{Command, Report};
use crate::tui::app::App;
use crate::tui::graphics::classes::{self, Letters};
use crate::tui::log::{Entry, Tone};

/// Changes the state by what the worker says.
pub fn hear(app: &mut App, report: Report) -> Vec<Effect> {
    match report {
        Report::Seen(snapshot) => {
            let new_episode = app.now.as_ref().is_none_or(|now| now.episode != snapshot.episode);
            if new_episode {
                app.letters = Arc::new(Letters::of(&snapshot.scene, &snapshot.world));
                app.examples.clone_from(&snapshot.examples);
                app.replaced = None;
                app.thought = None;
                app.divergence = None;
                app.contrast = None;
                app.landscape = None;
                app.paints_values = false;
                app.chain = None;
                app.rival = None;
                let known = app.now.as_ref().is_some_and(|now| now.instruction == snapshot.instruction);
                if !known {
                    app.editor.remember(&snapshot.instruction);
                }
            }
            app.names = Arc::new(classes::names(&snapshot.scene, &snapshot.world));
            app.trouble = None;
            app.policy = snapshot.policy;
            app.page_of_interactions = 0;
            app.newcomer &= snapshot.step < NEW;
            let before = app.now.replace(snapshot);
            if let Some(note) = app.now.as_ref().and_then(|now| arrival(before.as_deref(), now, new_episode)) {
                let step = app.now.as_ref().map(|now| now.step);
                app.log.write(Entry { step, text: note, outcome: String::new(), tone: Tone::Note });
            }
            let mut effects = vec![Effect::Encode];
            effects.extend(asked_again(app));
            effects
        }
        Report::Stepped(event) => {
            let action = if event.by_hand { format!("{} (you)", event.action) } else { event.action };
            let tone = if event.outcome.is_done() { Tone::Done } else { Tone::Impossible };
            let step = Some(event.step);
            if let Some(forked) = event.forked {
                let text = format!("branch {forked}");
                app.log.write(Entry {
                    step: step.map(|step| step - 1),
                    text,
                    outcome: String::new(),
                    tone: Tone::Note,
                });
            }
            app.log.write(Entry { step, text: action, outcome: event.outcome.to_string(), tone });
            if let Some(subtask) = event.completed {
                app.log.write(Entry {
                    step,
                    text: format!("done: {subtask}"),
                    outcome: String::new(),
                    tone: Tone::Good,
                });
            }
            vec![]
        }
        Report::Thought(decision, words, values) => {
            app.thought = Some((decision, words));
            app.values = values;
            if app.going.is_some() { vec![] } else { vec![Effect::Encode] }
        }
        Report::Going(going) => {
            app.going = going;
            vec![Effect::Encode]
        }
        Report::Busy(busy) => {
            app.busy = busy;
            vec![]
        }
        Report::Instructed { old, new, note } => {
            app.editor.remember(&new);
            app.note(Tone::Note, format!("told: {new} ({note})"));
            app.thought = None;
            let effects = vec![Effect::Remember(new.clone())];
            app.replaced = (old != new).then_some(old);
            effects
        }
        Report::Ended(end) => {
            let task = app.now.as_ref().and_then(|now| now.progress.as_ref());
            let (done, of) = task.map_or((0, 0), |task| (task.completed_at.len(), task.subtasks.len()));
            match end {
                End::Success => app.note(Tone::Good, format!("success: {done} of {of} subtasks; r resets, N goes on")),
                End::Timeout => {
                    app.note(Tone::Bad, format!("out of time: {done} of {of} subtasks; r resets, N goes on"));
                }
            }
            app.thought = None;
            vec![]
        }
        Report::Stopped(why) => {
            app.note(Tone::Note, format!("stopped: {why}"));
            vec![]
        }
        Report::Diverged(divergence) => {
            if app.page == Page::Branches {
                app.divergence = Some(divergence);
            }
            vec![Effect::Encode]
        }
        Report::Compared(contrast) => {
            app.contrast = Some(*contrast);
            app.contrast_at = app.now.as_ref().map(|now| (now.time.branch, now.step));
            turn_to(app, Page::Compare)
        }
        Report::Surveyed(landscape, step) => {
            // What was cancelled may still arrive.
            if app.paints_values {
                app.landscape = Some((landscape, step));
            }
            vec![]
        }
        Report::Chained(chained) => {
            take_in(app, *chained);
            vec![]
        }
        Report::Working(working) => {
            app.working = working;
            vec![]
        }
        Report::Noted(text) => {
            app.note(Tone::Good, text);
            vec![]
        }
        Report::Refused(reason) => {
            app.note(Tone::Bad, reason);
            vec![]
        }
        Report::Failed(reason) => {
            app.busy = None;
            app.note(Tone::Bad, reason.clone());
            app.trouble = Some(reason);
            vec![]
        }
    }
}

/// Shows a chain: in the place of what the same policy made of it, or beside what another one did.
fn take_in(app: &mut App, chained: Chained) {
    match &app.chain {
        Some(known) if known.is_same_chain(&chained) && known.who != chained.who => app.rival = Some(chained),
        _ => {
            app.rival = app.rival.take().filter(|rival| rival.is_same_chain(&chained));
            app.chain = Some(chained);
        }
    }
}

/// Steps after which nobody is a newcomer.
const NEW: u32 = 20;

/// What has to be asked again in a new state: how the branches beside each other part, and values for other words.
fn asked_again(app: &App) -> Vec<Effect> {
    let mut effects = Vec::new();
    let Some(now) = &app.now else { return effects };
    let other = app.divergence.as_ref().map(|divergence| &divergence.names[1]).filter(|_| app.page == Page::Branches);
    effects.extend(other.map(|other| Effect::Send(Command::Diverge(other.clone()))));
    let told = app.landscape.as_ref().is_some_and(|(values, _)| values.instruction != now.instruction);
    if app.paints_values && told {
        effects.push(Effect::Send(Command::Survey));
    }
    effects
}

/// What is worth saying about a new state that was not stepped to.
fn arrival(
    before: Option<&crate::explore::session::Snapshot>,
    now: &crate::explore::session::Snapshot,
    new_episode: bool,
) -> Option<String> {
    let Some(before) = before else { return Some(now.scene.name.clone()) };
    if new_episode {
        return Some(now.scene.name.clone());
    }
    let name = |snapshot: &crate::explore::session::Snapshot| {
        snapshot.time.branches.get(snapshot.time.branch).map_or_else(String::new, |branch| branch.name.clone())
    };
    let forked = now.time.branches.len() > before.time.branches.len();
    if before.time.branch != now.time.branch && !forked {
        return Some(format!("on {}", name(now)));
    }
    (now.step < before.step && now.step == 0).then(|| "back at the start".into())
}
