//! The detector: from a frame with depth to what shows in each of 40 x 40 places, at a resolution at which a cup across the
//! room is a place of its own. A residual encoder with a feature pyramid (Lin et al., 2017) down to a quarter of the image.

use serde::{Deserialize, Serialize};
use tch::nn;
use tch::{Device, Kind, Tensor};

use super::bounds;
use super::frozen::{FoldedConv, stacked};
use super::precision::Precision;
use super::resize::resize_area;
use super::visual::{ConvNorm, FoldedStage, ResidualStage};
use crate::domain::Class;
use crate::house::view::Frame;

/// The side of the image that the detector reads, in pixels.
const IMAGE: usize = 160;
/// Places in a row of what it says.
pub(crate) const GRID: usize = 40;
/// Labels of a place: the classes that may show there, and whether something there stands open or is switched on.
pub(crate) const LABELS: usize = Class::VOCABULARY + 1;
/// Planes of the image: red, green, blue, and nearness.
const PLANES: usize = 4;

/// The size of a detector.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DetectorSpec {
    /// Channels at 1/2, 1/4, 1/8 of the image and so on; at least four.
    pub(crate) channels: Vec<i64>,
    /// Channels of the pyramid, on which the labels are read.
    pub(crate) pyramid: i64,
}

impl DetectorSpec {
    /// Whether such a detector can be built.
    ///
    /// # Errors
    /// Names the field that is out of its bounds.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        let levels = self.channels.len();
        anyhow::ensure!((4..=5).contains(&levels), "detector.channels has {levels} entries, not 4 to 5");
        bounds::sizes("detector.channels", &self.channels, 4096)?;
        bounds::sizes("detector.pyramid", &[self.pyramid], 4096)
    }

    /// What the detector reads of a frame: planes of bytes.
    pub(crate) fn image(frame: &Frame) -> Vec<u8> {
        let mut planes = resize_area(&frame.rgb, frame.width, IMAGE);
        // A quarter of a metre is white, infinitely far is black.
        let nearness = |depth: f32| (64.0 / depth.max(0.25)) as u8;
        for y in 0..IMAGE {
            let row = (2 * y + 1) * frame.height / (2 * IMAGE) * frame.width;
            planes.extend((0..IMAGE).map(|x| nearness(frame.depth[row + (2 * x + 1) * frame.width / (2 * IMAGE)])));
        }
        planes
    }
}

/// A detector that learns.
#[derive(Debug)]
pub(crate) struct Detector {
    stem: ConvNorm,
    /// At 1/4, 1/8 and so on.
    stages: Vec<ResidualStage>,
    /// To the pyramid's channels, one for each stage.
    laterals: Vec<ConvNorm>,
    /// After the laterals are added up: at 1/8 and at 1/4.
    smooth: [ConvNorm; 2],
    labels: nn::Conv2D,
    device: Device,
}

impl Detector {
    /// A detector with fresh weights under `path`.
    pub(crate) fn new(path: &nn::Path<'_>, spec: &DetectorSpec) -> Detector {
        let DetectorSpec { channels, pyramid } = spec;
        let stage =
            |(i, pair): (usize, &[i64])| ResidualStage::new(&(path / format!("stage{}", i + 1)), pair[0], pair[1]);
        let lateral =
            |(i, &from): (usize, &i64)| ConvNorm::new(&(path / format!("lateral{}", i + 1)), from, *pyramid, 1);
        // Nearly every label is absent nearly everywhere.
        let config = nn::ConvConfig { bs_init: nn::Init::Const(-4.0), ..Default::default() };
        Detector {
            stem: ConvNorm::new(&(path / "stem"), PLANES as i64, channels[0], 2),
            stages: channels.windows(2).enumerate().map(stage).collect(),
            laterals: channels[1..].iter().enumerate().map(lateral).collect(),
            smooth: ["smooth8", "smooth4"].map(|name| ConvNorm::new(&(path / name), *pyramid, *pyramid, 1)),
            labels: nn::conv2d(path / "labels", *pyramid, LABELS as i64, 1, config),
            device: path.device(),
        }
    }

    /// The device of its weights.
    pub(crate) fn device(&self) -> Device {
        self.device
    }

    /// `pixels` [n, 4, 160, 160] of bytes to logits [n, 83, 40, 40].
    pub(crate) fn forward(&self, precision: Precision, pixels: &Tensor, train: bool) -> Tensor {
        let x = precision.cast(&normalised(&pixels.to_device(self.device)));
        let mut x = self.stem.forward(&x, train).relu();
        let mut levels = Vec::with_capacity(self.stages.len());
        for (stage, lateral) in self.stages.iter().zip(&self.laterals) {
            x = stage.forward(&x, train);
            levels.push(lateral.forward(&x, train));
        }
        let x = pyramid(levels, |level, x| self.smooth[level].forward(x, train));
        x.to_kind(Kind::Float).conv2d(&self.labels.ws, self.labels.bs.as_ref(), [1], [0], [1], 1)
    }

