//! What the screen has to do beside changing its state.

use crate::explore::session::SessionCommand;

/// Something to be done about a message.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Effect {
    /// Ask the session.
    Send(SessionCommand),
    /// Encode the frame again.
    Encode,
    /// Draw the whole screen again.
    Repaint,
    /// Put text on the terminal's clipboard.
    Copy(String),
    /// Keep an instruction for later sessions.
    Remember(String),
    /// Hear the mouse, or no longer.
    Mouse(bool),
    /// Give the terminal back and stop until somebody lets the program go on.
    Stop,
    /// Take the terminal again after that.
    GoOn,
    /// End the program, for that reason.
    Quit(ExitReason),
}

/// How the explorer ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ExitReason {
    /// The person wanted to.
    Asked,
    /// The person wants the list of what there is to start with.
    ToList,
    /// A signal of that number came.
    Signal(i32),
    /// The worker stopped.
    WorkerGone,
}

pub(super) fn send(command: SessionCommand) -> Vec<Effect> {
    vec![Effect::Send(command)]
}
