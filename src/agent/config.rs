//! A checkpoint's `config.json`: what its networks are, and where they come from.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use tch::Device;

use super::decision_rule::{self, DecisionRule};
use super::logit_adjustment::LogitAdjustment;
use super::value_estimates::{AdvantageScale, Values};
use crate::data::{json, text_file};
use crate::domain::{ActionType, Class};
use crate::language::vocabulary::Vocabulary;
use crate::nets::critic::CriticSpec;
use crate::nets::policy::PolicySpec;
use crate::nets::precision::Precision;
use crate::nets::resnet18;
use crate::nets::sentence::SentenceEncoder;
use crate::nets::visual::VisualSpec;
use crate::nets::visual_encoder::VisualEncoder;

/// The classes and actions that a policy's heads stand for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Ontology {
    /// The first 16 digits of the sha256 of the class names, a line each.
    pub(crate) classes: String,
    /// The actions by name, in the order of the action head.
    pub(crate) actions: Vec<String>,
}

impl Ontology {
    /// This program's own.
    pub(crate) fn current() -> Ontology {
        let names: Vec<&str> = (0..Class::VOCABULARY).filter_map(Class::from_index).map(Class::name).collect();
        let digest = format!("{:x}", Sha256::digest(names.join("\n")));
        Ontology {
            classes: digest[..16].to_string(),
            actions: ActionType::ALL.iter().map(|kind| kind.name().to_string()).collect(),
        }
    }
}

/// What tells the checkpoints of agents with a memory from those of the paper's, which do not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum AgentKind {
    /// One with a memory.
    Memory,
}

impl AgentKind {
    /// What the checkpoint in a folder says.
    pub(crate) fn of(folder: &Path) -> Option<AgentKind> {
        #[derive(Deserialize)]
        struct Peek {
            agent: Option<AgentKind>,
        }
        let text = text_file::read(&folder.join("config.json")).unwrap_or_default();
        serde_json::from_str::<Peek>(&text).ok()?.agent
    }
}

/// Which sentence encoder the policy was trained with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SentenceSpec {
    /// The name of its folder.
    pub(crate) name: String,
    /// The digest of its weights.
    pub(crate) digest: String,
    /// Where it lay when the agent was trained, unless its name leads there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) folder: Option<PathBuf>,
}

/// A checkpoint from which another one took networks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SourceCheckpoint {
    /// Its folder's name.
    pub(crate) name: String,
    /// The preset it was trained with.
    pub(crate) preset: String,
    /// Steps of its policy's training.
    pub(crate) policy_steps: u64,
}

/// How a checkpoint was trained, and from what.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Provenance {
    /// The preset's name; of a mean, those of its parts.
    pub(crate) preset: String,
    /// The digest of the trajectories it was trained on.
    pub(crate) dataset: String,
    /// How many of those were not held out.
    pub(crate) trajectories: u64,
    /// The seed of initialisation and data order.
    pub(crate) seed: u64,
    /// Steps of the visual encoder's training.
    pub(crate) visual_encoder_steps: u64,
    /// Steps of the policy's training.
    pub(crate) policy_steps: u64,
    /// How wide the numbers were that the networks computed with while they learned.
    #[serde(default)]
    pub(crate) precision: Precision,
    /// The checkpoint whose visual encoder it uses, where that was not trained with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) visual_encoder_from: Option<SourceCheckpoint>,
    /// The checkpoint whose weights the policy's training started from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) policy_initialised_from: Option<SourceCheckpoint>,
    /// The checkpoint whose weights the critic's training started from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) critic_initialised_from: Option<SourceCheckpoint>,
    /// How many checkpoints' policies it is the mean of, where it is one; seed, steps and trajectories are then the first one's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) averaged_checkpoints: Option<u64>,
    /// The task that it was finetuned on, where it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) finetuned_on: Option<FinetunedOn>,
}

/// How a checkpoint was finetuned; all else in its provenance is of the pre-training.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FinetunedOn {
    /// The task's id.
    pub(crate) task: String,
    /// Steps of the environment.
    pub(crate) steps: u64,
    /// Updates of policy and critic.
    pub(crate) updates: u64,
}

