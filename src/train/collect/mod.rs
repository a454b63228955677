//! Collects demonstrations in generated houses or of given tasks.

mod demonstration;
mod task_source;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tch::Device;

use self::demonstration::{Demonstration, own_annotation, phrasings};
pub use self::demonstration::{DemonstrationSettings, ExpertKind};
use self::task_source::PER_HOUSE;
pub use self::task_source::TaskSource;
use super::metrics::{ProgressLogger, Scalars};
use crate::agent::Policy;
use crate::agent::learned::SharedEmbedder;
use crate::agent::policy_source;
use crate::data::dataset::{Counts, DatasetManifest, DatasetWriter};
use crate::data::ensure_free;
use crate::data::folder_lock::FolderLock;
use crate::domain::task::SceneRef;
use crate::domain::{Room, Trajectory};
use crate::episode::scenes::Setting;
use crate::house::generate;

/// A dataset of demonstrations to be made.
pub struct Collection {
    /// The dataset's folder, which must not hold anything yet.
    pub out: PathBuf,
    /// The tasks that are demonstrated.
    pub tasks: TaskSource,
    /// Drives houses, tasks, words and chance.
    pub seed: u64,
    /// Which expert demonstrates, and how much random actions disturb it.
    pub settings: DemonstrationSettings,
    /// A checkpoint that acts instead of the expert, with its sentence encoder where it reads through one: the expert then only says what it
    /// would do, and finishes what is left at the horizon.
    pub learner: Option<(PathBuf, Option<SharedEmbedder>)>,
}

/// How a collection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Collected {
    /// How many demonstrations were kept.
    pub(crate) trajectories: usize,
    /// Whether it was stopped before its end.
    pub(crate) stopped: bool,
}

/// Generated houses, at most: where fewer tasks than wished for can be demonstrated it must end some time.
const HOUSES: u64 = 1_000_000;

impl Collection {
    /// Collects; the same trajectories for any number of threads. Stopped, it keeps the first of them. A task that the
    /// expert cannot do gives no trajectory.
    ///
    /// # Errors
    /// When a given task does not fit its scene, or the folder holds something already, which is found before anything is written;
    /// when the folder cannot be written to, or the learner not be loaded.
    pub fn run(&self, logger: &mut dyn ProgressLogger, stop: &AtomicBool) -> anyhow::Result<Collected> {
        if let TaskSource::Tasks { tasks, scenes } = &self.tasks {
            scenes.check(tasks)?;
        }
        let folder = FolderLock::take(&self.out)?;
        ensure_free::check(&self.out)?;
        let mut writer = DatasetWriter::into_folder(folder)?;
        let mut counts = Counts::default();
        let mut scenes = BTreeSet::new();
        let (mut next, mut stopped) = (0u64, false);
        while let Some(numbers) = self.tasks.numbers(next, counts.trajectories as usize) {
            next = numbers.end;
            let endless = matches!(self.tasks, TaskSource::Generated { .. }) && next >= HOUSES;
            anyhow::ensure!(!endless, "too few of the generated tasks could be demonstrated");
            let collect = |learner: &mut anyhow::Result<Option<Box<dyn Policy>>>, number: u64| {
                let learner = learner.as_mut().map_err(|error| anyhow::anyhow!("{error:#}"))?;
                if stop.load(Ordering::Relaxed) { Ok(Vec::new()) } else { self.house_or_task(number, learner.as_mut()) }
            };
            let made: Vec<Vec<Trajectory>> =
                numbers.into_par_iter().map_init(|| self.load(), collect).collect::<anyhow::Result<_>>()?;
            if stop.load(Ordering::Relaxed) {
                // Of this group some trajectories may be missing.
                stopped = true;
                break;
            }
            let missing = self.tasks.most() - counts.trajectories as usize;
            for trajectory in made.into_iter().flatten().take(missing) {
                count(&trajectory, &mut counts);
                self.keep_scene(&trajectory.scene, &writer, &mut scenes)?;
                writer.trajectory(&trajectory)?;
            }
            logger.log(&Scalars::new("episodes", self.tasks.done(next, &counts), self.tasks.most() as u64))?;
        }
        writer.finish(&DatasetManifest {
            format_version: DatasetManifest::FORMAT,
            source: self.tasks.name().into(),
            counts: [("train".to_string(), counts)].into(),
            scenes: scenes.len() as u64,
            held_out: Vec::new(),
            skipped: Vec::new(),
        })?;
        Ok(Collected { trajectories: counts.trajectories as usize, stopped })
    }

