//! The steps of the branch in hand in a form that a screen can draw, and how two branches part.

use std::sync::Arc;

use crate::domain::ActionType;
use crate::episode::branches::{TakenStep, Tree};
use crate::house::view::Frame;

/// What was tried, for the screen.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Timeline {
    /// The step in hand.
    pub(crate) at: u32,
    /// The steps of the branch in hand.
    pub(crate) steps: Vec<TimelineStep>,
    /// Other branches leave it at the start.
    pub(crate) forks_at_start: bool,
    /// All branches, in the order in which they began.
    pub(crate) branches: Vec<BranchSummary>,
    /// The number of the one in hand.
    pub(crate) branch: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TimelineStep {
    /// What was done.
    pub(crate) kind: ActionType,
    /// It could be done.
    pub(crate) done: bool,
    /// The subtask that it completed, from 1.
    pub(crate) completed: Option<u32>,
    /// A person chose it.
    pub(crate) by_hand: bool,
    /// The agent was told something else before it.
    pub(crate) instructed: bool,
    /// Other branches leave after it.
    pub(crate) forks: bool,
    /// The entropy of the choice, in nats.
    pub(crate) entropy: Option<f32>,
    /// The probability of what was chosen.
    pub(crate) chosen: Option<f32>,
    /// V of the state before it.
    pub(crate) value: Option<f32>,
    /// Q of what was chosen.
    pub(crate) q: Option<f32>,
}

/// A branch in the list of branches.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct BranchSummary {
    /// As a person or the session named it.
    pub(crate) name: String,
    /// Why it began.
    pub(crate) why: String,
    /// The branch that it left, and after which step.
    pub(crate) left: Option<(usize, u32)>,
    /// Its last step.
    pub(crate) last: u32,
    /// Subtasks that were completed on it.
    pub(crate) completed: u32,
}

impl TimelineStep {
    fn of(taken: &TakenStep, before: Option<&TakenStep>, forks: bool) -> TimelineStep {
        let distribution = taken.decision.distribution.as_ref();
        let kind = taken.decision.action.kind;
        TimelineStep {
            kind,
            done: taken.step.outcome.is_done(),
            completed: taken.step.subtask.map(|subtask| subtask + 1),
            by_hand: taken.author.is_hand(),
            instructed: before.is_some_and(|before| match (&before.wish, &taken.wish) {
                (Some(before), Some(wish)) => !before.is_same(wish),
                _ => before.instruction != taken.instruction,
            }),
            forks,
            entropy: distribution.map(|distribution| distribution.entropy),
            chosen: distribution.and_then(|distribution| distribution.actions[kind.index()]),
            value: taken.values.as_ref().map(|values| values.state),
            q: taken.values.as_ref().and_then(|values| values.q(kind, taken.step.class)),
        }
    }

    /// Something to jump to.
    pub(crate) fn is_event(&self) -> bool {
        self.completed.is_some() || !self.done || self.instructed || self.forks
    }
}

impl Timeline {
    /// The branch in hand of a tree.
    pub(crate) fn of(tree: &Tree) -> Timeline {
        let steps: Vec<&TakenStep> = tree.steps().collect();
        let mut forks = tree.forks();
        let forks_at_start = forks.next().unwrap_or(false);
        let before = std::iter::once(None).chain(steps.iter().copied().map(Some));
        let steps =
            steps.iter().zip(before).zip(forks).map(|((taken, before), forks)| TimelineStep::of(taken, before, forks));
        let branches = tree.branches().iter().enumerate().map(|(at, branch)| BranchSummary {
            name: branch.name.clone(),
            why: branch.why.clone(),
            left: branch.left,
            last: tree.length(at),
            completed: tree.completed(at),
        });
        Timeline {
            at: tree.at(),
            steps: steps.collect(),
            forks_at_start,
            branches: branches.collect(),
            branch: tree.branch(),
        }
    }

