//! What the agent carries from step to step of an episode, and how a step changes it. Without the network: the same code runs
//! when it acts and when its training replays demonstrations.

use super::eyes::Seen;
use super::features::Choice;
use super::goal::Goal;
use super::macro_action::{MacroAction, available};
use super::progress::{Attempt, Progress};
use crate::agent::loop_guard::digest;
use crate::agent::memory::navigator::Failed;
use crate::agent::memory::{Glance, Memory};
use crate::domain::{Action, ActionType, Cell, Class, Pose};
use crate::house::view::{Candidate, Frame};

/// The height of a counter in metres: where things are taken to be put when it is not known.
const COUNTER: f32 = 0.9;

/// Memory, progress, and what was tried.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Mind {
    pub(crate) memory: Memory,
    pub(crate) progress: Progress,
    failed: Failed,
    attempt: Option<Attempt>,
    /// A digest of the picture that was seen last.
    picture: Option<u64>,
}

/// A moment as the agent meets it.
pub(crate) struct Moment<'a> {
    /// Where it stands relative to where it began, as its own moves tell.
    pub(crate) pose: Pose,
    /// The picture and its depth.
    pub(crate) frame: &'a Frame,
    /// What it makes of the picture.
    pub(crate) seen: &'a Seen,
    /// The interactions that are possible.
    pub(crate) legal: &'a [Candidate],
}

impl Mind {
    /// Takes in the next moment, and what came of the last action in it.
    pub(crate) fn observe(&mut self, moment: &Moment<'_>) {
        let before = self.memory.odometry.pose();
        let picture = Some(digest(&moment.frame.rgb));
        let changed = picture != self.picture;
        let first = std::mem::replace(&mut self.picture, picture).is_none();
        let attempt = self.attempt.take();
        if let Some(attempt) = attempt {
            let held = self.progress.held;
            self.progress.record(attempt, changed);
            if let Some((class, cell)) = attempt.target.filter(|_| changed) {
                // What was in vain may work now: a door stands open, the hand is empty.
                self.failed.clear();
                match (attempt.kind, held) {
                    (ActionType::Pickup, _) => self.memory.map.forget(class, cell, 0.4),
                    (ActionType::Put, Some(held)) => {
                        let height = self.memory.map.evidence(class, cell).map_or(COUNTER, |known| known.height);
                        self.memory.map.place(held, cell, height, self.memory.step);
                    }
                    _ => {}
                }
            }
        }
        if first {
            self.progress.held = moment.seen.hand_full.then_some(Class::NONE);
        }
        // What can be done tells for certain: nobody picks up with a full hand, or puts down with an empty one.
        let can = |kinds: &[ActionType]| moment.legal.iter().any(|candidate| kinds.contains(&candidate.kind));
        if can(&[ActionType::Pickup]) {
            self.progress.held = None;
        } else if can(&[ActionType::Put, ActionType::Slice]) {
            self.progress.held.get_or_insert(Class::NONE);
        }
        self.progress.name_what_is_held();
        self.memory.observe(Glance {
            pose: moment.pose,
            blocked: attempt.is_some_and(|it| it.kind == ActionType::MoveAhead) && moment.pose == before,
            frame: moment.frame,
            percept: &moment.seen.percept,
            held: self.progress.held,
        });
        let is_empty = self.progress.held.is_none();
        let is_offered = |class: Class| moment.legal.iter().any(|candidate| candidate.class == class);
        self.memory.map.refute(moment.pose, &moment.seen.percept, |class| {
            let info = class.info();
            (info.pickupable && is_empty || info.toggleable || info.openable) && !is_offered(class)
        });
    }

    /// New goals: what was tried for others counts no more.
    pub(crate) fn set_goals(&mut self, goals: Vec<Goal>) {
        self.progress.set_goals(goals);
        self.failed.clear();
    }

    /// What there is to choose from.
    pub(crate) fn choice(&mut self, legal: &[Candidate]) -> (Vec<MacroAction>, Choice) {
        let (things, actions) = available(&mut self.memory, &mut self.progress, legal, &mut self.failed);
        let choice = Choice::of(&self.memory, &self.progress, &things, &actions);
        (actions, choice)
    }

    /// Remembers what is about to be done: to which class of things, and where they are.
    pub(crate) fn attempt(&mut self, action: Action, target: Option<(Class, Cell)>) {
        self.attempt = Some(Attempt { kind: action.kind, target });
    }

    /// Learns which action was really taken: not always the one that it was about to.
    pub(crate) fn acted(&mut self, action: Action, class: Option<Class>) {
        let own = self.attempt.filter(|own| own.kind == action.kind && own.target.map(|target| target.0) == class);
        if own.is_none() {
            self.attempt(action, class.map(|class| (class, self.ahead())));
        }
    }

    /// The cell ahead, where an interaction takes place as far as is known.
    pub(crate) fn ahead(&self) -> Cell {
        let pose = self.memory.odometry.pose();
        pose.cell.ahead(pose.heading)
    }
}
