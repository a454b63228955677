//! What the chooser knows of the situation and of each macro action, as numbers.

use tch::{Device, Tensor};

use super::goal::Goal;
use super::macro_action::{MacroAction, Purpose};
use super::progress::Progress;
use crate::agent::memory::Memory;
use crate::agent::memory::semantic_map::Thing;
use crate::domain::{ActionType, Cell, Class};
use crate::nets::chooser::Choices;

/// Numbers of a situation.
pub(crate) const SITUATION: usize = 56;
/// Numbers of a macro action.
pub(crate) const ACTION: usize = 48;
/// Kinds of interaction.
const INTERACTIONS: usize = ActionType::COUNT - 5;

/// What there is to choose from, and in which situation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Choice {
    /// [`SITUATION`] numbers.
    pub(crate) situation: Vec<f32>,
    /// The classes of the goal's object and receptacle; 0 for none.
    pub(crate) goal: [u8; 2],
    /// [`ACTION`] numbers for each macro action, one after the other.
    pub(crate) actions: Vec<f32>,
    /// The class that each macro action is about; 0 for none.
    pub(crate) classes: Vec<u8>,
}

/// A list of numbers under construction: each has its place. The places that are left at the end are spare, and 0.
struct Numbers(Vec<f32>);

impl Numbers {
    fn flag(&mut self, holds: bool) {
        self.0.push(f32::from(u8::from(holds)));
    }

    fn number(&mut self, number: f32) {
        self.0.push(if number.is_finite() { number.clamp(-4.0, 4.0) } else { 4.0 });
    }

    fn one_of(&mut self, count: usize, index: Option<usize>) {
        (0..count).for_each(|at| self.flag(index == Some(at)));
    }

    fn exactly(mut self, count: usize) -> Vec<f32> {
        debug_assert!(self.0.len() <= count, "{} numbers, not {count}", self.0.len());
        self.0.resize(count, 0.0);
        self.0
    }
}

fn log(count: f32) -> f32 {
    (1.0 + count.max(0.0)).ln() / 3.0
}

fn interaction(kind: ActionType) -> usize {
    kind.index().saturating_sub(5)
}

impl Choice {
    /// The numbers of a moment.
    pub(crate) fn of(memory: &Memory, progress: &Progress, things: &[Thing], actions: &[MacroAction]) -> Choice {
        let goal = progress.goal();
        let class = |class: Option<Class>| class.map_or(0, |class| class.index() as u8);
        let about = |action: &MacroAction| match action.purpose {
            Purpose::Interact(_, class) | Purpose::Search(class) => class.index() as u8,
            _ => 0,
        };
        Choice {
            situation: situation(memory, progress, things),
            goal: [class(goal.map(|goal| goal.object)), class(goal.and_then(|goal| goal.receptacle))],
            actions: actions.iter().flat_map(|action| numbers(memory, progress, things, action)).collect(),
            classes: actions.iter().map(about).collect(),
        }
    }

    /// How many macro actions there are.
    pub(crate) fn len(&self) -> usize {
        self.classes.len()
    }
}

/// Choices side by side, the shorter ones filled up.
pub(crate) fn side_by_side(choices: &[&Choice], device: Device) -> Choices {
    let (n, most) = (choices.len(), choices.iter().map(|choice| choice.len()).max().unwrap_or(0));
    let mut actions = vec![0f32; n * most * ACTION];
    let (mut classes, mut present) = (vec![0i64; n * most], vec![0f32; n * most]);
    for (row, choice) in choices.iter().enumerate() {
        actions[row * most * ACTION..][..choice.actions.len()].copy_from_slice(&choice.actions);
        for (column, &class) in choice.classes.iter().enumerate() {
            classes[row * most + column] = class.into();
            present[row * most + column] = 1.0;
        }
    }
    let situation: Vec<f32> = choices.iter().flat_map(|choice| choice.situation.iter().copied()).collect();
    let goal: Vec<i64> = choices.iter().flat_map(|choice| choice.goal.map(i64::from)).collect();
    let (n, most) = (n as i64, most as i64);
    Choices {
        situation: Tensor::from_slice(&situation).view([n, SITUATION as i64]).to_device(device),
        goal: Tensor::from_slice(&goal).view([n, 2]).to_device(device),
        actions: Tensor::from_slice(&actions).view([n, most, ACTION as i64]).to_device(device),
        classes: Tensor::from_slice(&classes).view([n, most]).to_device(device),
        present: Tensor::from_slice(&present).view([n, most]).to_device(device),
    }
}

