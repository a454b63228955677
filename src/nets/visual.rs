//! The visual encoder: a small residual network from a frame to a 7 x 7 feature map. Trained on what the simulator knows of
//! its own frames, frozen for every policy.

use serde::{Deserialize, Serialize};
use tch::nn::{self, ModuleT};
use tch::{Device, Kind, Tensor};

use super::bounds;
use super::frozen::{BatchNormParts, FoldedConv, FrameEncoder, stacked};
use super::precision::{self, Precision};
use super::resize::resize_area;
use super::weights;
use crate::house::view::Frame;

/// The side of a feature map.
pub(crate) const SIDE: i64 = 7;

/// The size of a visual encoder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VisualSpec {
    /// The side of the image it reads, in pixels: [`SIDE`], doubled as often as there are channels.
    pub(crate) image_size: i64,
    /// Channels at 1/2, 1/4, 1/8 of the image and so on; the last are the features.
    pub(crate) channels: Vec<i64>,
}

impl VisualSpec {
    /// Whether an image becomes a map of [`SIDE`] x [`SIDE`] places.
    ///
    /// # Errors
    /// When it becomes another, or there is no channel.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        let halvings = self.channels.len();
        anyhow::ensure!((1..=6).contains(&halvings), "visual_encoder.channels has {halvings} entries, not 1 to 6");
        let side = SIDE << halvings;
        bounds::sizes("visual_encoder.channels", &self.channels, 4096)?;
        anyhow::ensure!(
            self.image_size == side,
            "visual_encoder.image_size is {}, not {side} for {halvings} channels",
            self.image_size
        );
        Ok(())
    }

    /// Features in each of the 7 x 7 places.
    pub(crate) fn features(&self) -> i64 {
        self.channels.last().copied().unwrap_or(0)
    }

    /// Numbers in a feature map.
    pub fn map(&self) -> i64 {
        self.features() * SIDE * SIDE
    }

    /// What the encoder reads of a frame: planes of bytes.
    pub(crate) fn image(&self, frame: &Frame) -> Vec<u8> {
        resize_area(&frame.rgb, frame.width, self.image_size as usize)
    }
}

#[derive(Debug)]
pub(super) struct ConvNorm {
    conv: nn::Conv2D,
    stride: i64,
    norm: nn::BatchNorm,
}

impl ConvNorm {
    pub(super) fn new(path: &nn::Path<'_>, from: i64, to: i64, stride: i64) -> ConvNorm {
        let config = nn::ConvConfig { stride, padding: 1, bias: false, ..Default::default() };
        ConvNorm {
            conv: nn::conv2d(path / "conv", from, to, 3, config),
            stride,
            norm: nn::batch_norm2d(path / "norm", to, Default::default()),
        }
    }

    pub(super) fn forward(&self, x: &Tensor, train: bool) -> Tensor {
        self.norm.forward_t(&precision::convolution(&self.conv, x, self.stride), train)
    }

    pub(super) fn folded(&self) -> FoldedConv {
        FoldedConv::new(&self.conv.ws, BatchNormParts::of(&self.norm).as_ref(), self.stride)
    }
}

/// A step down in resolution, then a residual block.
#[derive(Debug)]
pub(super) struct ResidualStage {
    down: ConvNorm,
    first: ConvNorm,
    second: ConvNorm,
}

impl ResidualStage {
    pub(super) fn new(path: &nn::Path<'_>, from: i64, to: i64) -> ResidualStage {
        ResidualStage {
            down: ConvNorm::new(&(path / "down"), from, to, 2),
            first: ConvNorm::new(&(path / "first"), to, to, 1),
            second: ConvNorm::new(&(path / "second"), to, to, 1),
        }
    }

    pub(super) fn forward(&self, x: &Tensor, train: bool) -> Tensor {
        let x = self.down.forward(x, train).relu();
        let change = self.second.forward(&self.first.forward(&x, train).relu(), train);
        (x + change).relu()
    }

    pub(super) fn folded(&self) -> FoldedStage {
        FoldedStage([self.down.folded(), self.first.folded(), self.second.folded()])
    }
}

/// A residual stage that only computes.
#[derive(Debug)]
pub(super) struct FoldedStage([FoldedConv; 3]);

impl FoldedStage {
    pub(super) fn forward(&self, x: &Tensor) -> Tensor {
        let [down, first, second] = &self.0;
        let x = down.forward_relu(x);
        (second.forward(&first.forward_relu(&x)) + &x).relu_()
    }

    pub(super) fn share(&self) -> FoldedStage {
        FoldedStage(self.0.each_ref().map(FoldedConv::share))
    }
}

/// From a frame to its feature map.
#[derive(Debug)]
pub struct HouseEncoder {
    spec: VisualSpec,
    stem: ConvNorm,
    stages: Vec<ResidualStage>,
    device: Device,
}

impl HouseEncoder {
    /// An encoder with fresh weights under `path`.
    pub(crate) fn new(path: &nn::Path<'_>, spec: &VisualSpec) -> HouseEncoder {
        let stage =
            |(i, pair): (usize, &[i64])| ResidualStage::new(&(path / format!("stage{}", i + 1)), pair[0], pair[1]);
        HouseEncoder {
            stem: ConvNorm::new(&(path / "stem"), 3, spec.channels[0], 2),
            stages: spec.channels.windows(2).enumerate().map(stage).collect(),
            spec: spec.clone(),
            device: path.device(),
        }
    }

    /// The size that it was built with.
    pub(crate) fn spec(&self) -> &VisualSpec {
        &self.spec
    }

