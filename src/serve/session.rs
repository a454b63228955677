//! One connection's episode: it is reset, stepped, looked at and put back, whatever protocol asks for it.

use std::collections::VecDeque;
use std::sync::Arc;

use super::episodes::{EpisodeStart, Episodes};
use super::refusal::Refusal;
use crate::agent::Decision;
use crate::domain::{Action, ActionType, Class};
use crate::env::Environment;
use crate::env::environment::Snapshot;
use crate::episode::rollout::{End, Rollout};
use crate::house::render::Renderer;
use crate::house::view::{Candidate, Frame, Sighting, nearest};
use crate::house::{House, Outcome};

/// A session that takes a snapshot a step keeps the newest of them.
const SNAPSHOTS_KEPT: usize = 4096;

/// What a connection plays.
pub(super) struct Session {
    episodes: Arc<Episodes>,
    size: usize,
    /// Draws frames of another size than House's own.
    renderer: Option<Renderer>,
    playing: Option<Playing>,
    /// The seed of a reset that names none.
    next: u64,
    snapshots: VecDeque<Kept>,
    taken: u64,
}

/// An episode under way.
pub(super) struct Playing {
    pub(super) start: Arc<EpisodeStart>,
    pub(super) rollout: Rollout,
    /// What the last step came to.
    pub(super) last: Option<Stepped>,
}

/// What a step came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stepped {
    pub(super) outcome: Outcome,
    /// 1 for a step that completed a subtask.
    pub(super) reward: f32,
}

struct Kept {
    id: u64,
    start: Arc<EpisodeStart>,
    state: Snapshot,
    steps: u32,
    last: Option<Action>,
}

impl Session {
    /// Nothing is played yet. Frames have `size` pixels a side.
    pub(super) fn new(episodes: Arc<Episodes>, size: usize) -> Session {
        let (renderer, snapshots) = (renderer(size), VecDeque::new());
        Session { episodes, size, renderer, playing: None, next: 0, snapshots, taken: 0 }
    }

    /// Frames have so many pixels a side from now on.
    pub(super) fn resize(&mut self, size: usize) {
        if size != self.size {
            self.size = size;
            self.renderer = renderer(size);
        }
    }

    /// How many pixels a side frames have.
    pub(super) fn size(&self) -> usize {
        self.size
    }

    /// The episode under way.
    ///
    /// # Errors
    /// Before the first reset.
    pub(super) fn playing(&self) -> Result<&Playing, Refusal> {
        self.playing.as_ref().ok_or_else(not_begun)
    }

    /// The episode under way, for whoever else is to act in it.
    #[cfg(test)]
    pub(super) fn rollout(&mut self) -> &mut Rollout {
        &mut self.playing.as_mut().unwrap().rollout
    }

    /// Begins the task of that name, else the episode of that seed, else the one after the last.
    ///
    /// # Errors
    /// When there is no such task, or it cannot be opened.
    pub(super) fn reset(&mut self, seed: Option<u64>, task: Option<&str>) -> Result<(), Refusal> {
        let number = match task {
            Some(id) => self.episodes.named(id).ok_or_else(|| Refusal::invalid(format!("there is no task {id:?}")))?,
            None => seed.unwrap_or(self.next),
        };
        let start = self.episodes.open(number)?;
        self.next = start.number.wrapping_add(1);
        self.begin(start)
    }

    /// Whether a task set has a task of that name.
    pub(super) fn has_task(&self, id: &str) -> bool {
        self.episodes.named(id).is_some()
    }

    fn begin(&mut self, start: Arc<EpisodeStart>) -> Result<(), Refusal> {
        match &mut self.playing {
            Some(playing) if Arc::ptr_eq(&playing.start, &start) => {
                playing.rollout.restart()?;
                playing.last = None;
            }
            _ => self.playing = Some(Playing { rollout: start.rollout(), start, last: None }),
        }
        Ok(())
    }

