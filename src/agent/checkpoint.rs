//! The checkpoint folder: `config.json`, `model.safetensors`, and a model card.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use tch::{Device, Tensor, nn};

use crate::domain::{ActionType, Class};
use crate::nets::critic::{Critic, CriticSpec, Senses};
use crate::nets::eyes::Eyes;
use crate::nets::policy::{PolicyNet, PolicySpec};
use crate::nets::resnet18;
use crate::nets::visual::VisualSpec;
use crate::nets::weights::{self, Form};

/// The classes and actions that a policy's heads stand for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ontology {
    /// The first 16 digits of the sha256 of the class names, a line each.
    pub classes: String,
    /// The actions by name, in the order of the action head.
    pub actions: Vec<String>,
}

impl Ontology {
    /// This program's own.
    pub fn current() -> Ontology {
        let names: Vec<&str> = (0..Class::VOCABULARY).filter_map(Class::from_index).map(Class::name).collect();
        let digest = format!("{:x}", Sha256::digest(names.join("\n")));
        Ontology {
            classes: digest[..16].to_string(),
            actions: ActionType::ALL.iter().map(|kind| kind.name().to_string()).collect(),
        }
    }
}

/// Which sentence encoder the policy was trained with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SentenceSpec {
    /// The name of its folder.
    pub name: String,
    /// The digest of its weights.
    pub digest: String,
}

/// Where a checkpoint comes from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// The preset's name.
    pub preset: String,
    /// The digest of the trajectories it was trained on.
    pub dataset: String,
    /// How many trajectories those were.
    pub trajectories: u64,
    /// The seed of initialisation and data order.
    pub seed: u64,
    /// Steps of the visual encoder's training.
    pub visual_steps: u64,
    /// Steps of the policy's training.
    pub policy_steps: u64,
}

/// A checkpoint's `config.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Version of this format.
    pub format_version: u32,
    /// What the heads stand for.
    pub ontology: Ontology,
    /// The size of the House encoder, where the agent sees through one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visual: Option<VisualSpec>,
    /// The digest of ResNet-18's weights, where the agent sees through that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resnet18: Option<String>,
    /// The method it was trained by: `bc`, `iql`, `sprint`, `am`, `et`; absent in older checkpoints, which are cloned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<String>,
    /// The policy network's size.
    pub policy: PolicySpec,
    /// The critic's size, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub critic: Option<CriticSpec>,
    /// The words that the agent knows, where it reads words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub words: Option<Vec<String>>,
    /// The sentence encoder.
    pub sentence_encoder: SentenceSpec,
    /// Where it comes from.
    pub provenance: Provenance,
}

impl Config {
    /// The format version this program reads and writes.
    pub const FORMAT: u32 = 1;