    /// Writes a scene that comes from a file beside the trajectories, once.
    fn keep_scene(
        &self,
        reference: &SceneRef,
        writer: &DatasetWriter,
        kept: &mut BTreeSet<String>,
    ) -> anyhow::Result<()> {
        if let (SceneRef::Named(name), TaskSource::Tasks { scenes, .. }) = (reference, &self.tasks)
            && kept.insert(name.clone())
        {
            writer.scene(&scenes.scene(reference)?.0)?;
        }
        Ok(())
    }

    fn load(&self) -> anyhow::Result<Option<Box<dyn Policy>>> {
        let Some((folder, sentences)) = &self.learner else { return Ok(None) };
        policy_source::load_agent(folder, sentences.clone(), Device::Cpu).map(Some)
    }

    /// The trajectories of one house, or of one given task.
    fn house_or_task(&self, number: u64, learner: Option<&mut Box<dyn Policy>>) -> anyhow::Result<Vec<Trajectory>> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(number + 1);
        match &self.tasks {
            TaskSource::Generated { lengths, annotations, .. } => {
                self.house(number, (lengths, *annotations), learner, &mut rng)
            }
            TaskSource::Tasks { tasks, scenes } => {
                let Some(task) = tasks.get(number as usize) else { return Ok(Vec::new()) };
                let setting = scenes.setting(task).with_context(|| format!("task {:?}", task.id))?;
                let (id, annotations) = (task.id.clone(), vec![own_annotation(task)]);
                let demonstration = Demonstration { task, setting, id, annotations, settings: self.settings };
                Ok(demonstration.play(learner, &mut rng)?.into_iter().collect())
            }
        }
    }

    fn house(
        &self,
        number: u64,
        (lengths, annotations): (&[usize], usize),
        mut learner: Option<&mut Box<dyn Policy>>,
        rng: &mut ChaCha8Rng,
    ) -> anyhow::Result<Vec<Trajectory>> {
        let room = Room::ALL[(number % 4) as usize];
        let seed = self.seed * 1_000_000 + number;
        let (scene, world) = generate::house(room, seed);
        let scene = Arc::new(scene);
        let mut made = Vec::new();
        for position in 0..PER_HOUSE {
            let length = lengths.get(rng.random_range(0..lengths.len().max(1))).copied().unwrap_or(1);
            let reference = SceneRef::Generated { room, seed };
            let Some(task) = generate::task(&scene, &world, reference, length, rng) else { continue };
            let start = task.start.clone().unwrap_or_else(|| world.clone());
            let id = format!("{}-{position}", scene.name);
            let annotations = phrasings(&scene, &start, &task, annotations, rng);
            let setting = Setting { scene: scene.clone(), world: start };
            let demonstration = Demonstration { task: &task, setting, id, annotations, settings: self.settings };
            made.extend(demonstration.play(learner.as_deref_mut(), rng)?);
        }
        Ok(made)
    }
}