fn situation(memory: &Memory, progress: &Progress, things: &[Thing]) -> Vec<f32> {
    let mut numbers = Numbers(Vec::with_capacity(SITUATION));
    let goal = progress.goal();
    let is = |of: fn(&Goal, Class) -> bool, class: Class| goal.is_some_and(|goal| of(goal, class));
    let object: fn(&Goal, Class) -> bool = Goal::is_object;
    let receptacle: fn(&Goal, Class) -> bool = |goal, class| goal.receptacle == Some(class);
    let tool: fn(&Goal, Class) -> bool = Goal::is_tool;

    numbers.one_of(7, goal.map(|goal| goal.skill as usize));
    numbers.flag(goal.is_some_and(|goal| goal.slice));
    numbers.flag(goal.is_some_and(|goal| goal.place.is_some()));
    numbers.flag(progress.is_last());
    let held = progress.held;
    numbers.flag(held.is_none());
    numbers.flag(held.is_some_and(|held| is(object, held)));
    numbers.flag(held.is_some_and(Class::is_knife));
    numbers.flag(held.is_some_and(|held| is(receptacle, held)));

    // How often what was done for this goal, and to what of it.
    for kind in ActionType::ALL.into_iter().filter(|kind| kind.is_interaction()) {
        let count = progress.done.iter().filter(|done| done.kind == kind).count();
        numbers.number(count.min(3) as f32 / 2.0);
    }
    let did = |kind: ActionType, of: fn(&Goal, Class) -> bool| {
        progress.done.iter().any(|done| done.kind == kind && is(of, done.class))
    };
    numbers.flag(did(ActionType::Pickup, object));
    numbers.flag(did(ActionType::Put, receptacle));
    numbers.flag(did(ActionType::Put, tool));
    numbers.flag(did(ActionType::ToggleOn, tool));
    numbers.flag(did(ActionType::ToggleOn, object));
    numbers.flag(did(ActionType::ToggleOff, tool));
    numbers.flag(did(ActionType::Close, tool));
    numbers.flag(did(ActionType::Slice, object));
    let last = progress.done.last();
    numbers.one_of(INTERACTIONS, last.map(|last| interaction(last.kind)));
    for of in [object, receptacle, tool] {
        numbers.flag(last.is_some_and(|last| is(of, last.class)));
    }
    // What was put into a tool and came out of it again.
    let order = |kind: ActionType, of: fn(&Goal, Class) -> bool| {
        progress.done.iter().rposition(|done| done.kind == kind && is(of, done.class))
    };
    let out_again = order(ActionType::Put, tool).is_some_and(|put| order(ActionType::Pickup, object) > Some(put));
    numbers.flag(out_again);
    numbers.number(progress.active.len() as f32 / 2.0);
    numbers.flag(progress.active.iter().any(|(class, _)| class.info().openable));

    let best = |of: fn(&Goal, Class) -> bool| {
        things.iter().filter(|thing| is(of, thing.class)).map(|thing| thing.score).fold(0.0, f32::max)
    };
    let seen_now =
        |of: fn(&Goal, Class) -> bool| things.iter().any(|thing| is(of, thing.class) && thing.seen == memory.step);
    for of in [object, receptacle, tool] {
        numbers.number(best(of));
        numbers.flag(seen_now(of));
    }
    numbers.number(progress.turns.min(5) as f32 / 4.0);
    numbers.number(f32::from(memory.odometry.pose().horizon) / 60.0);
    numbers.number(log(progress.steps as f32));
    numbers.flag(memory.odometry.blocked());
    numbers.flag(progress.placed.iter().any(|(class, _)| is(object, *class)));
    numbers.exactly(SITUATION)
}

