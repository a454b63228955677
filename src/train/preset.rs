//! Presets: every hyper-parameter of a training by name.

use std::path::Path;

use anyhow::Context;
use serde::{Deserialize, Serialize};

use crate::algo::chain::{Chaining, PairSource};
use crate::algo::iql::Iql;
use crate::algo::learner::Optimisation;
use crate::data::selection::DataSelection;
use crate::nets::critic::CriticSpec;
use crate::nets::policy::PolicySpec;
use crate::nets::precision::Precision;
use crate::nets::visual::VisualSpec;

/// A training, in full.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Preset {
    /// Version of this format.
    pub format_version: u32,
    /// What reports call it.
    pub name: String,
    /// Drives initialisation, dropout and the order of the data.
    pub seed: u64,
    /// One trajectory in that many is held out.
    pub hold_out: usize,
    /// Steps between two saved states.
    pub save_every: u64,
    /// Steps between two reports.
    pub report_every: u64,
    /// What is learned from.
    pub data: DataSelection,
    /// What the agent sees through.
    #[serde(default)]
    pub eyes: Sight,
    /// The House encoder; ResNet-18 has one size.
    pub visual: VisualSpec,
    /// Its training.
    pub visual_training: VisualTraining,
    /// The policy network.
    pub policy: PolicySpec,
    /// The critic; absent for behaviour cloning.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub critic: Option<CriticSpec>,
    /// How the critic learns and weighs the policy; there if the critic is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iql: Option<Iql>,
    /// How skills are chained; absent where they are not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chaining: Option<Chaining>,
    /// The training of policy and critic.
    pub training: Optimisation,
    /// How wide the numbers are that networks compute with while they learn.
    #[serde(default)]
    pub precision: Precision,
    /// How much of the log share that each action has among the labels is taken off its logit when the agent decides.
    #[serde(default)]
    pub logit_adjustment: f32,
    /// How the result is measured.
    pub appraisal: Appraisal,
}

/// What an agent sees through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sight {
    /// The House encoder, which is trained on drawn frames.
    #[default]
    House,
    /// torchvision's ResNet-18, as it is.
    ResNet18,
}

/// How the House encoder is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VisualTraining {
    /// The optimisation.
    pub optimisation: Optimisation,
    /// A mark that holds weighs that many times one that does not.
    pub positive_weight: f64,
}

/// How a trained policy is measured, in houses that no training saw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Appraisal {
    /// One-skill tasks.
    pub tasks: usize,
    /// Cases in which the instruction is swapped for another object in view.
    pub swaps: usize,
    /// Drives their choice.
    pub seed: u64,
}

impl Preset {
    /// The format version this program reads and writes.
    pub const FORMAT: u32 = 1;
    const SHIPPED: [(&'static str, &'static str); 9] = [
        ("sprint", include_str!("../../assets/presets/sprint.toml")),
        ("l-bc", include_str!("../../assets/presets/l-bc.toml")),
        ("iql-primitive", include_str!("../../assets/presets/iql-primitive.toml")),
        ("am", include_str!("../../assets/presets/am.toml")),
        ("et", include_str!("../../assets/presets/et.toml")),
        ("sprint-no-chain", include_str!("../../assets/presets/sprint-no-chain.toml")),
        ("sprint-no-agg", include_str!("../../assets/presets/sprint-no-agg.toml")),
        ("sprint-concat-agg", include_str!("../../assets/presets/sprint-concat-agg.toml")),
        ("l-bc-agg", include_str!("../../assets/presets/l-bc-agg.toml")),
    ];
    /// Sizes other than the presets' own, which suits two CPU cores.
    const SIZES: [(&'static str, &'static str); 1] = [("paper", include_str!("../../assets/presets/sizes/paper.toml"))];