    /// The detector as it is now, for computing alone.
    pub(crate) fn frozen(&self) -> FrozenDetector {
        FrozenDetector {
            stem: self.stem.folded(),
            stages: self.stages.iter().map(ResidualStage::folded).collect(),
            laterals: self.laterals.iter().map(ConvNorm::folded).collect(),
            smooth: self.smooth.each_ref().map(ConvNorm::folded),
            labels: (self.labels.ws.detach(), self.labels.bs.as_ref().map(Tensor::detach)),
            device: self.device,
        }
    }
}

/// Bytes as the networks read them.
fn normalised(pixels: &Tensor) -> Tensor {
    (pixels.to_kind(Kind::Float) - 127.5) / 64.0
}

/// Adds the levels up from the coarsest to the finest; the two finest are smoothed, `smooth(0)` at 1/8 and `smooth(1)` at 1/4.
fn pyramid(levels: Vec<Tensor>, smooth: impl Fn(usize, &Tensor) -> Tensor) -> Tensor {
    let from_coarsest = levels.into_iter().enumerate().rev();
    let add = |coarser: Option<Tensor>, (level, finer): (usize, Tensor)| {
        let Some(coarser) = coarser else { return Some(finer.relu()) };
        let size = finer.size();
        let sum = (finer + coarser.upsample_nearest2d([size[2], size[3]], None, None)).relu();
        Some(if level < 2 { smooth(1 - level, &sum).relu() } else { sum })
    };
    from_coarsest.fold(None, add).unwrap_or_default()
}

/// A trained detector that only computes.
#[derive(Debug)]
pub(crate) struct FrozenDetector {
    stem: FoldedConv,
    stages: Vec<FoldedStage>,
    laterals: Vec<FoldedConv>,
    smooth: [FoldedConv; 2],
    labels: (Tensor, Option<Tensor>),
    device: Device,
}

impl FrozenDetector {
    /// Probabilities [n, 83, 40, 40] of images (see [`DetectorSpec::image`]).
    pub(crate) fn detect(&self, images: &[Vec<u8>]) -> Tensor {
        tch::no_grad(|| {
            let pixels = stacked(images, PLANES).to_device(self.device);
            let mut x = self.stem.forward_relu(&normalised(&pixels));
            let mut levels = Vec::with_capacity(self.stages.len());
            for (stage, lateral) in self.stages.iter().zip(&self.laterals) {
                x = stage.forward(&x);
                levels.push(lateral.forward(&x));
            }
            let x = pyramid(levels, |level, x| self.smooth[level].forward(x));
            x.conv2d(&self.labels.0, self.labels.1.as_ref(), [1], [0], [1], 1).sigmoid()
        })
    }

    /// The same detector for another thread; the weights are shared.
    pub(crate) fn share(&self) -> FrozenDetector {
        FrozenDetector {
            stem: self.stem.share(),
            stages: self.stages.iter().map(FoldedStage::share).collect(),
            laterals: self.laterals.iter().map(FoldedConv::share).collect(),
            smooth: self.smooth.each_ref().map(FoldedConv::share),
            labels: (self.labels.0.shallow_clone(), self.labels.1.as_ref().map(Tensor::shallow_clone)),
            device: self.device,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::house::House;
    use crate::house::render::Renderer;
    use crate::house::testing::kitchen;

    #[test]
    fn frozen_it_says_the_same_of_every_place() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(5);
        let store = nn::VarStore::new(Device::Cpu);
        let spec = DetectorSpec { channels: vec![4, 6, 8, 10], pyramid: 8 };
        spec.check().unwrap();
        let detector = Detector::new(&store.root(), &spec);
        let noise = Tensor::randint(255, [4, PLANES as i64, IMAGE as i64, IMAGE as i64], (Kind::Uint8, Device::Cpu));
        // Batch norms that are not the identity.
        for _ in 0..10 {
            let _ = detector.forward(Precision::Full, &noise, true);
        }
        let (scene, world) = kitchen();
        let image = DetectorSpec::image(Renderer::new(House::FRAME).draw(&scene, &world));
        let pixels = Tensor::from_slice(&image).view([1, PLANES as i64, IMAGE as i64, IMAGE as i64]);
        let slow = tch::no_grad(|| detector.forward(Precision::Full, &pixels, false)).sigmoid();
        assert_eq!(slow.size(), [1, LABELS as i64, GRID as i64, GRID as i64]);
        let fast = detector.frozen().share().detect(&[image]);
        assert!((slow - fast).abs().max().double_value(&[]) < 1e-5);
    }

    #[test]
    fn what_is_near_is_light_in_the_plane_of_depth() {
        let (width, height) = (300, 300);
        let mut depth = vec![f32::INFINITY; width * height];
        depth[..150 * 300].fill(0.5);
        let frame = Frame { width, height, rgb: vec![0; 270_000], depth, ids: vec![0; 90_000] };
        let image = DetectorSpec::image(&frame);
        let plane = &image[3 * IMAGE * IMAGE..];
        assert_eq!((plane[0], plane[IMAGE * IMAGE - 1]), (128, 0));
    }
}