fn count(trajectory: &Trajectory, counts: &mut Counts) {
    let (skills, annotations) = (trajectory.skills.len() as u64, trajectory.annotations.len() as u64);
    let aligned = trajectory.annotations.iter().filter(|words| words.steps.len() as u64 == skills).count() as u64;
    counts.trajectories += 1;
    counts.annotated_primitives += annotations * skills;
    counts.aligned_primitives += aligned * skills;
    counts.spans += annotations * (skills * skills.saturating_sub(1) / 2);
    counts.spans_after_holdout += aligned * (skills * skills.saturating_sub(1) / 2);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::Decision;
    use crate::data::dataset::Dataset;
    use crate::data::json;
    use crate::domain::trajectory::Annotation;
    use crate::domain::{Class, Role, Task};
    use crate::episode::rollout::Rollout;
    use crate::episode::scenes::Scenes;
    use crate::house::House;
    use crate::house::expert::TurnTiming;
    use crate::house::grading::{Grader, Grading};
    use crate::needed;
    use crate::nets::embedding_cache::Embedder;
    use crate::nets::sentence::default_folder;

    const UNDISTURBED: DemonstrationSettings =
        DemonstrationSettings { expert: ExpertKind::Scanning, turn_timing: TurnTiming::Late, noise: 0.0 };

    struct Silent;

    impl ProgressLogger for Silent {
        fn log(&mut self, _: &Scalars) -> anyhow::Result<()> {
            Ok(())
        }
    }

    /// Two tasks: one in a scene file of the folder, in a person's words, and one that the demonstrator cannot do.
    fn tasks(folder: &std::path::Path) -> Vec<Task> {
        let (scene, world) = generate::house(Room::Kitchen, 3);
        json::write(&folder.join(format!("{}.json", scene.name)), &scene).unwrap();
        let reference = SceneRef::Named(scene.name.clone());
        let task = generate::task(&scene, &world, reference, 1, &mut ChaCha8Rng::seed_from_u64(5)).unwrap();
        let task = Task { start: Some(world), instruction: "do that for me".into(), sentences: Vec::new(), ..task };
        let mut hopeless = Task { id: "hopeless".into(), ..task.clone() };
        hopeless.subtasks[0].object = hopeless.roles.len() as u8;
        hopeless.roles.push(Role { class: Class::named("Desk").unwrap(), ..task.roles[0].clone() });
        vec![hopeless, task]
    }

    #[test]
    fn given_tasks_are_demonstrated_in_their_own_annotation_and_their_scenes_kept() {
        let folder = tempfile::tempdir().unwrap();
        let tasks = tasks(folder.path());
        let scenes = Scenes::in_folder(Some(folder.path().to_owned()));
        let collection = Collection {
            out: folder.path().join("D"),
            tasks: TaskSource::Tasks { tasks: tasks.clone(), scenes },
            seed: 1,
            settings: UNDISTURBED,
            learner: None,
        };
        assert_eq!(
            collection.run(&mut Silent, &AtomicBool::new(false)).unwrap(),
            Collected { trajectories: 1, stopped: false }
        );
        let dataset = Dataset::open(&collection.out).unwrap();
        let made: Vec<Trajectory> = dataset.trajectories().unwrap().collect::<Result<_, _>>().unwrap();
        let own = Annotation { goal: "do that for me".into(), steps: vec!["do that for me".into()] };
        assert_eq!((made.len(), &made[0].id, &made[0].annotations), (1, &tasks[1].id, &vec![own]));
        let scene = dataset.scenes().unwrap().into_values().next().unwrap();
        let grader = Grader::new(Grading::Class, &made[0].roles, &made[0].skills, None, (&scene, &made[0].start));
        let mut rollout =
            Rollout::in_house(House::new(scene, made[0].start.clone()), String::new(), Some(grader), None);
        made[0].actions.iter().for_each(|&action| drop(rollout.carry_out(Decision::of(action))));
        assert!(rollout.end().is_some(), "the demonstration, played again, completes the task");
    }

    /// How many steps the same tasks take, demonstrated by each of two settings.
    fn steps(both: [DemonstrationSettings; 2]) -> Vec<(usize, usize)> {
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = both.map(|settings| {
            let collection = Collection {
                out: folder.path().join(format!("{settings:?}")),
                tasks: TaskSource::Generated { episodes: 12, lengths: vec![1], annotations: 1 },
                seed: 2,
                settings,
                learner: None,
            };
            collection.run(&mut Silent, &AtomicBool::new(false)).unwrap();
            let dataset = Dataset::open(&collection.out).unwrap();
            let made: Vec<Trajectory> = dataset.trajectories().unwrap().collect::<Result<_, _>>().unwrap();
            made.into_iter().map(|trajectory| (trajectory.id, trajectory.actions.len())).collect::<Vec<_>>()
        });
        let same = |((id, steps), (same, others)): (&(String, usize), &(String, usize))| {
            assert_eq!(id, same, "the same tasks");
            (*steps, *others)
        };
        one.iter().zip(&other).map(same).collect()
    }

    #[test]
    fn an_expert_that_turns_early_is_done_sooner() {
        let expert = DemonstrationSettings { expert: ExpertKind::Privileged, ..UNDISTURBED };
        let pairs = steps([expert, DemonstrationSettings { turn_timing: TurnTiming::Early, ..expert }]);
        let saved: Vec<_> = pairs.iter().filter(|(late, early)| early < late).collect();
        let (late, early) = pairs.iter().fold((0, 0), |sum, pair| (sum.0 + pair.0, sum.1 + pair.1));
        assert!(early < late && !saved.is_empty(), "{pairs:?}");
    }

    #[test]
    fn a_learner_acts_greedily_in_some_episodes_and_draws_in_others() {
        let _chance = crate::nets::testing::chance();
        let Some(encoder) = needed::sentence_encoder(&default_folder()) else { return };
        let Some(clone) = needed::agent("tests/agents/clone") else { return };
        let sentences = Embedder::open(&encoder, Device::Cpu).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let task = tasks(folder.path()).remove(1);
        let again = |number: usize| Task { id: format!("again-{number}"), ..task.clone() };
        let collection = Collection {
            out: folder.path().join("D"),
            tasks: TaskSource::Tasks {
                tasks: (0..8).map(again).collect(),
                scenes: Scenes::in_folder(Some(folder.path().to_owned())),
            },
            seed: 1,
            settings: UNDISTURBED,
            learner: Some((clone, Some(Arc::new(std::sync::Mutex::new(sentences))))),
        };
        collection.run(&mut Silent, &AtomicBool::new(false)).unwrap();
        let dataset = Dataset::open(&collection.out).unwrap();
        let done: Vec<_> = dataset.trajectories().unwrap().map(|trajectory| trajectory.unwrap().actions).collect();
        let twins = |actions: &&Vec<crate::domain::Action>| done.iter().filter(|other| other == actions).count() > 1;
        let alike = done.iter().filter(twins).count();
        assert!((2..done.len()).contains(&alike), "{alike} of {} did what another one did", done.len());
    }

    #[test]
    fn the_scanning_expert_looks_around_for_what_the_privileged_one_goes_for_unseen() {
        let pairs = steps([UNDISTURBED, DemonstrationSettings { expert: ExpertKind::Privileged, ..UNDISTURBED }]);
        let longer = pairs.iter().filter(|(looks, goes)| looks > goes).count();
        assert!(longer > pairs.len() / 2, "{pairs:?}");
    }

    #[test]
    fn a_stopped_collection_keeps_what_came_first() {
        /// Stops at the first word of progress.
        struct Stopping<'a>(&'a AtomicBool);
        impl ProgressLogger for Stopping<'_> {
            fn log(&mut self, _: &Scalars) -> anyhow::Result<()> {
                self.0.store(true, Ordering::Relaxed);
                Ok(())
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let collection = |name: &str| Collection {
            out: folder.path().join(name),
            tasks: TaskSource::Generated { episodes: 150, lengths: vec![1], annotations: 1 },
            seed: 4,
            settings: UNDISTURBED,
            learner: None,
        };
        let made = |collection: &Collection| -> Vec<Trajectory> {
            Dataset::open(&collection.out).unwrap().trajectories().unwrap().collect::<Result<_, _>>().unwrap()
        };
        let (whole, part, stop) = (collection("whole"), collection("part"), AtomicBool::new(false));
        whole.run(&mut Silent, &AtomicBool::new(false)).unwrap();
        let collected = part.run(&mut Stopping(&stop), &stop).unwrap();
        let kept = made(&part);
        assert_eq!(collected, Collected { trajectories: kept.len(), stopped: true });
        assert!(!kept.is_empty() && kept.len() < 150, "{}", kept.len());
        assert_eq!(kept, made(&whole)[..kept.len()]);
    }

    #[test]
    fn a_task_that_does_not_fit_its_scene_is_refused_and_an_earlier_dataset_kept() {
        let folder = tempfile::tempdir().unwrap();
        let mut tasks = tasks(folder.path());
        let collected = |tasks: &[Task]| {
            let scenes = Scenes::in_folder(Some(folder.path().to_owned()));
            let tasks = TaskSource::Tasks { tasks: tasks.to_vec(), scenes };
            let collection =
                Collection { out: folder.path().join("D"), tasks, seed: 1, settings: UNDISTURBED, learner: None };
            collection.run(&mut Silent, &AtomicBool::new(false))
        };
        assert_eq!(collected(&tasks).unwrap(), Collected { trajectories: 1, stopped: false });
        tasks[1].start = None;
        let error = format!("{:#}", collected(&tasks).unwrap_err());
        assert!(error.starts_with("tasks[1].start: missing"), "{error}");
        assert_eq!(Dataset::open(&folder.path().join("D")).unwrap().trajectories().unwrap().count(), 1);
    }
}