    /// The names of the shipped presets.
    pub fn names() -> Vec<&'static str> {
        Preset::SHIPPED.iter().map(|(name, _)| *name).collect()
    }

    /// A shipped preset by name, or one from a file, in its own size.
    ///
    /// # Errors
    /// As [`Preset::sized`].
    pub fn named(name: &str) -> anyhow::Result<Preset> {
        Preset::sized(name, None)
    }

    /// A shipped preset by name, or one from a file, which may extend a shipped one. `size` names a shipped size or a file;
    /// it changes only what the preset has.
    ///
    /// # Errors
    /// When there is no such preset or size, or it is malformed; the field is named.
    pub fn sized(name: &str, size: Option<&str>) -> anyhow::Result<Preset> {
        let mut table = Preset::table(name).with_context(|| format!("the preset {name}"))?;
        if let Some(size) = size {
            let size: toml::Table =
                shipped(&Preset::SIZES, size, "size")?.parse().with_context(|| format!("the size {size}"))?;
            resize(&mut table, size);
        }
        Preset::of(table).with_context(|| format!("the preset {name}"))
    }

    /// A preset's text with what it extends.
    fn table(name: &str) -> anyhow::Result<toml::Table> {
        let mut table: toml::Table = shipped(&Preset::SHIPPED, name, "preset")?.parse()?;
        match table.remove("extends") {
            None => Ok(table),
            Some(toml::Value::String(base)) if Preset::names().contains(&base.as_str()) && base != name => {
                let mut whole = Preset::table(&base)?;
                extend(&mut whole, table);
                Ok(whole)
            }
            Some(other) => anyhow::bail!("extends is {other}, which is no other shipped preset"),
        }
    }

    /// What is wrong is told by the field: a line of what was joined would be none of the file's.
    fn of(table: toml::Table) -> anyhow::Result<Preset> {
        let preset: Preset = table.try_into().map_err(|error| anyhow::anyhow!("{}", error.to_string().trim_end()))?;
        anyhow::ensure!(
            preset.format_version == Preset::FORMAT,
            "format_version is {}, this program reads {}",
            preset.format_version,
            Preset::FORMAT
        );
        for (field, value) in [
            ("save_every", preset.save_every),
            ("report_every", preset.report_every),
            ("training.steps", preset.training.steps),
        ] {
            anyhow::ensure!(value > 0, "{field} is 0");
        }
        preset.training.check("training")?;
        preset.visual_training.optimisation.check("visual_training.optimisation")?;
        let weight = preset.visual_training.positive_weight;
        anyhow::ensure!(
            weight.is_finite() && weight > 0.0,
            "visual_training.positive_weight is {weight}, which is not above 0"
        );
        let logit_adjustment = preset.logit_adjustment;
        anyhow::ensure!(
            (0.0..=1.0).contains(&logit_adjustment),
            "logit_adjustment is {logit_adjustment}, which is not a share"
        );
        preset.visual.check()?;
        preset.policy.check()?;
        preset.check_method()?;
        Ok(preset)
    }

    /// What a method consists of has to fit together.
    fn check_method(&self) -> anyhow::Result<()> {
        anyhow::ensure!(
            self.critic.is_some() == self.iql.is_some(),
            "critic and iql go together: one of them is absent"
        );
        if self.policy.attention.is_some() {
            anyhow::ensure!(self.critic.is_none(), "policy.attention reads words, which no critic here does");
            anyhow::ensure!(self.policy.goal.is_none(), "policy.attention and policy.goal exclude each other");
        }
        if self.policy.goal.is_some() {
            let swaps = self.appraisal.swaps;
            anyhow::ensure!(swaps == 0, "appraisal.swaps is {swaps}, but with policy.goal no instruction is read");
        }
        if let Some(critic) = &self.critic {
            critic.check()?;
        }
        if let Some(iql) = &self.iql {
            iql.check()?;
        }
        let Some(chaining) = &self.chaining else { return Ok(()) };
        anyhow::ensure!(self.critic.is_some(), "chaining needs a critic");
        anyhow::ensure!(chaining.batch > 0, "chaining.batch is 0");
        for (field, value) in [
            ("chaining.weight", chaining.weight),
            ("chaining.chain", chaining.chain),
            ("chaining.aggregate", chaining.aggregate),
        ] {
            anyhow::ensure!(value.is_finite() && value >= 0.0, "{field} is {value}");
        }
        anyhow::ensure!(chaining.chain + chaining.aggregate > 0.0, "chaining.chain and chaining.aggregate are both 0");
        let sentences = self.policy.goal.is_none();
        anyhow::ensure!(sentences || chaining.aggregate == 0.0, "chaining.aggregate joins sentences; goals have none");
        anyhow::ensure!(
            sentences || chaining.pairs == PairSource::InBatch,
            "chaining.pairs: a pool is of sentences; goals are paired in-batch"
        );
        Ok(())
    }

    /// The method in a word.
    pub fn method(&self) -> &'static str {
        match (&self.iql, &self.chaining, &self.policy.goal) {
            (_, _, Some(_)) => "am",
            (None, ..) if self.policy.attention.is_some() => "et",
            (None, ..) => "bc",
            (Some(_), None, _) => "iql",
            (Some(_), Some(_), _) => "sprint",
        }
    }
}

