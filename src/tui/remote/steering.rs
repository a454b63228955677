//! The screen of another environment as `sprint ctl` steers it: what it tells is noted, and orders become commands.

use std::sync::mpsc::Sender;

use super::worker::{RemoteEvent, Told};
use crate::control::Order;
use crate::explore::remote::command::RemoteCommand;
use crate::explore::steering::ExplorerControl;

/// Orders as commands.
pub(super) fn obeyed_by(commands: Sender<RemoteCommand>) -> impl Fn(Order) -> bool + Send + 'static {
    move |order| {
        let command = match order {
            Order::Pause | Order::Stop => RemoteCommand::Pause,
            Order::Resume => RemoteCommand::Run,
            Order::Instruct(text) => RemoteCommand::Instruct(text),
        };
        commands.send(command).is_ok()
    }
}

/// Tells those who steer the explorer what happens.
pub(super) fn heard_by(control: &ExplorerControl, event: &RemoteEvent) {
    let Told::Shown(shown, runs, said) = &event.0 else { return };
    let (mut step, mut told) = (shown.step, None);
    control.note(|seen| {
        step = std::mem::replace(&mut seen.step, shown.step);
        told = seen.instruction.replace(shown.instruction.clone());
        seen.runs = *runs;
        seen.acts = format!("{}, {}", shown.name, shown.policy);
    });
    if told.is_some_and(|told| told != shown.instruction) {
        control.say(format!("instruction: {}", shown.instruction));
    }
    if let Some(taken) = shown.taken.as_ref().filter(|_| step != shown.step) {
        control.say(taken.in_words());
    }
    if let Some((is_problem, words)) = said {
        control.say(if *is_problem { format!("problem: {words}") } else { words.clone() });
    }
}
