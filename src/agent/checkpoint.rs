//! The checkpoint folder: `config.json`, `model.safetensors`, and a model card.

use std::collections::BTreeMap;
use std::path::Path;

use tch::{Device, Tensor, nn};

use super::config::CheckpointConfig;
use super::value_estimates::Values;
use crate::data::json;
use crate::house::view::Candidate;
use crate::nets::critic::{Critic, CriticInputs, CriticSpec};
use crate::nets::policy::{PolicyNet, PolicySpec};
use crate::nets::visual_encoder::VisualEncoder;
use crate::nets::weights::{self, TensorSpec};

/// A policy's networks with the stores that own their weights.
#[derive(Debug)]
pub struct Networks {
    /// Turns frames into feature maps.
    pub(crate) visual_encoder: VisualEncoder,
    /// Turns maps and instruction into logits.
    pub(crate) policy: PolicyNet,
    /// The policy's weights.
    pub(crate) policy_store: nn::VarStore,
    /// Q and V with their target, where the method has them.
    pub critic: Option<Critics>,
}

/// A critic and its target network, which follows it by Polyak averaging.
#[derive(Debug)]
pub struct Critics {
    /// The critic that learns.
    pub(crate) online: Critic,
    /// Its weights.
    pub(crate) online_store: nn::VarStore,
    /// The critic whose Q is the other's target; its V is not used.
    pub(crate) target: Critic,
    /// Its weights.
    pub(crate) target_store: nn::VarStore,
}

impl Networks {
    /// Networks with fresh weights behind a visual encoder.
    pub fn new(
        visual_encoder: VisualEncoder,
        policy: &PolicySpec,
        critic: Option<&CriticSpec>,
        device: Device,
    ) -> Networks {
        let policy_store = nn::VarStore::new(device);
        let features = visual_encoder.features();
        let inputs = CriticInputs {
            channels: policy.history * features,
            conditioning: policy.embedding,
            goal: policy.goal_channels,
        };
        Networks {
            visual_encoder,
            policy: PolicyNet::new(&policy_store.root(), policy, features),
            policy_store,
            critic: critic.map(|spec| {
                let (online_store, target_store) = (nn::VarStore::new(device), nn::VarStore::new(device));
                Critics {
                    online: Critic::new(&online_store.root(), spec, inputs),
                    target: Critic::new(&target_store.root(), spec, inputs),
                    online_store,
                    target_store,
                }
            }),
        }
    }

    /// The critic's values of an observation under an instruction, where its advantages take part in decisions.
    ///
    /// # Errors
    /// When the critic's answer cannot be read.
    pub(crate) fn advice(
        &self,
        config: &CheckpointConfig,
        observation: &Tensor,
        conditioning: &Tensor,
        candidates: &[Candidate],
    ) -> anyhow::Result<Option<Values>> {
        match (&self.critic, config.weighing()) {
            (Some(critic), Some(_)) => Values::of(&critic.online, observation, conditioning, candidates).map(Some),
            _ => Ok(None),
        }
    }

