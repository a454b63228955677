//! A house that someone acts in: a scene, its world, and the frame that is drawn when somebody looks.

use std::sync::Arc;

use super::outcome::{Outcome, Reason};
use super::render::Renderer;
use super::rules;
use super::view::{self, Candidate, Frame, View};
use crate::domain::{Action, ActionType, Instance, Scene, World};

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

    /// The floor plan, which no action changes.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The state after the last step.
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
        {
            let may = rules::check(&self.scene, &self.world, action);
            if let Err(reason) = may.and_then(|()| self.reach(action.kind, target)) {
                return Outcome::Impossible(reason);
            }
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
        let (renderer, scene, world) = (&mut self.renderer, &self.scene, &self.world);
        let drawn = self.drawn;
        self.view.get_or_insert_with(|| match drawn {
            true => View::of(renderer.frame()),
            // Without the colours, which nobody has asked for yet.
            false => renderer.look(scene, world),
        })
    }

    /// Every interaction that is possible now, nearest first.
    pub fn candidates(&mut self) -> Vec<Candidate> {
        self.view();
        let nothing = View::default();
        view::candidates(&self.scene, &self.world, self.view.as_ref().unwrap_or(&nothing))
    }

    fn reach(&mut self, kind: ActionType, target: Instance) -> Result<(), Reason> {
        self.view();
        let nothing = View::default();
        view::actionable(&self.scene, &self.world, self.view.as_ref().unwrap_or(&nothing), kind, target)
    }

    fn forget(&mut self) {
        self.view = None;
        self.drawn = false;
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{kitchen_house, named};
    use super::*;
    use crate::domain::{Heading, Pose};

    #[test]
    fn a_tap_is_turned_on_only_while_its_basin_is_in_view_and_off_from_wherever_it_is_seen() {
        let mut house = kitchen_house();
        let start = house.world().clone();
        let (scene, mut counts) = (house.scene().clone(), [0; 2]);
        let [tap, sink] = ["Faucet", "Sink"].map(|name| named(&scene, &start, name));
        for &cell in &scene.cells {
            for horizon in (Pose::UP..=Pose::DOWN).step_by(15) {
                let mut world = start.clone();
                world.agent = Pose { cell, heading: Heading::North, horizon };
                house.restore(world);
                let seen = house.view().clone();
                if view::reachable(&scene, house.world(), &seen, tap).is_err() {
                    continue;
                }
                let basin = seen.sighting(sink).is_some();
                let on = Action::interact(ActionType::ToggleOn, tap);
                assert_eq!(house.candidates().iter().any(|candidate| candidate.action() == on), basin);
                let outcome = house.step(on);
                if !basin {
                    assert_eq!(outcome.to_string(), "the sink is not in view");
                    let mut running = house.world().clone();
                    assert!(rules::apply(&scene, &mut running, on).is_done());
                    house.restore(running);
                }
                assert_eq!(outcome.is_done(), basin);
                assert!(house.step(Action::interact(ActionType::ToggleOff, tap)).is_done());
                counts[usize::from(basin)] += 1;
            }
        }
        assert!(counts.iter().all(|&count| count > 0), "{counts:?}");
    }

    #[test]
    fn looking_without_colours_sees_what_the_frame_shows() {
        let mut house = kitchen_house();
        let mut seen = 0;
        for heading in Heading::ALL {
            let mut world = house.world().clone();
            world.agent.heading = heading;
            house.restore(world);
            let looked = house.view().clone();
            seen += looked.sightings.len();
            assert_eq!(View::of(house.frame()), looked);
        }
        assert!(seen > 0, "nothing was in view in any direction");
    }
}