/// A checkpoint's `config.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckpointConfig {
    pub(crate) format_version: u32,
    /// The classes and actions of the heads.
    pub(crate) ontology: Ontology,
    /// The size of the House encoder, where the agent sees through one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) visual_encoder: Option<VisualSpec>,
    /// The digest of ResNet-18's weights, where the agent sees through that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) resnet18: Option<String>,
    /// The method it was trained by: `bc`, `iql`, `sprint`, `am`, `transformer-bc`; absent in older checkpoints, which are cloned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) method: Option<String>,
    /// The policy network's size.
    pub policy: PolicySpec,
    /// The critic's size, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) critic: Option<CriticSpec>,
    /// The words that the agent knows, where it reads words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) vocabulary: Option<Vec<String>>,
    /// How much of the actions' frequency among the labels is taken off their logits when it decides; absent where nothing is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) logit_adjustment: Option<LogitAdjustment>,
    /// How much the critic's advantages count when it decides, see [`AdvantageScale`]; absent where the policy decides alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) advantage_scale: Option<f32>,
    /// By which rule it decides.
    #[serde(default, skip_serializing_if = "DecisionRule::is_mass")]
    pub(crate) decision: DecisionRule,
    /// Whether it is kept from repeating itself.
    #[serde(default = "decision_rule::on", skip_serializing_if = "decision_rule::is_on")]
    pub(crate) loop_guard: bool,
    /// What turns its instruction into numbers; absent where it reads words or is shown its goal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) sentence_encoder: Option<SentenceSpec>,
    /// How it was trained, and from what.
    pub(crate) provenance: Provenance,
}

impl CheckpointConfig {
    /// The format version this program reads and writes.
    pub(crate) const FORMAT: u32 = 2;

    /// Reads a checkpoint's configuration.
    ///
    /// # Errors
    /// When the file is missing or malformed, of another format version, or for other classes or actions.
    pub fn read(folder: &Path) -> anyhow::Result<CheckpointConfig> {
        CheckpointConfig::check_there(folder)?;
        let path = folder.join("config.json");
        anyhow::ensure!(
            AgentKind::of(folder).is_none(),
            "{}: an agent with a memory, where one of the paper's is needed",
            folder.display()
        );
        let config: CheckpointConfig = json::read(&path, CheckpointConfig::FORMAT)?.value;
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
        config.check().with_context(|| path.display().to_string())?;
        Ok(config)
    }

    /// Whether there is a checkpoint at all.
    ///
    /// # Errors
    /// Says what would make one.
    pub(crate) fn check_there(folder: &Path) -> anyhow::Result<()> {
        ensure!(
            folder.join("config.json").exists(),
            "{} holds no checkpoint (config.json is missing); `sprint pretrain` makes one, and checkpoints/ holds some",
            folder.display()
        );
        Ok(())
    }

    /// The visual encoder: a House encoder with fresh weights, or ResNet-18 with the very weights it was trained on.
    ///
    /// # Errors
    /// When ResNet-18's weights are missing, or others.
    pub fn build_visual_encoder(&self, device: Device) -> anyhow::Result<VisualEncoder> {
        match (&self.visual_encoder, &self.resnet18) {
            (Some(spec), None) => Ok(VisualEncoder::house(spec, device)),
            (None, Some(digest)) => {
                let file = VisualEncoder::resnet18_file();
                let encoder = VisualEncoder::resnet18(&file, device)?;
                let found = encoder.frozen()?.digest().to_owned();
                anyhow::ensure!(
                    found == *digest,
                    "{}: these weights are {found}, the agent was trained on {digest}",
                    file.display()
                );
                Ok(encoder)
            }
            _ => anyhow::bail!("an agent has either visual_encoder or resnet18, not both or none"),
        }
    }

    /// An agent understands sentences only through the encoder that it was trained with.
    ///
    /// # Errors
    /// When `encoder` is another; begins with the field that differs.
    pub(crate) fn goes_with(&self, encoder: &SentenceEncoder) -> anyhow::Result<()> {
        let Some(SentenceSpec { name, digest: wanted, .. }) = self.read_sentences() else { return Ok(()) };
        let (embedding, width) = (self.policy.embedding, encoder.width() as i64);
        anyhow::ensure!(embedding == width, "policy.embedding is {embedding}, the sentence encoder's width is {width}");
        let found = encoder.digest();
        anyhow::ensure!(
            wanted == found,
            "sentence_encoder.digest is {wanted}, the encoder at hand has {found}; use {name}"
        );
        Ok(())
    }

