//! Presets: every hyper-parameter of a training by name, and what of them fits together.

mod files;
mod former_names;

pub(crate) use self::files::extend;

use serde::{Deserialize, Serialize};

use crate::agent::decision_rule::{self, DecisionRule};
use crate::algo::chain::{Chaining, PairSource};
use crate::algo::iql::Iql;
use crate::algo::learner::Optimisation;
use crate::data::selection::DataSelection;
use crate::nets::critic::CriticSpec;
use crate::nets::policy::PolicySpec;
use crate::nets::precision::Precision;
use crate::nets::visual::VisualSpec;

/// Every hyper-parameter of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Preset {
    pub(crate) format_version: u32,
    /// The method's name in cards and reports.
    pub name: String,
    /// Drives initialisation, dropout and the order of the data.
    pub seed: u64,
    /// One trajectory in that many is held out.
    pub(crate) hold_out: usize,
    /// Scenes of which no trajectory is learned from: their tasks show what an agent makes of a floor plan it never saw.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) withheld_scenes: Vec<String>,
    /// Steps between two saved states.
    pub(crate) save_every: u64,
    /// Steps between two lines of training/progress.jsonl.
    pub(crate) report_every: u64,
    /// Which spans are learned from, under which texts.
    pub(crate) data: DataSelection,
    /// Which network turns frames into feature maps.
    #[serde(default)]
    pub(crate) visual_backbone: VisualBackbone,
    /// The size of the House encoder; ResNet-18 has one size.
    pub visual_encoder: VisualSpec,
    /// The House encoder's training.
    pub(crate) visual_encoder_training: VisualEncoderTraining,
    /// The size of the policy network.
    pub policy: PolicySpec,
    /// The size of the critic; absent for behaviour cloning.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub critic: Option<CriticSpec>,
    /// Implicit Q-learning; present exactly where the critic is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iql: Option<Iql>,
    /// Cross-trajectory chaining (the paper's equations 4 and 5); absent where skills are not chained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chaining: Option<Chaining>,
    /// The training of policy and critic.
    pub training: Optimisation,
    /// Parts that a batch is computed in, one after the other, where the device has too little memory for the whole. Batch norms
    /// then see a part at a time.
    #[serde(default = "one_part")]
    pub(crate) parts: usize,
    /// How wide the numbers are that networks compute with while they learn.
    #[serde(default)]
    pub(crate) precision: Precision,
    /// How much of the log share that each action has among the labels is taken off its logit when the agent decides.
    #[serde(default)]
    pub(crate) logit_adjustment: f32,
    /// By which rule the agent decides.
    #[serde(default)]
    pub(crate) decision: DecisionRule,
    /// Whether the agent is kept from repeating itself.
    #[serde(default = "decision_rule::on")]
    pub(crate) loop_guard: bool,
    /// How the trained policy is measured.
    pub(crate) validation: ValidationSpec,
}

fn one_part() -> usize {
    1
}

/// The network that turns frames into feature maps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum VisualBackbone {
    /// The House encoder, which is trained on drawn frames.
    #[default]
    House,
    /// torchvision's ResNet-18, as it is.
    ResNet18,
}

/// How the House encoder is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct VisualEncoderTraining {
    /// Steps, batch size, learning rate and optimiser.
    pub(crate) optimisation: Optimisation,
    /// The weight of a positive cell label in the binary cross-entropy; that of a negative one is 1.
    pub(crate) positive_weight: f64,
}

/// How a trained policy is measured, in houses that no training saw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ValidationSpec {
    /// How many one-skill tasks are played.
    pub(crate) tasks: usize,
    /// Cases in which the instruction is swapped for another object in view.
    pub(crate) swaps: usize,
    /// Drives the choice of houses and tasks.
    pub(crate) seed: u64,
}

impl Preset {
    /// The format version this program reads and writes.
    pub(crate) const FORMAT: u32 = 2;

