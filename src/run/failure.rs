//! Why an episode fell short, in classes: its recorded steps are taken again, and the one subtask that was not done is
//! looked at.

use std::collections::HashSet;

use serde::{Deserialize, Serialize};

use super::episode::Step;
use super::rollout::Rollout;
use super::scenes::Setting;
use crate::domain::{Action, ActionType, Instance, Pose, SkillKind, Subtask, Task};
use crate::house::House;
use crate::house::grading::{Grader, Grading};

/// What kept an episode from success; the first that applies, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Failure {
    /// A later subtask was done while its turn had not come.
    OutOfOrder,
    /// The right kind of interaction with a thing that was not asked for.
    WrongObject,
    /// The right thing, but not what was to be done with it.
    WrongAction,
    /// At the end the agent turned on the spot or pushed against something.
    Stuck,
    /// The thing was never in view and in reach.
    NeverReached,
    /// None of these: the thing was in reach and the time ran out.
    Timeout,
}

impl Failure {
    /// Every class.
    pub const ALL: [Failure; 6] = [
        Failure::OutOfOrder,
        Failure::WrongObject,
        Failure::WrongAction,
        Failure::Stuck,
        Failure::NeverReached,
        Failure::Timeout,
    ];

    /// The class in words.
    pub fn words(self) -> &'static str {
        match self {
            Failure::OutOfOrder => "out of order",
            Failure::WrongObject => "wrong object",
            Failure::WrongAction => "right object, wrong action",
            Failure::Stuck => "stuck",
            Failure::NeverReached => "never reached the object",
            Failure::Timeout => "timeout",
        }
    }
}

/// An agent that saw no more than [`STUCK_POSES`] poses in its last this many steps, and moved nothing, is stuck.
const STUCK_STEPS: usize = 12;
/// Turning on the spot shows four.
const STUCK_POSES: usize = 4;

/// What the agent did in the subtask that it did not complete.
#[derive(Default)]
struct Evidence {
    out_of_order: bool,
    wrong_object: bool,
    right_object: bool,
    reached: bool,
    /// The agent's last poses, and whether it moved anything, step by step.
    ends: Vec<(Pose, bool)>,
}

/// Classifies an episode that ended in its time without success.
pub fn classify(task: &Task, grading: Grading, setting: &Setting, trace: &[Step]) -> Failure {
    let grader = Grader::new(grading, &task.roles, &task.subtasks, task.goal.as_ref());
    let house = House::new(setting.scene.clone(), setting.world.clone());
    let mut rollout = Rollout::new(house, String::new(), Some(grader), None);
    let last_done = trace.iter().rposition(|step| step.subtask.is_some()).map_or(0, |step| step + 1);
    for step in &trace[..last_done] {
        rollout.act(action(step));
    }
    let mut evidence = Evidence::default();
    let mut later = later_graders(task, &rollout);
    for step in &trace[last_done..] {
        look(&mut rollout, action(step), &mut evidence, &mut later);
    }
    evidence.verdict()
}

fn action(step: &Step) -> Action {
    Action { kind: step.kind, target: step.target }
}

/// A grader for each later subtask alone, unless the present one asks for the same.
fn later_graders(task: &Task, rollout: &Rollout) -> Vec<Grader> {
    let Some(grader) = &rollout.grader else { return Vec::new() };
    let asked = |subtask: &Subtask| {
        let class = |role: u8| task.roles.get(usize::from(role)).map(|role| (role.class, role.slice));
        (subtask.skill, class(subtask.object), subtask.receptacle.and_then(class))
    };
    let Some(present) = grader.subtask().map(asked) else { return Vec::new() };
    let later = task.subtasks.iter().skip(grader.completed() + 1).filter(|subtask| asked(subtask) != present);
    later.map(|subtask| Grader::new(Grading::Class, &task.roles, std::slice::from_ref(subtask), None)).collect()
}

/// Takes one recorded step, and notes what it says.
fn look(rollout: &mut Rollout, action: Action, evidence: &mut Evidence, later: &mut [Grader]) {
    let wanted = wanted(rollout);
    if !evidence.reached {
        let candidates = rollout.house.candidates();
        evidence.reached = candidates.iter().any(|candidate| wanted.fits(candidate.instance));
    }
    let tick = rollout.act(action);
    let moved = action.kind.is_interaction() && tick.outcome.is_done();
    if moved && let Some(target) = action.target {
        let fits = wanted.fits(target);
        evidence.right_object |= fits;
        evidence.wrong_object |= !fits && wanted.kinds.contains(&action.kind);
        let (scene, world) = (rollout.house.scene().clone(), rollout.house.world());
        for grader in later {
            evidence.out_of_order |= grader.observe(&scene, world, action, tick.outcome);
        }
    }
    evidence.ends.push((rollout.house.world().agent, moved));
}

/// What the present subtask asks for: interactions of which kinds, with which instances.
struct Wanted {
    kinds: &'static [ActionType],
    instances: HashSet<Instance>,
}

impl Wanted {
    fn fits(&self, instance: Instance) -> bool {
        self.instances.contains(&instance)
    }
}

fn wanted(rollout: &Rollout) -> Wanted {
    let none = Wanted { kinds: &[], instances: HashSet::new() };
    let Some(grader) = &rollout.grader else { return none };
    let Some(subtask) = grader.subtask() else { return none };
    let (scene, world) = (rollout.house.scene(), rollout.house.world());
    // What is held already is not gone for; then the place to put it is.
    let role = subtask.receptacle.unwrap_or(subtask.object);
    let objects = (0..world.objects.len() as u16).map(Instance::Object);
    let fixtures = (0..scene.fixtures.len() as u16).map(Instance::Fixture);
    let instances = objects.chain(fixtures).filter(|&instance| grader.fits(scene, world, role, instance)).collect();
    let kinds: &[ActionType] = match subtask.skill {
        SkillKind::Pickup => &[ActionType::Pickup],
        SkillKind::Put => &[ActionType::Put],
        SkillKind::Slice => &[ActionType::Slice],
        SkillKind::Toggle => &[ActionType::ToggleOn],
        SkillKind::Clean | SkillKind::Heat | SkillKind::Cool => &[ActionType::Pickup],
    };
    Wanted { kinds, instances }
}

impl Evidence {
    fn verdict(&self) -> Failure {
        let end = &self.ends[self.ends.len().saturating_sub(STUCK_STEPS)..];
        let poses: HashSet<Pose> = end.iter().map(|(pose, _)| *pose).collect();
        let is_stuck = end.len() == STUCK_STEPS && poses.len() <= STUCK_POSES && end.iter().all(|(_, moved)| !moved);
        match () {
            () if self.out_of_order => Failure::OutOfOrder,
            () if self.wrong_object => Failure::WrongObject,
            () if self.right_object => Failure::WrongAction,
            () if is_stuck => Failure::Stuck,
            () if !self.reached => Failure::NeverReached,
            () => Failure::Timeout,
        }
    }
}
