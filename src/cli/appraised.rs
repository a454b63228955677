//! Measures a new checkpoint in generated houses and writes its model card.

use std::path::Path;

use super::bar::Bars;
use super::streams::say;
use crate::agent::LearnedPolicy;
use crate::agent::config::Config;
use crate::agent::learned::SharedEmbedder;
use crate::data::atomic_file;
use crate::nets::device::best_device;
use crate::train::model_card::card;
use crate::train::preset::Appraisal;
use crate::train::validation::appraise;

/// Measures the checkpoint in `folder` and writes its card.
///
/// # Errors
/// When it cannot be loaded, or the card not be written.
pub fn appraised(
    folder: &Path,
    appraisal: &Appraisal,
    sentences: SharedEmbedder,
    mut bars: Bars,
) -> anyhow::Result<()> {
    let mut policy = LearnedPolicy::load(folder, sentences, best_device())?;
    let findings = appraise(&mut policy, appraisal, &mut bars)?;
    bars.end();
    let text = card(&name(folder), &Config::read(folder)?, &findings);
    atomic_file::write(&folder.join("README.md"), text.as_bytes())?;
    say(text.trim_end());
    Ok(())
}

/// What a folder is called.
pub fn name(folder: &Path) -> String {
    folder.file_name().map_or_else(|| folder.display().to_string(), |name| name.to_string_lossy().into_owned())
}
