//! The hyper-parameters of an agent with a memory.

use std::path::Path;

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};

use super::chooser::ChooserTraining;
use super::critic::CriticTraining;
use crate::agent::config::AgentKind;
use crate::agent::memory_agent::eyes::Sight;
use crate::agent::memory_agent::features::{ACTION, SITUATION};
use crate::data::text_file;
use crate::nets::chooser::ChooserSpec;
use crate::nets::detector::DetectorSpec;
use crate::train::detection::DetectorTraining;
use crate::train::preset::{Preset, ValidationSpec, extend};

const SHIPPED: &str = include_str!("../../../assets/presets/sprint-memory.toml");
const NAME: &str = "sprint-memory";

/// Every hyper-parameter of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MemoryPreset {
    pub(crate) format_version: u32,
    /// Always `memory`: what tells these presets from those of the paper's agents.
    pub(crate) agent: AgentKind,
    /// The method's name in cards and reports.
    pub(crate) name: String,
    /// Drives initialisation and the order of the data.
    pub(crate) seed: u64,
    /// One trajectory in that many is held out.
    pub(crate) hold_out: usize,
    /// Steps between two saved states.
    pub(crate) save_every: u64,
    /// Steps between two lines of training/progress.jsonl.
    pub(crate) report_every: u64,
    /// What the agent sees with; the simulator's truth is an ablation.
    pub(crate) sight: Sight,
    /// Whether the agent never does the same twice in the same place and situation.
    pub(crate) loop_guard: bool,
    /// The size of the detector.
    pub(crate) detector: DetectorSpec,
    /// How the detector is trained.
    pub(crate) detector_training: DetectorTraining,
    /// The size of the chooser.
    pub(crate) chooser: ChooserSize,
    /// How the chooser is trained.
    pub(crate) chooser_training: ChooserTraining,
    /// The size of the critic.
    pub(crate) critic: ChooserSize,
    /// How the critic is trained; with 0 steps there is none.
    pub(crate) critic_training: CriticTraining,
    /// How many times the advantage enters the exponent by which the agent weighs its chooser when it decides.
    pub(crate) advantage_scale: f32,
    /// How the trained agent is measured.
    pub(crate) validation: ValidationSpec,
}

/// The part of a chooser's or critic's size that is free.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ChooserSize {
    /// The length of a class's vector.
    pub(crate) embedding: i64,
    /// Widths of the hidden layers.
    pub(crate) hidden: Vec<i64>,
}

impl ChooserSize {
    /// The whole size, with as many numbers as the agent makes of a situation and a macro action.
    pub(crate) fn spec(&self) -> ChooserSpec {
        let ChooserSize { embedding, hidden } = self.clone();
        ChooserSpec { situation: SITUATION as i64, action: ACTION as i64, embedding, hidden }
    }
}

impl MemoryPreset {
    /// The shipped preset by its name, or a file's, which may extend it; `None` where the name or file is of another kind of agent.
    ///
    /// # Errors
    /// When the file is of this kind and malformed; the field is named.
    pub(crate) fn named(name: &str) -> anyhow::Result<Option<MemoryPreset>> {
        let base: toml::Table = SHIPPED.parse()?;
        let table = if name == NAME {
            base
        } else {
            let Ok(text) = text_file::read(Path::new(name)) else { return Ok(None) };
            let Ok(mut over) = text.parse::<toml::Table>() else { return Ok(None) };
            if over.get("extends").and_then(toml::Value::as_str) == Some(NAME) {
                over.remove("extends");
                let mut whole = base;
                extend(&mut whole, over);
                whole
            } else if over.contains_key("agent") {
                over
            } else {
                return Ok(None);
            }
        };
        MemoryPreset::of(table).map(Some).with_context(|| format!("the preset {name}"))
    }

    /// The size of the critic, where there is one.
    pub(crate) fn critic_spec(&self) -> Option<ChooserSpec> {
        (self.critic_training.optimisation.steps > 0).then(|| self.critic.spec())
    }

    fn of(table: toml::Table) -> anyhow::Result<MemoryPreset> {
        let preset: MemoryPreset =
            table.try_into().map_err(|error: toml::de::Error| anyhow::anyhow!("{}", error.to_string().trim_end()))?;
        let (found, own) = (preset.format_version, Preset::FORMAT);
        ensure!(found == own, "format_version is {found}, but this program reads {own}");
        for (field, value) in [("save_every", preset.save_every), ("report_every", preset.report_every)] {
            ensure!(value > 0, "{field} is 0");
        }
        preset.detector.check()?;
        preset.detector_training.check("detector_training")?;
        preset.chooser.spec().check("chooser")?;
        preset.chooser_training.check("chooser_training")?;
        preset.critic.spec().check("critic")?;
        preset.critic_training.check("critic_training")?;
        Ok(preset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_preset_is_read_by_name_and_a_file_may_change_it() {
        let shipped = MemoryPreset::named(NAME).unwrap().unwrap();
        assert_eq!((shipped.name.as_str(), shipped.sight), (NAME, Sight::Detector));
        let file = tempfile::NamedTempFile::new().unwrap();
        let named = |text: &str| {
            std::fs::write(file.path(), text).unwrap();
            MemoryPreset::named(file.path().to_str().unwrap())
        };
        let ablation = named("extends = \"sprint-memory\"\nsight = \"simulator\"\n[chooser]\nhidden = [8]").unwrap();
        let ablation = ablation.unwrap();
        assert_eq!((ablation.sight, ablation.chooser.hidden), (Sight::Simulator, vec![8]));
        let refused = |text: &str| format!("{:#}", named(text).unwrap_err());
        assert!(refused("extends = \"sprint-memory\"\n[chooser]\nheight = 8").contains("height"));
        assert!(refused("extends = \"sprint-memory\"\nsave_every = 0").contains("save_every is 0"));
        assert!(refused("extends = \"sprint-memory\"\n[detector_training]\nanywhere = 2.0").contains("anywhere is 2"));
    }

    #[test]
    fn presets_of_the_papers_agents_are_left_to_others() {
        assert_eq!(MemoryPreset::named("sprint").unwrap(), None);
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "extends = \"l-bc\"").unwrap();
        assert_eq!(MemoryPreset::named(file.path().to_str().unwrap()).unwrap(), None);
    }
}
