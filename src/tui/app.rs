//! The explorer's state, and the one function that changes it: a message in, effects out. No IO.

use std::collections::VecDeque;
use std::sync::Arc;

use crossterm::event::{KeyEvent, KeyEventKind};
use ratatui::layout::{Rect, Size};

use super::editor::Editor;
use super::engine::Snapshot;
use super::graphics::classes::{self, Letters, Names};
use super::graphics::labels::Label;
use super::graphics::{Job, Picture, Protocol};
use super::keys::{self, Mode};
use super::layout::Layout;
use super::policies::PolicyKind;
use super::theme::Ability;
use super::verb::Verb;
use super::worker::{Command, Pace, Report};
use crate::agent::Decision;
use crate::domain::Action;
use crate::house::view::Candidate;
use crate::run::rollout::End;

/// Something that happened.
#[derive(Clone)]
pub enum Msg {
    /// A key was pressed.
    Key(KeyEvent),
    /// Text was pasted.
    Paste(String),
    /// The terminal has another size.
    Resize(Size),
    /// The worker has something to say.
    Report(Report),
    /// A frame was encoded.
    Picture(Picture),
    /// A signal asks the program to end.
    Signal(i32),
    /// The worker stopped.
    WorkerGone,
}

/// Something to be done about it.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// Ask the worker.
    Send(Command),
    /// Encode the frame again.
    Encode,
    /// Draw the whole screen again.
    Repaint,
    /// End.
    Quit(Farewell),
}

/// How the explorer ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Farewell {
    /// The person wanted to.
    Asked,
    /// A signal of that number came.
    Signal(i32),
    /// The worker stopped.
    WorkerGone,
}

/// How a line of the log is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// It was done.
    Done,
    /// It was impossible.
    Impossible,
    /// A subtask or the task is complete.
    Good,
    /// Something went wrong.
    Bad,
    /// What else is worth knowing.
    Note,
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// At which step.
    pub step: Option<u32>,
    /// What happened.
    pub text: String,
    /// What it came to.
    pub outcome: String,
    /// How it is meant.
    pub tone: Tone,
}

/// Lines that the log keeps.
const LOG: usize = 500;

/// How pictures are shown, and why.
#[derive(Clone, Debug)]
pub struct Graphics {
    /// How.
    pub protocol: Protocol,
    /// Why.
    pub reason: String,
    /// The pixels of a character cell, width and height.
    pub cell_pixels: (u16, u16),
}

/// Everything that the screen shows.
pub struct App {
    /// The terminal's size.
    pub size: Size,
    /// What keys mean.
    pub mode: Mode,
    /// What keys meant before typing or help.
    pub under: Mode,
    /// What the terminal can show.
    pub ability: Ability,
    /// How pictures are shown.
    pub graphics: Graphics,
    /// The newest state.
    pub now: Option<Box<Snapshot>>,
    /// What the policy would do next, and that in words.
    pub thought: Option<(Decision, String)>,
    /// Who decides.
    pub policy: PolicyKind,
    /// It goes on by itself.
    pub running: bool,
    /// How fast.
    pub pace: Pace,
    /// Something slow goes on.
    pub busy: Option<String>,
    /// Why the policy cannot go on.
    pub trouble: Option<String>,
    /// What happened, oldest first.
    pub log: VecDeque<Entry>,
    /// The instruction line while somebody types.
    pub editor: Editor,
    /// What the agent was told before the present instruction.
    pub replaced: Option<String>,
    /// The encoded frame.
    pub picture: Option<Picture>,
    /// The letters of the scene's classes.
    pub letters: Arc<Letters>,
    /// The classes of the instances in the frame.
    pub names: Arc<Names>,
    /// Numbers are drawn into the picture.
    pub labels: bool,
    /// Which page of the interactions is shown, from 0.
    pub page: usize,
    /// Bytes that the newest step cost on the wire.
    pub bytes: Option<u64>,
}

impl App {
    /// Nothing seen yet.
    pub fn new(size: Size, graphics: Graphics, ability: Ability, policy: PolicyKind, manual: bool) -> App {
        let mode = if manual { Mode::Manual } else { Mode::Watch };
        App {
            size,
            mode,
            under: mode,
            ability,
            graphics,
            now: None,
            thought: None,
            policy,
            running: false,
            pace: Pace::START,
            busy: Some("building the house".into()),
            trouble: None,
            log: VecDeque::new(),
            editor: Editor::default(),
            replaced: None,
            picture: None,
            letters: Arc::default(),
            names: Arc::default(),
            labels: true,
            page: 0,
            bytes: None,
        }
    }

    /// Whether a person acts.
    pub fn by_hand(&self) -> bool {
        self.mode == Mode::Manual || (self.mode != Mode::Watch && self.under == Mode::Manual)
    }

    /// Where everything is.
    pub fn layout(&self) -> Option<Layout> {
        Layout::of(Rect::from((ratatui::layout::Position::ORIGIN, self.size)))
    }