    /// The device of its weights.
    pub(crate) fn device(&self) -> Device {
        self.device
    }

    /// `pixels` [n, 3, image_size, image_size] in 0..255, any kind, to [n, features, 7, 7].
    pub(crate) fn forward(&self, pixels: &Tensor, train: bool) -> Tensor {
        self.forward_with(Precision::Full, pixels, train)
    }

    /// The same, computed with `precision`; the maps have 32 bits.
    pub(crate) fn forward_with(&self, precision: Precision, pixels: &Tensor, train: bool) -> Tensor {
        let x = precision.cast(&((pixels.to_device(self.device).to_kind(Kind::Float) - 127.5) / 64.0));
        let stem = self.stem.forward(&x, train).relu();
        self.stages.iter().fold(stem, |x, stage| stage.forward(&x, train)).to_kind(Kind::Float)
    }

    /// The encoder as it is now, for computing alone.
    ///
    /// # Errors
    /// When the weights cannot be read.
    pub(crate) fn frozen(&self, store: &nn::VarStore) -> anyhow::Result<FrozenVisual> {
        Ok(FrozenVisual {
            spec: self.spec.clone(),
            stem: self.stem.folded(),
            stages: self.stages.iter().map(ResidualStage::folded).collect(),
            device: self.device,
            digest: weights::digest(store.variables())?,
        })
    }

    /// The feature maps [n, features, 7, 7] of shrunken frames (see [`VisualSpec::image`]), without gradients.
    #[cfg(test)]
    pub(crate) fn encode(&self, images: &[Vec<u8>]) -> Tensor {
        let side = self.spec.image_size;
        let pixels = Tensor::from_slice(&images.concat()).view([images.len() as i64, 3, side, side]);
        tch::no_grad(|| self.forward(&pixels, false))
    }
}

/// A trained encoder that only computes, faster than it trains.
#[derive(Debug)]
pub(crate) struct FrozenVisual {
    spec: VisualSpec,
    stem: FoldedConv,
    stages: Vec<FoldedStage>,
    device: Device,
    digest: String,
}

impl FrameEncoder for FrozenVisual {
    fn image(&self, frame: &Frame) -> Vec<u8> {
        self.spec.image(frame)
    }

    fn features(&self) -> i64 {
        self.spec.features()
    }

    fn encode(&self, images: &[Vec<u8>]) -> Tensor {
        tch::no_grad(|| {
            let pixels = stacked(images, 3).to_device(self.device).to_kind(Kind::Float);
            let mut x = self.stem.forward_relu(&((pixels - 127.5) / 64.0));
            for stage in &self.stages {
                x = stage.forward(&x);
            }
            x.contiguous()
        })
    }

    fn digest(&self) -> &str {
        &self.digest
    }

    fn share(&self) -> Box<dyn FrameEncoder> {
        Box::new(FrozenVisual {
            spec: self.spec.clone(),
            stem: self.stem.share(),
            stages: self.stages.iter().map(FoldedStage::share).collect(),
            device: self.device,
            digest: self.digest.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_becomes_a_seven_by_seven_map_whatever_the_batch() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(3);
        let store = nn::VarStore::new(Device::Cpu);
        let spec = VisualSpec { image_size: 112, channels: vec![8, 8, 8, 16] };
        let encoder = HouseEncoder::new(&store.root(), &spec);
        let images: Vec<Vec<u8>> = (0..3u8).map(|i| vec![40 * i; 3 * 112 * 112]).collect();
        let maps = encoder.encode(&images);
        assert_eq!(maps.size(), [3, 16, SIDE, SIDE]);
        let alone = encoder.encode(&images[1..2]);
        assert!((maps.narrow(0, 1, 1) - alone).abs().max().double_value(&[]) < 1e-5);
    }

    #[test]
    fn a_larger_image_is_halved_once_more_and_what_does_not_fit_is_refused() {
        let _chance = crate::nets::testing::chance();
        let spec = VisualSpec { image_size: 224, channels: vec![2, 2, 2, 2, 3] };
        spec.check().unwrap();
        let store = nn::VarStore::new(Device::Cpu);
        let maps = HouseEncoder::new(&store.root(), &spec).encode(&[vec![9; 3 * 224 * 224]]);
        assert_eq!(maps.size(), [1, 3, SIDE, SIDE]);
        let refused = |image_size, channels| VisualSpec { image_size, channels }.check().unwrap_err().to_string();
        assert!(refused(112, vec![2; 5]).contains("visual_encoder.image_size is 112, not 224"));
        assert!(refused(7, Vec::new()).contains("visual_encoder.channels has 0 entries"));
    }

    #[test]
    fn frozen_it_sees_the_same() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(5);
        let store = nn::VarStore::new(Device::Cpu);
        let encoder = HouseEncoder::new(&store.root(), &VisualSpec { image_size: 112, channels: vec![4, 8, 8, 16] });
        let noise = Tensor::randint(255, [4, 3, 112, 112], (Kind::Uint8, Device::Cpu));
        // Batch norms that are not the identity.
        for _ in 0..20 {
            let _ = encoder.forward(&noise, true);
        }
        let images: Vec<Vec<u8>> = (0..4).map(|i| Vec::try_from(noise.get(i).flatten(0, -1)).unwrap()).collect();
        let frozen = encoder.frozen(&store).unwrap().share();
        let (slow, fast) = (encoder.encode(&images), frozen.encode(&images));
        assert!(slow.abs().max().double_value(&[]) > 0.1);
        assert!((slow - fast).abs().max().double_value(&[]) < 1e-5);
    }
}
