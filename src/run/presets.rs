//! Presets: every hyper-parameter of a training by name.

use std::path::Path;

use anyhow::Context;
use serde::{Deserialize, Serialize};

use crate::algo::learner::Optimisation;
use crate::nets::policy::PolicySpec;
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
    /// The visual encoder.
    pub visual: VisualSpec,
    /// Its training.
    pub visual_training: VisualTraining,
    /// The policy network.
    pub policy: PolicySpec,
    /// Its training.
    pub training: Optimisation,
    /// How the result is measured.
    pub appraisal: Appraisal,
}

/// How the visual encoder is trained.
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
    const SHIPPED: [(&'static str, &'static str); 1] = [("l-bc", include_str!("../../assets/presets/l-bc.toml"))];

    /// A shipped preset by name, or one from a file.
    ///
    /// # Errors
    /// When there is neither, or it is malformed; the field is named.
    pub fn named(name: &str) -> anyhow::Result<Preset> {
        if let Some((_, text)) = Preset::SHIPPED.iter().find(|(shipped, _)| *shipped == name) {
            return Preset::parse(text).with_context(|| format!("the preset {name}"));
        }
        let names: Vec<&str> = Preset::SHIPPED.iter().map(|(name, _)| *name).collect();
        let text = std::fs::read_to_string(Path::new(name))
            .with_context(|| format!("there is no preset {name:?}: use {} or a file", names.join(", ")))?;
        Preset::parse(&text).with_context(|| name.to_string())
    }

    fn parse(text: &str) -> anyhow::Result<Preset> {
        let preset: Preset = toml::from_str(text)?;
        anyhow::ensure!(
            preset.format_version == Preset::FORMAT,
            "format_version is {}, this program reads {}",
            preset.format_version,
            Preset::FORMAT
        );
        for (field, value) in [("save_every", preset.save_every), ("report_every", preset.report_every)] {
            anyhow::ensure!(value > 0, "{field} is 0");
        }
        for (field, batch) in [
            ("training.batch", preset.training.batch),
            ("visual_training.optimisation.batch", preset.visual_training.optimisation.batch),
        ] {
            anyhow::ensure!((2..=65_536).contains(&batch), "{field} is {batch}, which is not between 2 and 65536");
        }
        Ok(preset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_preset_parses() {
        for (name, _) in Preset::SHIPPED {
            assert_eq!(Preset::named(name).unwrap().name, name);
        }
    }

    #[test]
    fn an_unknown_hyper_parameter_is_named() {
        let text = format!("surprise = 1\n{}", Preset::SHIPPED[0].1);
        assert!(format!("{:#}", Preset::parse(&text).unwrap_err()).contains("surprise"));
    }
}
