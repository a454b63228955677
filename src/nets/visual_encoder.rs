//! What an agent sees through: the House encoder, trained here and kept in its checkpoint, or ResNet-18 as torchvision publishes it.

use std::path::{Path, PathBuf};

use anyhow::Context;
use tch::{Device, nn};

use super::frozen::FrameEncoder;
use super::home::cache_folder;
use super::resnet18::{self, ResNet18};
use super::visual::{HouseEncoder, VisualSpec};

/// A visual encoder with its weights.
#[derive(Debug)]
pub enum VisualEncoder {
    /// Trained on drawn frames.
    House {
        /// The network.
        encoder: Box<HouseEncoder>,
        /// Its weights.
        store: nn::VarStore,
    },
    /// Trained on photographs, by others; too large for a checkpoint.
    ResNet18(Box<ResNet18>),
}

impl VisualEncoder {
    /// A House encoder with fresh weights.
    pub fn house(spec: &VisualSpec, device: Device) -> VisualEncoder {
        let store = nn::VarStore::new(device);
        VisualEncoder::House { encoder: Box::new(HouseEncoder::new(&store.root(), spec)), store }
    }

    /// Where ResNet-18's weights are looked for.
    pub(crate) fn resnet18_file() -> PathBuf {
        cache_folder().join("encoders/resnet18.safetensors")
    }

    /// The ResNet-18 in a file.
    ///
    /// # Errors
    /// When the file is missing or holds something else.
    pub(crate) fn resnet18(file: &Path, device: Device) -> anyhow::Result<VisualEncoder> {
        let net = ResNet18::read(file, device).with_context(|| {
            format!("ResNet-18's weights belong in {}: assets/convert_resnet18.py makes that file", file.display())
        })?;
        Ok(VisualEncoder::ResNet18(Box::new(net)))
    }

    /// Features in each of a map's 7 x 7 places.
    pub(crate) fn features(&self) -> i64 {
        match self {
            VisualEncoder::House { encoder, .. } => encoder.spec().features(),
            VisualEncoder::ResNet18(_) => resnet18::FEATURES,
        }
    }

    /// The weights that a checkpoint keeps.
    pub(crate) fn store(&self) -> Option<&nn::VarStore> {
        match self {
            VisualEncoder::House { store, .. } => Some(store),
            VisualEncoder::ResNet18(_) => None,
        }
    }

    /// The encoder as it is now, for computing alone.
    ///
    /// # Errors
    /// When the weights cannot be read.
    pub(crate) fn frozen(&self) -> anyhow::Result<Box<dyn FrameEncoder>> {
        match self {
            VisualEncoder::House { encoder, store } => Ok(Box::new(encoder.frozen(store)?)),
            VisualEncoder::ResNet18(net) => Ok(net.share()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::house::render::Renderer;
    use crate::house::testing::kitchen;
    use crate::nets::resnet18::tests::write_weights;

    #[test]
    fn resnet18_sees_a_frame_and_leaves_nothing_for_the_checkpoint() {
        let _chance = crate::nets::testing::chance();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("resnet18.safetensors");
        write_weights(&file);
        let eyes = VisualEncoder::resnet18(&file, Device::Cpu).unwrap();
        let (scene, world) = kitchen();
        let sight = eyes.frozen().unwrap();
        let image = sight.image(Renderer::new(300).draw(&scene, &world));
        assert_eq!(image.len(), 3 * 224 * 224);
        assert_eq!(sight.encode(&[image]).size(), [1, eyes.features(), 7, 7]);
        assert!(eyes.store().is_none());
    }

    #[test]
    fn missing_weights_are_told_with_their_place_and_remedy() {
        let error =
            format!("{:#}", VisualEncoder::resnet18(Path::new("nowhere/r.safetensors"), Device::Cpu).unwrap_err());
        assert!(error.contains("nowhere/r.safetensors") && error.contains("convert_resnet18.py"), "{error}");
    }
}
