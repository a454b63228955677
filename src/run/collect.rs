//! Collects demonstrations in generated houses: what the demonstrator would do in every state, while chance or a learner
//! disturbs what is done.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tch::Device;

use super::progress::{Report, Scalars};
use super::rollout::Rollout;
use crate::agent::learned::{LearnedPolicy, SharedEmbedder};
use crate::agent::seeker::Seeker;
use crate::agent::{Decision, Policy};
use crate::data::dataset::{Counts, Manifest, Writer};
use crate::domain::task::SceneRef;
use crate::domain::trajectory::Annotation;
use crate::domain::{Action, ActionType, Room, Scene, Task, Trajectory, World};
use crate::house::grading::{Grader, Grading};
use crate::house::{House, generate};
use crate::language::phrases;

/// What to collect.
pub struct Collection {
    /// The dataset's folder.
    pub out: PathBuf,
    /// How many trajectories.
    pub episodes: usize,
    /// Drives houses, tasks, words and chance.
    pub seed: u64,
    /// Task lengths, drawn uniformly; a length may be listed more than once.
    pub lengths: Vec<usize>,
    /// The share of steps at which chance takes over for a few steps.
    pub noise: f64,
    /// Phrasings of each trajectory.
    pub annotations: usize,
    /// A checkpoint that acts instead of the demonstrator, with its sentence encoder: the demonstrator then only says what it
    /// would do, and finishes what is left at the horizon.
    pub learner: Option<(PathBuf, SharedEmbedder)>,
}

/// Episodes in one house.
const PER_HOUSE: usize = 4;
/// Houses between two writes, at most.
const GROUP: usize = 32;
/// The longest disturbance, in steps.
const LONGEST: u32 = 4;
/// More steps than this beyond three times the expert's give an episode up.
const SLACK: u32 = 40;

impl Collection {
    /// Collects; the same trajectories for any number of threads. Returns how many, or `None` when it was stopped: nothing is kept then.
    ///
    /// # Errors
    /// When the folder cannot be written to or the learner not be loaded.
    pub fn run(&self, report: &mut dyn Report, stop: &AtomicBool) -> anyhow::Result<Option<usize>> {
        let mut writer = Writer::new(&self.out)?;
        let mut counts = Counts::default();
        let mut next = 0u64;
        while (counts.trajectories as usize) < self.episodes {
            let missing = self.episodes - counts.trajectories as usize;
            let houses: Vec<u64> = (next..).take(GROUP.min(missing.div_ceil(PER_HOUSE))).collect();
            next += houses.len() as u64;
            anyhow::ensure!(next < 1_000_000, "too few of the generated tasks could be demonstrated");
            let in_house = |learner: &mut anyhow::Result<Option<LearnedPolicy>>, &number: &u64| {
                let learner = learner.as_mut().map_err(|error| anyhow::anyhow!("{error:#}"))?;
                if stop.load(Ordering::Relaxed) { Ok(Vec::new()) } else { self.house(number, learner.as_mut()) }
            };
            let made: Vec<Vec<Trajectory>> =
                houses.par_iter().map_init(|| self.load(), in_house).collect::<anyhow::Result<_>>()?;
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            for trajectory in made.into_iter().flatten().take(missing) {
                let annotations = trajectory.annotations.len() as u64;
                counts.trajectories += 1;
                counts.annotated_primitives += annotations * trajectory.skills.len() as u64;
                counts.aligned_primitives += annotations * trajectory.skills.len() as u64;
                counts.spans += annotations * (trajectory.skills.len() * (trajectory.skills.len() - 1) / 2) as u64;
                counts.spans_after_holdout = counts.spans;
                writer.trajectory(&trajectory)?;
            }
            report.step(&Scalars::new("episodes", counts.trajectories, self.episodes as u64))?;
        }
        writer.finish(&Manifest {
            format_version: Manifest::FORMAT,
            source: "generated".into(),
            counts: [("train".to_string(), counts)].into(),
            scenes: 0,
            held_out: Vec::new(),
            skipped: Vec::new(),
        })?;
        Ok(Some(counts.trajectories as usize))
    }

    fn load(&self) -> anyhow::Result<Option<LearnedPolicy>> {
        let Some((folder, sentences)) = &self.learner else { return Ok(None) };
        let mut policy = LearnedPolicy::load(folder, sentences.clone(), Device::Cpu)?;
        policy.set_sampling(true);
        Ok(Some(policy))
    }

