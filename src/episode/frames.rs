//! A recorded episode as a sequence of states that can be drawn.

use std::ops::ControlFlow;
use std::sync::Arc;

use anyhow::ensure;

use super::record::{Episode, TraceStep};
use super::rollout::{AfterEach, Rollout, Tick};
use super::scenes::Setting;
use super::wish::Wish;
use crate::domain::{Scene, Task, World};
use crate::house::grading::describe;
use crate::house::view::Frame;
use crate::house::{House, Outcome};
use crate::language::count::counted;
use crate::language::instruction;

/// An episode with the state after every step.
#[derive(Clone, Debug)]
pub(crate) struct FrameSequence {
    /// Task, scene and result in a line.
    pub(crate) title: String,
    /// House's; nothing elsewhere.
    pub(crate) scene: Option<Arc<Scene>>,
    /// What the task asked, in words.
    pub(crate) subtasks: Vec<String>,
    /// What was told one after the other, with what came of it, where there was more than one task.
    pub(crate) wishes: Vec<String>,
    /// The start, and the state after each step.
    pub(crate) shots: Vec<Shot>,
}

/// What is drawn of a state.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Seen {
    /// House in that state.
    World(Box<World>),
    /// A picture of another environment's.
    Picture(Arc<Frame>),
    /// It shows no pictures.
    Nothing,
}

/// A state of a recording.
#[derive(Clone, Debug)]
pub(crate) struct Shot {
    /// How many steps were taken.
    pub(crate) step: u32,
    /// What is drawn of it.
    pub(crate) seen: Seen,
    /// What the agent was told when it got here.
    pub(crate) told: String,
    /// What was done to get here, with its target's class; nothing at the start.
    pub(crate) did: Option<String>,
    /// What that came to.
    pub(crate) outcome: Outcome,
    /// It could be done.
    pub(crate) possible: bool,
    /// The subtask that it completed, in words.
    pub(crate) done: Option<String>,
}

impl Shot {
    /// The state in which a recording begins.
    pub(super) fn start(seen: Seen, told: String) -> Shot {
        Shot { step: 0, seen, told, did: None, outcome: Outcome::Done, possible: true, done: None }
    }

    /// What was done and what it came to.
    pub(crate) fn words(&self) -> String {
        match (&self.did, self.possible) {
            (None, _) => "the start".into(),
            (Some(did), true) => did.clone(),
            (Some(did), false) => format!("{did} · {}", self.outcome),
        }
    }
}

/// Draws the states of a recording.
pub(crate) struct FrameCamera(Option<House>);

impl FrameCamera {
    /// What the agent saw.
    pub(crate) fn draw(&mut self, shot: &Shot) -> Frame {
        match (&shot.seen, &mut self.0) {
            (Seen::World(world), Some(house)) => {
                house.restore((**world).clone());
                house.frame().clone()
            }
            (Seen::Picture(frame), _) => (**frame).clone(),
            _ => {
                let side = House::FRAME;
                Frame { width: side, height: side, rgb: vec![0; 3 * side * side], depth: Vec::new(), ids: Vec::new() }
            }
        }
    }
}

