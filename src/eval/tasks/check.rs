//! A task file that somebody wrote: every mistake in it, with its line, before anything is played.

use std::path::Path;

use anyhow::Context;
use serde_json::Value;

use crate::data::{json, json_positions, schema, taskset, text_file};
use crate::domain::{Task, TaskSet};
use crate::episode::scenes::Scenes;
use crate::eval::read_tasks::read_instruction;
use crate::language::count::counted;

/// A mistake in a task file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// The line of the file, from 1.
    pub(crate) line: usize,
    /// The field, as in `tasks[1].roles[0].class`; empty for the whole file.
    pub(crate) field: String,
    /// What is wrong, and what was expected.
    pub(crate) problem: String,
}

impl std::fmt::Display for Mistake {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.field.as_str() {
            "" => write!(f, "{}: {}", self.line, self.problem),
            field => write!(f, "{}: {field}: {}", self.line, self.problem),
        }
    }
}

/// Every mistake in a task file: first whether it is JSON, then its form, then its meaning, then whether each task fits its
/// scene. A later kind of mistake is only looked for in tasks without an earlier one.
///
/// # Errors
/// When the file cannot be read.
pub fn mistakes(path: &Path) -> anyhow::Result<Vec<Mistake>> {
    let bytes = json::read_bytes(path)?;
    let whole = |problem: String| Ok(vec![Mistake { line: 1, field: String::new(), problem }]);
    let bytes = match text_file::content(&bytes) {
        Ok(bytes) => bytes,
        Err(error) => return whole(error.to_string()),
    };
    let Ok(text) = std::str::from_utf8(bytes) else { return whole("not a text in UTF-8".into()) };
    let document: Value = match serde_json::from_str(text) {
        Ok(document) => document,
        Err(error) => {
            return Ok(vec![Mistake {
                line: error.line(),
                field: String::new(),
                problem: format!("not JSON: {error}"),
            }]);
        }
    };
    let mut found: Vec<(String, String)> = schema::faults(&schemars::schema_for!(TaskSet).to_value(), &document)?
        .into_iter()
        .map(|fault| (fault.field, fault.problem))
        .collect();
    meaning(path, &document, &mut found);
    let places = json_positions::lines_of(text, found.iter().map(|(field, _)| field.as_str()));
    let mut mistakes: Vec<Mistake> = found
        .iter()
        .map(|(field, problem)| Mistake {
            line: places.get(field.as_str()).copied().unwrap_or(1),
            field: field.clone(),
            problem: problem.clone(),
        })
        .collect();
    mistakes.sort_by_key(|mistake| mistake.line);
    Ok(mistakes)
}

/// What the form alone does not show, in the tasks whose form is right.
fn meaning(path: &Path, document: &Value, found: &mut Vec<(String, String)>) {
    let Some(tasks) = document.get("tasks").and_then(Value::as_array) else { return };
    let folder = document.get("scenes").and_then(Value::as_str);
    let around = TaskSet {
        format_version: TaskSet::FORMAT,
        name: String::new(),
        scenes: folder.map(String::from),
        tasks: Vec::new(),
    };
    let scenes = Scenes::of(path, &around);
    let mut ids = std::collections::BTreeMap::new();
    for (i, value) in tasks.iter().enumerate() {
        let place = format!("tasks[{i}]");
        if let Some(id) = value.get("id").and_then(Value::as_str)
            && let Some(first) = ids.insert(id, i)
        {
            found.push((format!("{place}.id"), format!("tasks[{first}] has the same; an id is unique in its set")));
        }
        let inside = |field: &str| {
            field.strip_prefix(&place).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
        };
        if found.iter().any(|(field, _)| inside(field)) {
            continue;
        }
        match serde_path_to_error::deserialize::<_, Task>(value) {
            Err(error) => {
                let field = error.path().to_string();
                let field = if field == "." { place } else { format!("{place}.{field}") };
                found.push((field, error.inner().to_string()));
            }
            Ok(task) => {
                let misfits = taskset::misfits_told(&task);
                match (misfits.is_empty() && task.env.is_none()).then(|| scenes.setting(&task)) {
                    Some(Err(error)) => {
                        let text = format!("{error:#}");
                        let (field, problem) = text.split_once(": ").unwrap_or(("scene", &text));
                        found.push((format!("{place}.{field}"), problem.to_owned()));
                    }
                    Some(Ok(setting)) if task.subtasks.is_empty() => {
                        let problem = read_instruction(&task, &setting, None).err();
                        found.extend(problem.map(|problem| (format!("{place}.subtasks"), problem)));
                    }
                    Some(Ok(_)) | None => {}
                }
                found.extend(misfits.into_iter().map(|misfit| (format!("{place}.{}", misfit.field), misfit.problem)));
            }
        }
    }
}

