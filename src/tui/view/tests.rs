//! What the screens look like: pictures of them in text, kept and compared.

use std::sync::Arc;

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use termprofile::TermProfile;

use super::panel::{bar, fit, share, wrap};
use crate::agent::registry::PolicyKind;
use crate::analysis::value_map::{CellValue, Measure, ValueMap};
use crate::domain::{Action, ActionType};
use crate::explore::exploration::{Exploration, StepTaken};
use crate::explore::session::{SessionCommand, SessionEvent};
use crate::explore::verb::{ExplorerPage, Verb};
use crate::tui::app::App;
use crate::tui::graphics::Protocol;
use crate::tui::keys::{Mode, bindings_in_force};
use crate::tui::testing::{app, chained, decided, exploration, screen, snapshot, values};
use crate::tui::theme::Ability;
use crate::tui::update::{Effect, ExitReason, Msg, on_action, update};

/// The smallest screen, and a large one.
pub(super) const SIZES: [(u16, u16); 2] = [(80, 24), (120, 36)];
/// Every page but the main one.
const PAGES: [ExplorerPage; 5] =
    [ExplorerPage::Branches, ExplorerPage::Mind, ExplorerPage::World, ExplorerPage::Compare, ExplorerPage::Chain];

pub(super) fn check(name: &str, text: &str) {
    insta::with_settings!({ snapshot_path => "../snapshots", prepend_module_to_snapshot => false }, {
        insta::assert_snapshot!(name, text);
    });
}

#[test]
fn watching_at_80_by_24_and_120_by_36() {
    for (name, width, height) in [("watch-80x24", 80, 24), ("watch-120x36", 120, 36)] {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        for (number, action) in [(1, "RotateLeft"), (2, "MoveAhead")] {
            let step = StepTaken {
                step: number,
                action: action.into(),
                outcome: crate::house::Outcome::Done,
                by_hand: number == 2,
                completed: None,
                forked: None,
                distribution: None,
                progress: None,
                end: None,
            };
            update(&mut app, Msg::Session(SessionEvent::Stepped(Box::new(step))));
        }
        check(name, &screen(&mut app));
    }
}

#[test]
fn typing_shows_what_the_agent_is_told_now() {
    for (width, height) in SIZES {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        on_action(&mut app, Verb::Edit);
        check(&format!("examples-{width}x{height}"), &screen(&mut app));
        update(&mut app, Msg::Paste("pick up the p".into()));
        check(&format!("typing-{width}x{height}"), &screen(&mut app));
    }
}

#[test]
fn another_instruction_ends_the_task_and_the_expert_says_so() {
    for (width, height) in SIZES {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        let mut exploration = exploration();
        let note = exploration.instruct("open the fridge").unwrap();
        let (old, new) = ("put the mug in the sink".to_string(), "open the fridge".to_string());
        update(&mut app, Msg::Session(SessionEvent::Instructed { old, new, note }));
        update(&mut app, Msg::Session(SessionEvent::State(Box::new(snapshot(&mut exploration)))));
        update(&mut app, Msg::Session(SessionEvent::Failed("the expert needs a task".into())));
        check(&format!("no-task-{width}x{height}"), &screen(&mut app));
    }
}

#[test]
fn a_wish_is_shown_from_how_it_is_understood_to_what_came_of_it() {
    let shown = |name: &str, exploration: &mut Exploration| {
        let mut app = app(80, 24, Protocol::HalfBlocks, Ability::FULL);
        update(&mut app, Msg::Session(SessionEvent::State(Box::new(snapshot(exploration)))));
        check(&format!("wish-{name}-80x24"), &screen(&mut app));
        app
    };
    let mut exploration = exploration();
    exploration.choose(PolicyKind::Expert).unwrap();
    exploration.instruct("pick up the mug").unwrap();
    shown("read", &mut exploration);
    while exploration.end().is_none() {
        exploration.step().unwrap();
    }
    shown("done", &mut exploration);
    exploration.instruct("grab a knife").unwrap();
    shown("ambiguous", &mut exploration);
    exploration.act(Action::navigate(ActionType::LookUp)).unwrap();
    exploration.say(false).unwrap();
    shown("failed", &mut exploration);
    exploration.instruct("pick up the baseball bat").unwrap();
    let mut app = shown("refused", &mut exploration);
    on_action(&mut app, Verb::Show(ExplorerPage::Branches));
    check("wish-list-80x24", &screen(&mut app));
}

