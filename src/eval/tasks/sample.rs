//! Sampling task sets: from generated houses without end, or from the spans of a dataset's demonstrations.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use anyhow::{Context, bail, ensure};
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::scene_folder::relative;
use crate::data::Dataset;
use crate::data::alfred::span_task::span_task;
use crate::domain::task::SceneRef;
use crate::domain::{Room, Task, TaskSet, Trajectory};
use crate::house::{generate, validate};
use crate::language::count::counted;
use crate::language::phrases;

/// The seeds of sampled tasks' houses lie from here on, those of collected demonstrations far below: no task is played in a
/// house that an agent was trained in. Still small enough for readers of JSON that keep numbers as floats.
const HELD_OUT: u64 = 1 << 41;
/// How many houses are tried for one task before the length is given up.
const ATTEMPTS: u64 = 200;
/// After so many houses without a task, the next kind of room is tried.
const ATTEMPTS_A_ROOM: u64 = 20;

/// Where the instructions of sampled tasks come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phrasing {
    /// The program's own grammar.
    Grammar,
    /// What people wrote of the demonstrations.
    Annotators,
}

impl Phrasing {
    /// The option's name of the program's own grammar.
    pub(crate) const GRAMMAR: &str = "own";
    /// The option's name of what people wrote.
    pub(crate) const ANNOTATORS: &str = "annotators";
}

impl std::str::FromStr for Phrasing {
    type Err = String;

    fn from_str(text: &str) -> Result<Phrasing, String> {
        match text {
            Phrasing::GRAMMAR => Ok(Phrasing::Grammar),
            Phrasing::ANNOTATORS => Ok(Phrasing::Annotators),
            _ => Err(format!("{text:?} is neither {} nor {}", Phrasing::GRAMMAR, Phrasing::ANNOTATORS)),
        }
    }
}

/// Which tasks to sample, and how many.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SampleSpec {
    /// What the set is called in reports.
    pub name: String,
    /// How many subtasks each task has.
    pub length: usize,
    /// How many tasks to sample.
    pub count: usize,
    /// The same seed gives the same set.
    pub seed: u64,
    /// The kinds of rooms to take; they take turns in generated sets.
    pub rooms: Vec<Room>,
    /// The dataset's scenes to take, by name; all where none is named.
    pub only_scenes: Vec<String>,
    /// Whether only whole demonstrations are taken, in a person's words for the whole where the words are people's.
    pub wholes: bool,
}

impl SampleSpec {
    /// The random numbers of the task at `place` in its `attempt`: no task's chance depends on another's.
    fn rng(&self, place: u64, attempt: u64) -> ChaCha8Rng {
        let mut key = [0; 32];
        for (part, number) in key.chunks_exact_mut(8).zip([self.seed, place, attempt, self.length as u64]) {
            part.copy_from_slice(&number.to_le_bytes());
        }
        ChaCha8Rng::from_seed(key)
    }
}

/// Samples as many tasks of each length as of any other, longest first. Where there are too few of the longer ones, all of
/// those are taken, and the shorter ones make up the number: so the paper's EVAL_100 was made.
///
/// # Errors
/// When there are too few tasks of all these lengths together.
pub(crate) fn balanced(
    spec: &SampleSpec,
    lengths: &[usize],
    sample: &dyn Fn(&SampleSpec) -> anyhow::Result<TaskSet>,
) -> anyhow::Result<TaskSet> {
    if let [_] = lengths {
        return sample(spec);
    }
    let mut whole: Option<TaskSet> = None;
    let mut wanted = spec.count;
    for (left, &length) in (1..=lengths.len()).rev().zip(lengths.iter().rev()) {
        let count = if left == lengths.len() { wanted.div_ceil(left) } else { wanted / left };
        if count == 0 {
            continue;
        }
        let of = |count: usize| sample(&SampleSpec { length, count, ..spec.clone() });
        let set = match of(count) {
            Err(error) => match error.downcast_ref::<TooFew>() {
                Some(&TooFew { there, .. }) if left > 1 && there > 0 => of(there)?,
                Some(&TooFew { there: 0, .. }) if left > 1 => continue,
                _ => return Err(error),
            },
            Ok(set) => set,
        };
        wanted -= set.tasks.len();
        let renamed = set.tasks.into_iter().map(|task| Task { id: format!("{length}-{}", task.id), ..task });
        match &mut whole {
            Some(whole) => whole.tasks.extend(renamed),
            None => whole = Some(TaskSet { tasks: renamed.collect(), ..set }),
        }
    }
    whole.context("no tasks were asked for")
}

