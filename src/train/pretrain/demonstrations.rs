//! The data stage: demonstrations as labelled items, single skills and composites (the paper's relabelled dataset).

use std::path::Path;

use super::spec::Pretraining;
use crate::data::dataset::Dataset;
use crate::data::items::{ItemSource, Items};
use crate::data::selection::Composites;
use crate::data::summaries::Summaries;
use crate::train::frame_store::FrameStore;

/// The datasets of a pretraining.
pub(super) struct Demonstrations {
    pub(crate) datasets: Vec<Dataset>,
    /// A digest for each dataset.
    pub(crate) digests: Vec<String>,
    /// The trajectories of all datasets.
    pub(crate) frame_store: FrameStore,
}

impl Demonstrations {
    pub(crate) fn open(spec: &Pretraining) -> anyhow::Result<Demonstrations> {
        let datasets = spec.data.iter().map(|folder| Dataset::open(folder)).collect::<anyhow::Result<Vec<_>>>()?;
        let frame_store = FrameStore::open(&datasets)?;
        let digests = datasets.iter().map(Dataset::digest).collect::<anyhow::Result<Vec<_>>>()?;
        Ok(Demonstrations { datasets, digests, frame_store })
    }

    /// The digest of all datasets together.
    pub(crate) fn digest(&self) -> String {
        self.digests.join("-")
    }

    /// The items to learn from, with their texts, and those that are held out.
    pub(crate) fn items(&self, spec: &Pretraining) -> anyhow::Result<Items> {
        let source = ItemSource {
            trajectories: &self.frame_store.trajectories,
            apart: &self.frame_store.kept_apart_with(spec.preset.hold_out, &spec.preset.withheld_scenes)?,
            held_out: &self.frame_store.held_out,
            summaries: &summaries(spec)?,
        };
        let items = Items::of(&source, self.frame_store.labels()?, &spec.preset.data)?;
        anyhow::ensure!(
            !items.training.is_empty(),
            "there is nothing to learn from: no span has a text, or every one is held out (hold_out is {})",
            spec.preset.hold_out
        );
        Ok(items)
    }
}

/// The labels of the datasets, where the preset asks for labels.
fn summaries(spec: &Pretraining) -> anyhow::Result<Summaries> {
    if spec.preset.data.composites != Composites::Labels {
        return Ok(Summaries::default());
    }
    let folders: Vec<&Path> = spec.data.iter().map(|folder| folder.as_path()).collect();
    Summaries::read(&folders, spec.preset.data.label_source.as_deref())
}
