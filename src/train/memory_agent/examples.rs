//! What the chooser learns from: demonstrations, replayed through the agent's own eyes and memory. In each state the
//! demonstrator's choice says which macro actions begin rightly, and the trajectory's skills when a goal is reached.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tch::{Device, Tensor};

use crate::agent::memory_agent::eyes::Eyes;
use crate::agent::memory_agent::features::Choice;
use crate::agent::memory_agent::goal::Goal;
use crate::agent::memory_agent::macro_action::{MacroAction, Purpose};
use crate::agent::memory_agent::mind::{Mind, Moment};
use crate::domain::skill::SkillKind;
use crate::domain::world::Instance;
use crate::domain::{Action, ActionType, Cell, Pose, Scene, Trajectory, World};
use crate::house::render::Renderer;
use crate::house::view::{self, View};
use crate::house::{House, Replay};
use crate::language::instruction::normalise;
use crate::nets::device::set_threads;
use crate::train::frame_store::FrameStore;

/// A remembered object within so many cells of the one that the demonstrator went for is taken for it.
const MEANT: u16 = 4;

/// One state, with what is right in it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Example {
    /// What there is to choose from.
    pub(crate) choice: Choice,
    /// For each macro action, whether it begins as the demonstrator went on; empty where only `reached` is learned.
    pub(crate) right: Vec<bool>,
    /// The macro action that the demonstrator had set out to, where that can be told.
    pub(crate) aim: Option<usize>,
    /// For each macro action, whether it begins with what was done, be it right or not; empty where nothing was done for this
    /// goal, or it is not known what came of it. What came of it is the next example.
    pub(crate) taken: Vec<bool>,
    /// Whether the goal is reached.
    pub(crate) reached: bool,
}

/// Examples to learn from, and held-out ones to measure on; those of a trajectory one after the other.
pub(crate) struct ExampleSets {
    pub(crate) training: Vec<Example>,
    pub(crate) held_out: Vec<Example>,
}

/// What is marked of each macro action [n, actions], of the examples side by side: 1 or 0.
pub(super) fn marks(examples: &[&Example], device: Device, mark: impl Fn(&Example, usize) -> bool) -> Tensor {
    let (n, most) = (examples.len(), examples.iter().map(|example| example.choice.len()).max().unwrap_or(0));
    let row = |example: &&Example| -> Vec<f32> {
        (0..most).map(|column| f32::from(u8::from(column < example.choice.len() && mark(example, column)))).collect()
    };
    let marks: Vec<f32> = examples.iter().flat_map(row).collect();
    Tensor::from_slice(&marks).view([n as i64, most as i64]).to_device(device)
}

/// The examples of some trajectories, in their order; the same for any number of threads. `seed` drives in whose words each is told.
///
/// # Errors
/// When a scene is missing, or the shipped reader is damaged.
pub(crate) fn examples(
    frame_store: &FrameStore,
    eyes: &Eyes,
    seed: u64,
    wanted: &[usize],
) -> anyhow::Result<Vec<Vec<Example>>> {
    // Sums must not depend on how many threads there are.
    set_threads(1);
    let threads = rayon::current_num_threads().max(1);
    // Each worker has eyes of its own; weights are shared.
    let workers: Vec<(Eyes, &[usize])> =
        wanted.chunks(wanted.len().div_ceil(threads).max(1)).map(|own| (eyes.share(), own)).collect();
    let work = |(eyes, own): (Eyes, &[usize])| -> anyhow::Result<Vec<Vec<Example>>> {
        let mut renderer = Renderer::new(House::FRAME);
        let replayed = own.iter().map(|&trajectory| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(trajectory as u64 + 1);
            let recorded = &frame_store.trajectories[trajectory];
            let told = Told::of(recorded, &mut rng)?;
            replay(recorded, frame_store.scene(trajectory)?, &told, &eyes, &mut renderer)
        });
        replayed.collect()
    };
    let made: Vec<Vec<Vec<Example>>> = workers.into_par_iter().map(work).collect::<anyhow::Result<_>>()?;
    Ok(made.into_iter().flatten().collect())
}

/// A trajectory's goals in somebody's words, and the step in which each is reached.
struct Told {
    goals: Vec<Goal>,
    ends: Vec<usize>,
}

impl Told {
    /// One of the annotations at random, as it is read; where that does not say what was done, the skills themselves.
    fn of(trajectory: &Trajectory, rng: &mut ChaCha8Rng) -> anyhow::Result<Told> {
        let annotations = &trajectory.annotations;
        if !annotations.is_empty() {
            let text = &annotations[rng.random_range(0..annotations.len())].goal;
            let (goals, _) = Goal::read(&normalise(text), &[])?;
            if let Some(ends) = ends(trajectory, &goals) {
                return Ok(Told { goals, ends });
            }
        }
        let goals: Vec<Goal> = (0..trajectory.skills.len()).filter_map(|at| skill(trajectory, at)).collect();
        let ends = (1..=goals.len()).map(|at| end(trajectory, at - 1)).collect();
        Ok(Told { goals, ends })
    }
}