#[test]
fn wishes_for_this_house_are_listed_and_one_is_put_on_the_line() {
    let mut app = app(80, 24, Protocol::HalfBlocks, Ability::FULL);
    let press = |app: &mut App, code: KeyCode| update(app, Msg::Key(code.into()));
    assert_eq!(press(&mut app, KeyCode::Char('w')), [Effect::Send(SessionCommand::Examples)]);
    let wishes = ["Pick up the mug.", "Put the plate in the sink.", "Open the fridge."].map(str::to_string).to_vec();
    update(&mut app, Msg::Session(SessionEvent::Examples(wishes.clone())));
    press(&mut app, KeyCode::Char('j'));
    check("wishes-80x24", &screen(&mut app));
    press(&mut app, KeyCode::Enter);
    assert_eq!(app.input.editor.text(), "Put the plate in the sink.");
    let told = Effect::Send(SessionCommand::Instruct("Put the plate in the sink.".into()));
    assert_eq!(press(&mut app, KeyCode::Enter), [told]);
    press(&mut app, KeyCode::Char('i'));
    update(&mut app, Msg::Session(SessionEvent::Examples(wishes)));
    assert_eq!(app.input.mode, Mode::Typing, "whoever types meanwhile is not disturbed");
}

#[test]
fn what_is_not_saved_is_asked_about_before_it_is_left() {
    let mut app = app(80, 24, Protocol::HalfBlocks, Ability::FULL);
    let quit = [Effect::Quit(ExitReason::Asked)];
    assert_eq!(on_action(&mut app, Verb::Quit), quit, "nothing would be lost");
    let mut exploration = exploration();
    exploration.instruct("open the fridge").unwrap();
    update(&mut app, Msg::Session(SessionEvent::State(Box::new(snapshot(&mut exploration)))));
    let key = |app: &mut App, code: KeyCode| update(app, Msg::Key(code.into()));
    let interrupt = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
    assert_eq!(key(&mut app, KeyCode::Char('N')), []);
    check("unsaved-80x24", &screen(&mut app));
    assert_eq!(key(&mut app, KeyCode::Char('q')), [], "another question");
    key(&mut app, KeyCode::Char('b'));
    assert!(!screen(&mut app).contains("Not saved"));
    for page in [ExplorerPage::Main, ExplorerPage::World] {
        on_action(&mut app, Verb::Show(page));
        assert_eq!(key(&mut app, KeyCode::Char('q')), []);
        assert!(screen(&mut app).contains("q again leaves"), "{page:?}");
        assert_eq!(key(&mut app, KeyCode::Char('q')), quit);
    }
    on_action(&mut app, Verb::Edit);
    assert_eq!(update(&mut app, Msg::Key(interrupt)), []);
    assert!(screen(&mut app).contains("ctrl-c again"));
    assert_eq!(update(&mut app, Msg::Key(interrupt)), quit);
    assert_eq!(update(&mut app, Msg::Signal(15)), [Effect::Quit(ExitReason::Signal(15))], "a signal is not asked");
    on_action(&mut app, Verb::Cancel);
    update(&mut app, Msg::Resize(ratatui::layout::Size { width: 20, height: 6 }));
    assert_eq!(key(&mut app, KeyCode::Char('q')), quit, "nobody could read the question");
}

#[test]
fn help_names_every_key() {
    for (width, height) in SIZES {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        on_action(&mut app, Verb::Help);
        check(&format!("help-{width}x{height}"), &screen(&mut app));
        on_action(&mut app, Verb::Cancel);
        on_action(&mut app, Verb::ToggleManual);
        on_action(&mut app, Verb::Help);
        check(&format!("help-manual-{width}x{height}"), &screen(&mut app));
    }
}

