//! The seam between the program and a simulator, whatever language or process that lives in.

use std::any::Any;
use std::sync::Arc;

use super::remote_view::RemoteView;
use crate::domain::{Action, Class, Instance, Pose};
use crate::house::grading::Grader;
use crate::house::view::{Candidate, Frame};
use crate::house::{House, Outcome};

/// What a step came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Transition {
    /// Whether it was possible, and if not why.
    pub(crate) outcome: Outcome,
    /// The grader credited a subtask with it; never without grading.
    pub(crate) completed_subtask: bool,
    /// What it earned, where the environment tells.
    pub(crate) reward: Option<f64>,
}

/// House behind the seam, for what is about House: its map, its expert, its scenes and worlds.
pub(crate) struct HouseAccess<'a> {
    /// The simulator.
    pub(crate) house: &'a mut House,
    /// Follows the subtasks, where there is a task.
    pub(crate) grader: Option<&'a Grader>,
}

/// A state that an environment can go back to. Only the environment that made it can read it; copies share it.
#[derive(Clone)]
pub(crate) struct Snapshot(Arc<dyn Any + Send + Sync>);

impl Snapshot {
    /// Holds a state of some environment's own type.
    pub(crate) fn of<T: Any + Send + Sync>(state: T) -> Snapshot {
        Snapshot(Arc::new(state))
    }

    /// The state, if it is of that type.
    pub(crate) fn get<T: Any + Send + Sync>(&self) -> Option<&T> {
        self.0.downcast_ref()
    }
}

/// An episode's world: it is reset, observed and stepped. Plain data goes in and comes out, and every call may fail, so that
/// an implementation may speak with another process; what an environment cannot do has an answer that says so.
///
/// Only [`Rollout`](crate::episode::rollout::Rollout) steps one.
pub(crate) trait Environment: Send {
    /// What it is called in messages.
    fn name(&self) -> &str;

    /// Goes back to the episode's start, with nothing graded yet.
    ///
    /// # Errors
    /// When the simulator cannot be reached.
    fn reset(&mut self) -> anyhow::Result<()>;

    /// What the agent sees: RGB, and depth and instances where the simulator knows them. Asked for apart from
    /// [`legal_actions`](Environment::legal_actions), because drawing costs the most.
    ///
    /// # Errors
    /// When the simulator cannot be reached.
    fn frame(&mut self) -> anyhow::Result<&Frame>;

    /// Every interaction that is possible now, nearest first. Navigation may always be tried.
    ///
    /// # Errors
    /// When the simulator cannot be reached.
    fn legal_actions(&mut self) -> anyhow::Result<Vec<Candidate>>;

    /// Acts. An impossible action is an outcome, not an error, and changes nothing.
    ///
    /// # Errors
    /// When the simulator cannot be reached; nothing is known of the step then.
    fn step(&mut self, action: Action) -> anyhow::Result<Transition>;

    /// The class of a thing that an action may name.
    fn class_of(&self, instance: Instance) -> Option<Class>;

    /// Where the agent stands and looks relative to where it stood at the reset, as dead reckoning by its own moves tells; the
    /// horizon is an inclinometer's. `None` where the simulator does not tell.
    fn odometry(&self) -> Option<Pose> {
        None
    }

    /// A fingerprint of the state: equal states have equal ones. `None` where the simulator tells nothing of its state.
    fn fingerprint(&self) -> Option<String> {
        None
    }

    /// The seed by which the episode was reset, where one says how it starts.
    fn seed(&self) -> Option<u64> {
        None
    }

    /// How many subtasks are done and of how many, where the environment grades.
    fn grading(&self) -> Option<(usize, usize)> {
        None
    }

    /// The present state, where the environment can go back to it.
    fn snapshot(&self) -> Option<Snapshot> {
        None
    }

    /// Goes back to a state of its own.
    ///
    /// # Errors
    /// When it cannot go back, or the state is not its own.
    fn restore(&mut self, _snapshot: &Snapshot) -> anyhow::Result<()> {
        anyhow::bail!("{} cannot go back to an earlier state", self.name())
    }

    /// House itself, where the environment is one.
    fn house(&mut self) -> Option<HouseAccess<'_>> {
        None
    }

    /// What it shows and lets an agent do, where its actions are its own in place of ALFRED's 12.
    fn own(&self) -> Option<RemoteView<'_>> {
        None
    }
}

impl<E: Environment + ?Sized> Environment for Box<E> {
    fn name(&self) -> &str {
        (**self).name()
    }

    fn reset(&mut self) -> anyhow::Result<()> {
        (**self).reset()
    }

    fn frame(&mut self) -> anyhow::Result<&Frame> {
        (**self).frame()
    }

    fn legal_actions(&mut self) -> anyhow::Result<Vec<Candidate>> {
        (**self).legal_actions()
    }

    fn step(&mut self, action: Action) -> anyhow::Result<Transition> {
        (**self).step(action)
    }

    fn class_of(&self, instance: Instance) -> Option<Class> {
        (**self).class_of(instance)
    }

    fn odometry(&self) -> Option<Pose> {
        (**self).odometry()
    }

    fn fingerprint(&self) -> Option<String> {
        (**self).fingerprint()
    }

    fn seed(&self) -> Option<u64> {
        (**self).seed()
    }

    fn grading(&self) -> Option<(usize, usize)> {
        (**self).grading()
    }

    fn snapshot(&self) -> Option<Snapshot> {
        (**self).snapshot()
    }

    fn restore(&mut self, snapshot: &Snapshot) -> anyhow::Result<()> {
        (**self).restore(snapshot)
    }

    fn house(&mut self) -> Option<HouseAccess<'_>> {
        (**self).house()
    }

    fn own(&self) -> Option<RemoteView<'_>> {
        (**self).own()
    }
}
