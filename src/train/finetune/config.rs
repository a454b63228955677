//! How a finetuning trains: the shipped defaults, over them what a file says, and below them the pre-training's values.

use std::path::Path;

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};

use crate::agent::learned::LearnedPolicy;
use crate::algo::adamw::AdamWConfig;
use crate::algo::iql::Iql;
use crate::algo::learner::Optimisation;
use crate::algo::schedule::Schedule;
use crate::data::text_file;
use crate::train::preset::{Preset, extend};

/// The shipped defaults.
const DEFAULTS: &str = include_str!("../../../assets/finetune.toml");

/// Every hyper-parameter of a finetuning. Steps are those of the environment, counted after the initial rollouts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FinetuneConfig {
    pub(crate) format_version: u32,
    /// Drives exploration and the order of the replayed transitions.
    pub(crate) seed: u64,
    /// Steps of each task's training after the initial rollouts.
    pub(crate) steps: u64,
    /// Rollouts before the first update.
    pub(crate) initial_rollouts: u64,
    /// Updates a step that follows the initial rollouts.
    pub(crate) updates_per_step: f64,
    /// The share of random actions at the first and at the last step, linear between them.
    pub(crate) epsilon: [f64; 2],
    /// Whether the other actions are drawn from the policy's distribution instead of being its likeliest.
    pub(crate) sampling: bool,
    /// Rollouts that are played side by side, between two runs of updates.
    pub(crate) samplers: u64,
    /// Steps between two greedy rollouts that measure the agent.
    pub(crate) evaluate_every: u64,
    /// Steps between two saved states.
    pub(crate) save_every: u64,
    /// Implicit Q-learning.
    pub(crate) iql: Iql,
    /// The optimiser.
    pub(crate) training: FinetuneOptimisation,
}

/// The batch and the optimiser of a finetuning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FinetuneOptimisation {
    /// Transitions in an update.
    pub(crate) batch_size: usize,
    /// The learning rate, which stays as it is.
    pub(crate) learning_rate: f64,
    /// The optimiser's other settings.
    pub(crate) adamw: AdamWConfig,
}

impl FinetuneConfig {
    /// The format version this program reads and writes.
    const FORMAT: u32 = 1;

    /// The defaults over the values of a pre-training, and over both those of `file`.
    ///
    /// # Errors
    /// When the file cannot be read, or a field is unknown, malformed or out of its bounds; it is named.
    pub(crate) fn read(file: Option<&Path>, pretraining: &Preset) -> anyhow::Result<FinetuneConfig> {
        let over = match file {
            None => String::new(),
            Some(file) => text_file::read(file).with_context(|| format!("{} cannot be read", file.display()))?,
        };
        let name = || file.map_or_else(|| "the defaults".to_string(), |file| file.display().to_string());
        FinetuneConfig::of(&over, pretraining).with_context(name)
    }

    fn of(over: &str, pretraining: &Preset) -> anyhow::Result<FinetuneConfig> {
        let iql = pretraining.iql.as_ref().context("the pre-training of the critic has no [iql]")?;
        // An agent that is trained already has no phase in which it only clones.
        let iql = Iql { cloning_fraction: 0.0, ..iql.clone() };
        let Optimisation { batch_size, schedule, adamw, .. } = pretraining.training.clone();
        let training = FinetuneOptimisation { batch_size, learning_rate: schedule.learning_rate, adamw };
        let mut table = toml::Table::new();
        table.insert("iql".into(), toml::Value::try_from(iql)?);
        table.insert("training".into(), toml::Value::try_from(training)?);
        extend(&mut table, DEFAULTS.parse()?);
        let over: toml::Table = over.parse().map_err(|error| anyhow::anyhow!("{error}"))?;
        if let Some(found) = over.get("format_version") {
            let own = FinetuneConfig::FORMAT;
            ensure!(
                *found == toml::Value::from(own),
                "format_version is {found}, but this program reads {own}; use the version of sprint that wrote it"
            );
        }
        extend(&mut table, over);
        // Errors name the field and no line: a line of the joined table would be none of the file's.
        let config: FinetuneConfig =
            table.try_into().map_err(|error: toml::de::Error| anyhow::anyhow!("{}", error.to_string().trim_end()))?;
        config.check()?;
        Ok(config)
    }