/// Fails with the number of mistakes, once they were shown.
///
/// # Errors
/// When there are any.
pub(crate) fn none(mistakes: &[Mistake], path: &Path) -> anyhow::Result<()> {
    let count = mistakes.len();
    (count == 0).then_some(()).with_context(|| format!("{}: {}", path.display(), counted(count, "mistake")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::taskset::tests::sample_set;
    use crate::domain::task::SceneRef;
    use crate::house::testing::kitchen;

    fn of(text: &str) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.json");
        std::fs::write(&path, text).unwrap();
        mistakes(&path).unwrap().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn every_mistake_is_told_with_line_and_field() {
        let mut set = sample_set();
        set.tasks.truncate(1);
        set.tasks[0].start = None;
        set.tasks[0].roles[0].bound = None;
        let good = serde_json::to_string_pretty(&set).unwrap();
        assert_eq!(of(&good), Vec::<String>::new());
        let told =
            of(&good.replace("\"Fridge\"", "\"Frigde\"").replace("\"horizon\": 40", "\"horizon\": 0")).join("\n");
        assert!(
            told.contains("tasks[0].roles[1].class: \"Frigde\"") && told.contains("tasks[0].horizon: 0, but"),
            "{told}"
        );
        let line = good.lines().position(|line| line.contains("\"horizon\"")).unwrap() + 1;
        assert!(told.contains(&format!("{line}: tasks[0].horizon")), "{told}");
    }

    #[test]
    fn mistakes_of_meaning_are_told_together() {
        let mut set = sample_set();
        set.tasks.truncate(1);
        set.tasks[0].start = None;
        set.tasks[0].subtasks[0].object = 9;
        set.tasks[0].subtasks[1].receptacle = None;
        set.tasks[0].sentences.pop();
        let told = of(&serde_json::to_string(&set).unwrap()).join("\n");
        for part in
            ["tasks[0].sentences: 1 sentence for", "subtasks[0].object: 9, but", "subtasks[1].receptacle: a Put"]
        {
            assert!(told.contains(part), "{part} in {told}");
        }
    }

    #[test]
    fn a_task_without_subtasks_is_a_mistake_only_where_its_instruction_cannot_be_graded() {
        let folder = tempfile::tempdir().unwrap();
        let (scene, world) = kitchen();
        json::write(&folder.path().join(format!("{}.json", scene.name)), &*scene).unwrap();
        let told = |instruction: &str| {
            let mut set = sample_set();
            set.tasks.truncate(1);
            set.scenes = Some(".".into());
            let task = &mut set.tasks[0];
            (task.roles, task.subtasks, task.sentences) = (Vec::new(), Vec::new(), Vec::new());
            (task.scene, task.start) = (SceneRef::Named(scene.name.clone()), Some(world.clone()));
            task.instruction = instruction.into();
            let path = folder.path().join("mine.json");
            std::fs::write(&path, serde_json::to_string(&set).unwrap()).unwrap();
            mistakes(&path).unwrap().iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        assert_eq!(told("pick up the mug"), Vec::<String>::new());
        let dance = told("dance").join("\n");
        assert!(dance.contains("tasks[0].subtasks: none, and \"dance\" cannot be graded"), "{dance}");
    }

    #[test]
    fn what_is_no_json_is_told_with_its_line() {
        assert!(of("{\n\"tasks\": [,]\n}")[0].starts_with("2: not JSON"));
        assert!(of("[]")[0].contains("a list, but an object"));
    }
}