    /// The sentence encoder, where the agent reads an instruction through one.
    pub(crate) fn read_sentences(&self) -> Option<&SentenceSpec> {
        self.sentence_encoder.as_ref().filter(|_| self.policy.reads_sentences())
    }

    /// Adjusts the logits of the action head [12] in place, where `logit_adjustment` is there and the rule has it count.
    pub(crate) fn adjust_logits(&self, logits: &mut [f32]) {
        if let (Some(logit_adjustment), DecisionRule::Mass) = (&self.logit_adjustment, self.decision) {
            logit_adjustment.apply(logits);
        }
    }

    /// Sets the fraction of the log frequencies that is taken off the logits: 0 none, 1 all.
    ///
    /// # Errors
    /// When the strength is not between 0 and 1, or the actions' frequencies were not kept.
    pub(crate) fn set_logit_adjustment(&mut self, strength: f32) -> anyhow::Result<()> {
        let logit_adjustment = self.logit_adjustment.as_mut();
        let logit_adjustment = logit_adjustment
            .context("logit_adjustment is missing: how often each action was shown was not noted, so train anew")?;
        logit_adjustment.strength = strength;
        logit_adjustment.check().map_err(anyhow::Error::msg)
    }

    /// Sets how many times the critic's advantage enters the exponent when it decides; 0: the policy decides alone.
    ///
    /// # Errors
    /// When the scale is negative or not finite, or there is no critic.
    pub(crate) fn set_advantage_scale(&mut self, weight: f32) -> anyhow::Result<()> {
        self.advantage_scale = (weight != 0.0).then_some(weight);
        self.check_advantage_scale()
    }

    fn check_advantage_scale(&self) -> anyhow::Result<()> {
        let Some(weight) = self.advantage_scale else { return Ok(()) };
        anyhow::ensure!(weight.is_finite() && weight > 0.0, "advantage_scale is {weight}, which is no weight");
        anyhow::ensure!(self.critic.is_some(), "advantage_scale needs a critic, and there is none");
        Ok(())
    }

