//! What the screens look like: pictures of them in text, kept and compared.

use std::sync::Arc;

use termprofile::TermProfile;

use crate::agent::registry::{PolicyIdentity, PolicyKind};
use crate::analysis::chain::{ChainRun, Handover, LinkOutcome, LinkRate, LinkSuccess};
use crate::analysis::value_map::{CellValue, Measure, ValueMap};
use crate::domain::{Action, ActionType, World};
use crate::explore::chained::Chained;
use crate::explore::session::{Event, Session};
use crate::explore::verb::{Page, Verb};
use crate::explore::worker::{Command, Report};
use crate::tui::app::App;
use crate::tui::graphics::Protocol;
use crate::tui::keys::bindings;
use crate::tui::testing::{app, engine, screen, snapshot, thought, values};
use crate::tui::theme::Ability;
use crate::tui::update::{Effect, Msg, perform, update};

/// The smallest screen, and a large one.
const SIZES: [(u16, u16); 2] = [(80, 24), (120, 36)];
/// Every page but the main one.
const PAGES: [Page; 5] = [Page::Branches, Page::Mind, Page::World, Page::Compare, Page::Chain];

fn check(name: &str, text: &str) {
    insta::with_settings!({ snapshot_path => "../snapshots", prepend_module_to_snapshot => false }, {
        insta::assert_snapshot!(name, text);
    });
}

#[test]
fn watching_at_80_by_24_and_120_by_36() {
    for (name, width, height) in [("watch-80x24", 80, 24), ("watch-120x36", 120, 36)] {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        for (step, action) in [(1, "RotateLeft"), (2, "MoveAhead")] {
            let event = Event {
                step,
                action: action.into(),
                outcome: crate::house::Outcome::Done,
                by_hand: step == 2,
                completed: None,
                forked: None,
            };
            update(&mut app, Msg::Report(Report::Stepped(event)));
        }
        check(name, &screen(&mut app));
    }
}

#[test]
fn typing_shows_what_the_agent_is_told_now() {
    for (width, height) in SIZES {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        perform(&mut app, Verb::Edit);
        check(&format!("examples-{width}x{height}"), &screen(&mut app));
        update(&mut app, Msg::Paste("pick up the p".into()));
        check(&format!("typing-{width}x{height}"), &screen(&mut app));
    }
}

#[test]
fn another_instruction_ends_the_task_and_the_expert_says_so() {
    for (width, height) in SIZES {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        let mut engine = engine();
        let note = engine.instruct("open the fridge").unwrap();
        let (old, new) = ("put the mug in the sink".to_string(), "open the fridge".to_string());
        update(&mut app, Msg::Report(Report::Instructed { old, new, note }));
        update(&mut app, Msg::Report(Report::Seen(Box::new(snapshot(&mut engine)))));
        update(&mut app, Msg::Report(Report::Failed("the expert needs a task".into())));
        check(&format!("no-task-{width}x{height}"), &screen(&mut app));
    }
}

#[test]
fn help_names_every_key() {
    for (width, height) in SIZES {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        perform(&mut app, Verb::Help);
        check(&format!("help-{width}x{height}"), &screen(&mut app));
        perform(&mut app, Verb::Cancel);
        perform(&mut app, Verb::ToggleManual);
        perform(&mut app, Verb::Help);
        check(&format!("help-manual-{width}x{height}"), &screen(&mut app));
    }
}

#[test]
fn help_is_whole_on_every_page_of_a_small_screen() {
    for page in PAGES {
        for manual in [false, true] {
            let mut app = app(80, 24, Protocol::Ascii, Ability::FULL);
            perform(&mut app, Verb::Show(page));
            if manual {
                perform(&mut app, Verb::ToggleManual);
            }
            perform(&mut app, Verb::Help);
            let text = screen(&mut app);
            let bindings = bindings(app.under, app.page).filter(|binding| !binding.label.is_empty());
            for binding in bindings {
                let doc = binding.verb.doc();
                assert!(!doc.is_empty() && text.contains(doc), "{page:?}: no {doc:?} for {}:\n{text}", binding.label);
            }
        }
    }
}

