//! How far the agent believes to be: the subtask it is at, what it holds, and what it has done for it.

use super::goal::Goal;
use crate::agent::memory::navigator::Failed;
use crate::domain::{ActionType, Cell, Class, SkillKind};

/// An interaction that changed what is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interaction {
    /// What was done.
    pub(crate) kind: ActionType,
    /// To what.
    pub(crate) class: Class,
    /// Where, in the agent's own frame.
    pub(crate) cell: Cell,
}

/// An action that was decided, of which it is not known yet whether it worked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Attempt {
    pub(crate) kind: ActionType,
    /// Of an interaction: with what, and where.
    pub(crate) target: Option<(Class, Cell)>,
}

/// Where the agent stands with its goals.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Progress {
    /// What it is after, in order.
    pub(crate) goals: Vec<Goal>,
    /// At which of them it is; it stays at the last one.
    pub(crate) at: usize,
    /// What it holds; no class for something that it did not pick up itself.
    pub(crate) held: Option<Class>,
    /// What it has done for the present goal, oldest first.
    pub(crate) done: Vec<Interaction>,
    /// What it opened or switched on and has not closed or switched off since, in the whole episode.
    pub(crate) active: Vec<(Class, Cell)>,
    /// What it put where and has not taken again, in the whole episode.
    pub(crate) placed: Vec<(Class, Cell)>,
    /// From where it has looked at what might hold what it is after.
    pub(crate) searched: Failed,
    /// Steps since the present goal began.
    pub(crate) steps: u32,
    /// Turns on the spot since it last moved, looked up or down, or acted.
    pub(crate) turns: u32,
}

impl Progress {
    /// New goals, with what is in the hand and what stands open as it is.
    pub(crate) fn set_goals(&mut self, goals: Vec<Goal>) {
        (self.goals, self.at, self.steps, self.turns) = (goals, 0, 0, 0);
        self.done.clear();
        self.searched.clear();
    }

    /// What was in the hand from the start is what somebody means who says to put or to wash something next.
    pub(crate) fn name_what_is_held(&mut self) {
        let meant =
            self.goal().filter(|goal| !matches!(goal.skill, SkillKind::Pickup | SkillKind::Slice | SkillKind::Toggle));
        if let (Some(Class::NONE), Some(goal)) = (self.held, meant) {
            self.held = Some(goal.object);
        }
    }

    /// The present goal.
    pub(crate) fn goal(&self) -> Option<&Goal> {
        self.goals.get(self.at)
    }

    /// Whether the present goal can be reached by now: what is to be put must have been put down, and what is to be picked up
    /// be in the hand.
    pub(crate) fn can_be_reached(&self) -> bool {
        self.goal().is_some_and(|goal| match goal.skill {
            SkillKind::Pickup => self.held.is_some_and(|held| goal.is_object(held)),
            SkillKind::Put => self.placed.iter().any(|(placed, _)| goal.is_object(*placed)),
            _ => true,
        })
    }

    /// Whether an interaction brings about the present goal at once, as far as one can tell which thing is meant.
    pub(crate) fn is_fulfilled_by(&self, kind: ActionType, class: Class) -> bool {
        let Some(goal) = self.goal() else { return false };
        match (goal.skill, kind) {
            (SkillKind::Pickup, ActionType::Pickup) => {
                let any_will_do = goal.place.is_none() && self.placed.iter().all(|(placed, _)| *placed != class);
                goal.is_object(class) && !goal.slice && any_will_do
            }
            (SkillKind::Put, ActionType::Put) => {
                goal.receptacle == Some(class) && self.held.is_some_and(|held| goal.is_object(held))
            }
            (SkillKind::Toggle, ActionType::ToggleOn) | (SkillKind::Slice, ActionType::Slice) => goal.is_object(class),
            _ => false,
        }
    }

    /// Whether the present goal is the last one.
    pub(crate) fn is_last(&self) -> bool {
        self.at + 1 >= self.goals.len()
    }

    /// The next goal begins.
    pub(crate) fn advance(&mut self) {
        (self.at, self.steps, self.turns) = (self.at + 1, 0, 0);
        self.done.clear();
        self.searched.clear();
    }

