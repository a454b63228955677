//! What keys mean at the moment, and what was typed.

use crate::explore::verb::Verb;
use crate::tui::editor::Editor;
use crate::tui::keys::Mode;

/// What keys mean at the moment, and what was typed.
pub(crate) struct InputState {
    /// What keys mean.
    pub(crate) mode: Mode,
    /// What keys meant before typing or help.
    pub(crate) under: Mode,
    /// The instruction line while somebody types.
    pub(crate) editor: Editor,
    /// The line of a verb while somebody types.
    pub(crate) palette: Editor,
    /// The verb of the palette's list that is selected.
    pub(crate) selected_verb: usize,
    /// Wishes for this house, while they are listed.
    pub(crate) wishes: Vec<String>,
    /// The one of them that is selected.
    pub(crate) selected_wish: usize,
    /// What would lose work, and was asked about: done when it is asked for again.
    pub(crate) asked: Option<Verb>,
    /// What the key before asked about.
    pub(crate) confirms: Option<Verb>,
    /// Which part of the help is shown.
    pub(crate) help: HelpState,
    /// What is wrong with the verb that was typed, until another key.
    pub(crate) complaint: Option<String>,
    /// Nobody has explored here before: the last row says how to begin.
    pub(crate) newcomer: bool,
}

/// Which part of the help is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct HelpState {
    /// Terms, in place of keys.
    pub(crate) shows_terms: bool,
    /// Where that does not fit on one screen: which part, from 0.
    pub(crate) part: usize,
}

impl InputState {
    /// A policy acts at first, or a person.
    pub(crate) fn new(manual: bool) -> InputState {
        let mode = if manual { Mode::Manual } else { Mode::Watch };
        InputState {
            mode,
            under: mode,
            editor: Editor::default(),
            palette: Editor::default(),
            selected_verb: 0,
            wishes: Vec::new(),
            selected_wish: 0,
            asked: None,
            confirms: None,
            help: HelpState::default(),
            complaint: None,
            newcomer: false,
        }
    }

    /// Whether a person acts.
    pub(crate) fn by_hand(&self) -> bool {
        self.mode == Mode::Manual || (self.mode != Mode::Watch && self.under == Mode::Manual)
    }

    /// Opens a line or list over the screen; what keys meant before comes back when it closes.
    pub(crate) fn open(&mut self, mode: Mode) {
        if matches!(self.mode, Mode::Watch | Mode::Manual) {
            self.under = self.mode;
        }
        self.mode = mode;
    }

    /// Closes what was opened.
    pub(crate) fn close(&mut self) {
        self.mode = self.under;
    }
}