#[test]
fn help_is_whole_on_every_page_of_a_small_screen() {
    for page in PAGES {
        for manual in [false, true] {
            let mut app = app(80, 24, Protocol::Ascii, Ability::FULL);
            on_action(&mut app, Verb::Show(page));
            if manual {
                on_action(&mut app, Verb::ToggleManual);
            }
            on_action(&mut app, Verb::Help);
            let text = screen(&mut app);
            let bindings = bindings_in_force(app.input.under, app.page).filter(|binding| !binding.label.is_empty());
            for binding in bindings {
                let help = binding.help;
                assert!(
                    !help.is_empty() && text.contains(help),
                    "{page:?}: no {help:?} for {}:\n{text}",
                    binding.label
                );
            }
        }
    }
}

#[test]
fn values_are_painted_for_one_heading_or_the_best() {
    for (width, height) in SIZES {
        let mut app =
            app(width, height, Protocol::HalfBlocks, Ability { colours: TermProfile::NoColor, unicode: true });
        let cells = app.session.now.as_ref().unwrap().scene.cells.clone();
        let values = (0u8..).zip(&cells).map(|(at, &cell)| {
            let value = f32::from(at) / cells.len() as f32;
            CellValue { cell, values: [value, 1.0 - value, 0.5, 0.0] }
        });
        let landscape = ValueMap {
            instruction: app.session.now.as_ref().unwrap().instruction.clone(),
            measure: Measure::Value,
            cells: values.collect(),
            of: cells.len(),
        };
        on_action(&mut app, Verb::Show(ExplorerPage::World));
        assert_eq!(on_action(&mut app, Verb::ValueMap), [Effect::Send(SessionCommand::ValueMap)]);
        update(&mut app, Msg::Session(SessionEvent::ValueMap(Arc::new(landscape.clone()), 0)));
        assert!(screen(&mut app).contains("best heading: 0."), "{}", screen(&mut app));
        on_action(&mut app, Verb::NextHeading);
        check(&format!("values-{width}x{height}"), &screen(&mut app));
        let values = app.value_map.map.take().map(|(values, _)| (values, 7));
        app.value_map.map = values;
        let text = screen(&mut app);
        assert!(text.contains("as of step 7") || text.contains(" @7"), "{text}");
        assert_eq!(on_action(&mut app, Verb::ValueMap), [Effect::Send(SessionCommand::StopValueMap)]);
        update(&mut app, Msg::Session(SessionEvent::ValueMap(Arc::new(landscape), 0)));
        assert!(app.value_map.map.is_none(), "what was cancelled and still arrives is not shown");
    }
}

#[test]
fn a_newcomer_is_told_how_to_begin_until_the_first_key() {
    for (width, height) in SIZES {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        app.input.newcomer = true;
        let text = screen(&mut app);
        assert!(text.contains("New here?") && text.contains("?: keys"), "{text}");
        on_action(&mut app, Verb::Labels);
        update(&mut app, Msg::Key(crossterm::event::KeyCode::Char('b').into()));
        assert!(!screen(&mut app).contains("New here?"));
    }
}

#[test]
fn empty_pages_say_what_they_are_for() {
    for (page, name) in
        [(ExplorerPage::Branches, "branches"), (ExplorerPage::Compare, "compare"), (ExplorerPage::Chain, "chain")]
    {
        for (width, height) in SIZES {
            let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
            on_action(&mut app, Verb::Show(page));
            check(&format!("empty-{name}-{width}x{height}"), &screen(&mut app));
        }
    }
}

#[test]
fn what_is_refused_is_told_on_every_page_until_the_next_key() {
    let mut app = app(80, 24, Protocol::HalfBlocks, Ability::FULL);
    on_action(&mut app, Verb::Show(ExplorerPage::World));
    update(&mut app, Msg::Session(SessionEvent::Refused("the expert has no values".into())));
    assert!(screen(&mut app).contains("the expert has no values"));
    update(&mut app, Msg::Key(crossterm::event::KeyCode::Char('j').into()));
    assert!(!screen(&mut app).contains("the expert has no values"));
}

#[test]
fn without_colour_and_unicode_letters_say_it_all() {
    let ability = Ability { colours: TermProfile::NoColor, unicode: false };
    for (width, height) in SIZES {
        let mut app = app(width, height, Protocol::Ascii, ability);
        let text = screen(&mut app);
        assert!(text.is_ascii(), "{text}");
        check(&format!("ascii-{width}x{height}"), &text);
    }
}

