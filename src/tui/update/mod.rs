//! The one function that changes the explorer's state: a message in, effects out. No IO.

mod effect;
mod lines;
mod on_action;
mod on_event;
mod pages;
mod pointer;

pub(crate) use effect::{Effect, ExitReason};
pub(crate) use on_action::on_action;

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers, MouseEvent};
use ratatui::layout::Size;

use crate::explore::session::{SessionCommand, SessionEvent};
use crate::explore::verb::Verb;
use crate::tui::app::App;
use crate::tui::graphics::Picture;
use crate::tui::keys;
use crate::tui::keys::Mode;
use crate::tui::log::Tone;
use crate::tui::remote::RemoteEvent;
use on_event::on_event;

/// Something that happened.
// Nearly all messages of a session are its events: a box for each would only cost.
#[allow(clippy::large_enum_variant)]
#[derive(Clone)]
pub enum Msg {
    /// A key was pressed.
    Key(KeyEvent),
    /// The mouse was used.
    Mouse(MouseEvent),
    /// Text was pasted.
    Paste(String),
    /// The terminal has another size.
    Resize(Size),
    /// The session tells something.
    Session(SessionEvent),
    /// A frame was encoded.
    Picture(Picture),
    /// The terminal has taken in all that was written.
    Ready,
    /// A signal asks the program to stop for a while.
    StopAsked,
    /// The program goes on after it was stopped.
    Continued,
    /// A signal asks the program to end.
    Signal(i32),
    /// The worker stopped.
    WorkerGone,
    /// An exploration of an environment with actions of its own tells something.
    Remote(Box<RemoteEvent>),
}

/// Changes the state by one message.
pub(crate) fn update(app: &mut App, msg: Msg) -> Vec<Effect> {
    match msg {
        Msg::Key(key) if key.kind == KeyEventKind::Release => vec![],
        // Over a slow link an Esc and the key after it come together, as Alt and that key. Nothing has such a key, unless a person
        // set one.
        Msg::Key(key) if is_escape_and_key(app, key) => {
            let plain = KeyEvent { modifiers: key.modifiers.difference(KeyModifiers::ALT), ..key };
            let mut effects = update(app, Msg::Key(KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE)));
            effects.extend(update(app, Msg::Key(plain)));
            effects
        }
        Msg::Mouse(event) => pointer::on_pointer(app, event),
        Msg::Key(key) => match key_after_notice(app, key).or_else(|| keys::verb(app.input.mode, app.page, key)) {
            // What cannot be seen is not begun.
            Some(verb)
                if app.layout().is_none()
                    && !matches!(verb, Verb::Quit | Verb::List | Verb::Suspend | Verb::Cancel) =>
            {
                vec![]
            }
            Some(verb) => on_action(app, verb),
            None => {
                match app.input.mode {
                    Mode::Typing => app.input.editor.key(key),
                    Mode::Palette => {
                        app.input.palette.key(key);
                        app.input.selected_verb = 0;
                    }
                    Mode::Watch | Mode::Manual | Mode::Help | Mode::WishList => {}
                }
                vec![]
            }
        },
        Msg::Paste(text) => {
            if app.input.mode == Mode::Palette {
                app.input.palette.paste(&text);
                return vec![];
            }
            let mut effects = vec![];
            if app.input.mode != Mode::Typing {
                effects = on_action(app, Verb::Edit);
                app.input.editor.open("");
            }
            app.input.editor.paste(&text);
            effects
        }
        Msg::Resize(size) => {
            app.terminal.size = size;
            app.frame.picture = None;
            app.main.interactions = 0;
            app.input.editor.refit();
            app.input.palette.refit();
            let mut effects = vec![Effect::Encode, Effect::Repaint];
            if app.layout().is_none() && app.session.run_mode.is_some() {
                app.note(Tone::Note, "paused: the screen was too small to see anything");
                effects.push(Effect::Send(SessionCommand::Pause));
            }
            effects
        }
        Msg::Session(event) => on_event(app, event),
        Msg::Picture(picture) if app.traffic.refuses(&picture) => vec![Effect::Encode],
        Msg::Picture(picture) => {
            let fits = app.picture_area().is_some_and(|area| area.as_size() == picture.cells);
            let spared =
                app.session.run_mode.is_some() && !app.traffic.affords_picture() && app.frame.picture.is_some();
            if fits && !spared && picture.protocol == app.terminal.graphics.protocol {
                if app.traffic.take_in(&picture) {
                    app.note(
                        Tone::Note,
                        "the link is too slow for such pictures: block characters; F shows one in full",
                    );
                }
                app.frame.picture = Some(picture);
            }
            vec![]
        }
        Msg::Ready => vec![],
        Msg::StopAsked => vec![Effect::Stop],
        Msg::Continued => {
            app.frame.picture = None;
            vec![Effect::GoOn, Effect::Encode]
        }
        Msg::Signal(number) => vec![Effect::Quit(ExitReason::Signal(number))],
        Msg::WorkerGone => vec![Effect::Quit(ExitReason::WorkerGone)],
        // It has a screen of its own.
        Msg::Remote(_) => vec![],
    }
}

