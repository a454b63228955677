//! The tree of steps itself.

use super::saved_state::SavedState;
use super::taken_step::TakenStep;
use crate::agent::PolicyState;
use crate::episode::wish::Wishes;

/// A state's place in the tree.
pub(crate) type Place = usize;

struct Twig {
    parent: Option<Place>,
    step: u32,
    taken: Option<TakenStep>,
    moment: SavedState,
    children: Vec<Place>,
}

/// A way through the tree from its start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Branch {
    /// What it is called.
    pub(crate) name: String,
    /// Its last state.
    tip: Place,
    /// The branch that it left, and after which step.
    pub(crate) left: Option<(usize, u32)>,
    /// Why, in words.
    pub(crate) why: String,
}

/// Everything that was tried from one start.
pub(crate) struct Tree {
    twigs: Vec<Twig>,
    branches: Vec<Branch>,
    branch: usize,
    /// The states of the branch in hand, by step.
    line: Vec<Place>,
    at: u32,
}

/// States that keep what the policy carried; older ones are come back to by looking back at the frames before them.
const CARRIED: usize = 4096;
/// The most states that a tree holds.
const MOST: usize = 20_000;

/// What growing came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Growth {
    /// The branch in hand grew.
    Longer,
    /// The step was there already.
    Known,
    /// A branch of that number began.
    Forked(usize),
}

impl Tree {
    /// Only the start.
    pub(crate) fn new(start: SavedState) -> Tree {
        let twig = Twig { parent: None, step: 0, taken: None, moment: start, children: Vec::new() };
        let main = Branch { name: "main".into(), tip: 0, left: None, why: "the start".into() };
        Tree { twigs: vec![twig], branches: vec![main], branch: 0, line: vec![0], at: 0 }
    }

    /// The step in hand.
    pub(crate) fn at(&self) -> u32 {
        self.at
    }

    /// The last step of the branch in hand.
    pub(crate) fn last(&self) -> u32 {
        self.line.len() as u32 - 1
    }

    /// The state in hand.
    pub(crate) fn saved_state(&self) -> &SavedState {
        &self.twigs[self.line[self.at as usize]].moment
    }

    /// Replaces what the start is like, while nothing was tried from it.
    pub(crate) fn begin_with(&mut self, start: SavedState) {
        if self.twigs.len() == 1 {
            self.twigs[0].moment = start;
        }
    }

    /// Replaces what is known of the wishes in the state in hand, where the last of them is the one that is told there.
    pub(crate) fn judge(&mut self, wishes: &Wishes) {
        let place = self.line[self.at as usize];
        let known = &mut self.twigs[place].moment.wishes;
        if let (Some(known_last), Some(last)) = (known.last(), wishes.last())
            && known_last.is_same(last)
        {
            known.clone_from(wishes);
        }
    }

    /// The states up to the one in hand.
    pub(crate) fn past(&self) -> impl DoubleEndedIterator<Item = &SavedState> + ExactSizeIterator {
        self.line[..=self.at as usize].iter().map(|&place| &self.twigs[place].moment)
    }

    /// The steps of the branch in hand, from the first.
    pub(crate) fn steps(&self) -> impl Iterator<Item = &TakenStep> {
        self.line.iter().filter_map(|&place| self.twigs[place].taken.as_ref())
    }

    /// Whether it holds as many states as it can.
    pub(crate) fn is_full(&self) -> bool {
        self.twigs.len() >= MOST
    }

    /// How many states it holds.
    pub(crate) fn states(&self) -> usize {
        self.twigs.len()
    }

    /// The state at the start.
    pub(crate) fn start(&self) -> &SavedState {
        &self.twigs[0].moment
    }

    /// The step that led to the state in hand.
    pub(crate) fn last_taken(&self) -> Option<&TakenStep> {
        self.twigs[self.line[self.at as usize]].taken.as_ref()
    }

    /// The step that follows the state in hand on its branch.
    pub(crate) fn next(&self) -> Option<&TakenStep> {
        let place = *self.line.get(self.at as usize + 1)?;
        self.twigs[place].taken.as_ref()
    }

    /// Whether other branches leave the branch in hand after each of its steps, the start first.
    pub(crate) fn forks(&self) -> impl Iterator<Item = bool> {
        self.line.iter().map(|&place| self.twigs[place].children.len() > 1)
    }

    /// The states of a branch with the steps that led to them, from the start.
    pub(crate) fn story(&self, branch: usize) -> Vec<(&SavedState, Option<&TakenStep>)> {
        let line = self.branches.get(branch).map_or_else(Vec::new, |branch| self.line_to(branch.tip));
        line.into_iter().map(|place| (&self.twigs[place].moment, self.twigs[place].taken.as_ref())).collect()
    }