/// An app whose state is that of an exploration with a fork: main has three steps, b1 leaves it after the first.
pub(super) fn forked(width: u16, height: u16) -> (App, Exploration) {
    let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
    let mut exploration = exploration();
    let turn = |kind| Action::navigate(kind);
    for kind in [ActionType::RotateLeft, ActionType::MoveAhead, ActionType::LookDown] {
        exploration.act(turn(kind)).unwrap();
    }
    exploration.seek(1);
    exploration.act(turn(ActionType::RotateRight)).unwrap();
    exploration.act(turn(ActionType::LookUp)).unwrap();
    update(&mut app, Msg::Session(SessionEvent::State(Box::new(snapshot(&mut exploration)))));
    (app, exploration)
}

#[test]
fn whoever_takes_over_sees_the_main_page_drawn_anew() {
    let (mut app, _) = forked(80, 24);
    on_action(&mut app, Verb::Show(ExplorerPage::Mind));
    let effects = on_action(&mut app, Verb::ToggleManual);
    assert_eq!((app.page, effects), (ExplorerPage::Main, vec![Effect::Encode, Effect::Repaint]));
}

#[test]
fn the_first_row_holds_whatever_keeps_the_worker_busy() {
    for width in [1, 7, 20, 80] {
        let (mut app, _) = forked(width, 24);
        for length in 0..usize::from(width) + 3 {
            app.session.busy = Some("é".repeat(length));
            assert_eq!(screen(&mut app).lines().next().map(str::is_empty), Some(false), "{length} of {width}");
        }
    }
}

#[test]
fn branches_are_listed_and_shown_side_by_side() {
    for (name, width, height) in [("branches-80x24", 80, 24), ("branches-200x60", 200, 60)] {
        let (mut app, exploration) = forked(width, height);
        on_action(&mut app, Verb::Show(ExplorerPage::Branches));
        update(&mut app, Msg::Session(SessionEvent::Diverged(exploration.parted(0))));
        check(name, &screen(&mut app));
        let job = app.job().unwrap();
        assert!(job.frame.width > 2 * job.frame.height && job.labels.is_empty(), "both frames in one picture");
    }
}

#[test]
fn the_mind_has_a_table_of_choices_and_curves() {
    for (name, width, height) in [("mind-80x24", 80, 24), ("mind-120x36", 120, 36)] {
        let (mut app, mut exploration) = forked(width, height);
        let decided = decided(&snapshot(&mut exploration));
        update(&mut app, Msg::Session(decided));
        on_action(&mut app, Verb::Show(ExplorerPage::Mind));
        check(name, &screen(&mut app));
    }
}

#[test]
fn the_world_page_says_why_a_thing_is_no_candidate() {
    for (name, width, height) in [("world-80x24", 80, 24), ("world-120x36", 120, 36)] {
        let (mut app, _) = forked(width, height);
        on_action(&mut app, Verb::Show(ExplorerPage::World));
        on_action(&mut app, Verb::Select(1));
        check(name, &screen(&mut app));
    }
}

#[test]
fn two_instructions_are_compared_and_swapped() {
    for (name, width, height) in [("compare-80x24", 80, 24), ("compare-120x36", 120, 36)] {
        let (mut app, mut exploration) = forked(width, height);
        exploration.choose(PolicyKind::Random).unwrap();
        let contrast = exploration.contrast("open the fridge").unwrap();
        update(&mut app, Msg::Session(SessionEvent::Compared(Box::new(contrast))));
        check(name, &screen(&mut app));
        let at = exploration.tree().at();
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        update(&mut app, Msg::Session(SessionEvent::State(Box::new(snapshot(&mut exploration)))));
        assert!(screen(&mut app).contains(&format!("as of step {at} on ")), "{}", screen(&mut app));
        let effects = on_action(&mut app, Verb::Ask(SessionCommand::Swap));
        assert_eq!(effects, [Effect::Send(SessionCommand::Swap)]);
    }
}

