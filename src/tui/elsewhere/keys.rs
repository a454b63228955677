//! Keys, and what they ask for.

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use super::state::{OwnApp, OwnMode, Typed};
use crate::explore::elsewhere::breakpoint::OwnCondition;
use crate::explore::elsewhere::command::OwnCommand;

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

impl OwnApp {
    /// Takes in a key.
    pub(super) fn on_key(&mut self, key: KeyEvent) -> KeyAnswer {
        if key.kind == KeyEventKind::Release {
            return KeyAnswer::Nothing;
        }
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        match key.code {
            KeyCode::Char('c') if control => return KeyAnswer::Quit,
            KeyCode::Char('z') if control => return KeyAnswer::Stop,
            KeyCode::Char('l') if control => return KeyAnswer::Repaint,
            _ => {}
        }
        match self.mode.clone() {
            OwnMode::Typing(what) => {
                self.type_key(key, what);
                KeyAnswer::Nothing
            }
            OwnMode::Help => {
                self.mode = OwnMode::Watch;
                KeyAnswer::Nothing
            }
            OwnMode::Choosing | OwnMode::Watch => self.command_key(key),
        }
    }

    /// Takes in what was pasted.
    pub(super) fn paste(&mut self, text: &str) {
        if matches!(self.mode, OwnMode::Typing(_)) {
            self.typed.extend(text.chars().filter(|c| !c.is_control()));
        }
    }

    fn type_key(&mut self, key: KeyEvent, what: Typed) {
        match key.code {
            KeyCode::Esc => {
                self.typed.clear();
                self.mode = OwnMode::Watch;
            }
            KeyCode::Backspace => drop(self.typed.pop()),
            KeyCode::Char('u') if key.modifiers.contains(KeyModifiers::CONTROL) => self.typed.clear(),
            KeyCode::Char(c) if !key.modifiers.contains(KeyModifiers::CONTROL) => self.typed.push(c),
            KeyCode::Enter => {
                let text = std::mem::take(&mut self.typed);
                self.mode = OwnMode::Watch;
                let command = match what {
                    Typed::Instruction => Ok(OwnCommand::Instruct(text)),
                    Typed::Comparison if text.trim().is_empty() => return,
                    Typed::Comparison => Ok(OwnCommand::Compare(text)),
                    Typed::Condition => OwnCondition::parse(&text).map(OwnCommand::Break),
                    Typed::Command => OwnCommand::parse(&text),
                };
                match command {
                    Ok(command) => self.ask(command),
                    Err(complaint) => self.said = Some((true, complaint)),
                }
            }
            _ => {}
        }
    }

    fn command_key(&mut self, key: KeyEvent) -> KeyAnswer {
        let choosing = self.mode == OwnMode::Choosing;
        let many = self.shown.as_ref().map_or(0, |shown| shown.choices.len());
        match key.code {
            KeyCode::Char('q') => return KeyAnswer::Quit,
            KeyCode::Esc => (self.mode, self.compared) = (OwnMode::Watch, None),
            KeyCode::Char('j') | KeyCode::Down if choosing => {
                self.marked = (self.marked + 1).min(many.saturating_sub(1))
            }
            KeyCode::Char('k') | KeyCode::Up if choosing => self.marked = self.marked.saturating_sub(1),
            KeyCode::Enter if choosing => self.choose(self.marked),
            KeyCode::Char(digit @ '1'..='9') => self.choose(digit as usize - '1' as usize),
            KeyCode::Char('m') => self.mode = if choosing { OwnMode::Watch } else { OwnMode::Choosing },
            KeyCode::Char(' ') => self.ask(if self.is_running { OwnCommand::Pause } else { OwnCommand::Run }),
            KeyCode::Char('n') => self.ask(OwnCommand::Step(1)),
            KeyCode::Char('h') | KeyCode::Left => self.ask(OwnCommand::Move(-1)),
            KeyCode::Char('l') | KeyCode::Right => self.ask(OwnCommand::Move(1)),
            KeyCode::Char('H') => self.ask(OwnCommand::Move(-10)),
            KeyCode::Char('L') => self.ask(OwnCommand::Move(10)),
            KeyCode::Char('0') | KeyCode::Home => self.ask(OwnCommand::Goto(0)),
            KeyCode::Char('$') | KeyCode::End => self.ask(OwnCommand::Goto(u32::MAX)),
            KeyCode::Char('x') => self.ask(OwnCommand::Chance),
            KeyCode::Char('a') => self.ask(OwnCommand::Agent),
            KeyCode::Char('N') => self.ask(OwnCommand::Next),
            KeyCode::Char('r') => self.ask(OwnCommand::Reset),
            KeyCode::Char('S') => self.ask(OwnCommand::Save(None)),
            KeyCode::Char('t') => {
                let next = self.shown.as_ref().map_or(1, |shown| shown.branch.1 % shown.branch.2 + 1);
                self.ask(OwnCommand::Branch(next));
            }
            KeyCode::Char('i') => self.mode = OwnMode::Typing(Typed::Instruction),
            KeyCode::Char('B') => self.mode = OwnMode::Typing(Typed::Comparison),
            KeyCode::Char('b') => self.mode = OwnMode::Typing(Typed::Condition),
            KeyCode::Char(':') => self.mode = OwnMode::Typing(Typed::Command),
            KeyCode::Char('?') => self.mode = OwnMode::Help,
            _ => {}
        }
        KeyAnswer::Nothing
    }

    fn choose(&mut self, place: usize) {
        let words = self.shown.as_ref().and_then(|shown| shown.choices.get(place)).map(|choice| choice.words.clone());
        if let Some(words) = words {
            self.ask(OwnCommand::Act(words));
        }
    }
}
