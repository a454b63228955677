//! For tests: a screen over the hand-made kitchen.

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::layout::Size;

use super::app::{App, Graphics};
use super::graphics::{Picture, Protocol};
use super::theme::Ability;
use super::update::{Msg, update};
use crate::agent::registry::{PolicyIdentity, PolicyKind};
use crate::analysis::chain::{ChainRun, Handover, LinkOutcome};
use crate::domain::{Instance, World};
use crate::explore::chain_report::ChainReport;
use crate::explore::session::SessionEvent;
pub(crate) use crate::explore::testing::{decided, exploration, snapshot, values};
use crate::house::testing::named;

/// A screen of that size in which the agent has just begun.
pub(crate) fn app(width: u16, height: u16, protocol: Protocol, ability: Ability) -> App {
    let graphics = Graphics { protocol, reason: "inside tmux".into(), cell_pixels: (8, 16), in_tmux: false };
    let mut app = App::new(Size { width, height }, graphics, ability, PolicyKind::Agent, false);
    let mut exploration = exploration();
    let mut now = snapshot(&mut exploration);
    now.policy = PolicyKind::Agent;
    now.acts = "first".into();
    let decided = decided(&now);
    update(&mut app, Msg::Session(SessionEvent::State(Box::new(now))));
    update(&mut app, Msg::Session(SessionEvent::Busy(None)));
    update(&mut app, Msg::Session(decided));
    app
}

/// The screen as text.
pub(crate) fn screen(app: &mut App) -> String {
    if let Some(job) = app.job() {
        update(app, Msg::Picture(Picture::encode(&job)));
    }
    let mut terminal = Terminal::new(TestBackend::new(app.terminal.size.width, app.terminal.size.height)).unwrap();
    terminal.draw(|frame| frame.render_widget(&*app, frame.area())).unwrap();
    terminal.backend().to_string()
}

/// An instance of the kitchen by name.
pub(crate) fn instance(app: &App, name: &str) -> Instance {
    let now = app.session.now.as_ref().unwrap();
    named(&now.scene, &now.world, name)
}

/// A chain of three links by a policy: the second link is done or not, the link values are V or not.
pub(crate) fn chained(name: &str, second: bool, by_value: bool) -> ChainReport {
    let outcome = |reached: bool, done: bool, steps, worth: Option<f32>| LinkOutcome {
        taken: Vec::new(),
        failure: None,
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
        link_values: (0..23).map(|step| vec![1.0 - step as f32 / 23.0, step as f32 / 23.0, 0.1]).collect(),
        by_value,
        in_force: (0..23).map(|step| usize::from(step >= 9)).collect(),
    };
    ChainReport {
        who: PolicyIdentity { name: name.into(), checkpoint: Some(name.into()) },
        links: vec!["Pick up the knife.".into(), "Slice the tomato.".into(), "Put a slice in the fridge.".into()],
        start: "a kitchen".into(),
        graded: true,
        by_link: Some(play(second)),
        as_one: Some(play(true)),
        trials: None,
    }
}