/// Whether a key with Alt is an Esc and that key; where text is typed, Alt moves by words.
fn is_escape_and_key(app: &App, key: KeyEvent) -> bool {
    let is_text = matches!(app.input.mode, Mode::Typing | Mode::Palette);
    key.modifiers.contains(KeyModifiers::ALT)
        && matches!(key.code, KeyCode::Char(_))
        && !is_text
        && key_by_settings(app, key).is_none()
}

/// Whoever presses a key knows what keys are for, and has read what was noted.
fn key_after_notice(app: &mut App, key: KeyEvent) -> Option<Verb> {
    app.input.newcomer = false;
    app.notice = None;
    app.input.confirms = app.input.asked.take();
    app.input.complaint = None;
    key_by_settings(app, key)
}

/// What a key means by the person's own settings, while keys are no text.
fn key_by_settings(app: &App, key: KeyEvent) -> Option<Verb> {
    matches!(app.input.mode, Mode::Watch | Mode::Manual).then(|| app.config.verb(key)).flatten()
}

#[cfg(test)]
mod tests {
    use super::pages::turn_to;
    use super::*;
    use crate::domain::{Action, ActionType};
    use crate::explore::exploration::StepTaken;
    use crate::explore::session::RunMode;
    use crate::explore::timeline::ActionLine;
    use crate::explore::verb::ExplorerPage;
    use crate::house::Outcome;
    use crate::house::outcome::Reason;
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
        assert_eq!(
            press(&mut app, KeyCode::Char(' ')),
            [Effect::Send(SessionCommand::Run { mode: RunMode::Policy, until: None })]
        );
        update(&mut app, Msg::Session(SessionEvent::Running(Some(RunMode::Policy))));
        assert_eq!(press(&mut app, KeyCode::Char(' ')), [Effect::Send(SessionCommand::Pause)]);
    }

    #[test]
    fn an_instruction_is_typed_while_the_agent_runs_and_applies_on_enter() {
        let mut app = app();
        update(&mut app, Msg::Session(SessionEvent::Running(Some(RunMode::Policy))));
        press(&mut app, KeyCode::Char('i'));
        type_text(&mut app, "quit nothing, 1 mug");
        assert!(app.session.run_mode.is_some(), "typing does not stop the agent");
        assert_eq!(
            press(&mut app, KeyCode::Enter),
            [Effect::Send(SessionCommand::Instruct("quit nothing, 1 mug".into()))]
        );
        assert_eq!(app.input.mode, Mode::Watch);
    }

    #[test]
    fn what_is_wrong_with_a_verb_is_said_under_its_line_until_the_next_key() {
        let mut app = testing::app(80, 24, Protocol::HalfBlocks, Ability::FULL);
        press(&mut app, KeyCode::Char(':'));
        type_text(&mut app, "seek soon");
        assert_eq!(press(&mut app, KeyCode::Enter), []);
        let text = testing::screen(&mut app);
        assert!(text.contains("seek: \"soon\" is not a number"), "{text}");
        press(&mut app, KeyCode::Backspace);
        assert!(!testing::screen(&mut app).contains("is not a number"));
        app.input.palette.open("break");
        assert_eq!(press(&mut app, KeyCode::Enter), [Effect::Send(SessionCommand::Breakpoints)]);
    }

    #[test]
    fn actions_are_listed_and_one_can_be_gone_to() {
        let mut app = app();
        assert!(press(&mut app, KeyCode::Char('L')).contains(&Effect::Send(SessionCommand::Actions)));
        let line = |words: &str, done| ActionLine {
            words: words.into(),
            told: "Dance.".into(),
            by: "first".into(),
            done,
            completed: false,
        };
        let lines = vec![line("MoveAhead", true), line("Pickup Mug · too far", false)];
        update(&mut app, Msg::Session(SessionEvent::Actions(lines)));
        let text = testing::screen(&mut app);
        assert!(text.contains("1 MoveAhead") && text.contains("2 Pickup Mug · too far"), "{text}");
        assert!(text.contains("by first  instruction: Dance."), "{text}");
        press(&mut app, KeyCode::Char('j'));
        assert_eq!(press(&mut app, KeyCode::Enter), [Effect::Send(SessionCommand::Seek(2))]);
    }

    #[test]
    fn every_term_is_one_key_away_and_own_keys_are_among_the_keys() {
        for (width, height) in [(60, 20), (80, 24), (200, 60)] {
            let mut app = testing::app(width, height, Protocol::HalfBlocks, Ability::FULL);
            app.config =
                crate::tui::config::ExplorerConfig::parse("format_version = 1\n[keys]\nctrl-r = \"policy random\"\n")
                    .unwrap();
            press(&mut app, KeyCode::Char('G'));
            let mut seen = String::new();
            for _ in 0..12 {
                seen.push_str(&testing::screen(&mut app));
                press(&mut app, KeyCode::Tab);
            }
            for term in ["V", "entropy", "min Q", "advantage", "masked", "eq. 4", "eq. 5", "policy random (your own)"] {
                assert!(seen.contains(term), "{width}x{height}: no {term}:\n{seen}");
            }
            assert!(seen.contains("to the start, to the end"), "and all keys, however small the screen");
            press(&mut app, KeyCode::Esc);
            assert_eq!(app.input.mode, Mode::Watch);
        }
    }

    #[test]
    fn an_escape_that_comes_together_with_the_next_key_is_both() {
        let mut app = app();
        press(&mut app, KeyCode::Char('t'));
        assert_eq!(app.page, ExplorerPage::Branches);
        update(&mut app, Msg::Key(KeyEvent::new(KeyCode::Char('?'), KeyModifiers::ALT)));
        assert_eq!((app.page, app.input.mode), (ExplorerPage::Main, Mode::Help));
        press(&mut app, KeyCode::Esc);
        press(&mut app, KeyCode::Char('i'));
        type_text(&mut app, "one two");
        update(&mut app, Msg::Key(KeyEvent::new(KeyCode::Char('b'), KeyModifiers::ALT)));
        assert_eq!((app.input.mode, app.input.editor.text()), (Mode::Typing, "one two"), "a word back");
    }

    #[test]
    fn escape_leaves_the_instruction_as_it_was() {
        let mut app = app();
        on_action(&mut app, Verb::ToggleManual);
        press(&mut app, KeyCode::Char('/'));
        type_text(&mut app, "no");
        assert_eq!(press(&mut app, KeyCode::Esc), []);
        assert_eq!(app.input.mode, Mode::Manual, "typing goes back to where it came from");
        press(&mut app, KeyCode::Char('i'));
        assert_eq!(press(&mut app, KeyCode::Enter), [], "nothing typed changes nothing");
    }

    #[test]
    fn the_worker_says_what_an_instruction_replaced() {
        let mut app = app();
        let (old, new) = ("put the mug in the sink".to_string(), "open the fridge".to_string());
        update(&mut app, Msg::Session(SessionEvent::Instructed { old, new, note: "the task no longer applies" }));
        assert_eq!(app.session.replaced.as_deref(), Some("put the mug in the sink"));
        assert!(app.log.entries().next_back().unwrap().text.contains("open the fridge (the task no longer applies)"));
        press(&mut app, KeyCode::Char('i'));
        press(&mut app, KeyCode::Up);
        press(&mut app, KeyCode::Up);
        assert_eq!(app.input.editor.text(), "put the mug in the sink", "the history begins with the task's words");
    }

    #[test]
    fn a_digit_does_the_interaction_of_that_number() {
        let mut app = app();
        let fridge = testing::instance(&app, "Fridge");
        let open = Action::interact(ActionType::Open, fridge);
        assert_eq!(press(&mut app, KeyCode::Char('3')), [Effect::Send(SessionCommand::Act(open))]);
        assert_eq!(press(&mut app, KeyCode::Char('4')), []);
        assert!(app.log.entries().next_back().unwrap().text.contains("no interaction has the number 4"));
    }

    #[test]
    fn taking_over_stops_the_policy_and_arrows_move() {
        let mut app = app();
        update(&mut app, Msg::Session(SessionEvent::Running(Some(RunMode::Policy))));
        assert_eq!(press(&mut app, KeyCode::Char('m')), [Effect::Send(SessionCommand::Pause)]);
        let ahead = Action::navigate(ActionType::MoveAhead);
        assert_eq!(press(&mut app, KeyCode::Up), [Effect::Send(SessionCommand::Act(ahead))]);
        assert_eq!(press(&mut app, KeyCode::Enter), [Effect::Send(SessionCommand::Step)], "the policy's choice");
    }

    #[test]
    fn outcomes_are_told_in_words() {
        let mut app = app();
        let step = StepTaken {
            step: 1,
            action: "MoveAhead".into(),
            outcome: Outcome::Impossible(Reason::Blocked),
            by_hand: true,
            completed: None,
            forked: None,
            distribution: None,
            progress: None,
            end: None,
        };
        update(&mut app, Msg::Session(SessionEvent::Stepped(Box::new(step))));
        let entry = app.log.entries().next_back().unwrap();
        assert_eq!((entry.text.as_str(), entry.outcome.as_str()), ("MoveAhead (you)", "something is in the way"));
        assert_eq!(entry.tone, Tone::Impossible);
    }

    #[test]
    fn pictures_of_another_size_or_protocol_are_dropped() {
        let mut app = app();
        let stale = Picture::encode(&app.job().unwrap());
        update(&mut app, Msg::Resize(Size { width: 80, height: 24 }));
        update(&mut app, Msg::Picture(stale));
        assert!(app.frame.picture.is_none());
        let stale = Picture::encode(&app.job().unwrap());
        assert!(on_action(&mut app, Verb::Graphics).contains(&Effect::Repaint));
        update(&mut app, Msg::Picture(stale));
        assert!(app.frame.picture.is_none());
    }

    #[test]
    fn numbers_are_in_the_picture_only_while_somebody_may_choose() {
        let mut app = app();
        let labels = app.job().unwrap().labels;
        assert_eq!(labels.iter().map(|label| label.text.as_str()).collect::<Vec<_>>(), ["2", "3", "1"]);
        assert!(labels[2].chosen, "what the policy is about to act on comes last, over the others");
        update(&mut app, Msg::Session(SessionEvent::Running(Some(RunMode::Policy))));
        assert!(app.job().unwrap().labels.is_empty());
    }

    #[test]
    fn a_screen_of_any_size_draws() {
        let sizes = [(1, 1), (10, 3), (24, 9), (40, 23), (60, 20), (79, 24), (80, 23), (80, 24), (97, 31), (200, 20)];
        for (width, height) in sizes.into_iter().chain([(200, 60), (300, 40), (80, 90)]) {
            let all = Protocol::ALL.map(|protocol| (protocol, ExplorerPage::Main));
            // What is large enough for one page is so for all.
            let small = u32::from(width) * u32::from(height) <= 80 * 24;
            let pages = ExplorerPage::ALL.into_iter().filter(|_| small).map(|page| (Protocol::HalfBlocks, page));
            for (protocol, page) in all.into_iter().chain(pages) {
                let mut app = testing::app(width, height, protocol, Ability::FULL);
                turn_to(&mut app, page);
                testing::screen(&mut app);
                for verb in [Verb::Help, Verb::Terms, Verb::Edit, Verb::Palette(String::new()), Verb::ToggleManual] {
                    on_action(&mut app, verb);
                    testing::screen(&mut app);
                    on_action(&mut app, Verb::Cancel);
                }
            }
        }
    }

    #[test]
    fn nothing_goes_on_or_begins_on_a_screen_that_shows_nothing() {
        let mut app = app();
        update(&mut app, Msg::Session(SessionEvent::Running(Some(RunMode::Policy))));
        let small = Msg::Resize(Size { width: 20, height: 5 });
        assert!(update(&mut app, small).contains(&Effect::Send(SessionCommand::Pause)));
        update(&mut app, Msg::Session(SessionEvent::Running(None)));
        for code in [KeyCode::Char(' '), KeyCode::Char('n'), KeyCode::Char('1')] {
            assert_eq!(press(&mut app, code), []);
        }
        assert_eq!(press(&mut app, KeyCode::Char('q')), [Effect::Quit(ExitReason::Asked)]);
    }

    #[test]
    fn a_terminal_that_has_changed_its_size_before_its_message_came_is_not_drawn_to() {
        let app = app();
        for (width, height) in [(80, 24), (60, 50), (200, 60)] {
            let mut terminal = ratatui::Terminal::new(ratatui::backend::TestBackend::new(width, height)).unwrap();
            terminal.draw(|frame| frame.render_widget(&app, frame.area())).unwrap();
        }
    }
}
