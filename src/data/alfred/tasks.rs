//! The three official task sets, rebuilt from trajectories: which spans they are lies in an index of identifiers.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use anyhow::Context;
use serde::Deserialize;

use super::presence;
use crate::data::text_file;
use crate::domain::skill::{Goal, Original};
use crate::domain::task::{Task, TaskSet};
use crate::domain::world::{Instance, World};
use crate::domain::{Role, Scene, Subtask, Trajectory};
use crate::house::{Outcome, Replay, goals};
use crate::language::instruction;

/// One of the official sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Official {
    /// What it is called in reports.
    pub(crate) name: &'static str,
    /// Its file under `tasks/`, without the ending.
    pub(crate) file: &'static str,
    /// The authors' file.
    pub(crate) list: &'static str,
}

/// The paper's three task sets.
pub const OFFICIAL: [Official; 3] = [
    Official { name: "EVAL_100", file: "eval_100", list: "eval_instruct_ann_human.json" },
    Official { name: "EVAL_CHAIN", file: "eval_chain", list: "eval_length_ann_human.json" },
    Official { name: "EVAL_UNSEEN", file: "eval_unseen", list: "eval_scene_ann_human.json" },
];

/// Where the task's instruction comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
enum TaskText {
    /// The annotator's sentence for the whole trajectory.
    Goal,
    /// The annotator's sentences for the skills.
    Steps,
    /// A text that only the authors' file holds: the annotator's sentences stand in.
    Elsewhere,
    /// The text itself.
    Given(String),
}

/// One task of an official set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OfficialTask {
    trajectory: String,
    annotator: usize,
    first: usize,
    skills: usize,
    wording: TaskText,
    /// The list's own sentence for each skill, where it has them; they may be another annotator's.
    sentences: Option<Vec<String>>,
}

impl OfficialTask {
    /// The trajectory's id.
    pub fn trajectory(&self) -> &str {
        &self.trajectory
    }
}

/// The entries of a set by the index that the program carries.
pub fn indexed(set: Official) -> Vec<OfficialTask> {
    let index = include_str!("../../../assets/eval_index.tsv");
    let rows = index.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let entry = |row: Vec<&str>| match row[..] {
        [name, _, trajectory, annotator, first, skills, wording] if name == set.name => Some(OfficialTask {
            trajectory: trajectory.to_owned(),
            annotator: annotator.parse().ok()?,
            first: first.parse().ok()?,
            skills: skills.parse().ok()?,
            wording: match wording {
                "task_desc" => TaskText::Goal,
                "high_desc" => TaskText::Steps,
                _ => TaskText::Elsewhere,
            },
            sentences: None,
        }),
        _ => None,
    };
    rows.filter_map(entry).collect()
}

/// One item of the authors' file.
#[derive(Deserialize)]
struct Listed {
    task: String,
    repeat_id: usize,
    subgoal_ids: Vec<usize>,
    annotation: String,
    #[serde(default)]
    primitive_skills: Option<Vec<ListedSkill>>,
}

/// One skill of such an item.
#[derive(Deserialize)]
struct ListedSkill {
    annotations: String,
}

impl Listed {
    /// The sentences for its skills.
    fn sentences(&self) -> Result<Option<Vec<String>>, String> {
        let Some(listed) = &self.primitive_skills else { return Ok(None) };
        let (found, wanted) = (listed.len(), self.subgoal_ids.len());
        if found != wanted {
            return Err(format!("primitive_skills: {found} for {wanted} subgoal_ids"));
        }
        let sentence = |(at, skill): (usize, &ListedSkill)| {
            told(&skill.annotations).map_err(|wrong| format!("primitive_skills[{at}].annotations: {wrong}"))
        };
        listed.iter().enumerate().map(sentence).collect::<Result<_, _>>().map(Some)
    }
}

/// A text of the authors' file, as an agent may be told it.
fn told(text: &str) -> Result<String, String> {
    let text = instruction::visible(text);
    instruction::parse(&text).map_err(|error| error.to_string())?;
    Ok(text)
}

