//! The three official task sets, rebuilt from trajectories: which spans they are lies in an index of identifiers.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail, ensure};
use serde::Deserialize;

use super::presence;
use super::span_task::span_task;
use crate::data::text_file;
use crate::domain::task::{Task, TaskSet};
use crate::domain::{Scene, Trajectory};
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
    ensure!(
        !items.is_empty(),
        "{}: lists no task: take the authors' file, or remove it for the index that the program carries",
        path.display()
    );
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

/// What each official set consists of: by the authors' list where the folder has it, else by the index.
///
/// # Errors
/// When a list is malformed, or the folder holds none.
pub(crate) fn entries(lists: Option<&Path>) -> anyhow::Result<Vec<Vec<OfficialTask>>> {
    let listed_in = |set| lists.map(|folder| listed(set, folder)).transpose().map(Option::flatten);
    let found = OFFICIAL.into_iter().map(listed_in).collect::<anyhow::Result<Vec<_>>>()?;
    if let (Some(folder), true) = (lists, found.iter().all(Option::is_none)) {
        let names = OFFICIAL.map(|set| set.list).join(", ");
        bail!("{} holds none of the authors' lists: {names}", folder.display());
    }
    Ok(found.into_iter().zip(OFFICIAL).map(|(found, set)| found.unwrap_or_else(|| indexed(set))).collect())
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

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn a_folder_without_any_of_the_lists_is_refused_instead_of_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let error = entries(Some(folder.path())).unwrap_err().to_string();
        assert!(OFFICIAL.iter().all(|set| error.contains(set.list)), "{error}");
        assert_eq!(entries(None).unwrap().len(), OFFICIAL.len());
    }

    #[test]
    fn a_list_of_nothing_is_refused_and_named() {
        let folder = tempfile::tempdir().unwrap();
        for text in ["[]", "{}", "null", ""] {
            std::fs::write(folder.path().join(OFFICIAL[0].list), text).unwrap();
            let error = format!("{:#}", listed(OFFICIAL[0], folder.path()).unwrap_err());
            assert!(error.contains(OFFICIAL[0].list), "{error}");
        }
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
}