/// A dataset holds fewer spans than were asked for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{folder} holds {} of {} that fit; ask for at most that many tasks",
    counted(*there, "span"),
    counted(*length, "subtask")
)]
pub(crate) struct TooFew {
    folder: String,
    there: usize,
    length: usize,
}

/// Samples tasks in generated houses, each in a house of its own; `done` is called as they come, from several threads.
///
/// # Errors
/// When no house gives a task of that length.
pub fn sample_generated(spec: &SampleSpec, done: &(dyn Fn() + Sync)) -> anyhow::Result<TaskSet> {
    ensure!(!spec.rooms.is_empty(), "no kind of room is left to take");
    let task = |place: usize| -> anyhow::Result<Task> {
        for attempt in 0..ATTEMPTS {
            let mut rng = spec.rng(place as u64, attempt);
            let room = spec.rooms[(place + (attempt / ATTEMPTS_A_ROOM) as usize) % spec.rooms.len()];
            let seed = HELD_OUT + u64::from(rng.random::<u32>());
            let (scene, world) = generate::house(room, seed);
            let reference = SceneRef::Generated { room, seed };
            if let Some(task) = generate::task(&scene, &world, reference, spec.length, &mut rng) {
                done();
                return Ok(Task { id: format!("{}-{place}", scene.name), ..task });
            }
        }
        bail!("no task of {} was found in {ATTEMPTS} houses; ask for shorter ones", counted(spec.length, "subtask"))
    };
    let tasks = (0..spec.count).into_par_iter().map(task).collect::<anyhow::Result<Vec<_>>>()?;
    Ok(TaskSet { format_version: TaskSet::FORMAT, name: spec.name.clone(), scenes: None, tasks })
}