    /// Errors name the field and no line: a line of the joined table would be none of the file's.
    fn parse(table: toml::Table) -> anyhow::Result<Preset> {
        // The version first: a field of another format would be reported as a misspelt one.
        if let Some(found) = table.get("format_version") {
            anyhow::ensure!(
                *found == toml::Value::from(Preset::FORMAT),
                "format_version is {found}, but this program reads {}: name the fields as assets/presets/sprint.toml does",
                Preset::FORMAT
            );
        }
        table.try_into().map_err(|error| {
            let told = error.to_string();
            anyhow::anyhow!("{}{}", told.trim_end(), former_names::hint(&told))
        })
    }

    fn of(table: toml::Table) -> anyhow::Result<Preset> {
        let preset = Preset::parse(table)?;
        for (field, value) in [
            ("save_every", preset.save_every),
            ("report_every", preset.report_every),
            ("training.steps", preset.training.steps),
        ] {
            anyhow::ensure!(value > 0, "{field} is 0");
        }
        preset.training.check("training")?;
        preset.check_parts()?;
        preset.visual_encoder_training.optimisation.check("visual_encoder_training.optimisation")?;
        let weight = preset.visual_encoder_training.positive_weight;
        anyhow::ensure!(
            weight.is_finite() && weight > 0.0,
            "visual_encoder_training.positive_weight is {weight}, which is not above 0"
        );
        let logit_adjustment = preset.logit_adjustment;
        anyhow::ensure!(
            (0.0..=1.0).contains(&logit_adjustment),
            "logit_adjustment is {logit_adjustment}, which is not a share"
        );
        preset.visual_encoder.check()?;
        preset.policy.check()?;
        preset.check_method()?;
        Ok(preset)
    }

    /// Every part of a batch needs two items.
    ///
    /// # Errors
    /// When there are more parts than that.
    pub(crate) fn check_parts(&self) -> anyhow::Result<()> {
        let most = self.training.batch_size / 2;
        anyhow::ensure!(
            (1..=most).contains(&self.parts),
            "parts is {}, which is not between 1 and {most}: a part needs two items",
            self.parts
        );
        Ok(())
    }

    /// What a method consists of has to fit together.
    fn check_method(&self) -> anyhow::Result<()> {
        anyhow::ensure!(
            self.critic.is_some() == self.iql.is_some(),
            "critic and iql go together: one of them is absent"
        );
        if self.policy.attention.is_some() {
            anyhow::ensure!(self.critic.is_none(), "policy.attention reads words, which no critic here does");
            anyhow::ensure!(
                self.policy.goal_channels.is_none(),
                "policy.attention and policy.goal_channels exclude each other"
            );
        }
        if self.policy.goal_channels.is_some() {
            let swaps = self.validation.swaps;
            anyhow::ensure!(
                swaps == 0,
                "validation.swaps is {swaps}, but with policy.goal_channels no instruction is read"
            );
        }
        if let Some(critic) = &self.critic {
            critic.check()?;
        }
        if let Some(iql) = &self.iql {
            iql.check()?;
        }
        let Some(chaining) = &self.chaining else { return Ok(()) };
        anyhow::ensure!(self.critic.is_some(), "chaining needs a critic");
        let pairs = chaining.batch_size;
        anyhow::ensure!(
            (1..=65_536).contains(&pairs),
            "chaining.batch_size is {pairs}, which is not between 1 and 65536"
        );
        for (field, value) in [
            ("chaining.loss_weight", chaining.loss_weight),
            ("chaining.chain_weight", chaining.chain_weight),
            ("chaining.aggregate_weight", chaining.aggregate_weight),
            ("chaining.feasible_share", chaining.feasible_share),
        ] {
            anyhow::ensure!(value.is_finite() && value >= 0.0, "{field} is {value}");
        }
        anyhow::ensure!(
            chaining.chain_weight + chaining.aggregate_weight > 0.0,
            "chaining.chain_weight and chaining.aggregate_weight are both 0"
        );
        anyhow::ensure!(
            chaining.feasible_share <= 1.0,
            "chaining.feasible_share is {}, which is not a share",
            chaining.feasible_share
        );
        anyhow::ensure!(
            chaining.feasible_share == 0.0 || chaining.pairs != PairSource::InBatch,
            "chaining.feasible_share is of a pool: chaining.pairs are from the batch"
        );
        let sentences = self.policy.goal_channels.is_none();
        anyhow::ensure!(
            sentences || chaining.aggregate_weight == 0.0,
            "chaining.aggregate_weight joins sentences; goals have none"
        );
        anyhow::ensure!(
            sentences || chaining.pairs == PairSource::InBatch && !chaining.ranked,
            "chaining.pairs: a pool is of sentences; goals are paired in-batch"
        );
        anyhow::ensure!(
            !chaining.ranked || chaining.aggregate_weight > 0.0,
            "chaining.ranked is about joint sentences, but chaining.aggregate_weight is 0"
        );
        Ok(())
    }