    /// Takes in what came of an action.
    pub(crate) fn record(&mut self, attempt: Attempt, worked: bool) {
        self.steps += 1;
        match attempt.kind {
            ActionType::RotateLeft | ActionType::RotateRight => self.turns += 1,
            _ => self.turns = 0,
        }
        let Some((class, cell)) = attempt.target.filter(|_| worked) else { return };
        self.done.push(Interaction { kind: attempt.kind, class, cell });
        match attempt.kind {
            ActionType::Pickup => {
                self.held = Some(class);
                self.placed.retain(|(of, at)| *of != class || at.apart(cell) > 1);
            }
            ActionType::Put => {
                let put = self.held.take().filter(|held| *held != Class::NONE);
                self.placed.extend(put.map(|held| (held, cell)));
            }
            ActionType::Open | ActionType::ToggleOn => self.active.push((class, cell)),
            ActionType::Close | ActionType::ToggleOff => {
                // The last one of its class: one shuts what one has just opened.
                if let Some(at) = self.active.iter().rposition(|(of, _)| *of == class) {
                    self.active.remove(at);
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn what_is_in_the_hand_from_the_start_is_what_is_to_be_put_but_not_what_is_to_be_picked_up() {
        let mug = Class::named("Mug").unwrap();
        let held = |skill| {
            let goal = Goal { skill, object: mug, others: Vec::new(), receptacle: None, place: None, slice: false };
            let mut progress = Progress { goals: vec![goal], held: Some(Class::NONE), ..Progress::default() };
            progress.name_what_is_held();
            progress.held
        };
        assert_eq!(held(SkillKind::Put), Some(mug));
        assert_eq!(held(SkillKind::Pickup), Some(Class::NONE));
    }

    #[test]
    fn a_goal_is_brought_about_by_its_own_interaction_with_a_thing_that_must_be_the_one() {
        use ActionType::{Pickup, Put, ToggleOn};
        let [mug, cup, sink] = ["Mug", "Cup", "Sink"].map(|name| Class::named(name).unwrap());
        let goal = Goal {
            skill: SkillKind::Pickup,
            object: mug,
            others: Vec::new(),
            receptacle: None,
            place: None,
            slice: false,
        };
        let at = |goal: &Goal| Progress { goals: vec![goal.clone()], ..Progress::default() };
        assert!(at(&goal).is_fulfilled_by(Pickup, mug));
        assert!(!at(&goal).is_fulfilled_by(Pickup, cup) && !at(&goal).is_fulfilled_by(ToggleOn, mug));
        assert!(!at(&Goal { place: Some(sink), ..goal.clone() }).is_fulfilled_by(Pickup, mug), "it may lie elsewhere");
        let placed = Progress { placed: vec![(mug, Cell::new(0, 0))], ..at(&goal) };
        assert!(!placed.is_fulfilled_by(Pickup, mug), "it may be another one");
        let put = Goal { skill: SkillKind::Put, receptacle: Some(sink), ..goal };
        let holds = |held| Progress { held: Some(held), ..at(&put) };
        assert!(holds(mug).is_fulfilled_by(Put, sink) && !holds(cup).is_fulfilled_by(Put, sink));
    }

    #[test]
    fn what_worked_changes_hand_and_doors_and_what_did_not_changes_nothing() {
        let [mug, fridge] = ["Mug", "Fridge"].map(|name| Class::named(name).unwrap());
        let at = Cell::new(1, 2);
        let goal = Goal {
            skill: SkillKind::Put,
            object: mug,
            others: Vec::new(),
            receptacle: Some(fridge),
            place: None,
            slice: false,
        };
        let mut progress = Progress::default();
        progress.set_goals(vec![goal.clone(), goal]);
        let mut act = |kind, class, worked| {
            progress.record(Attempt { kind, target: Some((class, at)) }, worked);
            (progress.held, progress.active.len(), progress.done.len())
        };
        assert_eq!(act(ActionType::Pickup, mug, false), (None, 0, 0));
        assert_eq!(act(ActionType::Pickup, mug, true), (Some(mug), 0, 1));
        assert_eq!(act(ActionType::Open, fridge, true), (Some(mug), 1, 2));
        assert_eq!(act(ActionType::Put, fridge, true), (None, 1, 3));
        progress.advance();
        assert_eq!((progress.at, progress.done.len(), progress.active.len(), progress.is_last()), (1, 0, 1, true));
        progress.record(Attempt { kind: ActionType::Close, target: Some((fridge, at)) }, true);
        assert!(progress.active.is_empty());
    }

    #[test]
    fn another_thing_in_the_fridge_is_not_what_was_to_be_put_there() {
        let [apple, bread, fridge] = ["Apple", "Bread", "Fridge"].map(|name| Class::named(name).unwrap());
        let goal = |skill, receptacle| {
            vec![Goal { skill, object: bread, others: Vec::new(), receptacle, place: None, slice: false }]
        };
        let mut progress = Progress { held: Some(apple), ..Progress::default() };
        progress.set_goals(goal(SkillKind::Put, Some(fridge)));
        let mut act = |kind, class| {
            progress.record(Attempt { kind, target: Some((class, Cell::new(1, 2))) }, true);
            progress.can_be_reached()
        };
        assert!(!act(ActionType::Put, fridge), "that was the apple");
        assert!(!act(ActionType::Pickup, bread));
        assert!(act(ActionType::Put, fridge));
        progress.set_goals(goal(SkillKind::Pickup, None));
        assert!(!progress.can_be_reached());
    }

    #[test]
    fn what_it_put_down_is_known_until_it_takes_that_one_again() {
        let [mug, sink] = ["Mug", "Sink"].map(|name| Class::named(name).unwrap());
        let (there, elsewhere) = (Cell::new(4, 0), Cell::new(8, 0));
        let mut progress = Progress { held: Some(mug), ..Progress::default() };
        progress.record(Attempt { kind: ActionType::Put, target: Some((sink, there)) }, true);
        assert_eq!((progress.held, progress.placed.as_slice()), (None, [(mug, there)].as_slice()));
        progress.record(Attempt { kind: ActionType::Pickup, target: Some((mug, elsewhere)) }, true);
        assert_eq!(progress.placed, [(mug, there)], "another mug was taken");
        progress.record(Attempt { kind: ActionType::Put, target: Some((sink, elsewhere)) }, true);
        progress.record(Attempt { kind: ActionType::Pickup, target: Some((mug, Cell::new(4, 1))) }, true);
        assert_eq!(progress.placed, [(mug, elsewhere)]);
    }
}