    /// The next event after the step in hand (or, backwards, the last before it); the end of the branch without any.
    pub(crate) fn event(&self, forward: bool) -> u32 {
        let last = self.steps.len() as u32;
        let mut events = (1..=last).zip(&self.steps).filter(|(_, step)| step.is_event()).map(|(step, _)| step);
        match forward {
            true => events.find(|&step| step > self.at).unwrap_or(last),
            false => events.take_while(|&step| step < self.at).last().unwrap_or(0),
        }
    }

    /// The step that completed a subtask, from 1.
    pub(crate) fn subtask(&self, number: u32) -> Option<u32> {
        (1..).zip(&self.steps).find(|(_, step)| step.completed == Some(number)).map(|(step, _)| step)
    }
}

/// A step in the list of actions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ActionLine {
    /// What was done, on what, and what came of it.
    pub(crate) words: String,
    /// What the agent was told.
    pub(crate) told: Arc<str>,
    /// Who chose.
    pub(crate) by: String,
    /// It could be done.
    pub(crate) done: bool,
    /// It completed a subtask.
    pub(crate) completed: bool,
}

impl ActionLine {
    pub(crate) fn of(taken: &TakenStep) -> ActionLine {
        ActionLine {
            words: words(taken),
            told: taken.instruction.clone(),
            by: if taken.author.is_hand() { "you".into() } else { taken.author.policy.clone() },
            done: taken.step.outcome.is_done(),
            completed: taken.step.subtask.is_some(),
        }
    }

    /// In one line, with its number, and with what was told and by whom it was chosen where that is another than before.
    pub(crate) fn line(&self, step: usize, before: Option<&ActionLine>) -> String {
        let told =
            before.is_none_or(|before| before.told != self.told).then(|| format!("  instruction: {}", self.told));
        let by = before.is_none_or(|before| before.by != self.by).then(|| format!("  by {}", self.by));
        format!("{step:>4} {:<38}{}{}", self.words, by.unwrap_or_default(), told.unwrap_or_default())
    }
}

/// Which step of which branch is in hand.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BranchPosition {
    /// The step in hand.
    pub(crate) step: u32,
    /// The last step of the branch.
    pub(crate) of: u32,
    /// The branch's name.
    pub(crate) branch: String,
    /// What led here, in words; nothing at the start.
    pub(crate) last_step: Option<String>,
}

impl BranchPosition {
    /// The place in hand of a tree.
    pub(crate) fn of(tree: &Tree) -> BranchPosition {
        let branch = tree.branches().get(tree.branch()).map_or_else(String::new, |branch| branch.name.clone());
        BranchPosition { step: tree.at(), of: tree.last(), branch, last_step: tree.last_taken().map(words) }
    }
}

/// How two branches part.
#[derive(Clone, Debug, PartialEq)]
pub struct Divergence {
    /// The names of the branch in hand and the other one.
    pub(crate) names: [String; 2],
    /// How many steps they share.
    pub(crate) shared: u32,
    /// The steps after that, side by side.
    pub(crate) rows: Vec<DivergenceRow>,
    /// What the agent saw on both, side by side in one picture, at the steps that are named.
    pub(crate) frames: Option<(Arc<Frame>, [u32; 2])>,
}

/// A step of two branches that have parted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct DivergenceRow {
    /// Counted from 1.
    pub(crate) step: u32,
    /// What each did, in words; nothing where it is over.
    pub(crate) sides: [Option<String>; 2],
    /// The world was the same after it.
    pub(crate) same: bool,
}

