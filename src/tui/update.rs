//! The one function that changes the explorer's state: a message in, effects out. No IO.

use crossterm::event::{KeyEvent, KeyEventKind};
use ratatui::layout::Size;

use super::app::{App, Tone};
use super::graphics::Picture;
use super::graphics::overlay::Overlay;
use super::hear::hear;
use super::keys::{self, Mode};
use super::policies::PolicyKind;
use super::verb::{self, Page, Verb};
use super::worker::{Command, Going, Pace, Report};
use crate::domain::Action;

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
    /// Put text on the terminal's clipboard.
    Copy(String),
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

/// Changes the state by one message.
pub fn update(app: &mut App, msg: Msg) -> Vec<Effect> {
    match msg {
        Msg::Key(key) if key.kind == KeyEventKind::Release => vec![],
        Msg::Key(key) => match own(app, key).or_else(|| keys::verb(app.mode, app.page, key)) {
            Some(verb) => perform(app, verb),
            None => {
                match app.mode {
                    Mode::Typing => app.editor.key(key),
                    Mode::Palette => {
                        app.palette.key(key);
                        app.selected = 0;
                    }
                    Mode::Watch | Mode::Manual | Mode::Help => {}
                }
                vec![]
            }
        },
        Msg::Paste(text) => {
            if app.mode == Mode::Palette {
                app.palette.paste(&text);
                return vec![];
            }
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
            app.page_of_interactions = 0;
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

/// What a key means by the person's own settings, while keys are no text.
fn own(app: &App, key: KeyEvent) -> Option<Verb> {
    matches!(app.mode, Mode::Watch | Mode::Manual).then(|| app.config.verb(key)).flatten()
}

fn send(command: Command) -> Vec<Effect> {
    vec![Effect::Send(command)]
}

/// Does what a person asked for.
pub fn perform(app: &mut App, verb: Verb) -> Vec<Effect> {
    match verb {
        Verb::ToggleRun | Verb::Continue => go_on(app, verb == Verb::Continue),
        Verb::Step(count) => (0..count.max(1)).map(|_| Effect::Send(Command::Step)).collect(),
        Verb::Faster => pace(app, app.pace.faster()),
        Verb::Slower => pace(app, app.pace.slower()),
        Verb::Reset => send(Command::Reset),
        Verb::Next => send(Command::Next),
        Verb::Seed(seed) => send(Command::Seed(seed)),
        Verb::Policy(kind) => choose(app, kind),
        Verb::NextPolicy => choose(app, app.policy.next()),
        Verb::Checkpoint(wanted) => send(Command::Checkpoint(wanted)),
        Verb::Sample(seed) => send(Command::Reseed(seed, true)),
        Verb::Greedy => send(Command::Reseed(app.now.as_ref().map_or(0, |now| now.seed), false)),
        Verb::Navigate(kind) => send(Command::Act(Action::navigate(kind))),
        Verb::Interact(number) => {
            let candidate = app.page_of_candidates().get(usize::from(number).wrapping_sub(1)).copied();
            match candidate {
                Some(candidate) => send(Command::Act(candidate.action())),
                None => {
                    app.note(Tone::Note, format!("no interaction has the number {number} now"));
                    vec![]
                }
            }
        }
        Verb::Page => {
            app.page_of_interactions = (app.page_of_interactions + 1) % app.pages().max(1);
            vec![Effect::Encode]
        }
        Verb::ToggleManual => {
            app.mode = if app.mode == Mode::Manual { Mode::Watch } else { Mode::Manual };
            app.page = Page::Main;
            if app.going.is_some() { send(Command::Go(None)) } else { vec![] }
        }
        Verb::Instruct(text) => send(Command::Instruct(text)),
        Verb::Back(_)
        | Verb::Forward(_)
        | Verb::Seek(_)
        | Verb::Last
        | Verb::NextEvent
        | Verb::LastEvent
        | Verb::Subtask(_) => travel(app, &verb),
        Verb::NextBranch => {
            let Some(time) = app.now.as_ref().map(|now| now.time.clone()) else { return vec![] };
            send(Command::Switch(((time.branch + 1) % time.branches.len().max(1) + 1).to_string()))
        }
        Verb::Branch(wanted) => send(Command::Switch(wanted)),
        Verb::Name(name) => send(Command::Rename(name)),
        Verb::Diverge(wanted) => {
            let mut effects = turn_to(app, Page::Branches);
            effects.push(Effect::Send(Command::Diverge(wanted)));
            effects
        }
        Verb::Break(condition) => {
            match condition {
                None => app.breaks.clear(),
                Some(condition) if app.breaks.contains(&condition) => app.breaks.retain(|known| *known != condition),
                Some(condition) => app.breaks.push(condition),
            }
            let all: Vec<String> = app.breaks.iter().map(ToString::to_string).collect();
            let text =
                if all.is_empty() { "runs stop nowhere".into() } else { format!("runs stop at: {}", all.join("; ")) };
            app.note(Tone::Note, text);
            send(Command::Break(app.breaks.clone()))
        }
        Verb::Until(condition) => send(Command::Until(condition)),
        Verb::Show(page) => show(app, page),
        Verb::Select(by) => select(app, by),
        Verb::Take => match app.page {
            Page::Branches => send(Command::Switch((app.selected + 1).to_string())),
            _ => vec![],
        },
        Verb::Graphics => {
            app.graphics.protocol = app.graphics.protocol.next();
            app.graphics.reason = "chosen by key g".into();
            app.picture = None;
            vec![Effect::Encode, Effect::Repaint]
        }
        Verb::Overlay => {
            app.overlay = app.overlay.next();
            vec![Effect::Send(Command::LookBack(app.overlay == Overlay::Frames)), Effect::Encode]
        }
        Verb::Sort => {
            app.sort = app.sort.next();
            vec![]
        }
        Verb::Labels => {
            app.labels = !app.labels;
            vec![Effect::Encode]
        }
        Verb::Edit => {
            open_line(app, Mode::Typing);
            app.editor.open("");
            uncover(app)
        }
        Verb::Palette(text) => {
            open_line(app, Mode::Palette);
            app.selected = 0;
            app.palette.open(text);
            uncover(app)
        }
        Verb::Help => {
            open_line(app, Mode::Help);
            uncover(app)
        }
        Verb::Cancel => {
            app.mode = app.under;
            uncover(app)
        }
        Verb::Apply if app.mode == Mode::Palette => obey_line(app),
        Verb::Apply => {
            app.mode = app.under;
            let text = app.editor.text().trim().to_string();
            if text.is_empty() {
                return vec![];
            }
            send(Command::Instruct(text))
        }
        Verb::Earlier | Verb::Later if app.mode == Mode::Palette => {
            let by = if verb == Verb::Later { 1 } else { -1 };
            let most = verb::matching(app.palette.text()).len().saturating_sub(1);
            app.selected = app.selected.saturating_add_signed(by).min(most);
            vec![]
        }
        Verb::Earlier => {
            app.editor.travel(-1);
            vec![]
        }
        Verb::Later => {
            app.editor.travel(1);
            vec![]
        }
        Verb::Complete => {
            complete(app);
            vec![]
        }
        Verb::Branches => show(app, Page::Branches),
        Verb::Think => show(app, Page::Mind),
        Verb::Look | Verb::Candidates => show(app, Page::World),
        Verb::Quit => vec![Effect::Quit(Farewell::Asked)],
        Verb::Save(path) => send(Command::Save(path)),
        Verb::SaveTask(path) => send(Command::SaveTask(path)),
        Verb::Export(path) => send(Command::Export(path)),
        Verb::Compare(text) => {
            let mut effects = turn_to(app, Page::Compare);
            effects.push(Effect::Send(Command::Compare(text)));
            effects
        }
        Verb::Swap => match app.contrast.take() {
            Some(contrast) => {
                let [own, other] = contrast.sides.map(|side| side.instruction);
                vec![Effect::Send(Command::Instruct(other)), Effect::Send(Command::Compare(own))]
            }
            None => {
                app.note(Tone::Note, "there is nothing to swap: compare TEXT first");
                vec![]
            }
        },
        Verb::ValueMap if app.landscape.take().is_some() => send(Command::Stop),
        Verb::ValueMap => send(Command::Survey),
        Verb::Chain(text) => {
            let mut effects = turn_to(app, Page::Chain);
            effects.push(Effect::Send(Command::Chain(text)));
            effects
        }
        Verb::WhichLink(times) => {
            let mut effects = turn_to(app, Page::Chain);
            effects.push(Effect::Send(Command::WhichLink(times)));
            effects
        }
        Verb::Stop => send(Command::Stop),
        Verb::Bandwidth(kilobytes) => {
            app.bandwidth = (kilobytes > 0).then(|| 1000 * u64::from(kilobytes));
            app.coarseness = 0;
            vec![Effect::Encode]
        }
        Verb::FullFrame => {
            app.coarseness = 0;
            vec![Effect::Encode]
        }
        Verb::Copy => {
            let Some(now) = &app.now else { return vec![] };
            let last = app.log.iter().rev().find(|entry| entry.step == Some(now.step) && !entry.outcome.is_empty());
            let last = last.map_or(String::new(), |entry| format!(": {} · {}", entry.text, entry.outcome));
            let text = format!("{} | {} step {}{last}", now.instruction, now.scene.name, now.step);
            app.note(Tone::Note, "copied");
            vec![Effect::Copy(text)]
        }
    }
}

/// Opens a line or list over the screen; what keys meant before comes back when it closes.
fn open_line(app: &mut App, mode: Mode) {
    if matches!(app.mode, Mode::Watch | Mode::Manual) {
        app.under = app.mode;
    }
    app.mode = mode;
}

/// A picture that floats over the cells has to be drawn anew when something covers or uncovers it.
fn uncover(app: &App) -> Vec<Effect> {
    if app.graphics.protocol.floats() { vec![Effect::Repaint] } else { vec![] }
}

fn go_on(app: &mut App, by_policy: bool) -> Vec<Effect> {
    if app.going.is_some() && !by_policy {
        return send(Command::Go(None));
    }
    if app.mode == Mode::Manual {
        app.mode = Mode::Watch;
    }
    let in_the_past = app.now.as_ref().is_some_and(|now| (now.time.at as usize) < now.time.beats.len());
    send(Command::Go(Some(if in_the_past && !by_policy { Going::Replay } else { Going::Policy })))
}

/// Along the branch in hand. At its end a step forward is the policy's.
fn travel(app: &mut App, verb: &Verb) -> Vec<Effect> {
    let Some(time) = app.now.as_ref().map(|now| now.time.clone()) else { return vec![] };
    let last = time.beats.len() as u32;
    let step = match verb {
        Verb::Back(steps) => time.at.saturating_sub(*steps),
        Verb::Forward(_) if time.at == last => return send(Command::Step),
        Verb::Forward(steps) => time.at.saturating_add(*steps).min(last),
        Verb::Seek(step) => *step,
        Verb::NextEvent => time.event(true),
        Verb::LastEvent => time.event(false),
        Verb::Subtask(number) => match time.subtask(*number) {
            Some(step) => step,
            None => {
                app.note(Tone::Note, format!("subtask {number} is not done on this branch"));
                return vec![];
            }
        },
        _ => last,
    };
    send(Command::Seek(step))
}

/// Shows a page. Everything is drawn anew: pictures lie over the cells that change.
pub fn turn_to(app: &mut App, page: Page) -> Vec<Effect> {
    if app.page == page {
        return vec![];
    }
    app.page = page;
    app.selected = 0;
    if matches!(app.mode, Mode::Manual) && page != Page::Main {
        app.mode = Mode::Watch;
    }
    app.picture = None;
    vec![Effect::Encode, Effect::Repaint]
}

fn show(app: &mut App, page: Page) -> Vec<Effect> {
    let page = if app.page == page { Page::Main } else { page };
    let mut effects = turn_to(app, page);
    if app.page == Page::Branches {
        let branch = app.now.as_ref().map_or(0, |now| now.time.branch);
        app.selected = branch;
        app.divergence = None;
        // The branch that this one left is what one wants to see it beside.
        let other = app.now.as_ref().and_then(|now| now.time.branches.get(branch)?.left);
        effects.extend(other.map(|(other, _)| Effect::Send(Command::Diverge((other + 1).to_string()))));
    }
    effects
}

fn select(app: &mut App, by: i8) -> Vec<Effect> {
    let rows = app.rows();
    app.selected = app.selected.saturating_add_signed(isize::from(by)).min(rows.saturating_sub(1));
    match app.page {
        Page::Branches => send(Command::Diverge((app.selected + 1).to_string())),
        _ => vec![],
    }
}

/// Does what was typed in the palette, or fills in the verb that is selected there.
fn obey_line(app: &mut App) -> Vec<Effect> {
    let line = app.palette.text().trim().to_string();
    match verb::parse(&line) {
        Ok(verb) => {
            app.mode = app.under;
            app.palette.remember(&line);
            let mut effects = uncover(app);
            effects.extend(perform(app, verb));
            effects
        }
        Err(complaint) => {
            match verb::matching(&line).get(app.selected) {
                Some(said) if !line.contains(' ') && said.name != line => {
                    app.palette.open(said.name);
                    if said.arguments.is_empty() {
                        return obey_line(app);
                    }
                    app.palette.open(&format!("{} ", said.name));
                }
                _ => app.note(Tone::Bad, complaint),
            }
            vec![]
        }
    }
}

/// Fills in what the typed text begins.
fn complete(app: &mut App) {
    match app.mode {
        Mode::Palette => {
            if let Some(said) = verb::matching(app.palette.text()).get(app.selected) {
                app.palette.open(&format!("{} ", said.name));
            }
        }
        _ => {
            if let Some(whole) = app.completions().first() {
                app.editor.open(whole);
            }
        }
    }
}

fn pace(app: &mut App, pace: Pace) -> Vec<Effect> {
    app.pace = pace;
    send(Command::Pace(pace))
}

fn choose(app: &mut App, kind: PolicyKind) -> Vec<Effect> {
    app.policy = kind;
    app.thought = None;
    app.trouble = None;
    send(Command::Choose(kind))
}

#[cfg(test)]
mod tests {
    use crossterm::event::{KeyCode, KeyModifiers};

    use super::*;
    use crate::domain::ActionType;
    use crate::house::{Outcome, Reason};
    use crate::tui::engine::Event;
    use crate::tui::graphics::Protocol;
    use crate::tui::testing;
    use crate::tui::theme::Ability;

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
        assert_eq!(press(&mut app, KeyCode::Char(' ')), [Effect::Send(Command::Go(Some(Going::Policy)))]);
        update(&mut app, Msg::Report(Report::Going(Some(Going::Policy))));
        assert_eq!(press(&mut app, KeyCode::Char(' ')), [Effect::Send(Command::Go(None))]);
    }

    #[test]
    fn an_instruction_is_typed_while_the_agent_runs_and_applies_on_enter() {
        let mut app = app();
        update(&mut app, Msg::Report(Report::Going(Some(Going::Policy))));
        press(&mut app, KeyCode::Char('i'));
        type_text(&mut app, "quit nothing, 1 mug");
        assert!(app.going.is_some(), "typing does not stop the agent");
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
        update(&mut app, Msg::Report(Report::Going(Some(Going::Policy))));
        assert_eq!(press(&mut app, KeyCode::Char('m')), [Effect::Send(Command::Go(None))]);
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
            forked: None,
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
        update(&mut app, Msg::Report(Report::Going(Some(Going::Policy))));
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