    pub(crate) fn branches(&self) -> &[Branch] {
        &self.branches
    }

    /// The number of the branch in hand.
    pub(crate) fn branch(&self) -> usize {
        self.branch
    }

    /// The last step of a branch.
    pub(crate) fn length(&self, branch: usize) -> u32 {
        self.branches.get(branch).map_or(0, |branch| self.twigs[branch.tip].step)
    }

    /// How many subtasks were completed on a branch.
    pub(crate) fn completed(&self, branch: usize) -> u32 {
        let tip = self.branches.get(branch).map(|branch| branch.tip);
        let up = std::iter::successors(tip, |&place| self.twigs[place].parent);
        up.filter(|&place| self.twigs[place].taken.as_ref().is_some_and(|taken| taken.step.subtask.is_some())).count()
            as u32
    }

    /// Goes to a step of the branch in hand, or to its end.
    pub(crate) fn seek(&mut self, step: u32) -> &SavedState {
        self.at = step.min(self.last());
        self.saved_state()
    }

    /// Takes another branch in hand, at the same step or its end.
    pub(crate) fn switch(&mut self, branch: usize) -> bool {
        let Some(tip) = self.branches.get(branch).map(|branch| branch.tip) else { return false };
        self.branch = branch;
        self.line = self.line_to(tip);
        self.at = self.at.min(self.last());
        true
    }

    /// Gives a branch another name. One that is taken or empty is refused.
    pub(crate) fn rename(&mut self, branch: usize, name: &str) -> bool {
        let name = name.trim();
        let taken = self.branches.iter().enumerate().any(|(at, other)| at != branch && other.name == name);
        match self.branches.get_mut(branch) {
            Some(branch) if !taken && !name.is_empty() => {
                branch.name = name.to_string();
                true
            }
            _ => false,
        }
    }

    /// Adds a step that was taken from the state in hand, and what came of it; goes there. `why` says what was new about it.
    pub(crate) fn grow(
        &mut self,
        taken: TakenStep,
        moment: impl FnOnce() -> SavedState,
        why: impl FnOnce() -> String,
    ) -> Growth {
        let from = self.line[self.at as usize];
        if self.next().is_some_and(|next| next.is_same(&taken)) {
            self.at += 1;
            return Growth::Known;
        }
        let is_it = |&&child: &&Place| self.twigs[child].taken.as_ref().is_some_and(|known| known.is_same(&taken));
        if let Some(&child) = self.twigs[from].children.iter().find(is_it) {
            // Some branch goes through every state.
            let through = (0..self.branches.len()).find(|&at| self.line_to(self.branches[at].tip).contains(&child));
            self.switch(through.unwrap_or(self.branch));
            self.at = self.twigs[child].step;
            return Growth::Known;
        }
        let place = self.twigs.len();
        let step = self.at + 1;
        self.twigs.push(Twig { parent: Some(from), step, taken: Some(taken), moment: moment(), children: Vec::new() });
        self.twigs[from].children.push(place);
        if let Some(old) = place.checked_sub(CARRIED) {
            self.twigs[old].moment.carried = PolicyState::Nothing;
        }
        let longer = self.branches[self.branch].tip == from;
        let growth = if longer {
            self.branches[self.branch].tip = place;
            Growth::Longer
        } else {
            let left = Some((self.branch, self.at));
            self.branches.push(Branch { name: self.free_name(), tip: place, left, why: why() });
            self.branch = self.branches.len() - 1;
            self.line.truncate(self.at as usize + 1);
            Growth::Forked(self.branch)
        };
        self.line.push(place);
        self.at = step;
        growth
    }

    /// How many steps two branches share from the start.
    pub(crate) fn shared(&self, one: usize, other: usize) -> u32 {
        let lines = [one, other].map(|at| self.branches.get(at).map_or_else(Vec::new, |b| self.line_to(b.tip)));
        let same = lines[0].iter().zip(&lines[1]).take_while(|(a, b)| a == b).count();
        same.saturating_sub(1) as u32
    }

    fn line_to(&self, tip: Place) -> Vec<Place> {
        let mut line: Vec<Place> = std::iter::successors(Some(tip), |&place| self.twigs[place].parent).collect();
        line.reverse();
        line
    }