/// The entries of a set by the authors' own file in `folder`; `None` where it is absent.
///
/// # Errors
/// When the file is there but malformed.
pub fn listed(set: Official, folder: &Path) -> anyhow::Result<Option<Vec<OfficialTask>>> {
    let path = folder.join(set.list);
    let shown = || path.display().to_string();
    if !presence::is_file(&path).map_err(anyhow::Error::msg).with_context(shown)? {
        return Ok(None);
    }
    let text = text_file::read(&path).with_context(|| path.display().to_string())?;
    let mut items: Vec<Listed> = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
    // The task number on the authors' command line is the position in this order.
    items.sort_by_key(|item| std::cmp::Reverse(item.subgoal_ids.len()));
    let entry = |(number, item): (usize, Listed)| {
        let wrong = |what: String| anyhow::anyhow!("{}: item {number}: {what}", path.display());
        let first = item.subgoal_ids.first().copied();
        let adjacent = item.subgoal_ids.windows(2).all(|pair| pair[0].checked_add(1) == Some(pair[1]));
        let first = first.filter(|_| adjacent);
        let first = first.ok_or_else(|| wrong(format!("subgoal_ids: {:?} is no span", item.subgoal_ids)))?;
        let annotation = told(&item.annotation).map_err(|what| wrong(format!("annotation: {what}")))?;
        let sentences = item.sentences().map_err(wrong)?;
        Ok(OfficialTask {
            trajectory: item.task,
            annotator: item.repeat_id,
            first,
            skills: item.subgoal_ids.len(),
            wording: TaskText::Given(annotation),
            sentences,
        })
    };
    items.into_iter().enumerate().map(entry).collect::<anyhow::Result<Vec<_>>>().map(Some)
}

/// Builds a set. `find` gives a trajectory and its scene by id.
///
/// # Errors
/// Names the first entry that cannot be built.
pub(crate) fn build<'a>(
    set: Official,
    entries: &[OfficialTask],
    trajectories: &BTreeMap<&str, &'a Trajectory>,
    scenes: &BTreeMap<&str, &'a Scene>,
) -> Result<TaskSet, String> {
    let task = |(number, entry): (usize, &OfficialTask)| {
        let wrong = |what: &str| format!("task {number} ({}): {what}", entry.trajectory);
        let trajectory =
            trajectories.get(entry.trajectory.as_str()).ok_or_else(|| wrong("its trajectory is absent"))?;
        let crate::domain::task::SceneRef::Named(scene) = &trajectory.scene else {
            return Err(wrong("its scene has no name"));
        };
        let scene = scenes.get(scene.as_str()).ok_or_else(|| wrong("its scene is absent"))?;
        let id = format!("{}-{number}", set.name);
        cut(id, trajectory, scene, entry).map_err(|error| wrong(&error))
    };
    let tasks = entries.iter().enumerate().map(task).collect::<Result<Vec<_>, _>>()?;
    Ok(TaskSet {
        format_version: TaskSet::FORMAT,
        name: set.name.to_owned(),
        scenes: Some("../scenes".to_owned()),
        tasks,
    })
}

/// An official task: a span with the words that the index names.
fn cut(id: String, trajectory: &Trajectory, scene: &Scene, entry: &OfficialTask) -> Result<Task, String> {
    let span = entry.first..entry.first.saturating_add(entry.skills);
    let task = span_task(id, trajectory, scene, span.clone())?;
    let annotation = trajectory.annotations.get(entry.annotator);
    let annotation = annotation.ok_or_else(|| format!("annotator {} does not exist", entry.annotator))?;
    let annotated = || annotation.steps.get(span).map(<[String]>::to_vec).unwrap_or_default();
    let sentences = entry.sentences.clone().unwrap_or_else(annotated);
    let joined = || sentences.join(" ");
    let (instruction, reworded) = match &entry.wording {
        TaskText::Goal => (annotation.goal.clone(), false),
        TaskText::Steps => (joined(), false),
        TaskText::Elsewhere => (joined(), true),
        TaskText::Given(text) => (text.clone(), false),
    };
    if instruction.is_empty() {
        return Err(format!("annotator {} has no sentence for it", entry.annotator));
    }
    Ok(Task { instruction, sentences, reworded, ..task })
}