    /// The values with their scale, where the critic takes part in decisions.
    pub(crate) fn advantage_scale<'a>(&self, values: Option<&'a Values>) -> Option<AdvantageScale<'a>> {
        values.zip(self.weighing()).map(|(values, weight)| AdvantageScale { values, weight })
    }

    /// How much advantages count when it decides; nothing where the policy decides alone.
    pub(crate) fn weighing(&self) -> Option<f32> {
        self.advantage_scale.filter(|_| self.decision == DecisionRule::Mass)
    }

    /// Features in each of the 7 x 7 cells of a map.
    pub(crate) fn features(&self) -> i64 {
        self.visual_encoder.as_ref().map_or(resnet18::FEATURES, VisualSpec::features)
    }

    /// What no network or agent can have is refused before anything is allocated for it.
    fn check(&self) -> anyhow::Result<()> {
        self.policy.check()?;
        if let Some(critic) = &self.critic {
            critic.check()?;
        }
        if let Some(spec) = &self.visual_encoder {
            spec.check()?;
        }
        ensure!(
            self.visual_encoder.is_some() != self.resnet18.is_some(),
            "an agent has either visual_encoder or resnet18, not both or none"
        );
        self.check_vocabulary()?;
        ensure!(
            self.sentence_encoder.is_some() || !self.policy.reads_sentences(),
            "sentence_encoder is missing, through which the agent reads its instruction"
        );
        if let Some(logit_adjustment) = &self.logit_adjustment {
            logit_adjustment.check().map_err(anyhow::Error::msg)?;
        }
        self.check_advantage_scale()
    }

    /// An agent that attends to words has a number for each that it knows, and neither a critic nor a goal to be shown.
    fn check_vocabulary(&self) -> anyhow::Result<()> {
        let Some(attention) = &self.policy.attention else {
            ensure!(self.vocabulary.is_none(), "vocabulary is there, and no policy.attention that reads it");
            return Ok(());
        };
        ensure!(self.critic.is_none(), "policy.attention reads words, which no critic here does");
        ensure!(self.policy.goal_channels.is_none(), "policy.attention and policy.goal_channels exclude each other");
        let words = self.vocabulary.as_ref().context("vocabulary is missing, which policy.attention reads")?.len();
        let most = Vocabulary::most(attention.vocabulary_size);
        ensure!(
            words <= most,
            "vocabulary has {words} words, and policy.attention.vocabulary_size is enough for {most}"
        );
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A cloned agent of no use.
    pub(crate) fn small() -> CheckpointConfig {
        CheckpointConfig {
            format_version: CheckpointConfig::FORMAT,
            ontology: Ontology::current(),
            visual_encoder: Some(VisualSpec { image_size: 112, channels: vec![4; 4] }),
            resnet18: None,
            policy: PolicySpec {
                history: 5,
                embedding: 8,
                channels: [4; 4],
                downsample: false,
                hidden: vec![8],
                dropout: 0.2,
                goal_channels: None,
                attention: None,
            },
            method: None,
            critic: None,
            vocabulary: None,
            logit_adjustment: None,
            advantage_scale: None,
            decision: DecisionRule::Mass,
            loop_guard: true,
            sentence_encoder: Some(SentenceSpec { name: "tiny".into(), digest: "00".into(), folder: None }),
            provenance: Provenance {
                preset: "test".into(),
                dataset: "none".into(),
                trajectories: 0,
                seed: 1,
                visual_encoder_steps: 0,
                policy_steps: 0,
                precision: Precision::Full,
                visual_encoder_from: None,
                policy_initialised_from: None,
                critic_initialised_from: None,
                averaged_checkpoints: None,
                finetuned_on: None,
            },
        }
    }

    fn written() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        json::write_pretty(&folder.path().join("config.json"), &small()).unwrap();
        folder
    }

    fn edit(folder: &Path, change: impl Fn(&mut serde_json::Value)) -> String {
        let path = folder.join("config.json");
        let mut value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        change(&mut value);
        std::fs::write(&path, value.to_string()).unwrap();
        format!("{:#}", CheckpointConfig::read(folder).unwrap_err())
    }

    #[test]
    fn another_version_ontology_or_field_is_refused_by_name() {
        let folder = written();
        let error = edit(folder.path(), |value| {
            value["format_version"] = 1.into();
            value["balance"] = 0.5.into();
        });
        assert!(error.contains("config.json: format_version: 1, but this program reads 2; use the version"), "{error}");
        let folder = written();
        let error = edit(folder.path(), |value| value["ontology"]["classes"] = "abc".into());
        assert!(error.contains("ontology.classes is abc"), "{error}");
        let folder = written();
        let error = edit(folder.path(), |value| value["colour"] = 7.into());
        assert!(error.contains("colour"), "{error}");
        let folder = written();
        let error = edit(folder.path(), |value| value["policy"]["hidden"] = vec![1u64 << 40].into());
        assert!(error.contains("policy.hidden"), "{error}");
        let folder = written();
        let error = edit(folder.path(), |value| value["vocabulary"] = vec!["mug"].into());
        assert!(error.contains("no policy.attention that reads it"), "{error}");
        let folder = written();
        let attention = serde_json::json!({"vocabulary_size": 4, "layers": 1, "heads": 2, "feedforward": 8});
        let attending = |words: Option<[&str; 3]>| {
            edit(written().path(), |value| {
                value["policy"]["attention"] = attention.clone();
                value["vocabulary"] = serde_json::json!(words);
            })
        };
        assert!(attending(None).contains("vocabulary is missing"), "{}", attending(None));
        let many = attending(Some(["mug", "cup", "sink"]));
        assert!(many.contains("vocabulary has 3 words") && many.contains("enough for 2"), "{many}");
        let error = edit(folder.path(), |value| value["resnet18"] = "abc".into());
        assert!(error.contains("either visual_encoder or resnet18"), "{error}");
    }
}
