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
        (cells.width > 0 && cells.height > 0).then(|| Job {
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
        if self.log.back() == Some(&entry) {
            return;
        }
        if self.log.len() == LOG {
            self.log.pop_front();
        }
        self.log.push_back(entry);
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

#[cfg(test)]
mod tests {
    use crossterm::event::{KeyCode, KeyModifiers};

    use super::*;
    use crate::domain::ActionType;
    use crate::house::{Outcome, Reason};
    use crate::tui::engine::Event;
    use crate::tui::testing;

    fn app() -> App {
        testing::app(120, 36, Protocol::HalfBlocks, Ability::FULL)
    }

    fn press(app: &mut App, code: KeyCode) -> Vec<Effect> {
        update(app, Msg::Key(KeyEvent::new(code, KeyModifiers::NONE)))
    }

    fn type_text(app: &mut App, text: &str) {
        for c in text.chars() {
            assert_eq!(press(app, KeyCode::Char(c)), []);
        }
    }

    #[test]
    fn space_runs_and_pauses() {
        let mut app = app();
        assert_eq!(press(&mut app, KeyCode::Char(' ')), [Effect::Send(Command::Run(true))]);
        update(&mut app, Msg::Report(Report::Running(true)));
        assert_eq!(press(&mut app, KeyCode::Char(' ')), [Effect::Send(Command::Run(false))]);
    }

    #[test]
    fn an_instruction_is_typed_while_the_agent_runs_and_applies_on_enter() {
        let mut app = app();
        update(&mut app, Msg::Report(Report::Running(true)));
        press(&mut app, KeyCode::Char('i'));
        type_text(&mut app, "quit nothing, 1 mug");
        assert!(app.running, "typing does not stop the agent");
        assert_eq!(press(&mut app, KeyCode::Enter), [Effect::Send(Command::Instruct("quit nothing, 1 mug".into()))]);
        assert_eq!(app.mode, Mode::Watch);
    }

    #[test]
    fn escape_leaves_the_instruction_as_it_was() {
        let mut app = app();
        perform(&mut app, Verb::ToggleManual);
        press(&mut app, KeyCode::Char('/'));
        type_text(&mut app, "no");
        assert_eq!(press(&mut app, KeyCode::Esc), []);
        assert_eq!(app.mode, Mode::Manual, "typing goes back to where it came from");
        press(&mut app, KeyCode::Char('i'));
        assert_eq!(press(&mut app, KeyCode::Enter), [], "nothing typed changes nothing");
    }

    #[test]
    fn the_worker_says_what_an_instruction_replaced() {
        let mut app = app();
        let (old, new) = ("put the mug in the sink".to_string(), "open the fridge".to_string());
        update(&mut app, Msg::Report(Report::Instructed { old, new, note: "the task no longer applies" }));
        assert_eq!(app.replaced.as_deref(), Some("put the mug in the sink"));
        assert!(app.log.back().unwrap().text.contains("open the fridge (the task no longer applies)"));
        press(&mut app, KeyCode::Char('i'));
        press(&mut app, KeyCode::Up);
        press(&mut app, KeyCode::Up);
        assert_eq!(app.editor.text(), "put the mug in the sink", "the history begins with the task's words");
    }

    #[test]
    fn a_digit_does_the_interaction_of_that_number() {
        let mut app = app();
        let fridge = testing::instance(&app, "Fridge");
        let open = Action::interact(ActionType::Open, fridge);
        assert_eq!(press(&mut app, KeyCode::Char('3')), [Effect::Send(Command::Act(open))]);
        assert_eq!(press(&mut app, KeyCode::Char('4')), []);
        assert!(app.log.back().unwrap().text.contains("no interaction has the number 4"));
    }

    #[test]
    fn taking_over_stops_the_policy_and_arrows_move() {
        let mut app = app();
        update(&mut app, Msg::Report(Report::Running(true)));
        assert_eq!(press(&mut app, KeyCode::Char('m')), [Effect::Send(Command::Run(false))]);
        let ahead = Action::navigate(ActionType::MoveAhead);
        assert_eq!(press(&mut app, KeyCode::Up), [Effect::Send(Command::Act(ahead))]);
        assert_eq!(press(&mut app, KeyCode::Enter), [Effect::Send(Command::Step)], "the policy's choice");
    }

    #[test]
    fn outcomes_are_told_in_words() {
        let mut app = app();
        let event = Event {
            step: 1,
            action: "MoveAhead".into(),
            outcome: Outcome::Impossible(Reason::Blocked),
            by_hand: true,
            completed: None,
        };
        update(&mut app, Msg::Report(Report::Stepped(event)));
        let entry = app.log.back().unwrap();
        assert_eq!((entry.text.as_str(), entry.outcome.as_str()), ("MoveAhead (you)", "something is in the way"));
        assert_eq!(entry.tone, Tone::Impossible);
    }

    #[test]
    fn pictures_of_another_size_or_protocol_are_dropped() {
        let mut app = app();
        let stale = Picture::encode(&app.job().unwrap());
        update(&mut app, Msg::Resize(Size { width: 80, height: 24 }));
        update(&mut app, Msg::Picture(stale));
        assert!(app.picture.is_none());
        let stale = Picture::encode(&app.job().unwrap());
        assert!(perform(&mut app, Verb::Graphics).contains(&Effect::Repaint));
        update(&mut app, Msg::Picture(stale));
        assert!(app.picture.is_none());
    }

    #[test]
    fn numbers_are_in_the_picture_only_while_somebody_may_choose() {
        let mut app = app();
        let labels = app.job().unwrap().labels;
        assert_eq!(labels.iter().map(|label| label.text.as_str()).collect::<Vec<_>>(), ["2", "3", "1"]);
        assert!(labels[2].chosen, "what the policy is about to act on comes last, over the others");
        update(&mut app, Msg::Report(Report::Running(true)));
        assert!(app.job().unwrap().labels.is_empty());
    }

    #[test]
    fn a_screen_of_any_size_draws() {
        for (width, height) in [(1, 1), (10, 3), (79, 24), (80, 24), (97, 31), (200, 60), (300, 40), (80, 90)] {
            for protocol in Protocol::ALL {
                let mut app = testing::app(width, height, protocol, Ability::FULL);
                perform(&mut app, Verb::Help);
                testing::screen(&mut app);
            }
        }
    }
}