/// The step in which a skill is done.
fn end(trajectory: &Trajectory, skill: usize) -> usize {
    trajectory.skill_starts.get(skill + 1).map_or(trajectory.actions.len(), |&step| step as usize)
}

fn skill(trajectory: &Trajectory, at: usize) -> Option<Goal> {
    let subtask = trajectory.skills.get(at)?;
    let role = trajectory.roles.get(usize::from(subtask.object))?;
    let receptacle = subtask.receptacle.and_then(|role| trajectory.roles.get(usize::from(role)));
    Some(Goal {
        skill: subtask.skill,
        object: role.class,
        others: Vec::new(),
        receptacle: receptacle.map(|role| role.class),
        place: None,
        slice: role.slice,
    })
}

/// When each of the goals is reached, if they say what the trajectory's skills are: pickups may be left out that another goal
/// with the same thing implies.
fn ends(trajectory: &Trajectory, goals: &[Goal]) -> Option<Vec<usize>> {
    let mut skills = (0..trajectory.skills.len()).filter_map(|at| Some((at, skill(trajectory, at)?)));
    let mut ends = Vec::new();
    for goal in goals {
        loop {
            let (at, done) = skills.next()?;
            let same = |a: &Goal, b: &Goal| (a.object, a.slice) == (b.object, b.slice);
            if done.skill == goal.skill && same(&done, goal) && done.receptacle == goal.receptacle {
                ends.push(end(trajectory, at));
                break;
            }
            // People say nothing of the knife, neither that it is taken nor that it is laid down.
            let implied = done.object.is_knife() || done.skill == SkillKind::Pickup && same(&done, goal);
            if !implied {
                return None;
            }
        }
    }
    (skills.next().is_none() && !ends.is_empty()).then_some(ends)
}

fn replay(
    trajectory: &Trajectory,
    scene: &Scene,
    told: &Told,
    eyes: &Eyes,
    renderer: &mut Renderer,
) -> anyhow::Result<Vec<Example>> {
    let origin = trajectory.start.agent;
    let labels = if trajectory.choices.is_empty() { &trajectory.actions } else { &trajectory.choices };
    let mut recorded = Replay::new(scene, trajectory.start.clone(), &trajectory.actions);
    let mut mind = Mind::default();
    mind.set_goals(told.goals.clone());
    let mut found = Vec::new();
    for step in 0..=trajectory.actions.len() {
        let world = recorded.world().clone();
        let frame = renderer.draw(scene, &world);
        let seen = eyes.look_at(scene, &world, frame)?;
        let legal = view::candidates(scene, &world, &View::of(frame));
        mind.observe(&Moment { pose: world.agent.relative_to(origin), frame, seen: &seen, legal: &legal });
        while told.ends.get(mind.progress.at).is_some_and(|end| *end <= step) {
            let (_, choice) = mind.choice(&legal);
            found.push(Example { choice, right: Vec::new(), aim: None, taken: Vec::new(), reached: true });
            if mind.progress.is_last() {
                return Ok(found);
            }
            mind.progress.advance();
        }
        let (Some(&label), Some(&action)) = (labels.get(step), trajectory.actions.get(step)) else { break };
        let (actions, choice) = mind.choice(&legal);
        let right: Vec<bool> = actions.iter().map(|it| begins_so(scene, &world, it, label)).collect();
        let until = told.ends.get(mind.progress.at).copied().unwrap_or(labels.len());
        let next = labels[step..until.clamp(step, labels.len())].iter().find(|next| next.target.is_some());
        let aim = aim(scene, &world, origin, &actions, next.copied(), label).filter(|&aim| right[aim]);
        let right = if right.contains(&true) { right } else { Vec::new() };
        let taken = actions.iter().map(|it| begins_so(scene, &world, it, action)).collect();
        found.push(Example { choice, right, aim, taken, reached: false });

        let class = action.target.and_then(|target| world.class_of(scene, target));
        let at = actions.iter().find(|it| it.first == action).and_then(|it| it.at).unwrap_or_else(|| mind.ahead());
        mind.attempt(action, class.map(|class| (class, at)));
        recorded.step();
    }
    if let Some(last) = found.last_mut() {
        last.taken.clear();
    }
    Ok(found)
}