    /// The character cells that the picture fills.
    pub fn picture_area(&self) -> Option<Rect> {
        let layout = self.layout()?;
        Some(layout.picture(self.graphics.protocol, self.graphics.cell_pixels))
    }

    /// The interactions on the present page, numbered from 1.
    pub fn page_of_candidates(&self) -> &[Candidate] {
        let Some(now) = &self.now else { return &[] };
        let size = self.layout().map_or(9, |layout| layout.interactions()).max(1);
        now.candidates.chunks(size).nth(self.page).unwrap_or(&[])
    }

    /// How many pages of interactions there are.
    pub fn pages(&self) -> usize {
        let size = self.layout().map_or(9, |layout| layout.interactions()).max(1);
        self.now.as_ref().map_or(0, |now| now.candidates.len().div_ceil(size))
    }

    /// The frame to be encoded, as things stand.
    pub fn job(&self) -> Option<Job> {
        let now = self.now.as_ref()?;
        let cells = self.picture_area()?.as_size();
        let labels = if self.labels && !self.running { self.labelled(now) } else { Vec::new() };
        (!cells.is_empty_area()).then(|| Job {
            frame: now.frame.clone(),
            letters: self.letters.clone(),
            classes: self.names.clone(),
            labels,
            protocol: self.graphics.protocol,
            cells,
            cell_pixels: self.graphics.cell_pixels,
        })
    }

    fn labelled(&self, now: &Snapshot) -> Vec<Label> {
        let target = self.thought.as_ref().and_then(|(decision, _)| decision.action.target);
        let mut labels: Vec<Label> = Vec::new();
        for sighting in &now.view.sightings {
            let numbers: Vec<String> = (1..)
                .zip(self.page_of_candidates())
                .filter(|(_, candidate)| candidate.instance == sighting.instance)
                .map(|(number, _): (usize, _)| number.to_string())
                .collect();
            let chosen = target == Some(sighting.instance);
            if chosen || !numbers.is_empty() {
                let text = if numbers.is_empty() { "*".into() } else { numbers.join(",") };
                labels.push(Label { bounds: sighting.bounds, text, chosen });
            }
        }
        // The chosen one is drawn last, over its neighbours.
        labels.sort_by_key(|label| label.chosen);
        labels
    }

    fn note(&mut self, tone: Tone, text: impl Into<String>) {
        let step = self.now.as_ref().map(|now| now.step);
        self.write(Entry { step, text: text.into(), outcome: String::new(), tone });
    }

    fn write(&mut self, entry: Entry) {
        if self.log.len() == LOG {
            self.log.pop_front();
        }
        self.log.push_back(entry);
    }
}

trait EmptyArea {
    fn is_empty_area(&self) -> bool;
}

impl EmptyArea for Size {
    fn is_empty_area(&self) -> bool {
        self.width == 0 || self.height == 0
    }
}

/// Changes the state by one message.
pub fn update(app: &mut App, msg: Msg) -> Vec<Effect> {
    match msg {
        Msg::Key(key) if key.kind == KeyEventKind::Release => vec![],
        Msg::Key(key) => match keys::verb(app.mode, key) {
            Some(verb) => perform(app, verb),
            None if app.mode == Mode::Typing => {
                app.editor.key(key);
                vec![]
            }
            None => vec![],
        },
        Msg::Paste(text) => {
            let mut effects = vec![];
            if app.mode != Mode::Typing {
                effects = perform(app, Verb::Edit);
                app.editor.open("");
            }
            app.editor.paste(&text);
            effects
        }
        Msg::Resize(size) => {
            app.size = size;
            app.picture = None;
            app.page = 0;
            vec![Effect::Encode, Effect::Repaint]
        }
        Msg::Report(report) => hear(app, report),
        Msg::Picture(picture) => {
            let fits = app.picture_area().is_some_and(|area| area.as_size() == picture.cells);
            if fits && picture.protocol == app.graphics.protocol {
                app.picture = Some(picture);
            }
            vec![]
        }
        Msg::Signal(number) => vec![Effect::Quit(Farewell::Signal(number))],
        Msg::WorkerGone => vec![Effect::Quit(Farewell::WorkerGone)],
    }
}

