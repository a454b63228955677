//! Task files: read strictly, so that a mistake is found before the first episode and not in the middle of a night's run.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};

use super::json::{self, Document};
use crate::domain::task::SceneRef;
use crate::domain::{Class, EnvironmentName, Role, SkillKind, Subtask, Task, TaskSet};
use crate::house::validate::Misfit;
use crate::language::count::counted;
use crate::language::instruction;

/// The longest horizon that is taken, in steps.
pub(crate) const LONGEST_HORIZON: u32 = 100_000;
/// The most subtasks (and roles) that a task may have; steps and roles are counted in bytes.
pub(crate) const MOST_SUBTASKS: usize = 100;

/// Reads and checks a task file.
///
/// # Errors
/// Each names the file, and where it applies the task and the field.
pub fn read(path: &Path) -> anyhow::Result<Document<TaskSet>> {
    let document = filled(path)?;
    check(&document.value).with_context(|| format!("{}", path.display()))?;
    Ok(document)
}

/// The same, where a task may say no subtasks: then its instruction is read, and graded as it was read.
///
/// # Errors
/// As [`read`].
pub fn read_told(path: &Path) -> anyhow::Result<Document<TaskSet>> {
    let document = filled(path)?;
    check_each(&document.value, misfits_told).with_context(|| format!("{}", path.display()))?;
    Ok(document)
}

fn filled(path: &Path) -> anyhow::Result<Document<TaskSet>> {
    let Document { mut value, digest } = json::read::<TaskSet>(path, TaskSet::FORMAT)?;
    // It comes to stand in tables, pages and drawings.
    value.name = instruction::visible(&value.name);
    Ok(Document { value: value.filled(), digest })
}

/// Writes a task file atomically, in the form that [`read`] takes.
///
/// # Errors
/// When the set would not read back, or the file cannot be written.
pub fn write(path: &Path, set: &TaskSet) -> anyhow::Result<()> {
    check(set).with_context(|| format!("cannot write {}", path.display()))?;
    json::write(path, set)
}

/// Splits `FILE#TASK` into the file and the task; the whole is the file where no `#` is.
pub(crate) fn split_reference(text: &str) -> (PathBuf, Option<&str>) {
    match text.rsplit_once('#') {
        Some((file, task)) => (PathBuf::from(file), Some(task)),
        None => (PathBuf::from(text), None),
    }
}

/// The position of the task of that number from 1, or of that id.
///
/// # Errors
/// When there is none; says what there is.
pub(crate) fn pick(set: &TaskSet, wanted: &str) -> anyhow::Result<usize> {
    let numbered = wanted.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
    let named = || set.tasks.iter().position(|task| task.id == wanted);
    let found = numbered.filter(|&at| at < set.tasks.len()).or_else(named);
    found.with_context(|| format!("there is no task {wanted:?}; the tasks are numbered 1 to {}", set.tasks.len()))
}

/// Checks what the types alone do not: texts, indices and classes. Whether a task fits its scene is seen when that is loaded.
///
/// # Errors
/// Names the first task and field that is wrong.
pub(crate) fn check(set: &TaskSet) -> anyhow::Result<()> {
    check_each(set, misfits)
}

/// The same with what is wrong with a task as `misfits` tells it.
fn check_each(set: &TaskSet, misfits: impl Fn(&Task) -> Vec<Misfit>) -> anyhow::Result<()> {
    if set.tasks.is_empty() {
        return Err(anyhow!("tasks: the set is empty"));
    }
    let mut ids = BTreeSet::new();
    for (i, task) in set.tasks.iter().enumerate() {
        let named =
            |misfit: Misfit| anyhow!("{} (task {:?})", misfit.under(&format!("tasks[{i}]")), shortened(&task.id));
        misfits(task).into_iter().next().map_or(Ok(()), |misfit| Err(named(misfit)))?;
        if !ids.insert(&task.id) {
            return Err(named(Misfit::new("id", "another task of the set has the same")));
        }
        if matches!(task.scene, SceneRef::Named(_)) && set.scenes.is_none() {
            return Err(anyhow!("scenes: missing, but tasks[{i}] (task {:?}) names a scene", shortened(&task.id)));
        }
    }
    Ok(())
}

fn shortened(text: &str) -> String {
    if text.chars().count() <= 80 { text.to_owned() } else { text.chars().take(79).chain(['…']).collect() }
}