/// Cuts a span out of a trajectory, without words yet: the expert's actions before it are replayed, and what they handled
/// stays bound.
///
/// # Errors
/// When there is no such span, or the actions before it are not possible.
pub(crate) fn span_task(
    id: String,
    trajectory: &Trajectory,
    scene: &Scene,
    span: Range<usize>,
) -> Result<Task, String> {
    if span.is_empty() || span.end > trajectory.skills.len() {
        return Err(format!("skills {span:?} do not exist; there are {}", trajectory.skills.len()));
    }
    let from = trajectory.skill_range(span.start).start;
    let until = trajectory.skill_range(span.end - 1).end;
    let before = trajectory.actions.get(..from).filter(|_| from < until && until <= trajectory.actions.len());
    let before = before.ok_or_else(|| format!("skill_starts: skills {span:?} are not a run of its actions"))?;
    let mut replay = Replay::new(scene, trajectory.start.clone(), before);
    let mut number = 0;
    while let Some((_, outcome)) = replay.step() {
        if let Outcome::Impossible(reason) = outcome {
            return Err(format!("the expert's action {number} is not possible: {reason}"));
        }
        number += 1;
    }
    let start = replay.finish();
    let (roles, subtasks) = roles(trajectory, span.clone(), &start)?;
    let expert_steps = (until - from) as u32;
    Ok(Task {
        id,
        scene: trajectory.scene.clone(),
        start: Some(start),
        instruction: String::new(),
        sentences: Vec::new(),
        roles,
        subtasks,
        expert_steps,
        horizon: 2 * expert_steps,
        goal: trajectory.goal.clone(),
        source: Some((trajectory.id.clone(), span.start as u8)),
        env: None,
        seed: None,
        reworded: false,
    })
}

/// The roles that a span and the skills before it are about, renumbered; those that were handled before carry what they are
/// bound to, so that nothing else is taken for them.
///
/// A recording names one piece of furniture for whatever was put there. A task asks for one only where ALFRED's goal does;
/// elsewhere each Put may choose its own of the class.
fn roles(trajectory: &Trajectory, span: Range<usize>, start: &World) -> Result<(Vec<Role>, Vec<Subtask>), String> {
    let recorded =
        |number: u8| trajectory.roles.get(usize::from(number)).ok_or_else(|| format!("there is no role {number}"));
    let mut parts: Vec<Part> = Vec::new();
    let mut subtasks = Vec::new();
    for (number, skill) in trajectory.skills[..span.end].iter().enumerate() {
        let before = number < span.start;
        let mut part = |recorded: u8, shared: bool| {
            let known = parts.iter().position(|part| shared && part.shared && part.recorded == recorded);
            known.unwrap_or_else(|| {
                parts.push(Part { recorded, shared, before });
                parts.len() - 1
            }) as u8
        };
        let object = part(skill.object, true);
        let receptacle = match skill.receptacle {
            Some(number) => {
                let shared = is_shared(trajectory.goal.as_ref(), recorded(skill.object)?, recorded(number)?);
                // Where something was put before does not matter to what comes, unless more has to come there.
                (shared || !before).then(|| part(number, shared))
            }
            None => None,
        };
        if !before {
            subtasks.push(Subtask { object, receptacle, ..skill.clone() });
        }
    }
    let role = |part: &Part| {
        let role = recorded(part.recorded)?;
        let bound = role.expert.filter(|_| part.before).and_then(|expert| now(expert, start));
        Ok(Role { bound, ..role.clone() })
    };
    let roles = parts.iter().map(role).collect::<Result<_, String>>()?;
    Ok((roles, subtasks))
}

/// A role of a task that is cut from a recording.
struct Part {
    /// The number of the recording's own.
    recorded: u8,
    /// Whether all that name it there mean it here.
    shared: bool,
    /// It was handled before the task begins.
    before: bool,
}

/// Whether a Put means the same receptacle as others that name it.
fn is_shared(goal: Option<&Goal>, object: &Role, receptacle: &Role) -> bool {
    let is_furniture = matches!(receptacle.expert, Some(Original { instance: Instance::Fixture(_), .. }));
    !is_furniture || goal.is_none_or(|goal| goals::asks_for_one_receptacle(goal, object, receptacle))
}