/// A shipped text by name, or a file's.
fn shipped(texts: &[(&'static str, &'static str)], name: &str, what: &str) -> anyhow::Result<String> {
    if let Some((_, text)) = texts.iter().find(|(shipped, _)| *shipped == name) {
        return Ok((*text).to_string());
    }
    let names: Vec<&str> = texts.iter().map(|(name, _)| *name).collect();
    match std::fs::read_to_string(Path::new(name)) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            anyhow::bail!("there is no {what} {name:?}, nor a file of that name: use {} or a file", names.join(", "))
        }
        read => read.with_context(|| format!("{name} cannot be read")),
    }
}

/// Puts `over` over `table`, section by section; `false` takes a section away.
fn extend(table: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(value)) => extend(below, value),
            (Some(toml::Value::Table(_)), toml::Value::Boolean(false)) => drop(table.remove(&key)),
            (_, value) => drop(table.insert(key, value)),
        }
    }
}

/// Puts the values of a size over those that `table` has.
fn resize(table: &mut toml::Table, size: toml::Table) {
    for (key, value) in size {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(value)) => resize(below, value),
            (Some(own), value) => *own = value,
            (None, _) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::selection::{Composites, Named};

    #[test]
    fn every_shipped_preset_parses_in_every_size_and_is_what_its_name_says() {
        for name in Preset::names() {
            let preset = Preset::named(name).unwrap();
            assert_eq!(preset.name, name);
            let paper = Preset::sized(name, Some("paper")).unwrap();
            assert_eq!((paper.training.batch, paper.policy.embedding), (1024, 768), "{name}");
            assert_eq!(paper.method(), preset.method(), "{name}");
            assert!(paper.critic.is_none_or(|critic| !critic.shared_trunk), "{name}");
            assert_eq!((preset.data.named, paper.data.named), (Named::Ahead, Named::Own), "{name}");
            assert!(paper.iql.is_none_or(|iql| iql.advantage_scale == 0.0), "{name}");
            assert!(paper.chaining.is_none_or(|chaining| chaining.pairs == PairSource::InBatch), "{name}");
        }
        let method = |name| Preset::named(name).unwrap().method();
        let methods = ["sprint", "sprint-no-agg", "sprint-no-chain", "iql-primitive", "l-bc", "l-bc-agg", "am", "et"];
        assert_eq!(methods.map(method), ["sprint", "sprint", "iql", "iql", "bc", "bc", "am", "et"]);
        let composites = |name| Preset::named(name).unwrap().data.composites;
        let selections = ["sprint", "l-bc", "iql-primitive", "sprint-no-agg", "sprint-concat-agg"].map(composites);
        assert_eq!(
            selections,
            [Composites::Labels, Composites::None, Composites::None, Composites::None, Composites::Concat]
        );
    }

    #[test]
    fn every_recipe_is_a_preset() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/recipes");
        let recipes: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert!(!recipes.is_empty());
        for recipe in recipes {
            Preset::named(recipe.to_str().unwrap()).unwrap();
        }
    }

    #[test]
    fn an_unknown_hyper_parameter_is_named() {
        let mut table = Preset::table("sprint").unwrap();
        extend(&mut table, "[iql]\ngamma = 1".parse().unwrap());
        let error = format!("{:#}", Preset::of(table).unwrap_err());
        assert!(error.contains("gamma") && error.contains("iql") && !error.contains("line"), "{error}");
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
        refused("[policy]\ngoal = [4, 4, 4, 4]", "no instruction is read");
        refused("[policy]\ngoal = [4, 4, 4, 4]\n[appraisal]\nswaps = 0", "goals have none");
        refused("[chaining]\nbatch = 0", "chaining.batch");
        refused("[iql]\nwarmup_share = 3000.0", "iql.warmup_share");
        refused("[iql]\nweighing = -1.0", "iql.advantage_scale");
        refused("[iql]\nexpectile = 1.5", "iql.expectile");
        refused("[iql]\ndiscount = 2.0", "iql.discount");
        refused("[policy]\ndropout = 1.5", "policy.dropout");
        refused("[policy]\nhistory = -1", "policy.history");
        refused("[critic]\nchannels = [0, 4, 4, 4]", "critic.channels is 0");
        refused("[training.schedule]\nlearning_rate = nan", "training.schedule.learning_rate");
        refused("[training]\nsteps = 0", "training.steps is 0");
        refused("[visual_training.optimisation.adamw]\nbeta2 = 1.0", "visual_training.optimisation.adamw.beta2");
        refused("[visual]\ninput = 224", "visual.input is 224, not 112");
        refused("eyes = \"ears\"", "resnet18");
    }
}