#[test]
fn a_critic_shows_values_targets_and_advantages() {
    for (width, height) in SIZES {
        let (mut app, mut exploration) = forked(width, height);
        let now = snapshot(&mut exploration);
        let SessionEvent::Decided(decision, words, _) = decided(&now) else { panic!() };
        update(&mut app, Msg::Session(SessionEvent::Decided(decision, words, Some(values(&now)))));
        check(&format!("critic-watch-{width}x{height}"), &screen(&mut app));
        on_action(&mut app, Verb::Show(ExplorerPage::Mind));
        if let Some(now) = &mut app.session.now {
            let mut time = (*now.time).clone();
            for (beat, value) in time.steps.iter_mut().zip([0.2, 0.5, 0.4]) {
                (beat.value, beat.q, beat.entropy, beat.chosen) =
                    (Some(value), Some(value - 0.1), Some(1.0), Some(0.3));
            }
            now.time = Arc::new(time);
        }
        check(&format!("critic-mind-{width}x{height}"), &screen(&mut app));
        on_action(&mut app, Verb::Show(ExplorerPage::Chain));
        update(&mut app, Msg::Session(SessionEvent::Chain(Box::new(chained("sprint", true, true)))));
        check(&format!("critic-chain-{width}x{height}"), &screen(&mut app));
        exploration.choose(PolicyKind::Random).unwrap();
        let mut contrast = exploration.contrast("open the fridge").unwrap();
        contrast.sides[1].values = Some(values(&now));
        contrast.sides[0].values = Some(values(&now));
        update(&mut app, Msg::Session(SessionEvent::Compared(Box::new(contrast))));
        check(&format!("critic-compare-{width}x{height}"), &screen(&mut app));
    }
}

#[test]
fn the_palette_finds_verbs() {
    for (width, height) in SIZES {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        on_action(&mut app, Verb::Palette("br".into()));
        check(&format!("palette-{width}x{height}"), &screen(&mut app));
    }
}

#[test]
fn every_page_draws_at_every_size_and_without_colour_in_ascii() {
    for page in PAGES {
        for (width, height) in [(80, 24), (97, 31), (200, 60), (300, 40), (80, 90)] {
            let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
            on_action(&mut app, Verb::Show(page));
            screen(&mut app);
        }
        let ability = Ability { colours: TermProfile::NoColor, unicode: false };
        let mut app = app(80, 24, Protocol::Ascii, ability);
        on_action(&mut app, Verb::Show(page));
        let text = screen(&mut app);
        assert!(text.is_ascii(), "{page:?}:\n{text}");
    }
}

#[test]
fn a_small_terminal_is_told_what_is_needed() {
    let mut app = app(20, 8, Protocol::HalfBlocks, Ability::FULL);
    check("too-small-20x8", &screen(&mut app));
}

#[test]
fn the_frame_alone_has_all_the_room_by_its_key_or_on_a_small_screen() {
    let width = |app: &App| app.picture_area().unwrap().width;
    let mut large = app(80, 24, Protocol::HalfBlocks, Ability::FULL);
    let among_panels = width(&large);
    on_action(&mut large, Verb::Show(ExplorerPage::Frame));
    assert!(width(&large) >= 3 * among_panels / 2, "{} of {among_panels}", width(&large));
    let text = screen(&mut large);
    assert!(text.contains("Instruction >") && !text.contains("Mind"), "{text}");
    on_action(&mut large, Verb::Show(ExplorerPage::Frame));
    assert!(screen(&mut large).contains("Mind"), "the same key leads back");
    let mut small = app(40, 10, Protocol::HalfBlocks, Ability::FULL);
    let text = screen(&mut small);
    assert!(text.contains("Instruction >") && width(&small) >= 8 && !text.contains("Mind"), "{text}");
}

#[test]
fn bars_grow_by_eighths() {
    assert_eq!(bar(0.0, 4), "    ");
    assert_eq!(bar(1.0, 4), "████");
    assert_eq!(bar(0.5, 4), "██  ");
    assert_eq!(bar(0.28, 4), "█▏  ");
    assert_eq!((share(0.071), share(1.0), share(0.0)), (".07".into(), "1.0".into(), ".00".into()));
}

#[test]
fn long_text_is_broken_at_spaces_and_cut_visibly() {
    assert_eq!(wrap("put the apple in the fridge", 12, "  "), ["put the", "  apple in", "  the fridge"]);
    assert_eq!(fit("refrigerator", 6), "refri…");
    assert_eq!(fit("cup", 6), "cup");
}