/// Does what a person asked for.
pub fn perform(app: &mut App, verb: Verb) -> Vec<Effect> {
    match verb {
        Verb::ToggleRun => {
            if app.mode == Mode::Manual {
                app.mode = Mode::Watch;
            }
            vec![Effect::Send(Command::Run(!app.running))]
        }
        Verb::Step => vec![Effect::Send(Command::Step)],
        Verb::Faster => pace(app, app.pace.faster()),
        Verb::Slower => pace(app, app.pace.slower()),
        Verb::Reset => vec![Effect::Send(Command::Reset)],
        Verb::Next => vec![Effect::Send(Command::Next)],
        Verb::Policy(kind) => choose(app, kind),
        Verb::NextPolicy => choose(app, app.policy.next()),
        Verb::Navigate(kind) => vec![Effect::Send(Command::Act(Action::navigate(kind)))],
        Verb::Interact(number) => {
            let candidate = app.page_of_candidates().get(usize::from(number).wrapping_sub(1)).copied();
            match candidate {
                Some(candidate) => vec![Effect::Send(Command::Act(candidate.action()))],
                None => {
                    app.note(Tone::Note, format!("no interaction has the number {number} now"));
                    vec![]
                }
            }
        }
        Verb::Page => {
            app.page = (app.page + 1) % app.pages().max(1);
            vec![Effect::Encode]
        }
        Verb::ToggleManual => {
            app.mode = if app.mode == Mode::Manual { Mode::Watch } else { Mode::Manual };
            if app.running { vec![Effect::Send(Command::Run(false))] } else { vec![] }
        }
        Verb::Graphics => {
            app.graphics.protocol = app.graphics.protocol.next();
            app.graphics.reason = "chosen by key g".into();
            app.picture = None;
            vec![Effect::Encode, Effect::Repaint]
        }
        Verb::Labels => {
            app.labels = !app.labels;
            vec![Effect::Encode]
        }
        Verb::Edit => {
            app.under = app.mode;
            app.mode = Mode::Typing;
            app.editor.open("");
            vec![]
        }
        Verb::Help => {
            app.under = app.mode;
            app.mode = Mode::Help;
            if app.graphics.protocol.floats() { vec![Effect::Repaint] } else { vec![] }
        }
        Verb::Cancel => {
            let uncovered = app.mode == Mode::Help && app.graphics.protocol.floats();
            app.mode = app.under;
            if uncovered { vec![Effect::Repaint] } else { vec![] }
        }
        Verb::Apply => {
            app.mode = app.under;
            let text = app.editor.text().trim().to_string();
            if text.is_empty() {
                return vec![];
            }
            vec![Effect::Send(Command::Instruct(text))]
        }
        Verb::Earlier => {
            app.editor.travel(-1);
            vec![]
        }
        Verb::Later => {
            app.editor.travel(1);
            vec![]
        }
        Verb::Quit => vec![Effect::Quit(Farewell::Asked)],
    }
}

fn pace(app: &mut App, pace: Pace) -> Vec<Effect> {
    app.pace = pace;
    vec![Effect::Send(Command::Pace(pace))]
}

fn choose(app: &mut App, kind: PolicyKind) -> Vec<Effect> {
    app.policy = kind;
    app.thought = None;
    app.trouble = None;
    vec![Effect::Send(Command::Choose(kind))]
}

/// Takes in what the worker says.
fn hear(app: &mut App, report: Report) -> Vec<Effect> {
    match report {
        Report::Seen(snapshot) => {
            let new_episode = app.now.as_ref().is_none_or(|now| now.episode != snapshot.episode);
            if new_episode {
                app.letters = Arc::new(Letters::of(&snapshot.scene, &snapshot.world));
                app.replaced = None;
                app.thought = None;
                let known = app.now.as_ref().is_some_and(|now| now.instruction == snapshot.instruction);
                if !known {
                    app.editor.remember(&snapshot.instruction);
                }
            }
            app.names = Arc::new(classes::names(&snapshot.scene, &snapshot.world));
            app.trouble = None;
            app.policy = snapshot.policy;
            let from = app.now.as_ref().map(|now| now.scene.name.clone());
            app.now = Some(snapshot);
            app.page = 0;
            if new_episode {
                let name = app.now.as_ref().map(|now| now.scene.name.clone());
                let text = if from == name { "back at the start".into() } else { name.unwrap_or_default() };
                app.note(Tone::Note, text);
            }
            vec![Effect::Encode]
        }
        Report::Stepped(event) => {
            let action = if event.by_hand { format!("{} (you)", event.action) } else { event.action };
            let tone = if event.outcome.is_done() { Tone::Done } else { Tone::Impossible };
            app.write(Entry { step: Some(event.step), text: action, outcome: event.outcome.to_string(), tone });
            if let Some(subtask) = event.completed {
                let step = Some(event.step);
                app.write(Entry { step, text: format!("done: {subtask}"), outcome: String::new(), tone: Tone::Good });
            }
            vec![]
        }
        Report::Thought(decision, words) => {
            app.thought = Some((decision, words));
            if app.running { vec![] } else { vec![Effect::Encode] }
        }
        Report::Running(running) => {
            app.running = running;
            vec![Effect::Encode]
        }
        Report::Busy(busy) => {
            app.busy = busy;
            vec![]
        }
        Report::Instructed { old, new, note } => {
            app.editor.remember(&new);
            app.note(Tone::Note, format!("told: {new} ({note})"));
            app.replaced = (old != new).then_some(old);
            app.thought = None;
            vec![]
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
        Report::Failed(reason) => {
            app.busy = None;
            app.note(Tone::Bad, reason.clone());
            app.trouble = Some(reason);
            vec![]
        }
    }
}