fn numbers(memory: &Memory, progress: &Progress, things: &[Thing], action: &MacroAction) -> Vec<f32> {
    let mut numbers = Numbers(Vec::with_capacity(ACTION));
    let goal = progress.goal();
    let (kind, class) = match action.purpose {
        Purpose::Interact(kind, class) => (Some(kind), class),
        Purpose::Search(class) => (None, class),
        _ => (None, Class::NONE),
    };
    numbers.one_of(INTERACTIONS, kind.map(interaction));
    numbers.flag(action.purpose == Purpose::Explore);
    numbers.flag(matches!(action.purpose, Purpose::Search(_)));
    for look in [ActionType::RotateLeft, ActionType::RotateRight, ActionType::LookUp, ActionType::LookDown] {
        numbers.flag(action.purpose == Purpose::Look(look));
    }
    numbers.flag(action.is_immediate());
    numbers.number(action.steps as f32 / 20.0);
    numbers.number(log(action.steps as f32));
    numbers.number((action.cost - action.steps as f32) / 4.0);

    let info = class.info();
    numbers.flag(goal.is_some_and(|goal| goal.is_object(class)));
    numbers.flag(goal.is_some_and(|goal| goal.receptacle == Some(class)));
    numbers.flag(goal.is_some_and(|goal| goal.place == Some(class)));
    numbers.flag(goal.is_some_and(|goal| goal.is_tool(class)));
    numbers.flag(class.is_knife());
    numbers.flag(info.openable);
    numbers.flag(info.receptacle);
    numbers.flag(info.basin);
    numbers.flag(goal.is_some_and(|goal| class.holds(goal.object)));
    numbers.flag(progress.held.is_some_and(|held| class.holds(held)));

    let thing = action.thing.and_then(|index| things.get(index));
    numbers.flag(thing.is_some());
    numbers.number(thing.map_or(0.0, |thing| thing.score));
    numbers.flag(thing.is_some_and(|thing| thing.seen == memory.step));
    numbers.number(thing.map_or(0.0, |thing| log((memory.step - thing.seen) as f32)));
    numbers.number(thing.map_or(0.0, |thing| thing.open));
    numbers.number(thing.map_or(0.0, |thing| thing.height / 2.0));
    numbers.number(thing.map_or(0.0, |thing| log(thing.cells.len() as f32)));
    let at = thing.map(|thing| thing.best).or(action.at);
    let beside = |wanted: &dyn Fn(Class) -> bool| {
        let Some(thing) = thing else { return 0.0 };
        let near = things.iter().filter(|other| wanted(other.class) && lie_together(other, thing));
        near.map(|other| other.score).fold(0.0, f32::max)
    };
    numbers.number(beside(&|class| goal.is_some_and(|goal| goal.is_object(class))));
    numbers.number(beside(&|class| goal.is_some_and(|goal| goal.place == Some(class))));
    numbers.number(beside(&|class| goal.is_some_and(|goal| goal.receptacle == Some(class))));
    let near = |cell: &Cell| at.is_some_and(|at| at.apart(*cell) <= 2);
    let touched = progress.done.iter().filter(|done| done.class == class && near(&done.cell));
    numbers.number(touched.clone().count().min(4) as f32 / 2.0);
    numbers.number(touched.filter(|done| Some(done.kind) == kind).count().min(4) as f32 / 2.0);
    numbers.flag(progress.done.last().is_some_and(|last| last.class == class && near(&last.cell)));
    numbers.flag(progress.active.iter().any(|(active, cell)| *active == class && near(cell)));
    // The one that it put there itself, not another of its kind.
    numbers.flag(progress.placed.iter().any(|(placed, cell)| *placed == class && near(cell)));
    for novelty in action.novelty {
        numbers.number(novelty.unseen);
        numbers.number(novelty.nearer);
    }
    numbers.exactly(ACTION)
}

/// Whether two things share a cell, or lie in neighbouring ones.
fn lie_together(a: &Thing, b: &Thing) -> bool {
    let (small, large) = if a.cells.len() < b.cells.len() { (a, b) } else { (b, a) };
    small.cells.iter().any(|(cell, _)| large.cells.iter().any(|(other, _)| cell.apart(*other) <= 1))
}