/// Whether a macro action begins with what the demonstrator did: for an interaction, with a thing of the same class.
fn begins_so(scene: &Scene, world: &World, macro_action: &MacroAction, label: Action) -> bool {
    let class = |action: Action| action.target.and_then(|target| world.class_of(scene, target));
    macro_action.first.kind == label.kind && class(macro_action.first) == class(label)
}

/// What the demonstrator had set out to: its next interaction, where that thing is remembered; or to look around, where it is not.
fn aim(
    scene: &Scene,
    world: &World,
    origin: Pose,
    actions: &[MacroAction],
    next: Option<Action>,
    label: Action,
) -> Option<usize> {
    let next = next?;
    let target = next.target?;
    let class = world.class_of(scene, target)?;
    let place = place(scene, world, origin, target)?;
    let meant = |action: &MacroAction| match action.purpose {
        Purpose::Interact(kind, of) if kind == next.kind && of == class => Some(()),
        _ => None,
    };
    let away = |action: &MacroAction| {
        let at = action.at.unwrap_or(place);
        at.apart(place)
    };
    let candidates = actions.iter().enumerate().filter(|(_, action)| meant(action).is_some());
    let nearest = candidates
        .min_by_key(|(_, action)| away(action))
        .filter(|(_, action)| matches!(target, Instance::Fixture(_)) || away(action) <= MEANT);
    let look = || actions.iter().position(|action| action.purpose == Purpose::Look(label.kind));
    // What is not seen yet is looked for where it lies.
    let search = || {
        let searches = actions.iter().enumerate().filter(|(_, action)| matches!(action.purpose, Purpose::Search(_)));
        searches
            .filter(|(_, action)| away(action) <= 2 * MEANT)
            .min_by_key(|(_, action)| away(action))
            .map(|(at, _)| at)
    };
    match nearest.map(|(at, _)| at).or_else(search) {
        Some(at) => Some(at),
        None if matches!(label.kind, ActionType::RotateLeft | ActionType::RotateRight) => look(),
        None => None,
    }
}

fn place(scene: &Scene, world: &World, origin: Pose, target: Instance) -> Option<Cell> {
    let cell = Cell::nearest(world.position(scene, target)?);
    Some(Pose { cell, ..origin }.relative_to(origin).cell)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::data::dataset::Dataset;
    use crate::train::collect::{Collection, DemonstrationSettings, ExpertKind, TaskSource};
    use crate::train::metrics::{ProgressLogger, Scalars};

    struct Silent;

    impl ProgressLogger for Silent {
        fn log(&mut self, _: &Scalars) -> anyhow::Result<()> {
            Ok(())
        }
    }

    /// Demonstrations of generated tasks.
    pub(crate) fn demonstrations(episodes: usize) -> (tempfile::TempDir, FrameStore) {
        let folder = tempfile::tempdir().unwrap();
        let collection = Collection {
            out: folder.path().join("D"),
            tasks: TaskSource::Generated { lengths: vec![1, 2], episodes, annotations: 2 },
            seed: 3,
            settings: DemonstrationSettings {
                expert: ExpertKind::Scanning,
                turn_timing: crate::house::expert::TurnTiming::Late,
                noise: 0.0,
            },
            learner: None,
        };
        collection.run(&mut Silent, &std::sync::atomic::AtomicBool::new(false)).unwrap();
        let frame_store = FrameStore::open(&[Dataset::open(&collection.out).unwrap()]).unwrap();
        (folder, frame_store)
    }

    #[test]
    fn nearly_every_step_of_a_demonstration_is_the_beginning_of_something_and_goals_are_reached_at_its_end() {
        let (_folder, frame_store) = demonstrations(8);
        let all: Vec<usize> = (0..frame_store.trajectories.len()).collect();
        let made = examples(&frame_store, &Eyes::Simulator, 1, &all).unwrap();
        assert_eq!(made, examples(&frame_store, &Eyes::Simulator, 1, &all).unwrap(), "whatever the threads do");
        let (mut steps, mut explained) = (0, 0);
        for (examples, trajectory) in made.iter().zip(&frame_store.trajectories) {
            assert!(examples.last().unwrap().reached, "{}", trajectory.id);
            let acting: Vec<&Example> = examples.iter().filter(|example| !example.reached).collect();
            assert_eq!(acting.len(), trajectory.actions.len());
            steps += acting.len();
            explained += acting.iter().filter(|example| example.right.contains(&true)).count();
            for example in examples {
                assert!(example.aim.is_none_or(|aim| example.right[aim]));
                assert_eq!(example.choice.actions.len() % example.choice.len(), 0);
            }
        }
        assert!(explained * 10 >= steps * 9, "{explained} of {steps}");
    }
}