    /// The trajectories of one house.
    fn house(&self, number: u64, mut learner: Option<&mut LearnedPolicy>) -> anyhow::Result<Vec<Trajectory>> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(number + 1);
        let room = Room::ALL[(number % 4) as usize];
        let seed = self.seed * 1_000_000 + number;
        let (scene, world) = generate::house(room, seed);
        let scene = std::sync::Arc::new(scene);
        let mut made = Vec::new();
        for position in 0..PER_HOUSE {
            let length = self.lengths.get(rng.random_range(0..self.lengths.len().max(1))).copied().unwrap_or(1);
            let reference = SceneRef::Generated { room, seed };
            let Some(task) = generate::task(&scene, &world, reference, length, &mut rng) else { continue };
            let start = task.start.clone().unwrap_or_else(|| world.clone());
            let id = format!("{}-{position}", scene.name);
            let episode = Episode { collection: self, scene: &scene, task: &task, start, id };
            made.extend(episode.play(learner.as_deref_mut(), &mut rng)?);
        }
        Ok(made)
    }
}

struct Episode<'a> {
    collection: &'a Collection,
    scene: &'a std::sync::Arc<Scene>,
    task: &'a Task,
    start: World,
    id: String,
}

impl Episode<'_> {
    /// Plays a task to its end; `None` when the demonstrator sees no way or takes too long.
    fn play(self, mut learner: Option<&mut LearnedPolicy>, rng: &mut ChaCha8Rng) -> anyhow::Result<Option<Trajectory>> {
        let Task { roles, subtasks, .. } = self.task;
        let annotations = self.annotations(rng);
        let told = annotations.first().map_or(self.task.instruction.clone(), |annotation| annotation.goal.clone());
        let grader = Grader::new(Grading::Class, roles, subtasks, self.task.goal.as_ref());
        let house = House::new(self.scene.clone(), self.start.clone());
        let mut rollout = Rollout::new(house, told, Some(grader), None);
        let mut seeker = Seeker::new();
        if let Some(learner) = learner.as_deref_mut() {
            learner.begin(rng.random());
        }
        // Some episodes are left undisturbed.
        let noise = if rng.random_bool(0.3) { 0.0 } else { self.collection.noise };
        let (mut actions, mut choices, mut skill_starts) = (Vec::new(), Vec::new(), vec![0]);
        let mut disturbed = 0;
        while rollout.end().is_none() {
            if rollout.steps() > 3 * self.task.expert_steps + SLACK {
                return Ok(None);
            }
            let Ok(choice) = rollout.decide(&mut seeker) else { return Ok(None) };
            if disturbed == 0 && rng.random_bool(noise) {
                disturbed = rng.random_range(1..=LONGEST);
            }
            let action = match learner.as_deref_mut().filter(|_| rollout.steps() < self.task.horizon) {
                _ if disturbed > 0 => {
                    disturbed -= 1;
                    disturbance(&mut rollout.house, rng)
                }
                Some(learner) => rollout.decide(learner)?.action,
                None => choice.action,
            };
            actions.push(action);
            choices.push(choice.action);
            let tick = rollout.carry_out(Decision { action, mind: None });
            if tick.completed_one && rollout.end().is_none() {
                skill_starts.push(tick.step);
            }
        }
        if choices == actions {
            choices.clear();
        }
        Ok(Some(Trajectory {
            id: self.id,
            split: "train".into(),
            scene: self.task.scene.clone(),
            start: self.start,
            actions,
            roles: roles.clone(),
            skills: subtasks.clone(),
            skill_starts,
            goal: self.task.goal.clone(),
            annotations,
            boxes: Vec::new(),
            choices,
        }))
    }

    fn annotations(&self, rng: &mut ChaCha8Rng) -> Vec<Annotation> {
        let Task { roles, subtasks, .. } = self.task;
        let origins = phrases::origins(self.scene, &self.start, roles);
        let story = phrases::Story { roles, subtasks, origins: &origins };
        let annotate = |_| Annotation { goal: story.instruction(rng), steps: story.sentences(rng) };
        (0..self.collection.annotations.max(1)).map(annotate).collect()
    }
}

/// Something that could happen by chance: mostly a step or a turn, at times an interaction.
fn disturbance(house: &mut House, rng: &mut ChaCha8Rng) -> Action {
    let candidates = house.candidates();
    if !candidates.is_empty() && rng.random_bool(0.08) {
        return candidates[rng.random_range(0..candidates.len())].action();
    }
    Action::navigate(match rng.random_range(0..10) {
        0..4 => ActionType::MoveAhead,
        4..6 => ActionType::RotateLeft,
        6..8 => ActionType::RotateRight,
        8 => ActionType::LookUp,
        _ => ActionType::LookDown,
    })
}