impl FrameSequence {
    /// Takes the steps of an episode again, by the rules alone.
    ///
    /// # Errors
    /// When a step does not come to what was recorded.
    pub(crate) fn of(setting: &Setting, task: &Task, episode: &Episode) -> anyhow::Result<FrameSequence> {
        let house = House::new(setting.scene.clone(), setting.world.clone());
        let mut rollout = Rollout::in_house(house, String::new(), None, None);
        let subtasks: Vec<String> = task.subtasks.iter().map(|subtask| describe(&task.roles, subtask)).collect();
        let mut told = instruction::normalise(&episode.instruction);
        let start = Shot::start(Seen::World(Box::new(setting.world.clone())), told.clone());
        let mut shots = vec![start];
        let mut recorded = (1..).zip(&episode.trace);
        let mut record = AfterEach(|rollout: &mut Rollout, tick: &Tick| {
            let Some((number, step)) = recorded.next() else { return Ok(ControlFlow::Break(())) };
            if let Some(text) = &step.instruction {
                told.clone_from(text);
            }
            let outcome = tick.outcome;
            ensure!(
                outcome == step.outcome,
                "task {:?}, step {number} ({}): came to {outcome}, recorded is {}; the simulator or the scene is another one",
                episode.task,
                step.kind,
                step.outcome
            );
            let class = step.class.map_or(String::new(), |class| format!(" {}", class.name()));
            shots.push(Shot {
                step: number,
                seen: Seen::World(Box::new(rollout.env.house.world().clone())),
                told: told.clone(),
                did: Some(format!("{}{class}", step.kind)),
                outcome,
                possible: outcome.is_done(),
                done: step.subtask.map(|at| {
                    let wish = episode.wishes.iter().rev().find(|wish| wish.began < number);
                    let read = wish.filter(|wish| !wish.subtasks.is_empty()).map(Wish::subtasks_in_words);
                    read.as_ref().unwrap_or(&subtasks).get(at as usize).cloned().unwrap_or_default()
                }),
            });
            Ok(ControlFlow::Continue(()))
        });
        rollout.replay(episode.trace.iter().map(TraceStep::action), &mut record)?;
        let result = match (episode.success, episode.of) {
            (true, _) => "success".to_string(),
            (false, 0) => "not graded".to_string(),
            (false, of) => format!("{} of {}", episode.completed, counted(of, "subtask")),
        };
        let title = format!("{} in {}, {}: {result}", episode.task, setting.scene.name, counted(episode.steps, "step"));
        let row = |wish: &Wish| format!("at step {}: {} {}", wish.began, wish.instruction, wish.verdict_in_words());
        let is_told = episode.wishes.iter().any(Wish::is_told);
        let wishes = if is_told { episode.wishes.iter().map(row).collect() } else { Vec::new() };
        Ok(FrameSequence { title, scene: Some(setting.scene.clone()), subtasks, wishes, shots })
    }

    /// What the agent was told first.
    pub(crate) fn told(&self) -> String {
        self.shots.first().map_or_else(String::new, |shot| shot.told.clone())
    }

    /// Whether there is anything to draw.
    pub(crate) fn has_pictures(&self) -> bool {
        self.shots.iter().any(|shot| shot.seen != Seen::Nothing)
    }

    /// Something to draw its states with.
    pub(crate) fn camera(&self) -> FrameCamera {
        FrameCamera(self.scene.as_ref().map(|scene| House::new(scene.clone(), World::default())))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::domain::ActionType;
    use crate::house::testing::kitchen;

    /// A few turns in the kitchen; one subtask is said to be done.
    pub(crate) fn recording() -> FrameSequence {
        let (scene, world) = kitchen();
        let setting = Setting { scene, world };
        let mut task = crate::data::taskset::tests::sample_set().tasks.remove(0);
        task.instruction = "put the mug in the sink".into();
        let kinds = [ActionType::RotateLeft, ActionType::LookUp, ActionType::RotateLeft];
        let trace: Vec<TraceStep> = kinds
            .into_iter()
            .map(|kind| TraceStep {
                own: None,
                kind,
                target: None,
                class: None,
                outcome: Outcome::Done,
                subtask: (kind == ActionType::LookUp).then_some(0),
                instruction: None,
                author: None,
            })
            .collect();
        let episode = Episode {
            task: task.id.clone(),
            seed: 0,
            start_hash: setting.world.digest(),
            instruction: task.instruction.clone(),
            completed: 1,
            of: 1,
            success: true,
            steps: 3,
            trace,
            ..Episode::default()
        };
        FrameSequence::of(&setting, &task, &episode).unwrap()
    }

    #[test]
    fn a_recording_has_the_state_after_every_step() {
        let recording = recording();
        assert_eq!(recording.shots.len(), 4);
        assert_ne!(recording.shots[0].seen, recording.shots[1].seen);
        assert_eq!(recording.told(), "Put the mug in the sink.");
        assert!(recording.shots[2].done.is_some());
        assert!(recording.title.ends_with("3 steps: success"), "{}", recording.title);
        let frame = recording.camera().draw(&recording.shots[1]);
        assert_eq!((frame.width, frame.height), (300, 300));
    }
}
