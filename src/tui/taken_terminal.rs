//! The terminal as a screen takes it: its abilities, its display, and all that comes from it as messages.

use std::fs::File;
use std::io::{self, BufWriter, Stdout};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use anyhow::Context;
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;

use super::app::Graphics;
use super::capabilities::{ability, graphics};
use super::graphics::Protocol;
use super::keyboard::Keyboard;
use super::paced_display::PacedDisplay;
use super::signals;
use super::terminal::{self, Counted, Guard};
use super::theme::Ability;
use super::update::Msg;

/// Messages that may wait for the screen; beyond that their senders wait.
pub(crate) const QUEUE: usize = 64;

/// What a screen wants of a terminal.
pub(crate) struct TerminalOptions<'a> {
    /// How to show pictures; `None` to find out.
    pub(crate) protocol: Option<Protocol>,
    /// Where it is remembered what a terminal answered.
    pub(crate) memory: Option<&'a Path>,
    /// Where libtorch's messages go.
    pub(crate) log: Option<&'a File>,
}

/// A terminal that is ours until the guard is dropped.
pub(crate) struct TakenTerminal {
    pub(crate) guard: Guard,
    pub(crate) display: PacedDisplay<BufWriter<Counted<Stdout>>>,
    pub(crate) graphics: Graphics,
    pub(crate) ability: Ability,
    /// Keys, signals and what workers tell.
    pub(crate) messages: Receiver<Msg>,
    /// Where workers tell it.
    pub(crate) tell: SyncSender<Msg>,
}

impl TakenTerminal {
    /// Takes the terminal and begins to listen to it.
    ///
    /// # Errors
    /// When there is none.
    pub(crate) fn take(options: &TerminalOptions<'_>) -> anyhow::Result<TakenTerminal> {
        // The screen strips colours itself where there are none: kitty's placeholders carry a number in theirs.
        crossterm::style::force_color_output(true);
        let ability = ability();
        terminal::catch_panics();
        let (tell, messages) = sync_channel(QUEUE);
        signals::watch(tell.clone())?;
        let guard = Guard::take(options.log).context("this needs a terminal; --plain does not")?;
        let mut keyboard = Keyboard::default();
        let graphics = graphics(options.protocol, ability, options.memory, &mut keyboard);
        let out = BufWriter::with_capacity(1 << 16, Counted::new(io::stdout()));
        let display = PacedDisplay::new(Terminal::new(CrosstermBackend::new(out))?);
        keyboard.listen(tell.clone())?;
        Ok(TakenTerminal { guard, display, graphics, ability, messages, tell })
    }
}