/// Samples spans of a dataset's demonstrations, no span twice, and none that the dataset keeps from training. A task starts
/// where the expert's actions before it led.
///
/// # Errors
/// When the dataset cannot be read, or holds too few such spans.
pub(crate) fn sample_dataset(
    spec: &SampleSpec,
    dataset: &Dataset,
    split: Option<&str>,
    phrasing: Phrasing,
    set_folder: &Path,
) -> anyhow::Result<TaskSet> {
    if let Some(split) = split {
        dataset.check_split(split)?;
    }
    let scenes = dataset.scenes()?;
    for name in &spec.only_scenes {
        ensure!(scenes.contains_key(name), "{} has no scene {name:?}", dataset.folder().display());
    }
    let wanted = |name: &String| spec.only_scenes.is_empty() || spec.only_scenes.contains(name);
    let fits = |trajectory: &Trajectory| match &trajectory.scene {
        SceneRef::Named(name) => wanted(name) && scenes.get(name).is_some_and(|scene| spec.rooms.contains(&scene.room)),
        SceneRef::Generated { room, .. } => spec.only_scenes.is_empty() && spec.rooms.contains(room),
        SceneRef::Remote => false,
    };
    let mut spans: Vec<(u32, usize)> = Vec::new();
    for (number, trajectory) in (0..).zip(dataset.trajectories()?) {
        let trajectory = trajectory?;
        if split.is_some_and(|split| split != trajectory.split) || !fits(&trajectory) {
            continue;
        }
        let whole = spec.length == trajectory.skills.len();
        if !whole && spec.wholes {
            continue;
        }
        let said = |first: &usize| {
            phrasing == Phrasing::Grammar || !writers(spec, &trajectory, *first..*first + spec.length).is_empty()
        };
        let held_out = dataset.manifest().held_out.contains(&trajectory.id);
        let free = |_: &usize| !(held_out && whole);
        let firsts = (0..=trajectory.skills.len()).take_while(|first| first + spec.length <= trajectory.skills.len());
        spans.extend(firsts.filter(free).filter(said).map(|first| (number, first)));
    }
    if spans.len() < spec.count {
        let folder = dataset.folder().display().to_string();
        return Err(TooFew { folder, there: spans.len(), length: spec.length }.into());
    }
    let (chosen, _) = spans.partial_shuffle(&mut spec.rng(u64::MAX, 0), spec.count);
    let mut places: BTreeMap<u32, Vec<(usize, usize)>> = BTreeMap::new();
    for (place, &mut (number, first)) in chosen.iter_mut().enumerate() {
        places.entry(number).or_default().push((place, first));
    }
    let mut tasks: Vec<Option<Task>> = vec![None; spec.count];
    for (number, trajectory) in (0..).zip(dataset.trajectories()?) {
        let Some(spans) = places.get(&number) else { continue };
        let trajectory = trajectory?;
        for &(place, first) in spans {
            let span = first..first + spec.length;
            let id = format!("{}-{first}-{place}", trajectory.id);
            let scene = match &trajectory.scene {
                SceneRef::Remote => None,
                SceneRef::Named(name) => scenes.get(name).cloned(),
                SceneRef::Generated { room, seed } => Some(generate::house(*room, *seed).0.into()),
            };
            let scene = scene.with_context(|| format!("trajectory {}: its scene is absent", trajectory.id))?;
            validate::world(&scene, &trajectory.start)
                .with_context(|| format!("trajectory {}: start", trajectory.id))?;
            let mut task = span_task(id, &trajectory, &scene, span.clone())
                .map_err(|problem| anyhow::anyhow!("trajectory {}: {problem}", trajectory.id))?;
            let mut rng = spec.rng(place as u64, 0);
            let wrote = writers(spec, &trajectory, span.clone());
            if phrasing == Phrasing::Grammar || wrote.is_empty() {
                task.sentences =
                    task.subtasks.iter().map(|subtask| phrases::sentence(&task.roles, subtask, &mut rng)).collect();
                task.instruction = phrases::instruction(&task.roles, &task.subtasks, &mut rng);
            } else {
                let annotation = &trajectory.annotations[wrote[rng.random_range(0..wrote.len())]];
                task.sentences = annotation.steps[span].to_vec();
                let whole = spec.length == trajectory.skills.len() && !annotation.goal.trim().is_empty();
                task.instruction = if whole { annotation.goal.clone() } else { task.sentences.join(" ") };
            }
            tasks[place] = Some(task);
        }
    }
    let tasks: Vec<Task> = tasks.into_iter().flatten().collect();
    ensure!(tasks.len() == spec.count, "the dataset changed while it was read");
    let named = tasks.iter().any(|task| matches!(task.scene, SceneRef::Named(_)));
    let scenes = named.then(|| relative(&dataset.folder().join("scenes"), set_folder)).transpose()?;
    Ok(TaskSet { format_version: TaskSet::FORMAT, name: spec.name.clone(), scenes, tasks })
}

/// The annotators whose words a task may be told in.
fn writers(spec: &SampleSpec, trajectory: &Trajectory, span: Range<usize>) -> Vec<usize> {
    let mut wrote = annotators(trajectory, span);
    wrote.retain(|&annotator| !spec.wholes || !trajectory.annotations[annotator].goal.trim().is_empty());
    wrote
}

