//! Everything that was tried in an environment with actions of its own: states in a tree, and the branches that lead to its ends.

use std::sync::Arc;

use crate::agent::PolicyState;
use crate::domain::Action;
use crate::env::environment::Snapshot;
use crate::env::observation::RemoteObservation;
use crate::episode::record::{Author, TraceStep};

/// The most states that are remembered in an episode.
pub(crate) const MOST: usize = 100_000;
/// How much the pictures of remembered states may take, in bytes.
const PICTURES: usize = 512 << 20;

/// A state, and the step that led to it.
pub(crate) struct State {
    /// The state before; none at the start.
    pub(crate) before: Option<usize>,
    /// How many steps led here.
    pub(crate) step: u32,
    /// What led here; none at the start.
    pub(crate) taken: Option<Taken>,
    /// What was seen here.
    pub(crate) observation: Arc<RemoteObservation>,
    /// What the environment can go back to it by.
    pub(crate) snapshot: Option<Snapshot>,
    /// What the policy carried here, and who it was.
    pub(crate) carried: (Author, PolicyState),
    /// What the steps that led here earned.
    pub(crate) earned: f64,
}

/// A step that was taken.
#[derive(Clone)]
pub(crate) struct Taken {
    /// What was done.
    pub(crate) action: Action,
    /// The same as it is recorded.
    pub(crate) record: TraceStep,
    /// In words.
    pub(crate) words: String,
    /// What was told.
    pub(crate) instruction: Arc<str>,
    /// Who chose.
    pub(crate) author: Author,
}

/// A way from the start to an end.
pub(crate) struct Branch {
    /// What it is called.
    pub(crate) name: String,
    /// What was new about it.
    pub(crate) why: String,
    /// Its last state.
    pub(crate) tip: usize,
}

/// States and branches; one state is in hand.
pub(crate) struct RemoteTree {
    states: Vec<State>,
    branches: Vec<Branch>,
    branch: usize,
    here: usize,
    pictures: usize,
}

impl RemoteTree {
    /// Nothing was tried yet.
    pub(crate) fn new(start: State) -> RemoteTree {
        let branches = vec![Branch { name: "1".into(), why: "the start".into(), tip: 0 }];
        RemoteTree { states: vec![start], branches, branch: 0, here: 0, pictures: 0 }
    }

    /// The state in hand.
    pub(crate) fn here(&self) -> usize {
        self.here
    }

    /// A state.
    pub(crate) fn state(&self, at: usize) -> &State {
        &self.states[at]
    }

    /// The state in hand.
    pub(crate) fn present(&self) -> &State {
        &self.states[self.here]
    }

    /// The start.
    pub(crate) fn start(&self) -> &State {
        &self.states[0]
    }

    /// How many states are remembered.
    pub(crate) fn len(&self) -> usize {
        self.states.len()
    }

    /// Every branch, the first one first.
    pub(crate) fn branches(&self) -> &[Branch] {
        &self.branches
    }

    /// The branch in hand.
    pub(crate) fn branch(&self) -> usize {
        self.branch
    }

    /// The states of a way to one of them, from the start.
    pub(crate) fn way(&self, to: usize) -> Vec<usize> {
        let mut way = vec![to];
        let mut at = to;
        while let Some(before) = self.states[at].before {
            way.push(before);
            at = before;
        }
        way.reverse();
        way
    }

    /// The states of the branch in hand, from the start.
    pub(crate) fn story(&self) -> Vec<usize> {
        self.way(self.branches[self.branch].tip)
    }

    /// Steps of the branch in hand.
    pub(crate) fn length(&self) -> u32 {
        self.states[self.branches[self.branch].tip].step
    }

    /// The state after the one in hand on its branch.
    pub(crate) fn next(&self) -> Option<usize> {
        let step = self.present().step as usize + 1;
        self.story().get(step).copied()
    }

    /// Takes another step of the branch in hand in hand, or its end.
    pub(crate) fn seek(&mut self, step: u32) {
        let story = self.story();
        self.here = story[(step as usize).min(story.len() - 1)];
    }

    /// Takes a branch in hand, at its step nearest to the one in hand.
    pub(crate) fn switch(&mut self, branch: usize) -> bool {
        let is_there = branch < self.branches.len();
        if is_there {
            let step = self.present().step;
            self.branch = branch;
            self.seek(step);
        }
        is_there
    }

    /// What was seen in the state in hand is something else than was remembered.
    pub(crate) fn see_again(&mut self, observation: RemoteObservation) {
        self.states[self.here].observation = Arc::new(observation);
    }

    /// Goes on to a state: to the one that is there where the same was done and seen, else to a new one, in a new branch where
    /// the branch in hand goes on otherwise. The new branch's name.
    pub(crate) fn grow(&mut self, state: State, why: impl FnOnce() -> String) -> Option<String> {
        let same = |known: &State| {
            let (Some(known_step), Some(new)) = (&known.taken, &state.taken) else { return false };
            known.before == Some(self.here)
                && known.observation.digest == state.observation.digest
                && known_step.record.is_same_action(&new.record)
                && known_step.instruction == new.instruction
                && known_step.author == new.author
        };
        // Only the branch in hand is followed: another one may be meant to be a new try.
        if let Some(next) = self.next().filter(|&next| same(&self.states[next])) {
            self.here = next;
            return None;
        }
        let goes_on = self.branches[self.branch].tip == self.here;
        self.pictures += state.observation.picture.as_ref().map_or(0, |picture| picture.rgb.len());
        self.states.push(State { before: Some(self.here), ..state });
        self.here = self.states.len() - 1;
        self.forget_pictures();
        if goes_on {
            self.branches[self.branch].tip = self.here;
            return None;
        }
        let name = (self.branches.len() + 1).to_string();
        self.branches.push(Branch { name: name.clone(), why: why(), tip: self.here });
        self.branch = self.branches.len() - 1;
        Some(name)
    }

    /// The oldest pictures are forgotten where all together take too much.
    fn forget_pictures(&mut self) {
        if self.pictures <= PICTURES {
            return;
        }
        for state in self.states.iter_mut().filter(|state| state.before.is_some()) {
            if self.pictures <= PICTURES / 2 {
                break;
            }
            if let Some(picture) = &state.observation.picture {
                self.pictures = self.pictures.saturating_sub(picture.rgb.len());
                state.observation = Arc::new(RemoteObservation { picture: None, ..(*state.observation).clone() });
            }
        }
    }
}