/// The same as [`misfits`] where a task may say no subtasks.
pub(crate) fn misfits_told(task: &Task) -> Vec<Misfit> {
    let mut found = misfits(task);
    found.retain(|misfit| !(task.subtasks.is_empty() && misfit.field == "subtasks"));
    found
}

/// Everything that is wrong with a task by itself.
pub(crate) fn misfits(task: &Task) -> Vec<Misfit> {
    let mut found = Vec::new();
    if task.id.trim().is_empty() || task.id.chars().any(instruction::is_control) || task.id.chars().count() > 200 {
        found.push(Misfit::new("id", "empty, too long, or with control characters"));
    }
    if let Some(env) = &task.env {
        found.extend(remote_misfits(task, env));
        return found;
    }
    if task.scene == SceneRef::Remote {
        found.push(Misfit::new("scene", "missing; a task names a scene of House, or env and seed"));
    }
    if let SceneRef::Named(name) = &task.scene
        && (name.is_empty() || name.starts_with('.') || name.contains(['/', '\\', '\0']))
    {
        found.push(Misfit::new("scene", format!("{name:?} is a path, not the name of a scene")));
    }
    found.extend(text("instruction", &task.instruction).err());
    for (i, sentence) in task.sentences.iter().enumerate() {
        found.extend(text(&format!("sentences[{i}]"), sentence).err());
    }
    let (sentences, subtasks) = (task.sentences.len(), task.subtasks.len());
    if sentences != 0 && sentences != subtasks {
        found.push(Misfit::new(
            "sentences",
            format!("{} for {}", counted(sentences, "sentence"), counted(subtasks, "subtask")),
        ));
    }
    if !(1..=MOST_SUBTASKS).contains(&subtasks) {
        found.push(Misfit::new("subtasks", format!("{subtasks} are not 1 to {MOST_SUBTASKS}")));
    }
    if task.roles.len() > MOST_SUBTASKS {
        found.push(Misfit::new("roles", format!("{} are more than {MOST_SUBTASKS}", task.roles.len())));
    }
    for (i, role) in task.roles.iter().enumerate() {
        found.extend(check_role(role).err().map(|misfit| misfit.under(&format!("roles[{i}]"))));
    }
    for (i, subtask) in task.subtasks.iter().enumerate() {
        let misfit = check_subtask(&task.roles, subtask).err();
        found.extend(misfit.map(|misfit| misfit.under(&format!("subtasks[{i}]"))));
    }
    if !(1..=LONGEST_HORIZON).contains(&task.horizon) {
        found.push(Misfit::new("horizon", format!("{} is not 1 to {LONGEST_HORIZON}", task.horizon)));
    }
    found
}

/// What is wrong with a task in another environment than House.
fn remote_misfits(task: &Task, env: &EnvironmentName) -> Vec<Misfit> {
    let mut found = Vec::new();
    if *env == EnvironmentName::House {
        found.push(Misfit::new("env", "House is meant where a task names a scene; leave it out"));
    }
    if task.seed.is_none() {
        found.push(Misfit::new("seed", format!("missing; it says which episode of {env} is played")));
    }
    if !task.instruction.is_empty() {
        found.extend(text("instruction", &task.instruction).err());
    }
    let of_house = [
        ("scene", task.scene != SceneRef::Remote),
        ("start", task.start.is_some()),
        ("sentences", !task.sentences.is_empty()),
        ("roles", !task.roles.is_empty()),
        ("subtasks", !task.subtasks.is_empty()),
        ("goal", task.goal.is_some()),
    ];
    for (field, _) in of_house.into_iter().filter(|(_, is_there)| *is_there) {
        found.push(Misfit::new(field, format!("it is about House, but the task plays in {env}")));
    }
    // Absent, it is 0 until the set is filled.
    if task.horizon > LONGEST_HORIZON {
        found.push(Misfit::new("horizon", format!("{} is not 1 to {LONGEST_HORIZON}", task.horizon)));
    }
    found
}

fn text(field: &str, text: &str) -> Result<(), Misfit> {
    instruction::parse(text).map(drop).map_err(|problem| Misfit::new(field, problem.to_string()))
}

fn check_role(role: &Role) -> Result<(), Misfit> {
    let class = role.class;
    if !class.in_vocabulary() {
        return Err(Misfit::new("class", format!("{:?} is not a class that an action can name", class.name())));
    }
    if role.slice && class.info().slices == 0 {
        return Err(Misfit::new("slice", format!("a {class} cannot be sliced")));
    }
    Ok(())
}

