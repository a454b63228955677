//! What keeps an agent from repeating itself. With a few frames of memory it would come back to a view and do there what it
//! did before, for ever: a demonstrator never has to.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hasher};

use crate::domain::{Action, ActionType, Class, Instance};
use crate::house::view::Candidate;

/// An action as the guard remembers it: what is done, and to which class of things.
type Tried = (ActionType, Option<Class>);

/// What was tried at each view, and what was put down.
///
/// * At no view is the same action tried twice until something is picked up, put down or sliced, or another instruction is
///   given: this ends pushing against a wall, walking in a circle, opening and closing a door.
/// * What was put down is not picked up again before the agent has acted on something else.
#[derive(Clone, Debug, Default)]
pub(crate) struct LoopGuard {
    /// What was tried at each view since something was last moved, by the view's digest.
    tried_at: HashMap<u64, Vec<Tried>>,
    last: Option<(ActionType, Option<Candidate>)>,
    held: Option<Instance>,
    put_down: Option<Instance>,
}

impl LoopGuard {
    /// Forgets what was tried: another instruction may ask for it again.
    pub(crate) fn clear(&mut self) {
        self.tried_at.clear();
        self.put_down = None;
    }

    /// Records what came of the last action, which was chosen at `view`: whether the picture changed.
    pub(crate) fn record(&mut self, view: &[u8], changed: bool) {
        let Some((kind, target)) = self.last else { return };
        if changed && kind.is_interaction() {
            self.acted(kind, target.map(|target| target.instance));
        }
        if changed && matches!(kind, ActionType::Pickup | ActionType::Put | ActionType::Slice) {
            self.tried_at.clear();
        } else {
            self.tried_at.entry(digest(view)).or_default().push((kind, target.map(|target| target.class)));
        }
    }

    fn acted(&mut self, kind: ActionType, target: Option<Instance>) {
        match kind {
            ActionType::Put => self.put_down = self.held.take(),
            ActionType::Pickup => (self.held, self.put_down) = (target, None),
            _ => self.put_down = None,
        }
    }

    /// Of the candidates at `view` those that repeat nothing, and the navigation that was tried there.
    pub(crate) fn untried(&self, view: &[u8], candidates: &[Candidate]) -> (Vec<Candidate>, Vec<ActionType>) {
        let tried = self.tried_at.get(&digest(view)).map_or(&[][..], Vec::as_slice);
        let is_new = |candidate: &&Candidate| {
            let undoes = candidate.kind == ActionType::Pickup && self.put_down == Some(candidate.instance);
            !undoes && !tried.contains(&(candidate.kind, Some(candidate.class)))
        };
        let moves = tried.iter().filter(|tried| tried.1.is_none()).map(|tried| tried.0).collect();
        (candidates.iter().filter(is_new).copied().collect(), moves)
    }

    /// Remembers which action was chosen.
    pub(crate) fn chose(&mut self, action: Action, candidates: &[Candidate]) {
        let named = candidates.iter().find(|candidate| candidate.action() == action);
        self.last = Some((action.kind, named.copied()));
    }
}

