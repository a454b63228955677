//! Keys, and what they ask for.

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use super::state::{RemoteApp, RemoteMode, Typed};
use crate::explore::remote::breakpoint::RemoteCondition;
use crate::explore::remote::command::RemoteCommand;

/// What the loop has to do for a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum KeyAnswer {
    Nothing,
    Quit,
    Stop,
    Repaint,
}

/// The keys, for whoever asks.
pub(super) const KEYS: [(&str, &str); 16] = [
    ("space", "let the policy act; pause"),
    ("n", "one step"),
    ("h l", "a step back, forth; H L ten"),
    ("0 $", "to the start, to the end"),
    ("m", "act yourself: j k choose, Enter does it"),
    ("1-9", "do the choice of that number"),
    ("i", "tell the agent something; empty: what is asked"),
    ("B", "compare with another instruction"),
    ("x a", "chance acts; the agent of the command line"),
    ("b", "stop at a condition: subtask, reward, sees door"),
    ("t", "the next branch"),
    ("N r", "the next episode; back to the start"),
    ("S", "write what was tried as a run"),
    (":", "a command: act open door, begin 7, save RUN"),
    ("ctrl-l", "draw again"),
    ("q", "leave"),
];

impl RemoteApp {
    /// Takes in a key.
    pub(super) fn on_key(&mut self, key: KeyEvent) -> KeyAnswer {
        if key.kind == KeyEventKind::Release {
            return KeyAnswer::Nothing;
        }
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        let is_command = !matches!(self.mode, RemoteMode::Typing(_));
        if is_command && !matches!(key.code, KeyCode::Char('q' | 'N' | 'c')) {
            self.asked = None;
        }
        match key.code {
            KeyCode::Char('c') if control => return self.quit(),
            KeyCode::Char('z') if control => return KeyAnswer::Stop,
            KeyCode::Char('l') if control => return KeyAnswer::Repaint,
            _ => {}
        }
        match self.mode.clone() {
            RemoteMode::Typing(what) => self.type_key(key, what),
            RemoteMode::Help => {
                self.mode = RemoteMode::Watch;
                KeyAnswer::Nothing
            }
            RemoteMode::Choosing | RemoteMode::Watch => self.command_key(key),
        }
    }

    /// Takes in what was pasted.
    pub(super) fn paste(&mut self, text: &str) {
        // As in House: what is pasted elsewhere is an instruction that begins.
        if !matches!(self.mode, RemoteMode::Typing(_)) {
            self.type_what(Typed::Instruction);
        }
        self.editor.paste(text);
    }

    fn type_what(&mut self, what: Typed) {
        self.mode = RemoteMode::Typing(what);
        self.editor.open("");
    }

    fn quit(&mut self) -> KeyAnswer {
        if self.is_sure(&RemoteCommand::Quit) { KeyAnswer::Quit } else { KeyAnswer::Nothing }
    }

    fn type_key(&mut self, key: KeyEvent, what: Typed) -> KeyAnswer {
        match key.code {
            KeyCode::Esc => self.mode = RemoteMode::Watch,
            KeyCode::Up => self.editor.travel(-1),
            KeyCode::Down => self.editor.travel(1),
            KeyCode::Enter => {
                let text = self.editor.text().to_owned();
                self.mode = RemoteMode::Watch;
                let command = match what {
                    Typed::Instruction => Ok(RemoteCommand::Instruct(text.clone())),
                    Typed::Comparison if text.trim().is_empty() => return KeyAnswer::Nothing,
                    Typed::Comparison => Ok(RemoteCommand::Compare(text.clone())),
                    Typed::Condition => RemoteCondition::parse(&text).map(RemoteCommand::Break),
                    Typed::Command => RemoteCommand::parse(&text),
                };
                if !text.trim().is_empty() {
                    self.editor.remember(&text);
                }
                match command {
                    Ok(RemoteCommand::Quit) => return self.quit(),
                    Ok(command) => self.ask_surely(command),
                    Err(complaint) => self.refused = Some(complaint),
                }
            }
            _ => self.editor.key(key),
        }
        KeyAnswer::Nothing
    }

    /// Asks for something, where it loses nothing or is asked for again.
    fn ask_surely(&mut self, command: RemoteCommand) {
        if !matches!(command, RemoteCommand::Next | RemoteCommand::Begin(_)) || self.is_sure(&command) {
            self.ask(command);
        }
    }

    fn command_key(&mut self, key: KeyEvent) -> KeyAnswer {
        let choosing = self.mode == RemoteMode::Choosing;
        let many = self.shown.as_ref().map_or(0, |shown| shown.choices.len());
        match key.code {
            KeyCode::Char('q') => return self.quit(),
            KeyCode::Esc => (self.mode, self.compared, self.refused) = (RemoteMode::Watch, None, None),
            KeyCode::Char('j') | KeyCode::Down if choosing => {
                self.marked = (self.marked + 1).min(many.saturating_sub(1))
            }
            KeyCode::Char('k') | KeyCode::Up if choosing => self.marked = self.marked.saturating_sub(1),
            KeyCode::Enter if choosing => self.choose(self.marked),
            KeyCode::Char(digit @ '1'..='9') => self.choose(digit as usize - '1' as usize),
            KeyCode::Char('m') => self.mode = if choosing { RemoteMode::Watch } else { RemoteMode::Choosing },
            KeyCode::Char(' ') => self.ask(if self.is_running { RemoteCommand::Pause } else { RemoteCommand::Run }),
            KeyCode::Char('n') => self.ask(RemoteCommand::Step(1)),
            KeyCode::Char('h') | KeyCode::Left => self.ask(RemoteCommand::Move(-1)),
            KeyCode::Char('l') | KeyCode::Right => self.ask(RemoteCommand::Move(1)),
            KeyCode::Char('H') => self.ask(RemoteCommand::Move(-10)),
            KeyCode::Char('L') => self.ask(RemoteCommand::Move(10)),
            KeyCode::Char('0') | KeyCode::Home => self.ask(RemoteCommand::Goto(0)),
            KeyCode::Char('$') | KeyCode::End => self.ask(RemoteCommand::Goto(u32::MAX)),
            KeyCode::Char('x') => self.ask(RemoteCommand::Chance),
            KeyCode::Char('a') => self.ask(RemoteCommand::Agent),
            KeyCode::Char('N') => self.ask_surely(RemoteCommand::Next),
            KeyCode::Char('r') => self.ask(RemoteCommand::Reset),
            KeyCode::Char('S') => self.ask(RemoteCommand::Save(None)),
            KeyCode::Char('t') => {
                let next = self.shown.as_ref().map_or(1, |shown| shown.branch.1 % shown.branch.2 + 1);
                self.ask(RemoteCommand::Branch(next));
            }
            KeyCode::Char('i') => self.type_what(Typed::Instruction),
            KeyCode::Char('B') => self.type_what(Typed::Comparison),
            KeyCode::Char('b') => self.type_what(Typed::Condition),
            KeyCode::Char(':') => self.type_what(Typed::Command),
            KeyCode::Char('?') => self.mode = RemoteMode::Help,
            _ => {}
        }
        KeyAnswer::Nothing
    }

    fn choose(&mut self, place: usize) {
        let words = self.shown.as_ref().and_then(|shown| shown.choices.get(place)).map(|choice| choice.words.clone());
        if let Some(words) = words {
            self.ask(RemoteCommand::Act(words));
        }
    }
}