    /// Every tensor by its name in `model.safetensors`.
    pub(crate) fn tensors(&self) -> BTreeMap<String, Tensor> {
        let mut stores = vec![("policy", &self.policy_store)];
        stores.extend(self.visual_encoder.store().map(|store| ("visual", store)));
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
    pub fn load(folder: &Path, config: &CheckpointConfig, device: Device) -> anyhow::Result<Networks> {
        let path = folder.join("model.safetensors");
        let tensors = weights::read(&path)?;
        let networks =
            Networks::new(config.build_visual_encoder(device)?, &config.policy, config.critic.as_ref(), device);
        let variables = networks.tensors();
        let forms = variables.iter().map(|(name, tensor)| (name.clone(), TensorSpec::of(tensor))).collect();
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
    /// When a weight is no number, or the folder cannot be written to.
    pub fn save(&self, folder: &Path, config: &CheckpointConfig) -> anyhow::Result<()> {
        let (path, tensors) = (folder.join("model.safetensors"), self.tensors());
        weights::check_finite(&path, &tensors)?;
        weights::write(&path, &tensors, &BTreeMap::new())?;
        json::write_pretty(&folder.join("config.json"), config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::config::tests::small;

    fn saved() -> (tempfile::TempDir, CheckpointConfig) {
        let folder = tempfile::tempdir().unwrap();
        let config = small();
        let networks = Networks::new(
            config.build_visual_encoder(Device::Cpu).unwrap(),
            &config.policy,
            config.critic.as_ref(),
            Device::Cpu,
        );
        networks.save(folder.path(), &config).unwrap();
        (folder, config)
    }

    #[test]
    fn a_saved_checkpoint_loads_with_equal_weights() {
        let _chance = crate::nets::testing::chance();
        let (folder, config) = saved();
        let first =
            Networks::load(folder.path(), &CheckpointConfig::read(folder.path()).unwrap(), Device::Cpu).unwrap();
        let again = tempfile::tempdir().unwrap();
        first.save(again.path(), &config).unwrap();
        let second = weights::read(&again.path().join("model.safetensors")).unwrap();
        assert!(first.tensors().iter().all(|(name, tensor)| *tensor == second[name]));
    }

    #[test]
    fn a_critic_and_its_target_are_saved_with_the_policy() {
        let _chance = crate::nets::testing::chance();
        let (mut config, folder) = (small(), tempfile::tempdir().unwrap());
        config.method = Some("iql".into());
        config.critic = Some(CriticSpec {
            channels: [4; 4],
            downsample: false,
            hidden: vec![8],
            dropout: 0.2,
            action_embedding: 4,
            object_embedding: 2,
            shared_trunk: true,
        });
        let networks = Networks::new(
            config.build_visual_encoder(Device::Cpu).unwrap(),
            &config.policy,
            config.critic.as_ref(),
            Device::Cpu,
        );
        networks.save(folder.path(), &config).unwrap();
        let read = CheckpointConfig::read(folder.path()).unwrap();
        assert_eq!(read, config);
        let loaded = Networks::load(folder.path(), &read, Device::Cpu).unwrap().tensors();
        assert!(networks.tensors().iter().all(|(name, tensor)| *tensor == loaded[name]));
        assert!(loaded.contains_key("target.q1.out.weight") && loaded.contains_key("critic.value.out.bias"));
    }

    #[test]
    fn the_shipped_agents_load() {
        let _chance = crate::nets::testing::chance();
        for (name, has_critic) in [("checkpoints/alfred", true), ("tests/agents/clone", false)] {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
            let config = CheckpointConfig::read(&folder).unwrap();
            assert_eq!(Networks::load(&folder, &config, Device::Cpu).unwrap().critic.is_some(), has_critic);
        }
    }

    #[test]
    fn weights_that_are_no_numbers_are_not_written_over_good_ones() {
        let _chance = crate::nets::testing::chance();
        let (folder, config) = saved();
        let path = folder.path().join("model.safetensors");
        let good = std::fs::read(&path).unwrap();
        let networks = Networks::load(folder.path(), &config, Device::Cpu).unwrap();
        let _ = tch::no_grad(|| networks.policy_store.trainable_variables()[0].fill_(f64::NAN));
        let error = networks.save(folder.path(), &config).unwrap_err().to_string();
        assert!(error.contains("model.safetensors") && error.contains("NaN"), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), good);
    }

    #[test]
    fn a_checkpoint_whose_policy_critic_or_visual_encoder_holds_no_numbers_is_refused_by_name() {
        let _chance = crate::nets::testing::chance();
        for (name, bad) in [("checkpoints/alfred", f64::NAN), ("tests/agents/clone", f64::INFINITY)] {
            let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
            let config = CheckpointConfig::read(&shipped).unwrap();
            let whole = weights::read(&shipped.join("model.safetensors")).unwrap();
            let folder = tempfile::tempdir().unwrap();
            for prefix in ["policy.", "critic.", "target.", "visual."] {
                let part = whole.iter().find(|(name, tensor)| name.starts_with(prefix) && tensor.is_floating_point());
                let Some((changed, tensor)) = part else { continue };
                let mut tensors: weights::Tensors =
                    whole.iter().map(|(name, tensor)| (name.clone(), tensor.shallow_clone())).collect();
                let _ = tensors.insert(changed.clone(), tensor.full_like(bad));
                weights::write(&folder.path().join("model.safetensors"), &tensors, &BTreeMap::new()).unwrap();
                let error = format!("{:#}", Networks::load(folder.path(), &config, Device::Cpu).unwrap_err());
                assert!(error.contains(changed) && error.contains("model.safetensors"), "{error}");
            }
        }
    }

    #[test]
    fn missing_extra_and_misshapen_tensors_are_all_named() {
        let _chance = crate::nets::testing::chance();
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