    fn free_name(&self) -> String {
        let free = |name: &String| self.branches.iter().all(|branch| branch.name != *name);
        (1..).map(|number| format!("b{number}")).find(free).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::agent::Decision;
    use crate::domain::{Action, ActionType, World};
    use crate::episode::record::{Author, TraceStep};
    use crate::house::Outcome;

    fn saved_state(x: i16) -> SavedState {
        let mut world = World::default();
        world.agent.cell.x = x;
        SavedState {
            last: None,
            world: Arc::new(world),
            grader: None,
            task_aside: None,
            horizon: None,
            instruction: "go".into(),
            wishes: Wishes::new(),
            author: Author::hand(),
            carried: PolicyState::Nothing,
        }
    }

    fn taken(kind: ActionType, told: &str) -> TakenStep {
        let step = TraceStep {
            own: None,
            kind,
            target: None,
            class: None,
            outcome: Outcome::Done,
            subtask: None,
            instruction: None,
            author: None,
        };
        TakenStep {
            decision: Decision::of(Action::navigate(kind)),
            step,
            instruction: told.into(),
            wish: None,
            author: Author::hand(),
            values: None,
        }
    }

    fn grow(tree: &mut Tree, kind: ActionType, x: i16) -> Growth {
        tree.grow(taken(kind, "go"), || saved_state(x), || "why".into())
    }

    /// main: ahead, ahead, left; b1 leaves it after the first step, to the right.
    fn forked() -> Tree {
        let mut tree = Tree::new(saved_state(0));
        for (kind, x) in [(ActionType::MoveAhead, 1), (ActionType::MoveAhead, 2), (ActionType::RotateLeft, 3)] {
            assert_eq!(grow(&mut tree, kind, x), Growth::Longer);
        }
        tree.seek(1);
        assert_eq!(grow(&mut tree, ActionType::RotateRight, 10), Growth::Forked(1));
        tree
    }

    #[test]
    fn a_new_step_in_the_past_forks_and_both_branches_stay() {
        let mut tree = forked();
        assert_eq!((tree.branch(), tree.at(), tree.last()), (1, 2, 2));
        assert_eq!(tree.branches()[1].left, Some((0, 1)));
        assert_eq!(tree.shared(0, 1), 1);
        assert!(tree.switch(0));
        assert_eq!((tree.at(), tree.last()), (2, 3), "the same step of the other branch");
        assert_eq!(tree.saved_state().world.agent.cell.x, 2);
        assert_eq!(tree.forks().collect::<Vec<_>>(), [false, true, false, false]);
    }

    #[test]
    fn the_same_step_again_follows_what_is_there() {
        let mut tree = forked();
        tree.seek(1);
        assert_eq!(grow(&mut tree, ActionType::MoveAhead, 99), Growth::Known);
        assert_eq!((tree.branch(), tree.at()), (0, 2), "back on main");
        assert_eq!(tree.saved_state().world.agent.cell.x, 2);
        tree.seek(0);
        assert_eq!(grow(&mut tree, ActionType::MoveAhead, 99), Growth::Known);
    }

    #[test]
    fn the_same_action_under_another_instruction_is_another_step() {
        let mut tree = forked();
        tree.switch(0);
        tree.seek(2);
        let growth = tree.grow(taken(ActionType::RotateLeft, "stop"), || saved_state(5), || "told stop".into());
        assert_eq!(growth, Growth::Forked(2));
        assert_eq!(tree.branches()[2].why, "told stop");
    }

    #[test]
    fn names_are_free_and_stay_unique() {
        let mut tree = forked();
        assert!(tree.rename(1, " left turn "));
        assert_eq!(tree.branches()[1].name, "left turn");
        assert!(!tree.rename(1, "main") && !tree.rename(1, "") && !tree.rename(7, "x"));
        tree.seek(0);
        grow(&mut tree, ActionType::LookUp, 20);
        assert_eq!(tree.branches()[2].name, "b1");
    }

    #[test]
    fn a_long_branch_is_full_in_the_end_and_only_its_newest_states_keep_what_the_policy_carried() {
        let carrying = |x: i16| {
            let rng = rand_chacha::rand_core::SeedableRng::seed_from_u64(1);
            SavedState { carried: PolicyState::Random(Box::new(rng)), ..saved_state(x) }
        };
        let mut tree = Tree::new(carrying(0));
        let mut steps = 0;
        while !tree.is_full() {
            tree.grow(taken(ActionType::MoveAhead, "go"), || carrying(1), || "why".into());
            steps += 1;
        }
        assert!(steps < MOST);
        let kept = tree.twigs.iter().filter(|twig| !matches!(twig.moment.carried, PolicyState::Nothing)).count();
        assert_eq!(kept, CARRIED);
    }

    #[test]
    fn seeking_beyond_the_end_stops_there() {
        let mut tree = forked();
        assert_eq!(tree.seek(77).world.agent.cell.x, 10);
        assert!(tree.next().is_none());
        tree.seek(0);
        assert!(tree.next().is_some());
        assert_eq!(tree.story(0).len(), 4);
    }
}
