//! A house that someone acts in: a scene, its world, and the frame that is drawn when somebody looks.

use std::sync::Arc;

use super::outcome::{Outcome, Reason};
use super::render::Renderer;
use super::rules;
use super::view::{self, Candidate, Frame, View};
use crate::domain::world::Instance;
use crate::domain::{Action, Scene, World};

/// A scene with a world in it. Frames are drawn on demand: stepping without looking costs no drawing.
pub struct House {
    scene: Arc<Scene>,
    world: World,
    renderer: Renderer,
    view: Option<View>,
    /// The renderer's frame shows the present state.
    drawn: bool,
}

impl House {
    /// The side of a frame in pixels, as in ALFRED.
    pub const FRAME: usize = 300;

    /// A house in the given state.
    pub fn new(scene: Arc<Scene>, world: World) -> House {
        House { scene, world, renderer: Renderer::new(House::FRAME), view: None, drawn: false }
    }

    /// The floor plan.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The present state.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Puts back an earlier state, or sets another one.
    pub fn restore(&mut self, world: World) {
        self.world = world;
        self.forget();
    }

    /// Acts. An interaction needs its target in view and in reach; then the rules decide. An impossible action changes nothing.
    pub fn step(&mut self, action: Action) -> Outcome {
        if let Some(target) = action.target
            && action.kind.is_interaction()
            && let Err(reason) = rules::check(&self.scene, &self.world, action).and_then(|()| self.reach(target))
        {
            return Outcome::Impossible(reason);
        }
        let outcome = rules::apply(&self.scene, &mut self.world, action);
        if outcome.is_done() {
            self.forget();
        }
        outcome
    }

    /// What the agent sees, 300 x 300.
    pub fn frame(&mut self) -> &Frame {
        if !self.drawn {
            self.renderer.draw(&self.scene, &self.world);
            self.drawn = true;
        }
        self.renderer.frame()
    }

    /// Which instances the frame shows.
    pub fn view(&mut self) -> &View {
        if self.view.is_none() {
            self.view = Some(View::of(self.frame()));
        }
        self.view.get_or_insert_default()
    }

    /// Every interaction that is possible now, nearest first.
    pub fn candidates(&mut self) -> Vec<Candidate> {
        self.view();
        let empty = View::default();
        view::candidates(&self.scene, &self.world, self.view.as_ref().unwrap_or(&empty))
    }

    /// Whether the agent sees and reaches an instance.
    fn reach(&mut self, target: Instance) -> Result<(), Reason> {
        self.view();
        let nothing = View::default();
        view::reachable(&self.scene, &self.world, self.view.as_ref().unwrap_or(&nothing), target)
    }

    fn forget(&mut self) {
        self.view = None;
        self.drawn = false;
    }
}
