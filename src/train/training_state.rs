//! A training's state on disk: tensors, the step after which they were so, and what they were made with.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, ensure};

use crate::nets::weights;
use crate::nets::weights::Tensors;

/// Where a training's state lies, and what it belongs to.
#[derive(Clone, Copy)]
pub struct TrainingState<'a> {
    /// The safetensors file; step and identity are its metadata.
    pub path: &'a Path,
    /// What a state must have been made with to be taken up, by name: the dataset, the encoders.
    pub identity: &'a BTreeMap<String, String>,
}

impl TrainingState<'_> {
    /// Writes the state after so many steps, whole or not at all.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn write(&self, step: u64, tensors: &Tensors) -> anyhow::Result<()> {
        let mut metadata = self.identity.clone();
        metadata.insert("step".into(), step.to_string());
        Ok(weights::write(self.path, tensors, &metadata)?)
    }

    /// The step and the tensors, if there is a file.
    ///
    /// # Errors
    /// When it cannot be read, or was made with something else; both values are named.
    pub(crate) fn read(&self) -> anyhow::Result<Option<(u64, Tensors)>> {
        if !self.path.is_file() {
            return Ok(None);
        }
        let (tensors, metadata) = weights::read_with_metadata(self.path)?;
        let path = self.path.display();
        for (name, own) in self.identity {
            let found = metadata.get(name).map_or("missing", String::as_str);
            ensure!(
                found == own,
                "{path}: {name} is {found}, this training's is {own}; begin another one with another --out"
            );
        }
        let step = metadata.get("step").with_context(|| format!("{path}: step is missing"))?;
        let step = step.parse().with_context(|| format!("{path}: step is {step:?}, not a number"))?;
        Ok(Some((step, tensors)))
    }
}

#[cfg(test)]
mod tests {
    use tch::Tensor;

    use super::*;

    #[test]
    fn a_state_is_read_back_and_one_of_other_data_is_refused_with_both_values() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.safetensors");
        let [own, other] = ["abc", "def"].map(|dataset| [("dataset".to_string(), dataset.to_string())].into());
        let state = TrainingState { path: &path, identity: &own };
        assert!(state.read().unwrap().is_none());
        let tensors: Tensors = [("a".to_string(), Tensor::from_slice(&[1.0f32, 2.0]))].into();
        state.write(7, &tensors).unwrap();
        assert_eq!(state.read().unwrap(), Some((7, tensors)));
        let error = TrainingState { identity: &other, ..state }.read().unwrap_err().to_string();
        assert!(error.contains("state.safetensors: dataset is abc, this training's is def"), "{error}");
    }
}