#[test]
fn values_are_painted_for_one_heading_or_the_best() {
    for (width, height) in SIZES {
        let mut app =
            app(width, height, Protocol::HalfBlocks, Ability { colours: TermProfile::NoColor, unicode: true });
        let cells = app.now.as_ref().unwrap().scene.cells.clone();
        let heights = (0u8..).zip(&cells).map(|(at, &cell)| {
            let value = f32::from(at) / cells.len() as f32;
            CellValue { cell, values: [value, 1.0 - value, 0.5, 0.0] }
        });
        let landscape = ValueMap {
            instruction: app.now.as_ref().unwrap().instruction.clone(),
            measure: Measure::Value,
            heights: heights.collect(),
            of: cells.len(),
        };
        perform(&mut app, Verb::Show(Page::World));
        assert_eq!(perform(&mut app, Verb::ValueMap), [Effect::Send(Command::Survey)]);
        update(&mut app, Msg::Report(Report::Surveyed(Arc::new(landscape.clone()), 0)));
        assert!(screen(&mut app).contains("best heading: 0."), "{}", screen(&mut app));
        perform(&mut app, Verb::NextHeading);
        check(&format!("values-{width}x{height}"), &screen(&mut app));
        let values = app.landscape.take().map(|(values, _)| (values, 7));
        app.landscape = values;
        let text = screen(&mut app);
        assert!(text.contains("as of step 7") || text.contains(" @7"), "{text}");
        assert_eq!(perform(&mut app, Verb::ValueMap), [Effect::Send(Command::StopSurvey)]);
        update(&mut app, Msg::Report(Report::Surveyed(Arc::new(landscape), 0)));
        assert!(app.landscape.is_none(), "what was cancelled and still arrives is not shown");
    }
}

#[test]
fn a_newcomer_is_told_how_to_begin_until_the_first_key() {
    for (width, height) in SIZES {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        app.newcomer = true;
        let text = screen(&mut app);
        assert!(text.contains("New here?") && text.contains("?: keys"), "{text}");
        perform(&mut app, Verb::Labels);
        update(&mut app, Msg::Key(crossterm::event::KeyCode::Char('b').into()));
        assert!(!screen(&mut app).contains("New here?"));
    }
}

#[test]
fn empty_pages_say_what_they_are_for() {
    for (page, name) in [(Page::Branches, "branches"), (Page::Compare, "compare"), (Page::Chain, "chain")] {
        for (width, height) in SIZES {
            let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
            perform(&mut app, Verb::Show(page));
            check(&format!("empty-{name}-{width}x{height}"), &screen(&mut app));
        }
    }
}