impl Divergence {
    /// How `one` and `other` part.
    pub(crate) fn of(tree: &Tree, one: usize, other: usize) -> Divergence {
        let stories = [tree.story(one), tree.story(other)];
        let name = |at: usize| tree.branches().get(at).map_or_else(String::new, |branch| branch.name.clone());
        let shared = tree.shared(one, other);
        let longest = stories.iter().map(Vec::len).max().unwrap_or(0) as u32;
        let rows = (shared + 1..longest).map(|step| {
            let of = |side: usize| stories[side].get(step as usize);
            let side = |side: usize| of(side).and_then(|(_, taken)| taken.map(words));
            let same = matches!((of(0), of(1)), (Some((a, _)), Some((b, _))) if a.world == b.world);
            DivergenceRow { step, sides: [side(0), side(1)], same }
        });
        Divergence { names: [name(one), name(other)], shared, rows: rows.collect(), frames: None }
    }
}

/// A step in words.
pub(crate) fn words(taken: &TakenStep) -> String {
    let class = taken.step.class.map_or(String::new(), |class| format!(" {}", class.name()));
    let hand = if taken.author.is_hand() { " (you)" } else { "" };
    let done = taken.step.subtask.map_or(String::new(), |subtask| format!(" · subtask {} done", subtask + 1));
    let outcome = if taken.step.outcome.is_done() { String::new() } else { format!(" · {}", taken.step.outcome) };
    format!("{}{class}{hand}{outcome}{done}", taken.step.kind)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Action;
    use crate::explore::testing;

    #[test]
    fn events_are_what_one_jumps_to() {
        let mut exploration = testing::exploration();
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        for _ in 0..4 {
            exploration.act(Action::navigate(ActionType::LookDown)).unwrap();
        }
        exploration.instruct("dance").unwrap();
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        let time = Timeline::of(exploration.tree());
        let events: Vec<u32> =
            (1..).zip(&time.steps).filter(|(_, step)| step.is_event()).map(|(step, _)| step).collect();
        assert_eq!(events.last(), Some(&6), "the new instruction");
        assert!(events.len() >= 2, "and a look beyond the limit: {events:?}");
        assert_eq!(time.event(false), events[events.len() - 2]);
        assert_eq!(time.event(true), 6);
        exploration.seek(0);
        assert_eq!(Timeline::of(exploration.tree()).event(true), events[0]);
    }

    #[test]
    fn actions_are_listed_with_what_was_told_where_that_changed() {
        let mut exploration = testing::exploration();
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        exploration.act(Action::navigate(ActionType::LookUp)).unwrap();
        exploration.instruct("dance").unwrap();
        exploration.act(Action::navigate(ActionType::RotateLeft)).unwrap();
        let lines: Vec<ActionLine> = exploration.tree().steps().map(ActionLine::of).collect();
        let before = |at: usize| at.checked_sub(1).map(|before| &lines[before]);
        let texts: Vec<String> = (0..3).map(|at| lines[at].line(at + 1, before(at))).collect();
        assert!(
            texts[0].starts_with("   1 RotateLeft (you)")
                && texts[0].ends_with("by you  instruction: put the mug in the sink"),
            "{texts:?}"
        );
        assert_eq!(texts[1].trim_end(), "   2 LookUp (you)");
        assert!(texts[2].ends_with("instruction: Dance."), "{texts:?}");
    }

    #[test]
    fn parted_branches_are_told_side_by_side() {
        let mut exploration = testing::exploration();
        let turn = |kind| Action::navigate(kind);
        exploration.act(turn(ActionType::RotateLeft)).unwrap();
        exploration.act(turn(ActionType::RotateLeft)).unwrap();
        exploration.seek(1);
        exploration.act(turn(ActionType::RotateRight)).unwrap();
        exploration.act(turn(ActionType::LookUp)).unwrap();
        let parted = exploration.divergence(0);
        assert_eq!((parted.names.clone(), parted.shared), (["b1".into(), "main".into()], 1));
        assert_eq!(parted.rows.len(), 2);
        assert_eq!(parted.rows[0].sides, [Some("RotateRight (you)".into()), Some("RotateLeft (you)".into())]);
        assert_eq!(parted.rows[1].sides[1], None);
        assert!(!parted.rows[0].same);
    }
}