    /// Whether a training can be so.
    ///
    /// # Errors
    /// Names the field that is out of its bounds.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        let counts = [
            ("steps", self.steps),
            ("initial_rollouts", self.initial_rollouts),
            ("evaluate_every", self.evaluate_every),
            ("save_every", self.save_every),
        ];
        for (field, value) in counts {
            ensure!(value > 0, "{field} is 0");
        }
        for epsilon in self.epsilon {
            ensure!((0.0..=1.0).contains(&epsilon), "epsilon is {epsilon}, which is not a share");
        }
        let (samplers, most) = (self.samplers, LearnedPolicy::SLOTS as u64);
        ensure!((1..=most).contains(&samplers), "samplers is {samplers}, which is not between 1 and {most}");
        let ratio = self.updates_per_step;
        ensure!((0.0..=100.0).contains(&ratio), "updates_per_step is {ratio}, which is not between 0 and 100");
        self.iql.check()?;
        self.optimisation().check("training")
    }

    /// The share of random actions after so many steps that followed the initial rollouts.
    pub(crate) fn epsilon_at(&self, step: u64) -> f64 {
        let [first, last] = self.epsilon;
        first + (last - first) * (step as f64 / self.steps as f64).min(1.0)
    }

    /// How many updates are due after so many steps that followed the initial rollouts.
    pub(crate) fn updates_due(&self, steps: u64) -> u64 {
        (steps as f64 * self.updates_per_step) as u64
    }

    /// The optimiser's settings. How many steps it will take is not known; its rate does not depend on it.
    pub(crate) fn optimisation(&self) -> Optimisation {
        let FinetuneOptimisation { batch_size, learning_rate, adamw } = self.training.clone();
        let schedule = Schedule { learning_rate, warmup_steps: 0, final_fraction: 1.0 };
        Optimisation { steps: u64::MAX, batch_size, schedule, adamw }
    }

    /// All of it, as `--config` takes it.
    ///
    /// # Errors
    /// Never for a configuration that was read.
    pub(crate) fn text(&self) -> anyhow::Result<String> {
        Ok(toml::to_string(self)?)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    fn of(over: &str) -> anyhow::Result<FinetuneConfig> {
        FinetuneConfig::of(over, &Preset::named("sprint").unwrap())
    }

    #[test]
    fn the_defaults_are_the_papers_and_the_rest_is_the_pretrainings() {
        let config = of("").unwrap();
        assert_eq!((config.initial_rollouts, config.updates_per_step, config.epsilon), (50, 0.5, [0.25, 0.05]));
        let preset = Preset::named("sprint").unwrap();
        let iql = preset.iql.unwrap();
        assert_eq!(config.iql, Iql { cloning_fraction: 0.0, ..iql });
        assert_eq!(config.training.batch_size, preset.training.batch_size);
        assert_eq!(of(&config.text().unwrap()).unwrap(), config, "what is kept reads back the same");
    }

    #[test]
    fn a_file_changes_what_it_names_and_unknown_or_impossible_fields_are_refused_by_name() {
        let config = of("steps = 40\n[training]\nlearning_rate = 1e-3").unwrap();
        assert_eq!((config.steps, config.training.learning_rate, config.seed), (40, 1e-3, 1));
        let refused = |over: &str, what: &str| {
            let error = format!("{:#}", of(over).unwrap_err());
            assert!(error.contains(what), "{over}: {error}");
        };
        refused("rollouts = 50", "rollouts");
        refused("[training]\nrate = 1.0", "rate");
        refused("steps = 0", "steps is 0");
        refused("epsilon = [0.5, 1.5]", "epsilon is 1.5, which is not a share");
        refused("samplers = 9", "samplers is 9, which is not between 1 and 8");
        refused("updates_per_step = -1.0", "updates_per_step is -1");
        refused("[iql]\nexpectile = 2.0", "iql.expectile");
        refused("[training]\nbatch_size = 1", "training.batch_size");
        refused("format_version = 2", "format_version is 2, but this program reads 1");
    }

    #[test]
    fn exploration_falls_linearly_and_half_an_update_is_due_a_step() {
        let config = of("steps = 100").unwrap();
        let found = [0, 50, 100, 150].map(|step| (100.0 * config.epsilon_at(step)).round());
        assert_eq!(found, [25.0, 15.0, 5.0, 5.0]);
        assert_eq!([0, 1, 7, 100].map(|steps| config.updates_due(steps)), [0, 0, 3, 50]);
    }
}