fn check_subtask(roles: &[Role], subtask: &Subtask) -> Result<(), Misfit> {
    let class_at = |field: &str, index: u8| -> Result<Class, Misfit> {
        let role = roles.get(usize::from(index));
        role.map(|role| role.class)
            .ok_or_else(|| Misfit::new(field, format!("{index}, but the task has {} roles", roles.len())))
    };
    let object = class_at("object", subtask.object)?;
    let receptacle = subtask.receptacle.map(|index| class_at("receptacle", index)).transpose()?;
    let info = object.info();
    let possible = match subtask.skill {
        SkillKind::Toggle => info.toggleable,
        SkillKind::Slice => info.slices > 0,
        SkillKind::Pickup | SkillKind::Put | SkillKind::Clean | SkillKind::Heat | SkillKind::Cool => info.pickupable,
    };
    if !possible {
        return Err(Misfit::new("object", format!("{:?} cannot be done to a {object}", subtask.skill)));
    }
    match (subtask.skill, receptacle) {
        (SkillKind::Put, None) => Err(Misfit::new("receptacle", "a Put needs one")),
        (_, Some(class)) if !class.info().receptacle => {
            Err(Misfit::new("receptacle", format!("a {class} holds nothing")))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::domain::{Instance, Room, World};

    /// A task set that uses every field.
    pub(crate) fn sample_set() -> TaskSet {
        let class = |name: &str| Class::named(name).unwrap();
        let role = |name: &str, bound| Role { class: class(name), slice: false, bound, expert: None };
        let subtask = |skill, object, receptacle| Subtask { skill, object, receptacle, closes: false, literal: None };
        let task = Task {
            id: "first".into(),
            scene: SceneRef::Generated { room: Room::Kitchen, seed: 5 },
            start: Some(World::default()),
            instruction: "Put the apple in the fridge.".into(),
            sentences: vec!["Take the apple.".into(), "Put it in the fridge.".into()],
            roles: vec![role("Apple", Some(Instance::Object(0))), role("Fridge", None)],
            subtasks: vec![subtask(SkillKind::Pickup, 0, None), subtask(SkillKind::Put, 0, Some(1))],
            expert_steps: 20,
            horizon: 40,
            goal: None,
            source: None,
            env: None,
            seed: None,
            reworded: false,
        };
        let second = Task { id: "second".into(), scene: SceneRef::Named("FloorPlan7".into()), ..task.clone() };
        TaskSet {
            format_version: 1,
            name: "sample".into(),
            scenes: Some("../scenes".into()),
            tasks: vec![task, second],
        }
    }

    fn complaint(change: impl FnOnce(&mut TaskSet)) -> String {
        let mut set = sample_set();
        change(&mut set);
        check(&set).err().map_or_else(String::new, |error| format!("{error:#}"))
    }

    fn complaint_about(from: &str, to: &str) -> String {
        let text = serde_json::to_string(&sample_set()).unwrap();
        assert!(text.contains(from), "{from} in {text}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.json");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let error = format!("{:#}", read(&path).err().unwrap());
        assert!(error.contains("mine.json"), "{error}");
        error
    }

    #[test]
    fn a_name_is_read_without_what_steers_a_terminal_and_an_id_of_that_kind_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tasks.json");
        let mut set = TaskSet { name: "mine\u{1b}[2J\u{202e}".into(), ..sample_set() };
        json::write(&path, &set).unwrap();
        assert_eq!(read(&path).unwrap().value.name, "mine[2J");
        set.tasks[0].id = "a\u{202e}b".into();
        json::write(&path, &set).unwrap();
        assert!(format!("{:#}", read(&path).err().unwrap()).contains("tasks[0].id"));
    }

    #[test]
    fn a_set_that_was_written_reads_back_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("set.json");
        write(&path, &sample_set()).unwrap();
        assert_eq!(read(&path).unwrap().value, sample_set());
    }

    #[test]
    fn a_mistake_in_the_file_is_named_by_file_and_field() {
        assert!(
            complaint_about("\"Apple\"", "\"Aple\"").contains("tasks[0].roles[0].class: unknown object class \"Aple\"")
        );
        assert!(complaint_about("\"kitchen\"", "\"attic\"").contains("tasks[0].scene"));
        assert!(complaint_about("\"horizon\":40", "\"horizon\":-1").contains("tasks[0].horizon"));
        assert!(complaint_about("\"horizon\":40", "\"horizont\":40").contains("`horizont`"));
        assert!(complaint_about("\"format_version\":1", "\"format_version\":3").contains("format_version: 3, but"));
        assert!(complaint_about("\"seed\":5", "\"seed\":-5").contains("tasks[0].scene"));
    }

    #[test]
    fn a_mistake_in_meaning_is_named_by_task_and_field() {
        assert_eq!(complaint(|_| ()), "");
        assert!(complaint(|set| set.tasks.clear()).contains("the set is empty"));
        assert!(complaint(|set| set.tasks[1].id = "first".into()).contains("tasks[1].id"));
        assert!(complaint(|set| set.scenes = None).contains("scenes: missing"));
        assert!(complaint(|set| set.tasks[1].scene = SceneRef::Named("../../etc".into())).contains("tasks[1].scene"));
        assert!(complaint(|set| set.tasks[0].instruction = "x".repeat(10_000)).contains("10000 characters"));
        assert!(complaint(|set| set.tasks[0].instruction = "go\u{1b}[2J".into()).contains("U+001B"));
        assert!(
            complaint(|set| set.tasks[0].instruction = "  ".into())
                .contains("tasks[0].instruction: the instruction is empty")
        );
        assert!(complaint(|set| set.tasks[0].sentences.truncate(1)).contains("1 sentence for 2 subtasks"));
        assert!(complaint(|set| set.tasks[0].subtasks[1].object = 9).contains("tasks[0].subtasks[1].object: 9, but"));
        assert!(complaint(|set| set.tasks[0].subtasks[1].receptacle = None).contains("subtasks[1].receptacle"));
        assert!(complaint(|set| set.tasks[0].subtasks[0].skill = SkillKind::Toggle).contains("subtasks[0].object"));
        assert!(complaint(|set| set.tasks[0].roles[0].class = Class::NONE).contains("roles[0].class"));
        assert!(complaint(|set| set.tasks[0].subtasks.clear()).contains("sentences"));
        assert!(complaint(|set| set.tasks[0].horizon = 0).contains("horizon"));
        let long_name = complaint(|set| set.tasks[0].id = "x".repeat(9_000));
        assert!(long_name.len() < 300, "the error itself stays short");
    }

    #[test]
    fn a_task_is_picked_by_its_number_or_its_id() {
        let set = sample_set();
        assert_eq!(split_reference("a/b.json#1"), (PathBuf::from("a/b.json"), Some("1")));
        assert_eq!(split_reference("a/b.json"), (PathBuf::from("a/b.json"), None));
        assert_eq!([pick(&set, "2").unwrap(), pick(&set, "first").unwrap()], [1, 0]);
        for none in ["0", "3"] {
            assert!(pick(&set, none).unwrap_err().to_string().contains("1 to 2"));
        }
        let mut numbered = set.clone();
        numbered.tasks[0].id = "2".into();
        assert_eq!(pick(&numbered, "2").unwrap(), 1, "a number is a place, whatever a task is called");
    }

    proptest! {
        #[test]
        fn no_mutation_of_a_task_file_makes_the_reader_panic(
            edits in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..4), 1..8),
        ) {
            let mut bytes = serde_json::to_vec(&sample_set()).unwrap();
            for (at, byte, edit) in edits {
                let at = at.index(bytes.len().max(1));
                match edit {
                    0 => bytes.truncate(at),
                    1 if at < bytes.len() => bytes[at] = byte,
                    2 if at < bytes.len() => { bytes.remove(at); }
                    _ => bytes.insert(at.min(bytes.len()), byte),
                }
            }
            if let Ok(set) = json::parse::<TaskSet>(&bytes, TaskSet::FORMAT) {
                let _ = check(&set);
            }
        }

        #[test]
        fn no_number_in_a_task_file_makes_the_reader_panic(number in any::<i64>(), which in 0usize..40) {
            let text = serde_json::to_string(&sample_set()).unwrap();
            let mut seen = 0;
            let mut changed = String::new();
            let mut rest = text.chars().peekable();
            while let Some(c) = rest.next() {
                if c.is_ascii_digit() {
                    while rest.peek().is_some_and(char::is_ascii_digit) {
                        rest.next();
                    }
                    changed += &if seen == which { number.to_string() } else { c.to_string() };
                    seen += 1;
                } else {
                    changed.push(c);
                }
            }
            if let Ok(set) = json::parse::<TaskSet>(changed.as_bytes(), TaskSet::FORMAT) {
                let _ = check(&set);
            }
        }
    }
}