/// The instance that an original is in a world.
fn now(original: Original, world: &World) -> Option<Instance> {
    match (original.instance, original.slice) {
        (instance, None) => Some(instance),
        (Instance::Object(whole), Some(slice)) => {
            let cut = world.objects.iter().position(|object| object.slice_of == Some((whole, slice)));
            cut.map(|number| Instance::Object(number as u16))
        }
        (Instance::Fixture(_), Some(_)) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Class;
    use crate::domain::skill::GoalKind;
    use crate::domain::task::SceneRef;
    use crate::house::testing::{kitchen, named, put_subtask, role};

    #[test]
    fn the_index_holds_the_three_sets_with_25_instructions_elsewhere() {
        let counts = OFFICIAL.map(|set| indexed(set).len());
        assert_eq!(counts, [100, 20, 10]);
        let elsewhere = indexed(OFFICIAL[0]).iter().filter(|entry| entry.wording == TaskText::Elsewhere).count();
        assert_eq!(elsewhere, 25);
    }

    #[test]
    fn a_list_that_is_absent_is_none_and_one_without_a_span_names_file_and_field() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(listed(OFFICIAL[0], folder.path()).unwrap(), None);
        let item = r#"[{"task": "a/b", "repeat_id": 0, "subgoal_ids": [0, 2], "annotation": "x"}]"#;
        std::fs::write(folder.path().join(OFFICIAL[0].list), item).unwrap();
        let error = format!("{:#}", listed(OFFICIAL[0], folder.path()).unwrap_err());
        assert!(error.contains(OFFICIAL[0].list) && error.contains("subgoal_ids"), "{error}");
    }

    /// A list of one item, of two skills, with these sentences.
    fn list(skills: &serde_json::Value) -> anyhow::Result<Vec<OfficialTask>> {
        let folder = tempfile::tempdir().unwrap();
        let item = serde_json::json!({
            "task": "a/b", "repeat_id": 0, "subgoal_ids": [0, 1], "annotation": "Tidy up.", "primitive_skills": skills,
        });
        std::fs::write(folder.path().join(OFFICIAL[0].list), serde_json::json!([item]).to_string()).unwrap();
        listed(OFFICIAL[0], folder.path()).map(Option::unwrap)
    }

    #[test]
    fn the_sentences_of_a_list_for_its_skills_are_kept_though_another_annotator_wrote_them() {
        let skills = serde_json::json!([
            {"annotations": "take the \u{8}red mug", "scene_index": 3},
            {"annotations": "put it in the basin"},
        ]);
        let entry = &list(&skills).unwrap()[0];
        let data = serde_json::from_str(include_str!("../../../tests/fuzz/traj_data.json")).unwrap();
        let recording = super::super::recording::Recording::new("a/b".into(), "train".into(), data).unwrap();
        let settings = [&recording.setting];
        let layout = super::super::layout::FloorPlanLayout::default();
        let room = recording.setting.room;
        let built = super::super::scenes::build("FloorPlan1", room, &layout, &[&recording], &settings).unwrap();
        let parents =
            super::super::parents::parents(&recording, &built.inventory, &built.recorded, &built.scene.fixtures);
        let trajectory =
            super::super::trajectories::resolve(&recording, &built.scene, &built.inventory, &parents).unwrap();
        let task = cut("x".into(), &trajectory, &built.scene, entry).unwrap();
        assert_eq!((&*task.instruction, task.reworded), ("Tidy up.", false));
        assert_eq!(task.sentences, ["take the red mug", "put it in the basin"]);
        let indexed = OfficialTask { sentences: None, ..entry.clone() };
        let own = cut("x".into(), &trajectory, &built.scene, &indexed).unwrap();
        assert_eq!(own.sentences, ["Take the mug.", "Put it in the sink."]);
    }

    #[test]
    fn a_list_whose_sentences_fit_no_skills_or_say_nothing_names_item_and_field() {
        let wrong = |skills: serde_json::Value| format!("{:#}", list(&skills).unwrap_err());
        let one = wrong(serde_json::json!([{"annotations": "take it"}]));
        assert!(one.contains("item 0: primitive_skills: 1 for 2"), "{one}");
        let empty = wrong(serde_json::json!([{"annotations": "take it"}, {"annotations": " \u{200b}"}]));
        assert!(empty.contains("primitive_skills[1].annotations") && empty.contains("empty"), "{empty}");
        let long = wrong(serde_json::json!([{"annotations": "a".repeat(3000)}, {"annotations": "b"}]));
        assert!(long.contains("primitive_skills[0].annotations") && long.contains("2000"), "{long}");
    }

    /// A demonstration in the test kitchen that only says what is put where: a knife and two mugs, all on the counter.
    fn puts(kind: GoalKind, mug_on_counter: bool) -> Trajectory {
        let (scene, start) = kitchen();
        let expert = |name: &str| Some(Original { instance: named(&scene, &start, name), slice: None });
        let roles = ["Knife", "CounterTop", "Mug", "Mug2", "Plate"];
        let roles = roles.map(|name| Role { expert: expert(name), ..role(name.trim_end_matches('2')) });
        let holder = if mug_on_counter { 1 } else { 4 };
        let skills = [(0, 1), (2, holder), (3, holder)].map(|(thing, place)| put_subtask(thing, place));
        let goal = Goal {
            kind,
            object: Class::named("Mug").unwrap(),
            sliced: false,
            receptacle: Class::named("CounterTop"),
            movable: None,
            lamp: None,
        };
        Trajectory {
            id: "puts".into(),
            split: "train".into(),
            scene: SceneRef::Named(scene.name.clone()),
            start,
            actions: Vec::new(),
            skill_starts: vec![0, 1, 2],
            roles: roles.to_vec(),
            skills: skills.to_vec(),
            goal: Some(goal),
            annotations: Vec::new(),
            boxes: Vec::new(),
            choices: Vec::new(),
        }
    }

    /// The receptacles' roles in a span, and which of all roles are bound at its start.
    fn places(trajectory: &Trajectory, span: Range<usize>) -> (Vec<u8>, Vec<bool>) {
        let (roles, subtasks) = roles(trajectory, span, &trajectory.start).unwrap();
        let places: Vec<u8> = subtasks.iter().filter_map(|subtask| subtask.receptacle).collect();
        let holder = if trajectory.skills[1].receptacle == Some(1) { "CounterTop" } else { "Plate" };
        assert!(places[places.len() - 2..].iter().all(|&place| roles[usize::from(place)].class.name() == holder));
        (places, roles.iter().map(|role| role.bound.is_some()).collect())
    }

    #[test]
    fn only_what_the_goal_wants_together_has_to_come_to_one_piece_of_furniture() {
        let heat = puts(GoalKind::PickHeatThenPlaceInRecep, true);
        assert_eq!(places(&heat, 0..3), (vec![1, 3, 5], vec![false; 6]), "each has its own");
        assert_eq!(places(&heat, 1..3), (vec![2, 4], vec![true, false, false, false, false]), "the knife is bound");
        let two = puts(GoalKind::PickTwoObjAndPlace, true);
        assert_eq!(places(&two, 0..3), (vec![1, 3, 3], vec![false; 5]), "two mugs together, the knife anywhere");
        let (second, bound) = places(&Trajectory { skills: two.skills[..].to_vec(), ..two.clone() }, 1..3);
        assert_eq!((second, bound), (vec![2, 2], vec![true, false, false, false]));
    }

    #[test]
    fn the_second_of_two_things_has_to_come_to_where_the_first_was_put_before_the_task() {
        let two = puts(GoalKind::PickTwoObjAndPlace, true);
        let (roles, subtasks) = roles(&two, 2..3, &two.start).unwrap();
        let place = &roles[usize::from(subtasks[0].receptacle.unwrap())];
        assert_eq!(place.bound, two.roles[1].expert.map(|expert| expert.instance));
    }

    #[test]
    fn what_things_are_put_in_to_be_carried_is_one_thing_whatever_the_goal() {
        let carried = puts(GoalKind::PickHeatThenPlaceInRecep, false);
        assert_eq!(places(&carried, 0..3).0, [1, 3, 3]);
    }

    #[test]
    fn a_recording_without_a_goal_means_the_furniture_that_it_names() {
        let own = Trajectory { goal: None, ..puts(GoalKind::PickTwoObjAndPlace, true) };
        assert_eq!(places(&own, 0..3).0, [1, 1, 1]);
    }
}