/// The annotators who wrote a sentence for each skill of a trajectory, and none of the span's empty.
pub(crate) fn annotators(trajectory: &Trajectory, span: Range<usize>) -> Vec<usize> {
    let said = |steps: &[String]| {
        steps.len() == trajectory.skills.len() && steps[span.clone()].iter().all(|s| !s.trim().is_empty())
    };
    (0..).zip(&trajectory.annotations).filter(|(_, annotation)| said(&annotation.steps)).map(|(i, _)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::dataset;
    use crate::data::dataset::DatasetWriter;
    use crate::data::taskset;
    use crate::domain::skill::Original;
    use crate::domain::trajectory;
    use crate::domain::trajectory::Annotation;
    use crate::domain::{Class, Instance, Role, SkillKind, Subtask};
    use crate::episode::scenes::Scenes;
    use crate::house::expert::Expert;
    use crate::house::grading::{Grader, Grading};
    use crate::house::testing::kitchen_house;

    fn spec(length: usize, count: usize, seed: u64) -> SampleSpec {
        SampleSpec {
            name: "sampled".into(),
            length,
            count,
            seed,
            rooms: Room::ALL.to_vec(),
            only_scenes: Vec::new(),
            wholes: false,
        }
    }

    #[test]
    fn a_sample_is_the_same_for_the_same_seed_and_another_for_another() {
        let sample = |seed| sample_generated(&spec(1, 6, seed), &|| ()).unwrap();
        assert_eq!(sample(3), sample(3));
        assert_ne!(sample(3), sample(4));
        let longer = sample_generated(&spec(1, 8, 3), &|| ()).unwrap();
        assert_eq!(longer.tasks[..6], sample(3).tasks, "asking for more keeps the first ones");
    }

    #[test]
    fn sampled_tasks_have_the_wished_length_and_rooms_and_are_sound() {
        let rooms = vec![Room::Kitchen];
        let set = sample_generated(&SampleSpec { rooms, ..spec(3, 4, 0) }, &|| ()).unwrap();
        taskset::check(&set).unwrap();
        Scenes::in_folder(None).check(&set.tasks).unwrap();
        for task in &set.tasks {
            assert_eq!(task.subtasks.len(), 3);
            assert!(matches!(task.scene, SceneRef::Generated { room: Room::Kitchen, .. }));
        }
    }

    /// A dataset of one demonstration in the test kitchen: a mug is taken, and put on the table.
    fn dataset(folder: &Path) -> Dataset {
        dataset_without(folder, &[])
    }

    /// The same, with wholes that training must not see.
    fn dataset_without(folder: &Path, held_out: &[&str]) -> Dataset {
        let role = |name: &str| Role { class: Class::named(name).unwrap(), slice: false, bound: None, expert: None };
        let roles = vec![role("Mug"), role("DiningTable")];
        let subtask = |skill, receptacle| Subtask { skill, object: 0, receptacle, closes: false, literal: None };
        let skills = vec![subtask(SkillKind::Pickup, None), subtask(SkillKind::Put, Some(1))];
        let mut house = kitchen_house();
        let (scene, start) = (house.scene().clone(), house.world().clone());
        let mut grader = Grader::new(Grading::Class, &roles, &skills, None, (&scene, &start));
        let (mut expert, mut actions, mut skill_starts) = (Expert::new(), Vec::new(), vec![0]);
        while !grader.is_done() {
            let action = expert.next(&mut house, &grader).unwrap();
            let outcome = house.step(action);
            actions.push(action);
            if grader.observe(&scene, house.world(), action, outcome) && !grader.is_done() {
                skill_starts.push(actions.len() as u32);
            }
        }
        let expert = |number| Original { instance: grader.binding(number).unwrap(), slice: None };
        let roles: Vec<Role> =
            (0..).zip(roles).map(|(number, role)| Role { expert: Some(expert(number)), ..role }).collect();
        let mut writer = DatasetWriter::new(folder).unwrap();
        writer.scene(&scene).unwrap();
        let trajectory = Trajectory {
            start,
            actions,
            roles,
            skills,
            skill_starts,
            annotations: vec![Annotation {
                goal: "Set the table.".into(),
                steps: vec!["grab the cup".into(), "put the cup down".into()],
            }],
            ..trajectory::testing::empty("mug", &scene.name)
        };
        writer.trajectory(&trajectory).unwrap();
        let manifest = dataset::testing::manifest(1, held_out);
        writer.finish(&manifest).unwrap();
        Dataset::open(folder).unwrap()
    }

    #[test]
    fn a_span_starts_where_the_expert_led_and_is_told_in_either_words() {
        let folder = tempfile::tempdir().unwrap();
        let dataset = dataset(folder.path());
        let sample =
            |length, count, phrasing| sample_dataset(&spec(length, count, 5), &dataset, None, phrasing, folder.path());
        let told = sample(1, 2, Phrasing::Annotators).unwrap();
        let put = told.tasks.iter().find(|task| task.subtasks[0].skill == SkillKind::Put).unwrap();
        assert_eq!(put.instruction, "put the cup down");
        assert_eq!(put.source, Some(("mug".into(), 1)));
        let start = put.start.as_ref().unwrap();
        assert_eq!(start.held.map(Instance::Object), put.roles[usize::from(put.subtasks[0].object)].bound);
        assert!(start.held.is_some(), "the mug is in the hand already");
        assert_eq!(sample(2, 1, Phrasing::Annotators).unwrap().tasks[0].instruction, "Set the table.");
        let own = sample(1, 2, Phrasing::Grammar).unwrap();
        assert!(own.tasks.iter().all(|task| !task.instruction.is_empty() && !task.instruction.contains("cup down")));
        for set in [told, own] {
            taskset::check(&set).unwrap();
            Scenes::of(&folder.path().join("set.json"), &set).check(&set.tasks).unwrap();
        }
        let error = sample(1, 3, Phrasing::Grammar).unwrap_err().to_string();
        assert!(error.contains("2 spans of 1 subtask "), "{error}");
    }

    #[test]
    fn a_whole_that_is_held_out_is_no_task_but_its_parts_are() {
        let folder = tempfile::tempdir().unwrap();
        let dataset = dataset_without(folder.path(), &["mug"]);
        let sample = |length, count| {
            sample_dataset(&spec(length, count, 5), &dataset, None, Phrasing::Annotators, folder.path())
        };
        assert_eq!(sample(1, 2).unwrap().tasks.len(), 2);
        assert!(sample(2, 1).unwrap_err().to_string().contains("holds 0 spans of 2 subtasks"));
    }

    #[test]
    fn wholes_alone_are_sampled_in_a_persons_words_for_the_whole_and_withheld_ones_never_again() {
        let folder = tempfile::tempdir().unwrap();
        let dataset = dataset(folder.path());
        let sample = |dataset: &Dataset, length| {
            let wholes = SampleSpec { wholes: true, ..spec(length, 1, 5) };
            sample_dataset(&wholes, dataset, None, Phrasing::Annotators, folder.path())
        };
        assert!(sample(&dataset, 1).unwrap_err().to_string().contains("holds 0 spans of 1 subtask "));
        let set = sample(&dataset, 2).unwrap();
        assert_eq!(set.tasks[0].instruction, "Set the table.");
        let (demonstration, first) = set.tasks[0].source.clone().unwrap();
        assert_eq!(first, 0);
        dataset.withhold(&[demonstration.as_str()].into()).unwrap();
        let dataset = Dataset::open(folder.path()).unwrap();
        assert_eq!(dataset.manifest().held_out, ["mug"]);
        assert!(sample(&dataset, 2).is_err());
    }

    #[test]
    fn a_balanced_set_takes_what_there_is_of_the_long_ones_and_fills_up_with_short_ones() {
        let folder = tempfile::tempdir().unwrap();
        let dataset = dataset(folder.path());
        let sample = |spec: &SampleSpec| sample_dataset(spec, &dataset, None, Phrasing::Grammar, folder.path());
        let set = balanced(&spec(1, 3, 0), &[1, 2], &sample).unwrap();
        let lengths: Vec<usize> = set.tasks.iter().map(|task| task.subtasks.len()).collect();
        assert_eq!(lengths, [2, 1, 1]);
        taskset::check(&set).unwrap();
        assert!(balanced(&spec(1, 9, 0), &[1, 2], &sample).unwrap_err().to_string().contains("2 spans of 1 subtask "));
        let long = balanced(&spec(1, 2, 0), &[1, 2, 7], &sample).unwrap();
        assert_eq!(long.tasks.len(), 2);
    }
}