/// Tells views apart.
pub(crate) fn digest(view: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(view);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use ActionType::{Close, MoveAhead, Open, Pickup, Put, RotateLeft, RotateRight};

    use super::*;

    #[derive(Default)]
    struct Walk {
        guard: LoopGuard,
        view: Vec<u8>,
    }

    impl Walk {
        /// Comes to a view and does the first thing that repeats nothing: a candidate, else a move in the order of the head.
        fn leave(&mut self, view: u8, candidates: &[Candidate]) -> ActionType {
            self.guard.record(&self.view, self.view != [view]);
            self.view = vec![view];
            let (candidates, tried) = self.guard.untried(&self.view, candidates);
            let untried = ActionType::ALL.into_iter().find(|kind| !kind.is_interaction() && !tried.contains(kind));
            let action = candidates.first().map_or_else(|| Action::navigate(untried.unwrap()), Candidate::action);
            self.guard.chose(action, &candidates);
            action.kind
        }
    }

    fn with(kind: ActionType, instance: Instance, class: &str) -> Candidate {
        Candidate { kind, instance, class: Class::named(class).unwrap(), distance: 0.0 }
    }

    #[test]
    fn nothing_is_tried_twice_at_a_view_until_something_is_moved() {
        let mut walk = Walk::default();
        let went: Vec<ActionType> = [7, 7, 8, 7, 8].into_iter().map(|view| walk.leave(view, &[])).collect();
        assert_eq!(went, [MoveAhead, RotateLeft, MoveAhead, RotateRight, RotateLeft]);
        let mug = with(Pickup, Instance::Object(0), "Mug");
        assert_eq!(walk.leave(7, &[mug]), Pickup);
        assert_eq!([walk.leave(9, &[]), walk.leave(7, &[])], [MoveAhead; 2]);
    }

    #[test]
    fn another_instruction_allows_everything_again() {
        let mut walk = Walk::default();
        assert_eq!([walk.leave(7, &[]), walk.leave(7, &[])], [MoveAhead, RotateLeft]);
        walk.guard.clear();
        // The last way was taken before and is noted after.
        assert_eq!([walk.leave(7, &[]), walk.leave(7, &[])], [MoveAhead, RotateRight]);
    }

    #[test]
    fn no_door_is_opened_and_closed_for_ever() {
        let door = |kind| [with(kind, Instance::Fixture(0), "Cabinet")];
        let mut walk = Walk::default();
        let (shut, open) = (7, 8);
        assert_eq!([walk.leave(shut, &door(Open)), walk.leave(open, &door(Close))], [Open, Close]);
        assert_eq!([walk.leave(shut, &door(Open)), walk.leave(shut, &door(Open))], [MoveAhead, RotateLeft]);
        assert_eq!(walk.leave(9, &[with(Pickup, Instance::Object(0), "Mug")]), Pickup);
        assert_eq!([walk.leave(shut, &door(Open)), walk.leave(open, &door(Close))], [Open, Close]);
    }

    #[test]
    fn what_was_put_down_is_not_taken_again_before_something_else_was_acted_on() {
        let [keys, others] = [0, 1].map(|index| with(Pickup, Instance::Object(index), "KeyChain"));
        let sofa = with(Put, Instance::Fixture(0), "Sofa");
        let mut walk = Walk::default();
        assert_eq!([walk.leave(1, &[keys]), walk.leave(2, &[sofa])], [Pickup, Put]);
        assert_eq!([walk.leave(3, &[keys]), walk.leave(4, &[keys])], [MoveAhead; 2]);
        // What only looks like it may be taken; and then the first again.
        assert_eq!([walk.leave(5, &[keys, others]), walk.leave(6, &[sofa])], [Pickup, Put]);
        assert_eq!(walk.guard.put_down, None, "not known until the next view");
        assert_eq!([walk.leave(8, &[others]), walk.leave(9, &[others, keys])], [MoveAhead, Pickup]);
        // A thing is put in, the door shut and opened: it may be taken out.
        let door = |kind| with(kind, Instance::Fixture(1), "Fridge");
        assert_eq!(
            [walk.leave(10, &[with(Put, Instance::Fixture(1), "Fridge")]), walk.leave(11, &[keys])],
            [Put, MoveAhead]
        );
        assert_eq!(
            [walk.leave(12, &[door(Close)]), walk.leave(13, &[door(Open)]), walk.leave(14, &[keys])],
            [Close, Open, Pickup]
        );
    }

    #[test]
    fn what_failed_was_not_put_down() {
        let mug = with(Pickup, Instance::Object(0), "Mug");
        let mut walk = Walk::default();
        assert_eq!([walk.leave(1, &[mug]), walk.leave(2, &[with(Put, Instance::Fixture(0), "Sink")])], [Pickup, Put]);
        // The picture is the same: the mug is still in the hand, and nothing was put down.
        assert_eq!(walk.leave(2, &[mug]), Pickup);
    }
}