    /// Reads a checkpoint's configuration.
    ///
    /// # Errors
    /// When the file is missing or malformed, of another format version, or for other classes or actions.
    pub fn read(folder: &Path) -> anyhow::Result<Config> {
        let path = folder.join("config.json");
        let text = std::fs::read_to_string(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        let value: serde_json::Value =
            serde_json::from_str(&text).with_context(|| format!("{} is not JSON", path.display()))?;
        let version = value.get("format_version").and_then(serde_json::Value::as_u64);
        anyhow::ensure!(
            version == Some(u64::from(Config::FORMAT)),
            "{}: format_version is {}, this program reads {}",
            path.display(),
            version.map_or("missing".to_string(), |version| version.to_string()),
            Config::FORMAT
        );
        let config: Config = serde_json::from_value(value)
            .with_context(|| format!("{} is not a checkpoint's configuration", path.display()))?;
        let own = Ontology::current();
        anyhow::ensure!(
            config.ontology.classes == own.classes,
            "{}: ontology.classes is {}, this program's is {}",
            path.display(),
            config.ontology.classes,
            own.classes
        );
        anyhow::ensure!(
            config.ontology.actions == own.actions,
            "{}: ontology.actions is {:?}, this program's is {:?}",
            path.display(),
            config.ontology.actions,
            own.actions
        );
        config.check(&path)?;
        Ok(config)
    }

    /// What the agent sees through: a House encoder with fresh weights, or ResNet-18 with the very weights it was trained on.
    ///
    /// # Errors
    /// When ResNet-18's weights are missing, or others.
    pub fn eyes(&self, device: Device) -> anyhow::Result<Eyes> {
        match (&self.visual, &self.resnet18) {
            (Some(spec), None) => Ok(Eyes::house(spec, device)),
            (None, Some(digest)) => {
                let file = Eyes::resnet18_file();
                let eyes = Eyes::resnet18(&file, device)?;
                let found = eyes.frozen()?.digest().to_owned();
                anyhow::ensure!(
                    found == *digest,
                    "{}: these weights are {found}, the agent was trained on {digest}",
                    file.display()
                );
                Ok(eyes)
            }
            _ => anyhow::bail!("an agent sees through either visual or resnet18, not both or none"),
        }
    }

    /// Features in each of the 7 x 7 places of a map.
    pub fn features(&self) -> i64 {
        self.visual.as_ref().map_or(resnet18::FEATURES, VisualSpec::features)
    }

    /// Sizes that no network can have are refused before anything is allocated for them.
    fn check(&self, path: &Path) -> anyhow::Result<()> {
        let sizes = [
            ("policy.history", std::slice::from_ref(&self.policy.history), 64),
            ("policy.embedding", std::slice::from_ref(&self.policy.embedding), 8192),
            ("policy.channels", &self.policy.channels[..], 4096),
            ("policy.hidden", &self.policy.hidden[..], 16384),
        ];
        let critic = self.critic.iter().flat_map(|critic| {
            [
                ("critic.channels", &critic.channels[..], 4096),
                ("critic.hidden", &critic.hidden[..], 16384),
                ("critic.action_embedding", std::slice::from_ref(&critic.action_embedding), 8192),
                ("critic.object_embedding", std::slice::from_ref(&critic.object_embedding), 8192),
            ]
        });
        let visual = self.visual.iter().flat_map(|visual| {
            [
                ("visual.input", std::slice::from_ref(&visual.input), 1024),
                ("visual.channels", &visual.channels[..], 4096),
            ]
        });
        let goal = self.policy.goal.iter().map(|goal| ("policy.goal", &goal[..], 4096));
        let attention = self.policy.attention.iter().flat_map(|attention| {
            [
                ("policy.attention.words", std::slice::from_ref(&attention.words), 1 << 20),
                ("policy.attention.layers", std::slice::from_ref(&attention.layers), 64),
                ("policy.attention.heads", std::slice::from_ref(&attention.heads), 64),
                ("policy.attention.inner", std::slice::from_ref(&attention.inner), 16384),
            ]
        });
        for (field, values, most) in sizes.into_iter().chain(visual).chain(critic).chain(goal).chain(attention) {
            for &value in values {
                anyhow::ensure!(
                    (1..=most).contains(&value),
                    "{}: {field} is {value}, which is not between 1 and {most}",
                    path.display()
                );
            }
        }
        anyhow::ensure!(
            self.visual.is_some() != self.resnet18.is_some(),
            "{}: an agent sees through either visual or resnet18, not both or none",
            path.display()
        );
        if let Some(visual) = &self.visual {
            let side = 16 * crate::nets::visual::SIDE;
            anyhow::ensure!(visual.input == side, "{}: visual.input is {}, not {side}", path.display(), visual.input);
        }
        if let Some(attention) = &self.policy.attention {
            attention.check(self.policy.embedding).with_context(|| format!("{}: policy", path.display()))?;
        }
        let critic = self.critic.as_ref().map(|critic| ("critic.dropout", critic.dropout));
        for (field, share) in std::iter::once(("policy.dropout", self.policy.dropout)).chain(critic) {
            anyhow::ensure!(
                (0.0..1.0).contains(&share),
                "{}: {field} is {share}, which is not a share",
                path.display()
            );
        }
        Ok(())
    }
}

/// A policy's networks with the stores that own their weights.
#[derive(Debug)]
pub struct Networks {
    /// Sees.
    pub eyes: Eyes,
    /// Decides.
    pub policy: PolicyNet,
    /// The policy's weights.
    pub policy_store: nn::VarStore,
    /// Judges.
    pub critic: Option<Critics>,
}

/// A critic and the target that follows it.
#[derive(Debug)]
pub struct Critics {
    /// The critic that learns.
    pub online: Critic,
    /// Its weights.
    pub online_store: nn::VarStore,
    /// The critic whose Q is the other's target; its V is not used.
    pub target: Critic,
    /// Its weights.
    pub target_store: nn::VarStore,
}

impl Networks {
    /// Networks with fresh weights behind the eyes.
    pub fn new(eyes: Eyes, policy: &PolicySpec, critic: Option<&CriticSpec>, device: Device) -> Networks {
        let policy_store = nn::VarStore::new(device);
        let features = eyes.features();
        let senses = Senses { channels: policy.history * features, told: policy.embedding, goal: policy.goal };
        Networks {
            eyes,
            policy: PolicyNet::new(&policy_store.root(), policy, features),
            policy_store,
            critic: critic.map(|spec| {
                let (online_store, target_store) = (nn::VarStore::new(device), nn::VarStore::new(device));
                Critics {
                    online: Critic::new(&online_store.root(), spec, senses),
                    target: Critic::new(&target_store.root(), spec, senses),
                    online_store,
                    target_store,
                }
            }),
        }
    }

