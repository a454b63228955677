//! Summaries by an OPT model in this process.

use std::path::Path;

use tch::Device;

use super::ranked_chains::ChainModel;
use crate::language::maker::{Maker, Sampling};
use crate::language::passage::{Passage, Summarizer, TakeSummary};
use crate::language::prompt;
use crate::nets::language_model::{LanguageModel, Prompt};

/// An OPT model that sums passages up.
pub(crate) struct OptSummarizer {
    model: LanguageModel,
    name: String,
    maker: Maker,
}

impl OptSummarizer {
    /// Reads a model's folder; `name` is what its labels are called, where it is not the folder's.
    ///
    /// # Errors
    /// When the folder holds no OPT model.
    pub(crate) fn open(
        folder: &Path,
        name: Option<String>,
        sampling: Sampling,
        device: Device,
    ) -> anyhow::Result<OptSummarizer> {
        let model = LanguageModel::open(folder, device, &prompt::shared())?;
        let folder = std::path::absolute(folder)?;
        let known_as = folder.file_name().map_or_else(|| "opt".into(), |name| name.to_string_lossy().into_owned());
        let files = Some(model.digest().to_owned());
        let maker = Maker { model: known_as.clone(), files, prompt: prompt::digest(), sampling };
        Ok(OptSummarizer { model, name: name.unwrap_or(known_as), maker })
    }
}

impl Summarizer for OptSummarizer {
    fn source(&self) -> &str {
        &self.name
    }

    fn version(&self) -> u32 {
        1
    }

    fn maker(&self) -> Option<&Maker> {
        Some(&self.maker)
    }

    /// On a CPU more rows gain little; elsewhere a row costs next to nothing.
    fn together(&self) -> usize {
        if self.model.device() == Device::Cpu { 16 } else { 64 }
    }

    fn summaries(&self, passages: &[Passage<'_>], take: &mut TakeSummary<'_>) -> anyhow::Result<()> {
        let prompt =
            |passage: &Passage<'_>| Prompt { text: prompt::summarise(passage.sentences), seed: passage.seed() };
        for (lot, passages) in passages.chunks(self.together()).enumerate() {
            let prompts: Vec<Prompt> = passages.iter().map(prompt).collect();
            let answers = self.model.complete(&prompts, &self.maker.sampling, &prompt::is_whole)?;
            for (index, answer) in answers.iter().enumerate() {
                take(lot * self.together() + index, prompt::summary(&answer.text, answer.ended))?;
            }
        }
        Ok(())
    }
}

impl ChainModel for OptSummarizer {
    fn log_probabilities(&self, steps: &[(String, String)]) -> anyhow::Result<Option<Vec<f64>>> {
        let steps: Vec<_> = steps.iter().map(|(first, second)| prompt::follow(first, second)).collect();
        let mut found = Vec::new();
        for chunk in steps.chunks(self.together()) {
            found.extend(self.model.mean_log_probabilities(chunk)?);
        }
        Ok(Some(found))
    }

    fn chain_maker(&self) -> Maker {
        self.maker.clone()
    }
}
