//! Task sets of environments that say themselves what is asked: an episode a seed.

use crate::domain::{EnvironmentName, Task, TaskSet};

/// The episodes of so many seeds, from that one on. The set is called like the environment, as far as a folder's name allows.
pub(crate) fn set(name: &EnvironmentName, first: u64, count: u32) -> TaskSet {
    let seeds = (0..u64::from(count)).map(|at| first.saturating_add(at));
    let tasks = seeds.map(|seed| Task::remote(seed.to_string(), name.clone(), seed)).collect();
    let text = match name {
        EnvironmentName::OpenEnv(address) => format!("{}-{}", address.host, address.port),
        EnvironmentName::Gym(id) => id.clone(),
        EnvironmentName::House => "house".into(),
    };
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let name = text.chars().map(plain).collect();
    TaskSet { format_version: TaskSet::FORMAT, name, scenes: None, tasks }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{schema, taskset};

    #[test]
    fn a_set_of_another_environment_is_written_read_and_fits_its_schema() {
        let set = set(&"gym:ALE/Pong-v5".parse().unwrap(), 7, 3);
        assert_eq!((set.name.as_str(), set.tasks[2].seed), ("ALE-Pong-v5", Some(9)));
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("set.json");
        taskset::write(&file, &set).unwrap();
        assert_eq!(taskset::read(&file).unwrap().value, set);
        let schema = crate::eval::schemas::schema("tasks").unwrap().to_value();
        let faults = |document: serde_json::Value| schema::faults(&schema, &document).unwrap();
        assert_eq!(faults(serde_json::to_value(&set).unwrap()), []);
        let short = serde_json::json!({"format_version": 1, "name": "mine",
            "tasks": [{"id": "a", "env": "gym:X-v0", "seed": 1}, {"id": "b", "env": "gym:X-v0"}, {"id": "c"}]});
        let found: Vec<String> = faults(short.clone()).into_iter().map(|fault| fault.field).collect();
        assert!(found.contains(&"tasks[1].seed".into()) && found.contains(&"tasks[2].scene".into()), "{found:?}");
        assert!(!found.iter().any(|field| field.starts_with("tasks[0]")), "{found:?}");
    }

    #[test]
    fn what_is_missing_or_about_house_is_named() {
        let told = |change: fn(&mut Task)| {
            let mut set = set(&"gym:X-v0".parse().unwrap(), 0, 1);
            change(&mut set.tasks[0]);
            taskset::check(&set).err().map_or_else(String::new, |error| format!("{error:#}"))
        };
        assert_eq!(told(|_| ()), "");
        assert!(told(|task| task.seed = None).contains("tasks[0].seed: missing"));
        assert!(told(|task| task.env = None).contains("tasks[0].scene: missing"));
        assert!(told(|task| task.env = Some(EnvironmentName::House)).contains("tasks[0].env: House"));
        assert!(told(|task| task.sentences = vec!["Go.".into()]).contains("tasks[0].sentences: it is about House"));
    }
}