    /// Every tensor by its name in `model.safetensors`.
    pub fn tensors(&self) -> BTreeMap<String, Tensor> {
        let mut stores = vec![("policy", &self.policy_store)];
        stores.extend(self.eyes.store().map(|store| ("visual", store)));
        if let Some(critic) = &self.critic {
            stores.extend([("critic", &critic.online_store), ("target", &critic.target_store)]);
        }
        let named = |(prefix, store): (&'static str, &nn::VarStore)| {
            store.variables().into_iter().map(move |(name, tensor)| (format!("{prefix}.{name}"), tensor.detach()))
        };
        stores.into_iter().flat_map(named).collect()
    }

    /// Loads a checkpoint's networks.
    ///
    /// # Errors
    /// When `model.safetensors` cannot be read or differs from the configuration; every such tensor is named.
    pub fn load(folder: &Path, config: &Config, device: Device) -> anyhow::Result<Networks> {
        let path = folder.join("model.safetensors");
        let tensors = weights::read(&path)?;
        let networks = Networks::new(config.eyes(device)?, &config.policy, config.critic.as_ref(), device);
        let variables = networks.tensors();
        let forms = variables.iter().map(|(name, tensor)| (name.clone(), Form::of(tensor))).collect();
        weights::check(&path, &tensors, &forms)?;
        tch::no_grad(|| -> anyhow::Result<()> {
            for (name, mut variable) in variables {
                if let Some(tensor) = tensors.get(&name) {
                    variable.f_copy_(tensor)?;
                }
            }
            Ok(())
        })?;
        Ok(networks)
    }

    /// Writes a checkpoint: the weights first, the configuration last.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub fn save(&self, folder: &Path, config: &Config) -> anyhow::Result<()> {
        std::fs::create_dir_all(folder).with_context(|| format!("{} cannot be made", folder.display()))?;
        weights::write(&folder.join("model.safetensors"), &self.tensors(), &BTreeMap::new())?;
        write_whole(&folder.join("config.json"), serde_json::to_string_pretty(config)?.as_bytes())
    }
}

