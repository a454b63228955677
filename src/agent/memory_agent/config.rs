//! The `config.json` of an agent with a memory, and its networks.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use tch::{Device, Tensor, nn};

use super::eyes::Sight;
use super::features;
use crate::agent::config::{AgentKind, CheckpointConfig, Ontology};
use crate::data::json;
use crate::nets::chooser::{Chooser, ChooserSpec};
use crate::nets::detector::{Detector, DetectorSpec};
use crate::nets::macro_critic::MacroCritic;
use crate::nets::size_differences::size_differences;
use crate::nets::weights::{self, TensorSpec};

/// How a checkpoint was trained, and from what.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MemoryProvenance {
    /// The preset's name.
    pub(crate) preset: String,
    /// The digest of the trajectories that the detector learned from.
    pub(crate) detector_dataset: String,
    /// Steps of the detector's training.
    pub(crate) detector_steps: u64,
    /// The digest of the trajectories that the chooser learned from.
    pub(crate) dataset: String,
    /// How many those are.
    pub(crate) trajectories: u64,
    /// Steps of the chooser's training.
    pub(crate) chooser_steps: u64,
    /// The digest of the trajectories that the critic learned from, and the steps of its training.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) critic: Option<CriticProvenance>,
    /// The seed of initialisation and data order.
    pub(crate) seed: u64,
}

/// What a critic was trained on, and how long.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CriticProvenance {
    /// The digest of the trajectories.
    pub(crate) dataset: String,
    /// How many those are.
    pub(crate) trajectories: u64,
    /// Steps of the training.
    pub(crate) steps: u64,
}

/// A checkpoint's `config.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MemoryConfig {
    pub(crate) format_version: u32,
    /// Always `memory`.
    pub(crate) agent: AgentKind,
    /// The classes and actions that the networks speak of.
    pub(crate) ontology: Ontology,
    /// What it sees with.
    #[serde(default)]
    pub(crate) sight: Sight,
    /// Whether it never does the same twice in the same place and situation.
    pub(crate) loop_guard: bool,
    pub(crate) detector: DetectorSpec,
    pub(crate) chooser: ChooserSpec,
    /// The size of the critic, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) critic: Option<ChooserSpec>,
    /// How many times the advantage enters the exponent by which the agent weighs its chooser when it decides.
    #[serde(default)]
    pub(crate) advantage_scale: f32,
    /// How it was trained, and from what.
    pub(crate) provenance: MemoryProvenance,
}

impl MemoryConfig {
    /// Whether a folder holds a checkpoint of an agent with a memory.
    pub(crate) fn is_there(folder: &Path) -> bool {
        AgentKind::of(folder).is_some()
    }

    /// Reads a checkpoint's configuration.
    ///
    /// # Errors
    /// When the file is missing or malformed, of another format version, or for other classes, actions or features.
    pub(crate) fn read(folder: &Path) -> anyhow::Result<MemoryConfig> {
        CheckpointConfig::check_there(folder)?;
        let path = folder.join("config.json");
        ensure!(
            MemoryConfig::is_there(folder),
            "{}: not an agent with a memory, which is needed here",
            folder.display()
        );
        let config: MemoryConfig = json::read(&path, CheckpointConfig::FORMAT)?.value;
        config.check().with_context(|| path.display().to_string())?;
        Ok(config)
    }

    fn check(&self) -> anyhow::Result<()> {
        let (found, own) = (&self.ontology, Ontology::current());
        ensure!(*found == own, "ontology is not this program's: {}", size_differences(found, &own));
        self.detector.check()?;
        for (name, spec) in
            std::iter::once(("chooser", &self.chooser)).chain(self.critic.iter().map(|it| ("critic", it)))
        {
            spec.check(name)?;
            for (field, found, own) in
                [("situation", spec.situation, features::SITUATION), ("action", spec.action, features::ACTION)]
            {
                ensure!(
                    found == own as i64,
                    "{name}.{field} is {found}, and this program counts {own}: train the agent anew"
                );
            }
        }
        let scale = self.advantage_scale;
        ensure!(scale.is_finite() && scale >= 0.0, "advantage_scale is {scale}, which is no weight");
        ensure!(scale == 0.0 || self.critic.is_some(), "advantage_scale is {scale}, and there is no critic");
        Ok(())
    }
}

/// The networks of an agent with a memory, with the stores that own their weights.
#[derive(Debug)]
pub(crate) struct MemoryNetworks {
    pub(crate) detector: Detector,
    pub(crate) detector_store: nn::VarStore,
    pub(crate) chooser: Chooser,
    pub(crate) chooser_store: nn::VarStore,
    pub(crate) critic: Option<MacroCritic>,
    pub(crate) critic_store: nn::VarStore,
}

impl MemoryNetworks {
    /// Networks with fresh weights.
    pub(crate) fn new(
        detector: &DetectorSpec,
        chooser: &ChooserSpec,
        critic: Option<&ChooserSpec>,
        device: Device,
    ) -> MemoryNetworks {
        let [detector_store, chooser_store, critic_store] = [(); 3].map(|()| nn::VarStore::new(device));
        MemoryNetworks {
            detector: Detector::new(&detector_store.root(), detector),
            chooser: Chooser::new(&chooser_store.root(), chooser),
            critic: critic.map(|spec| MacroCritic::new(&critic_store.root(), spec)),
            detector_store,
            chooser_store,
            critic_store,
        }
    }

