//! For tests: a screen over the hand-made kitchen.

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::layout::Size;

use super::app::{App, Graphics};
use super::graphics::{Picture, Protocol};
use super::theme::Ability;
use super::update::{Msg, update};
use crate::agent::registry::PolicyKind;
use crate::domain::Instance;
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
    super::screen::draw(&mut terminal, app).unwrap();
    terminal.backend().to_string()
}

/// An instance of the kitchen by name.
pub(crate) fn instance(app: &App, name: &str) -> Instance {
    let now = app.session.now.as_ref().unwrap();
    named(&now.scene, &now.world, name)
}