/// Writes a file whole or not at all.
///
/// # Errors
/// When its folder cannot be written to.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let whole = || -> anyhow::Result<()> {
        let mut temporary = tempfile::NamedTempFile::new_in(path.parent().unwrap_or(Path::new(".")))?;
        std::io::Write::write_all(&mut temporary, bytes)?;
        temporary.persist(path)?;
        Ok(())
    };
    whole().with_context(|| format!("{} cannot be written", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Config {
        Config {
            format_version: Config::FORMAT,
            ontology: Ontology::current(),
            visual: Some(VisualSpec { input: 112, channels: [4, 4, 4, 4] }),
            resnet18: None,
            policy: PolicySpec {
                history: 5,
                embedding: 8,
                channels: [4; 4],
                hidden: vec![8],
                dropout: 0.2,
                goal: None,
                attention: None,
            },
            method: None,
            critic: None,
            words: None,
            sentence_encoder: SentenceSpec { name: "tiny".into(), digest: "00".into() },
            provenance: Provenance {
                preset: "test".into(),
                dataset: "none".into(),
                trajectories: 0,
                seed: 1,
                visual_steps: 0,
                policy_steps: 0,
            },
        }
    }

    fn saved() -> (tempfile::TempDir, Config) {
        let folder = tempfile::tempdir().unwrap();
        let config = small();
        let networks =
            Networks::new(config.eyes(Device::Cpu).unwrap(), &config.policy, config.critic.as_ref(), Device::Cpu);
        networks.save(folder.path(), &config).unwrap();
        (folder, config)
    }

    fn edit(folder: &Path, change: impl Fn(&mut serde_json::Value)) -> String {
        let path = folder.join("config.json");
        let mut value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        change(&mut value);
        std::fs::write(&path, value.to_string()).unwrap();
        format!("{:#}", Config::read(folder).unwrap_err())
    }

    #[test]
    fn a_saved_checkpoint_loads_with_equal_weights() {
        let (folder, config) = saved();
        let first = Networks::load(folder.path(), &Config::read(folder.path()).unwrap(), Device::Cpu).unwrap();
        let again = tempfile::tempdir().unwrap();
        first.save(again.path(), &config).unwrap();
        let second = weights::read(&again.path().join("model.safetensors")).unwrap();
        assert!(first.tensors().iter().all(|(name, tensor)| *tensor == second[name]));
    }

    #[test]
    fn a_critic_and_its_target_are_saved_with_the_policy() {
        let (mut config, folder) = (small(), tempfile::tempdir().unwrap());
        config.method = Some("iql".into());
        config.critic = Some(CriticSpec {
            channels: [4; 4],
            hidden: vec![8],
            dropout: 0.2,
            action_embedding: 4,
            object_embedding: 2,
            shared_trunk: true,
        });
        let networks =
            Networks::new(config.eyes(Device::Cpu).unwrap(), &config.policy, config.critic.as_ref(), Device::Cpu);
        networks.save(folder.path(), &config).unwrap();
        let read = Config::read(folder.path()).unwrap();
        assert_eq!(read, config);
        let loaded = Networks::load(folder.path(), &read, Device::Cpu).unwrap().tensors();
        assert!(networks.tensors().iter().all(|(name, tensor)| *tensor == loaded[name]));
        assert!(loaded.contains_key("target.q1.out.weight") && loaded.contains_key("critic.value.out.bias"));
    }

    #[test]
    fn the_shipped_agent_loads() {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/checkpoints/first"));
        let config = Config::read(folder).unwrap();
        assert!(Networks::load(folder, &config, Device::Cpu).unwrap().critic.is_none());
    }

    #[test]
    fn another_version_ontology_or_field_is_refused_by_name() {
        let (folder, _) = saved();
        let error = edit(folder.path(), |value| value["format_version"] = 7.into());
        assert!(error.contains("format_version is 7") && error.contains("reads 1"), "{error}");
        let error = edit(saved().0.path(), |value| value["ontology"]["classes"] = "abc".into());
        assert!(error.contains("config.json") || error.contains("ontology"), "{error}");
        let (folder, _) = saved();
        let error = edit(folder.path(), |value| value["ontology"]["classes"] = "abc".into());
        assert!(error.contains("ontology.classes is abc"), "{error}");
        let (folder, _) = saved();
        let error = edit(folder.path(), |value| value["colour"] = 7.into());
        assert!(error.contains("colour"), "{error}");
        let (folder, _) = saved();
        let error = edit(folder.path(), |value| value["policy"]["hidden"] = vec![1u64 << 40].into());
        assert!(error.contains("policy.hidden"), "{error}");
        let (folder, _) = saved();
        let error = edit(folder.path(), |value| value["resnet18"] = "abc".into());
        assert!(error.contains("either visual or resnet18"), "{error}");
    }

    #[test]
    fn missing_extra_and_misshapen_tensors_are_all_named() {
        let (folder, config) = saved();
        let path = folder.path().join("model.safetensors");
        let mut tensors = weights::read(&path).unwrap();
        tensors.remove("policy.actions.bias");
        tensors.insert("surprise".into(), Tensor::from_slice(&[1.0f32]));
        tensors.insert("policy.objects.bias".into(), Tensor::from_slice(&[1.0f32]));
        weights::write(&path, &tensors, &BTreeMap::new()).unwrap();
        let error = format!("{:#}", Networks::load(folder.path(), &config, Device::Cpu).unwrap_err());
        for part in [
            "model.safetensors",
            "missing policy.actions.bias",
            "unknown surprise",
            "policy.objects.bias is Float[1]",
            "Float[82]",
        ] {
            assert!(error.contains(part), "{error}");
        }
        std::fs::write(&path, b"nonsense").unwrap();
        let error = format!("{:#}", Networks::load(folder.path(), &config, Device::Cpu).unwrap_err());
        assert!(error.contains("model.safetensors"), "{error}");
    }
}