    fn tensors(&self) -> BTreeMap<String, Tensor> {
        let stores =
            [("detector", &self.detector_store), ("chooser", &self.chooser_store), ("critic", &self.critic_store)];
        let named = |(prefix, store): (&'static str, &nn::VarStore)| {
            store.variables().into_iter().map(move |(name, tensor)| (format!("{prefix}.{name}"), tensor.detach()))
        };
        stores.into_iter().flat_map(named).collect()
    }

    /// Loads a checkpoint's networks.
    ///
    /// # Errors
    /// When `model.safetensors` cannot be read or differs from the configuration; every such tensor is named.
    pub(crate) fn load(folder: &Path, config: &MemoryConfig, device: Device) -> anyhow::Result<MemoryNetworks> {
        let path = folder.join("model.safetensors");
        let tensors = weights::read(&path)?;
        let networks = MemoryNetworks::new(&config.detector, &config.chooser, config.critic.as_ref(), device);
        let variables = networks.tensors();
        let forms = variables.iter().map(|(name, tensor)| (name.clone(), TensorSpec::of(tensor))).collect();
        weights::check(&path, &tensors, &forms)?;
        weights::copy(&tensors, "detector.", &networks.detector_store)?;
        weights::copy(&tensors, "chooser.", &networks.chooser_store)?;
        weights::copy(&tensors, "critic.", &networks.critic_store)?;
        Ok(networks)
    }

    /// Writes a checkpoint: the weights first, the configuration last. A critic that the configuration does not name is left out.
    ///
    /// # Errors
    /// When a weight is no number, or the folder cannot be written to.
    pub(crate) fn save(&self, folder: &Path, config: &MemoryConfig) -> anyhow::Result<()> {
        let (path, mut tensors) = (folder.join("model.safetensors"), self.tensors());
        if config.critic.is_none() {
            tensors.retain(|name, _| !name.starts_with("critic."));
        }
        weights::check_finite(&path, &tensors)?;
        weights::write(&path, &tensors, &BTreeMap::new())?;
        json::write_pretty(&folder.join("config.json"), config)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// An agent of no use that the simulator tells what is in view.
    pub(crate) fn small() -> MemoryConfig {
        MemoryConfig {
            format_version: CheckpointConfig::FORMAT,
            agent: AgentKind::Memory,
            ontology: Ontology::current(),
            sight: Sight::Simulator,
            loop_guard: true,
            detector: DetectorSpec { channels: vec![2, 2, 2, 2], pyramid: 2 },
            chooser: ChooserSpec {
                situation: features::SITUATION as i64,
                action: features::ACTION as i64,
                embedding: 2,
                hidden: vec![8],
            },
            critic: None,
            advantage_scale: 0.0,
            provenance: MemoryProvenance {
                preset: "test".into(),
                detector_dataset: String::new(),
                detector_steps: 0,
                dataset: "none".into(),
                trajectories: 0,
                chooser_steps: 0,
                critic: None,
                seed: 1,
            },
        }
    }

    #[test]
    fn a_saved_checkpoint_is_known_by_its_kind_and_loads_with_equal_weights() {
        let _chance = crate::nets::testing::chance();
        let folder = tempfile::tempdir().unwrap();
        assert!(!MemoryConfig::is_there(folder.path()));
        let config = small();
        let networks = MemoryNetworks::new(&config.detector, &config.chooser, config.critic.as_ref(), Device::Cpu);
        networks.save(folder.path(), &config).unwrap();
        assert!(MemoryConfig::is_there(folder.path()));
        let read = MemoryConfig::read(folder.path()).unwrap();
        assert_eq!(read, config);
        let loaded = MemoryNetworks::load(folder.path(), &read, Device::Cpu).unwrap().tensors();
        assert!(networks.tensors().iter().all(|(name, tensor)| *tensor == loaded[name]));
    }

    #[test]
    fn the_shipped_agent_loads() {
        let _chance = crate::nets::testing::chance();
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/checkpoints/sprint-memory"));
        let config = MemoryConfig::read(folder).unwrap();
        assert_eq!(config.sight, Sight::Detector);
        MemoryNetworks::load(folder, &config, Device::Cpu).unwrap();
    }

    #[test]
    fn an_agent_that_counts_other_features_is_refused_with_the_field() {
        let _chance = crate::nets::testing::chance();
        let folder = tempfile::tempdir().unwrap();
        let mut config = small();
        config.chooser.action += 1;
        let networks = MemoryNetworks::new(&config.detector, &config.chooser, config.critic.as_ref(), Device::Cpu);
        networks.save(folder.path(), &config).unwrap();
        let refused = CheckpointConfig::read(folder.path()).unwrap_err().to_string();
        assert!(refused.contains("an agent with a memory, where one of the paper's is needed"), "{refused}");
        let alfred = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/checkpoints/alfred"));
        let refused = MemoryConfig::read(alfred).unwrap_err().to_string();
        assert!(refused.contains("alfred: not an agent with a memory"), "{refused}");
        let error = format!("{:#}", MemoryConfig::read(folder.path()).unwrap_err());
        assert!(error.contains("config.json: chooser.action is") && error.contains("train the agent anew"), "{error}");
    }
}
