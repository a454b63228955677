//! What a run was made from: its `manifest.json`.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::shard::Shard;
use crate::agent::DecisionOverride;
use crate::data::json;
use crate::episode::rollout::EndedBy;
use crate::house::grading::Grading;

/// What a run was made from; two runs with equal manifests measure the same thing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RunManifest {
    /// Version of the format of the whole folder.
    #[schemars(extend("const" = RunManifest::FORMAT))]
    pub(crate) format_version: u32,
    /// The version of the program.
    pub(crate) sprint_version: String,
    /// The name that the task file gives itself.
    pub(crate) task_set: String,
    /// SHA-256 of the task file.
    pub(crate) task_set_hash: String,
    /// SHA-256 over the scenes that its tasks play in.
    pub(crate) scenes_hash: String,
    /// The name of the policy that acts: of an agent, its checkpoint's.
    pub(crate) policy: String,
    /// SHA-256 of the checkpoint, where the policy has one.
    pub(crate) checkpoint_hash: Option<String>,
    /// How many tasks of the set, from the first.
    pub(crate) tasks: usize,
    /// Each task is played with the seeds 0 to this, exclusive.
    pub(crate) seeds: u64,
    /// The rules by which subtasks count as completed.
    pub(crate) grader: Grading,
    /// Whose word ends an episode before its time.
    #[serde(default, skip_serializing_if = "EndedBy::is_grader")]
    pub(crate) end: EndedBy,
    /// The agent is told all steps instead of the task's instruction.
    pub(crate) step_by_step: bool,
    /// The agent draws its actions by chance instead of taking the likeliest.
    #[serde(default)]
    pub(crate) sampling: bool,
    /// What was asked of the agent's decisions in place of what its checkpoint says.
    #[serde(default, skip_serializing_if = "DecisionOverride::is_none")]
    pub(crate) deciding: DecisionOverride,
    /// Each task is also played with every other variant of its instruction.
    #[serde(default)]
    pub(crate) instruction_variants: bool,
    /// Each task is also played from each of its subtasks on.
    #[serde(default)]
    pub(crate) all_start_subtasks: bool,
    /// Which share of the run this is; nothing for a whole one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) shard: Option<Shard>,
    /// Which language model said what instructions alone ask for; nothing where the program did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) reader: Option<String>,
}

impl RunManifest {
    /// The format version this program reads and writes.
    pub(crate) const FORMAT: u32 = 2;
    /// What stands for the policy of a run that a person explored.
    pub(crate) const EXPLORED: &str = "explored";
    /// The most episodes, other words and starts apart, that a run may have: its episodes are listed in memory.
    const MOST: u64 = 10_000_000;

    /// Reads a run's manifest.
    ///
    /// # Errors
    /// When it cannot be read, or an older or newer program wrote it; names the file and the field.
    pub(crate) fn read(path: &Path) -> anyhow::Result<RunManifest> {
        Ok(json::read(path, RunManifest::FORMAT)?.value)
    }

    /// Checks that a run of this size fits into memory.
    ///
    /// # Errors
    /// When it has more episodes than that.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        let episodes = self.seeds.saturating_mul(self.tasks as u64);
        anyhow::ensure!(
            episodes <= RunManifest::MOST,
            "seeds: {} with {} tasks are {episodes} episodes, but a run has at most {}",
            self.seeds,
            self.tasks,
            RunManifest::MOST
        );
        Ok(())
    }

    /// The fields in which `other` differs, each as `field: this, not that`.
    pub(crate) fn differences(&self, other: &RunManifest) -> Vec<String> {
        let fields = |manifest| match serde_json::to_value(manifest) {
            Ok(serde_json::Value::Object(fields)) => fields,
            _ => serde_json::Map::new(),
        };
        let (own, others) = (fields(self), fields(other));
        let names: std::collections::BTreeSet<&String> = own.keys().chain(others.keys()).collect();
        let null = serde_json::Value::Null;
        let pairs =
            names.into_iter().map(|name| (name, own.get(name).unwrap_or(&null), others.get(name).unwrap_or(&null)));
        pairs.filter(|(_, a, b)| a != b).map(|(name, a, b)| format!("{name}: {a}, not {b}")).collect()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn manifest() -> RunManifest {
        RunManifest {
            format_version: RunManifest::FORMAT,
            sprint_version: "0".into(),
            task_set: "set".into(),
            task_set_hash: "aa".into(),
            scenes_hash: "bb".into(),
            policy: "random".into(),
            checkpoint_hash: None,
            tasks: 2,
            seeds: 1,
            grader: Grading::Class,
            end: EndedBy::Grader,
            step_by_step: false,
            sampling: false,
            deciding: DecisionOverride::default(),
            instruction_variants: false,
            all_start_subtasks: false,
            shard: None,
            reader: None,
        }
    }

    #[test]
    fn a_run_of_an_older_program_is_refused_in_one_sentence() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("manifest.json");
        std::fs::write(&path, r#"{"format_version":1,"sprint":"0.1.0","language":false}"#).unwrap();
        let error = format!("{:#}", RunManifest::read(&path).unwrap_err());
        let told = "format_version: 1, but this program reads 2; use the version of sprint that wrote it";
        assert_eq!(error, format!("{}: {told}", path.display()));
    }
}