    /// The method as `config.json` names it: `bc`, `iql`, `sprint`, `am` or `transformer-bc`.
    pub(crate) fn method(&self) -> &'static str {
        match (&self.iql, &self.chaining, &self.policy.goal_channels) {
            (_, _, Some(_)) => "am",
            (None, ..) if self.policy.attention.is_some() => "transformer-bc",
            (None, ..) => "bc",
            (Some(_), None, _) => "iql",
            (Some(_), Some(_), _) => "sprint",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_hyper_parameter_is_named() {
        let mut table = Preset::table("sprint").unwrap();
        extend(&mut table, "[iql]\ngamma = 1".parse().unwrap());
        let error = format!("{:#}", Preset::of(table).unwrap_err());
        assert!(error.contains("gamma") && error.contains("iql") && !error.contains("line"), "{error}");
    }

    #[test]
    fn a_preset_of_another_format_is_refused_before_its_fields_are_read() {
        let mut table = Preset::table("sprint").unwrap();
        extend(&mut table, "format_version = 1\nbalance = 0.5".parse().unwrap());
        let error = format!("{:#}", Preset::of(table).unwrap_err());
        assert!(error.starts_with("format_version is 1, but this program reads 2: "), "{error}");
    }

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let refused = |over: &str, what: &str| {
            let mut table = Preset::table("sprint").unwrap();
            extend(&mut table, over.parse().unwrap());
            let error = format!("{:#}", Preset::of(table).unwrap_err());
            assert!(error.contains(what), "{error}");
        };
        refused("critic = false", "critic and iql");
        refused("critic = false\niql = false", "chaining needs a critic");
        refused("[policy]\ngoal_channels = [4, 4, 4, 4]", "no instruction is read");
        refused("[policy]\ngoal_channels = [4, 4, 4, 4]\n[validation]\nswaps = 0", "goals have none");
        refused("[chaining]\nbatch_size = 0", "chaining.batch_size");
        refused("[chaining]\nfeasible_share = 1.5", "chaining.feasible_share is 1.5");
        refused("[chaining]\npairs = \"in-batch\"\nfeasible_share = 0.5", "chaining.feasible_share is of a pool");
        refused("parts = 0", "parts is 0");
        refused("[iql]\ncloning_fraction = 3000.0", "iql.cloning_fraction");
        refused("[iql]\nadvantage_scale = -1.0", "iql.advantage_scale");
        refused("[iql]\nexpectile = 1.5", "iql.expectile");
        refused("[iql]\ndiscount = 2.0", "iql.discount");
        refused("[policy]\ndropout = 1.5", "policy.dropout");
        refused("[policy]\nhistory = -1", "policy.history");
        refused("[critic]\nchannels = [0, 4, 4, 4]", "critic.channels is 0");
        refused("[training.schedule]\nlearning_rate = nan", "training.schedule.learning_rate");
        refused("[training]\nsteps = 0", "training.steps is 0");
        refused(
            "[visual_encoder_training.optimisation.adamw]\nbeta2 = 1.0",
            "visual_encoder_training.optimisation.adamw.beta2",
        );
        refused("[visual_encoder]\nimage_size = 224", "visual_encoder.image_size is 224, not 112");
        refused("visual_backbone = \"ears\"", "resnet18");
    }
}