#[test]
fn what_is_refused_is_told_on_every_page_until_the_next_key() {
    let mut app = app(80, 24, Protocol::HalfBlocks, Ability::FULL);
    perform(&mut app, Verb::Show(Page::World));
    update(&mut app, Msg::Report(Report::Refused("the expert has no values".into())));
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

/// An app whose state is that of an engine with a fork: main has three steps, b1 leaves it after the first.
fn forked(width: u16, height: u16) -> (App, Session) {
    let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
    let mut engine = engine();
    let turn = |kind| Action::navigate(kind);
    for kind in [ActionType::RotateLeft, ActionType::MoveAhead, ActionType::LookDown] {
        engine.act(turn(kind));
    }
    engine.seek(1);
    engine.act(turn(ActionType::RotateRight));
    engine.act(turn(ActionType::LookUp));
    update(&mut app, Msg::Report(Report::Seen(Box::new(snapshot(&mut engine)))));
    (app, engine)
}

#[test]
fn whoever_takes_over_sees_the_main_page_drawn_anew() {
    let (mut app, _) = forked(80, 24);
    perform(&mut app, Verb::Show(Page::Mind));
    let effects = perform(&mut app, Verb::ToggleManual);
    assert_eq!((app.page, effects), (Page::Main, vec![Effect::Encode, Effect::Repaint]));
}

#[test]
fn the_first_row_holds_whatever_keeps_the_worker_busy() {
    for width in [1, 7, 20, 80] {
        let (mut app, _) = forked(width, 24);
        for length in 0..usize::from(width) + 3 {
            app.busy = Some("é".repeat(length));
            assert_eq!(screen(&mut app).lines().next().map(str::is_empty), Some(false), "{length} of {width}");
        }
    }
}

#[test]
fn branches_are_listed_and_shown_side_by_side() {
    for (name, width, height) in [("branches-80x24", 80, 24), ("branches-200x60", 200, 60)] {
        let (mut app, engine) = forked(width, height);
        perform(&mut app, Verb::Show(Page::Branches));
        update(&mut app, Msg::Report(Report::Diverged(engine.parted(0))));
        check(name, &screen(&mut app));
        let job = app.job().unwrap();
        assert!(job.frame.width > 2 * job.frame.height && job.labels.is_empty(), "both frames in one picture");
    }
}

#[test]
fn the_mind_has_a_table_of_choices_and_curves() {
    for (name, width, height) in [("mind-80x24", 80, 24), ("mind-120x36", 120, 36)] {
        let (mut app, mut engine) = forked(width, height);
        let thought = thought(&snapshot(&mut engine));
        update(&mut app, Msg::Report(thought));
        perform(&mut app, Verb::Show(Page::Mind));
        check(name, &screen(&mut app));
    }
}

#[test]
fn the_world_page_says_why_a_thing_is_no_candidate() {
    for (name, width, height) in [("world-80x24", 80, 24), ("world-120x36", 120, 36)] {
        let (mut app, _) = forked(width, height);
        perform(&mut app, Verb::Show(Page::World));
        perform(&mut app, Verb::Select(1));
        check(name, &screen(&mut app));
    }
}

#[test]
fn two_instructions_are_compared_and_swapped() {
    for (name, width, height) in [("compare-80x24", 80, 24), ("compare-120x36", 120, 36)] {
        let (mut app, mut engine) = forked(width, height);
        engine.choose(PolicyKind::Random).unwrap();
        let contrast = engine.contrast("open the fridge").unwrap();
        update(&mut app, Msg::Report(Report::Compared(Box::new(contrast))));
        check(name, &screen(&mut app));
        let at = engine.tree().at();
        engine.act(Action::navigate(ActionType::RotateLeft));
        update(&mut app, Msg::Report(Report::Seen(Box::new(snapshot(&mut engine)))));
        assert!(screen(&mut app).contains(&format!("as of step {at} on ")), "{}", screen(&mut app));
        let effects = perform(&mut app, Verb::Swap);
        assert_eq!(effects[0], Effect::Send(Command::Instruct("Open the fridge.".into())));
    }
}

/// A chain of three links by a policy: the second link is done or not, the heat is V or not.
fn chained(name: &str, second: bool, by_value: bool) -> Chained {
    let outcome = |reached: bool, done: bool, steps, worth: Option<f32>| LinkOutcome {
        reached,
        done: Some(done),
        steps,
        entry: World::default(),
        exit: World::default(),
        handover: worth.filter(|_| by_value).map(|worth| Handover { worth, next: worth - 0.1, joined: 0.3 }),
    };
    let play = |second: bool| ChainRun {
        outcomes: vec![
            outcome(true, true, 9, Some(0.62)),
            outcome(true, second, 14, Some(-0.07)),
            outcome(second, false, 0, None),
        ],
        heat: (0..23).map(|step| vec![1.0 - step as f32 / 23.0, step as f32 / 23.0, 0.1]).collect(),
        by_value,
        in_force: (0..23).map(|step| usize::from(step >= 9)).collect(),
    };
    Chained {
        who: PolicyIdentity { name: name.into(), checkpoint: Some(name.into()) },
        links: vec!["Pick up the knife.".into(), "Slice the tomato.".into(), "Put a slice in the fridge.".into()],
        start: "a kitchen".into(),
        graded: true,
        by_link: Some(play(second)),
        as_one: Some(play(true)),
        trials: None,
    }
}

#[test]
fn a_chain_shows_each_link_and_which_one_breaks() {
    let rate = |done| LinkRate { done, of: 8 };
    let trials =
        LinkSuccess { expert: vec![rate(8), rate(6), rate(7)], own: vec![rate(8), rate(1), LinkRate::default()] };
    let chained = Chained { trials: Some(trials), ..chained("first", false, false) };
    for (width, height) in SIZES {
        let (mut app, _) = forked(width, height);
        perform(&mut app, Verb::Show(Page::Chain));
        update(&mut app, Msg::Report(Report::Chained(Box::new(chained.clone()))));
        check(&format!("chain-{width}x{height}"), &screen(&mut app));
    }
}

#[test]
fn a_critic_shows_values_targets_and_advantages() {
    for (width, height) in SIZES {
        let (mut app, mut engine) = forked(width, height);
        let now = snapshot(&mut engine);
        let Report::Thought(decision, words, _) = thought(&now) else { panic!() };
        update(&mut app, Msg::Report(Report::Thought(decision, words, Some(values(&now)))));
        check(&format!("critic-watch-{width}x{height}"), &screen(&mut app));
        perform(&mut app, Verb::Show(Page::Mind));
        if let Some(now) = &mut app.now {
            let mut time = (*now.time).clone();
            for (beat, value) in time.beats.iter_mut().zip([0.2, 0.5, 0.4]) {
                (beat.value, beat.q, beat.entropy, beat.chosen) =
                    (Some(value), Some(value - 0.1), Some(1.0), Some(0.3));
            }
            now.time = Arc::new(time);
        }
        check(&format!("critic-mind-{width}x{height}"), &screen(&mut app));
        perform(&mut app, Verb::Show(Page::Chain));
        update(&mut app, Msg::Report(Report::Chained(Box::new(chained("sprint", true, true)))));
        check(&format!("critic-chain-{width}x{height}"), &screen(&mut app));
        engine.choose(PolicyKind::Random).unwrap();
        let mut contrast = engine.contrast("open the fridge").unwrap();
        contrast.sides[1].values = Some(values(&now));
        contrast.sides[0].values = Some(values(&now));
        update(&mut app, Msg::Report(Report::Compared(Box::new(contrast))));
        check(&format!("critic-compare-{width}x{height}"), &screen(&mut app));
    }
}

#[test]
fn two_policies_follow_the_same_chain_side_by_side() {
    for (width, height) in [(80, 24), (120, 36), (200, 60)] {
        let (mut app, _) = forked(width, height);
        perform(&mut app, Verb::Show(Page::Chain));
        for report in [chained("sprint", true, true), chained("first", false, false)] {
            update(&mut app, Msg::Report(Report::Chained(Box::new(report))));
        }
        check(&format!("chains-{width}x{height}"), &screen(&mut app));
        let again = Chained { trials: Some(LinkSuccess::default()), ..chained("first", false, false) };
        update(&mut app, Msg::Report(Report::Chained(Box::new(again))));
        assert_eq!(app.chain.as_ref().unwrap().who.name, "sprint", "each stays on its side");
        assert!(app.rival.as_ref().unwrap().trials.is_some());
        let elsewhere = Chained { start: "another kitchen".into(), ..chained("sprint", true, true) };
        update(&mut app, Msg::Report(Report::Chained(Box::new(elsewhere))));
        assert!(app.rival.is_none(), "another start is another chain");
    }
}

#[test]
fn the_palette_finds_verbs() {
    for (width, height) in SIZES {
        let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
        perform(&mut app, Verb::Palette("br"));
        check(&format!("palette-{width}x{height}"), &screen(&mut app));
    }
}

#[test]
fn every_page_draws_at_every_size_and_without_colour_in_ascii() {
    for page in PAGES {
        for (width, height) in [(80, 24), (97, 31), (200, 60), (300, 40), (80, 90)] {
            let mut app = app(width, height, Protocol::HalfBlocks, Ability::FULL);
            perform(&mut app, Verb::Show(page));
            screen(&mut app);
        }
        let ability = Ability { colours: TermProfile::NoColor, unicode: false };
        let mut app = app(80, 24, Protocol::Ascii, ability);
        perform(&mut app, Verb::Show(page));
        let text = screen(&mut app);
        assert!(text.is_ascii(), "{page:?}:\n{text}");
    }
}

#[test]
fn a_small_terminal_is_told_what_is_needed() {
    let mut app = app(40, 10, Protocol::HalfBlocks, Ability::FULL);
    check("too-small-40x10", &screen(&mut app));
}
