//! JSON Schemas of the files that the program reads and writes, derived from the types that it reads and writes them with.

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};

use super::progress_event::ProgressEvent;
use crate::agent::exported::spec::PolicySpec;
use crate::domain::TaskSet;
use crate::episode::record::Episode;
use crate::report::compare::Comparison;
use crate::report::summary::RunSummary;
use crate::run_dir::manifest::RunManifest;
use crate::run_dir::policy_places::PolicyPlaces;

/// The files and lines that have a schema, as `sprint schema` names them.
pub(crate) const NAMES: [&str; 8] =
    ["tasks", "manifest", "episode", "summary", "comparison", "progress", "policies", "policy"];

/// The schema of that name.
pub fn schema(name: &str) -> Option<Schema> {
    Some(match name {
        "tasks" => schemars::schema_for!(TaskSet),
        "manifest" => written::<RunManifest>(),
        "episode" => written::<Episode>(),
        "summary" => written::<RunSummary>(),
        "comparison" => written::<Comparison>(),
        "progress" => written::<ProgressEvent>(),
        "policies" => written::<PolicyPlaces>(),
        "policy" => schemars::schema_for!(PolicySpec),
        _ => return None,
    })
}

/// The schema of what the program writes: every field that is always there is required.
fn written<T: JsonSchema>() -> Schema {
    SchemaSettings::default().for_serialize().into_generator().into_root_schema_for::<T>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::policy_place::PolicyPlace;
    use crate::data::schema;
    use crate::data::taskset::tests::sample_set;
    use crate::domain::{ActionType, Class, Instance};
    use crate::episode::record::{Author, TraceStep};
    use crate::eval::evaluation::EvaluationProgress;
    use crate::house::Outcome;
    use crate::house::outcome::Reason;
    use crate::report::compare::paired::tests::run;
    use crate::report::summary::tests::sample;
    use crate::run_dir::episodes::tests::episode;
    use crate::run_dir::manifest::tests::manifest;
    use crate::run_dir::policy_places;

    fn faults(name: &str, document: &impl serde::Serialize) -> Vec<schema::Fault> {
        schema::faults(&super::schema(name).unwrap().to_value(), &serde_json::to_value(document).unwrap()).unwrap()
    }

    #[test]
    fn what_the_program_writes_satisfies_its_schema() {
        let (tasks, episodes) = sample();
        let all = RunManifest { instruction_variants: true, all_start_subtasks: true, ..manifest() };
        let step = TraceStep {
            own: None,
            kind: ActionType::Pickup,
            target: Some(Instance::Object(3)),
            class: Class::named("Mug"),
            outcome: Outcome::Impossible(Reason::TooFar { class: Class::named("Mug").unwrap(), millimetres: 1700 }),
            subtask: None,
            instruction: Some("Go.".into()),
            author: Some(Author::hand()),
        };
        let explored = Episode { trace: vec![step], ..episode("a") };
        let comparison = Comparison::of(&[run("a", &[true, false]), run("b", &[false, true])]).unwrap().0;
        let progress = EvaluationProgress { done: 1, of: 2, successes: 1, errors: 0 };
        assert_eq!(faults("tasks", &sample_set()), []);
        assert_eq!(faults("manifest", &all), []);
        assert_eq!(faults("episode", &explored), []);
        assert_eq!(faults("summary", &RunSummary::of(&all, &tasks, &episodes, false)), []);
        assert_eq!(faults("comparison", &comparison), []);
        let folder = tempfile::tempdir().unwrap();
        let place = PolicyPlace { policy: "a".into(), checkpoint: None, place: "ws:localhost:8000".into() };
        policy_places::write(folder.path(), &[place]).unwrap();
        let written = std::fs::read(folder.path().join("policies.json")).unwrap();
        let written: serde_json::Value = serde_json::from_slice(&written).unwrap();
        assert_eq!(faults("policies", &written), []);
        assert_eq!(faults("progress", &ProgressEvent::Progress { progress, seconds: 0.5 }), []);
    }

    #[test]
    fn a_field_too_many_or_of_another_kind_is_found() {
        let mut written = serde_json::to_value(manifest()).unwrap();
        written["speed"] = 1.into();
        written["seeds"] = "two".into();
        written["format_version"] = 1.into();
        let fields: Vec<String> = faults("manifest", &written).into_iter().map(|fault| fault.field).collect();
        assert!(
            ["speed", "seeds", "format_version"].iter().all(|field| fields.iter().any(|f| f == field)),
            "{fields:?}"
        );
    }

    #[test]
    fn every_schema_has_a_title_and_describes_its_fields() {
        for name in NAMES {
            let schema = schema(name).unwrap().to_value();
            assert!(schema["title"].is_string() && schema["description"].is_string(), "{name}");
        }
    }
}