    /// Acts: on the nearest thing of a class that the action can be done to now. Where there is none it is impossible, which is
    /// an outcome too.
    ///
    /// # Errors
    /// Before the first reset, and when the episode is over.
    pub(super) fn step(&mut self, kind: ActionType, class: Option<Class>) -> Result<(), Refusal> {
        let Playing { rollout, last, .. } = self.playing.as_mut().ok_or_else(not_begun)?;
        if rollout.end().is_some() {
            return Err(Refusal::failed("the episode is over: send reset"));
        }
        let action = match class.filter(|_| kind.is_interaction()) {
            Some(class) => {
                let candidates = rollout.env.legal_actions()?;
                nearest(&candidates, kind, class).map_or(Action::navigate(kind), Candidate::action)
            }
            None => Action::navigate(kind),
        };
        let tick = rollout.carry_out(Decision::of(action))?;
        let reward = if tick.completed_one { 1.0 } else { 0.0 };
        *last = Some(Stepped { outcome: tick.outcome, reward });
        Ok(())
    }

    /// What the agent sees.
    ///
    /// # Errors
    /// Before the first reset.
    pub(super) fn frame(&mut self) -> Result<&Frame, Refusal> {
        let house = &mut self.playing.as_mut().ok_or_else(not_begun)?.rollout.env.house;
        Ok(match &mut self.renderer {
            Some(renderer) => renderer.draw(house.scene(), house.world()),
            None => house.frame(),
        })
    }

    /// Every interaction that is possible now, nearest first.
    ///
    /// # Errors
    /// Before the first reset.
    pub(super) fn candidates(&mut self) -> Result<Vec<Candidate>, Refusal> {
        Ok(self.playing.as_mut().ok_or_else(not_begun)?.rollout.env.legal_actions()?)
    }

    /// Everything in view that an action may name, with its class.
    ///
    /// # Errors
    /// Before the first reset.
    pub(super) fn sightings(&mut self) -> Result<Vec<(Class, Sighting)>, Refusal> {
        let env = &mut self.playing.as_mut().ok_or_else(not_begun)?.rollout.env;
        let sightings = env.house.view().sightings.clone();
        let named = |sighting: Sighting| Some((env.class_of(sighting.instance)?, sighting));
        Ok(sightings.into_iter().filter_map(named).filter(|(class, _)| class.in_vocabulary()).collect())
    }

    /// Keeps the present state, until the connection ends; its name.
    ///
    /// # Errors
    /// Before the first reset.
    pub(super) fn snapshot(&mut self) -> Result<u64, Refusal> {
        let Playing { start, rollout, .. } = self.playing.as_ref().ok_or_else(not_begun)?;
        let state = rollout.env.snapshot().ok_or_else(|| Refusal::failed("this state cannot be kept"))?;
        self.taken += 1;
        if self.snapshots.len() == SNAPSHOTS_KEPT {
            self.snapshots.pop_front();
        }
        let (id, start) = (self.taken, start.clone());
        self.snapshots.push_back(Kept { id, start, state, steps: rollout.steps(), last: rollout.last() });
        Ok(id)
    }

    /// Goes back to a state that was kept.
    ///
    /// # Errors
    /// When none of that name is kept.
    pub(super) fn restore(&mut self, id: u64) -> Result<(), Refusal> {
        let at = self.snapshots.iter().position(|kept| kept.id == id).ok_or_else(|| {
            Refusal::invalid(format!("id: no snapshot {id} is kept (the newest {SNAPSHOTS_KEPT} are)"))
        })?;
        self.begin(self.snapshots[at].start.clone())?;
        let kept = &self.snapshots[at];
        let rollout = &mut self.playing.as_mut().ok_or_else(not_begun)?.rollout;
        rollout.env.restore(&kept.state)?;
        rollout.set_steps(kept.steps);
        rollout.set_last(kept.last);
        Ok(())
    }
}

impl Playing {
    /// Why the episode is over, if it is.
    pub(super) fn end(&self) -> Option<End> {
        self.rollout.end()
    }

    /// How many subtasks are done, and of how many.
    pub(super) fn grading(&self) -> (usize, usize) {
        self.rollout.env.grading().unwrap_or_default()
    }
}

/// House draws frames of its own size itself.
fn renderer(size: usize) -> Option<Renderer> {
    (size != House::FRAME).then(|| Renderer::new(size))
}

fn not_begun() -> Refusal {
    Refusal::failed("no episode has begun: send reset first")
}
