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
pub use crate::explore::testing::{engine, snapshot, thought, values};
use crate::explore::worker::Report;
use crate::house::testing::named;

/// A screen of that size in which the agent has just begun.
pub fn app(width: u16, height: u16, protocol: Protocol, ability: Ability) -> App {
    let graphics = Graphics { protocol, reason: "inside tmux".into(), cell_pixels: (8, 16), in_tmux: false };
    let mut app = App::new(Size { width, height }, graphics, ability, PolicyKind::Agent, false);
    let mut engine = engine();
    let mut now = snapshot(&mut engine);
    now.policy = PolicyKind::Agent;
    now.acts = "first".into();
    let thought = thought(&now);
    update(&mut app, Msg::Report(Report::Seen(Box::new(now))));
    update(&mut app, Msg::Report(Report::Busy(None)));
    update(&mut app, Msg::Report(thought));
    app
}

/// The screen as text.
pub fn screen(app: &mut App) -> String {
    if let Some(job) = app.job() {
        update(app, Msg::Picture(Picture::encode(&job)));
    }
    let mut terminal = Terminal::new(TestBackend::new(app.size.width, app.size.height)).unwrap();
    super::screen::draw(&mut terminal, app).unwrap();
    terminal.backend().to_string()
}

/// An instance of the kitchen by name.
pub fn instance(app: &App, name: &str) -> Instance {
    let now = app.now.as_ref().unwrap();
    named(&now.scene, &now.world, name)
}
