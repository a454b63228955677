//! ResNet-18 as torchvision publishes it, without its classifier: from a 224 x 224 image to 512 x 7 x 7.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use tch::{Device, Kind, Tensor};

use super::frozen::{BatchNormParts, FoldedConv, FrameEncoder, stacked};
use super::resize::resize_bilinear;
use super::weights::{self, TensorSpec, Tensors};
use crate::house::view::Frame;

/// The side of the image it reads, in pixels.
pub(crate) const INPUT: usize = 224;
/// Channels of its maps.
pub(crate) const FEATURES: i64 = 512;
/// The means and deviations of ImageNet's colours, of 1.
const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
const DEVIATION: [f32; 3] = [0.229, 0.224, 0.225];

/// The trunk of a ResNet-18, batch norms folded in.
#[derive(Debug)]
pub struct ResNet18 {
    stem: FoldedConv,
    blocks: Vec<Block>,
    mean: Tensor,
    deviation: Tensor,
    device: Device,
    digest: String,
}

#[derive(Debug)]
struct Block {
    first: FoldedConv,
    second: FoldedConv,
    /// What brings the input into the output's shape, where that is another one.
    shortcut: Option<FoldedConv>,
}

/// The two blocks of each layer: their names, channels before and after, and stride.
fn blocks() -> impl Iterator<Item = (String, i64, i64, i64)> {
    [(64, 64, 1), (64, 128, 2), (128, 256, 2), (256, 512, 2)].into_iter().enumerate().flat_map(
        |(i, (from, to, stride))| {
            [(format!("layer{}.0", i + 1), from, to, stride), (format!("layer{}.1", i + 1), to, to, 1)]
        },
    )
}

/// The name of every tensor that is used, with its form.
pub fn forms() -> BTreeMap<String, TensorSpec> {
    let mut forms = BTreeMap::new();
    let mut layer = |conv: String, norm: String, shape: [i64; 4]| {
        forms.insert(format!("{conv}.weight"), TensorSpec::float(&shape));
        for part in ["weight", "bias", "running_mean", "running_var"] {
            forms.insert(format!("{norm}.{part}"), TensorSpec::float(&shape[..1]));
        }
    };
    layer("conv1".into(), "bn1".into(), [64, 3, 7, 7]);
    for (name, from, to, stride) in blocks() {
        layer(format!("{name}.conv1"), format!("{name}.bn1"), [to, from, 3, 3]);
        layer(format!("{name}.conv2"), format!("{name}.bn2"), [to, to, 3, 3]);
        if stride > 1 {
            layer(format!("{name}.downsample.0"), format!("{name}.downsample.1"), [to, from, 1, 1]);
        }
    }
    forms
}

impl ResNet18 {
    /// Reads torchvision's tensors from a safetensors file; those of its classifier, and its counters, are passed over.
    ///
    /// # Errors
    /// When the file cannot be read, or tensors are missing, unknown or of another shape: each is named.
    pub(crate) fn read(path: &Path, device: Device) -> anyhow::Result<ResNet18> {
        let mut tensors = weights::read(path)?;
        tensors.retain(|name, _| !name.starts_with("fc.") && !name.ends_with(".num_batches_tracked"));
        weights::check(path, &tensors, &forms())
            .context("these are not torchvision's weights of ResNet-18; assets/convert_resnet18.py writes them")?;
        let digest = weights::digest(tensors.iter().map(|(name, tensor)| (name.clone(), tensor.shallow_clone())))?;
        let tensors: Tensors = tensors.into_iter().map(|(name, tensor)| (name, tensor.to_device(device))).collect();
        let get = |name: String| tensors.get(&name).with_context(|| format!("the tensor {name} is missing"));
        let folded = |conv: &str, norm: &str, stride: i64| -> anyhow::Result<FoldedConv> {
            let norm = BatchNormParts {
                weight: get(format!("{norm}.weight"))?,
                bias: get(format!("{norm}.bias"))?,
                mean: get(format!("{norm}.running_mean"))?,
                variance: get(format!("{norm}.running_var"))?,
                epsilon: 1e-5,
            };
            Ok(FoldedConv::new(get(format!("{conv}.weight"))?, Some(&norm), stride))
        };
        let block = |(name, _, _, stride): (String, i64, i64, i64)| -> anyhow::Result<Block> {
            let [one, two, down] = ["conv1", "conv2", "downsample.0"].map(|part| format!("{name}.{part}"));
            let shortcut = (stride > 1).then(|| folded(&down, &format!("{name}.downsample.1"), stride)).transpose()?;
            Ok(Block {
                first: folded(&one, &format!("{name}.bn1"), stride)?,
                second: folded(&two, &format!("{name}.bn2"), 1)?,
                shortcut,
            })
        };
        let colours = |values: [f32; 3]| {
            Tensor::from_slice(&values.map(|value| 255.0 * value)).view([1, 3, 1, 1]).to_device(device)
        };
        Ok(ResNet18 {
            stem: folded("conv1", "bn1", 2)?,
            blocks: blocks().map(block).collect::<anyhow::Result<_>>()?,
            mean: colours(MEAN),
            deviation: colours(DEVIATION),
            device,
            digest,
        })
    }
}

impl Block {
    fn forward(&self, x: &Tensor) -> Tensor {
        let change = self.second.forward(&self.first.forward_relu(x));
        match &self.shortcut {
            Some(shortcut) => (change + shortcut.forward(x)).relu_(),
            None => (change + x).relu_(),
        }
    }

    fn share(&self) -> Block {
        Block {
            first: self.first.share(),
            second: self.second.share(),
            shortcut: self.shortcut.as_ref().map(FoldedConv::share),
        }
    }
}

impl FrameEncoder for ResNet18 {
    fn image(&self, frame: &Frame) -> Vec<u8> {
        resize_bilinear(&frame.rgb, frame.width, INPUT)
    }

    fn features(&self) -> i64 {
        FEATURES
    }

    fn encode(&self, images: &[Vec<u8>]) -> Tensor {
        tch::no_grad(|| {
            let pixels = stacked(images, 3).to_device(self.device).to_kind(Kind::Float);
            let stem = self.stem.forward_relu(&((pixels - &self.mean) / &self.deviation));
            let pooled = stem.max_pool2d([3, 3], [2, 2], [1, 1], [1, 1], false);
            self.blocks.iter().fold(pooled, |x, block| block.forward(&x)).contiguous()
        })
    }

    fn digest(&self) -> &str {
        &self.digest
    }

    fn share(&self) -> Box<dyn FrameEncoder> {
        Box::new(ResNet18 {
            stem: self.stem.share(),
            blocks: self.blocks.iter().map(Block::share).collect(),
            mean: self.mean.shallow_clone(),
            deviation: self.deviation.shallow_clone(),
            device: self.device,
            digest: self.digest.clone(),
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// The number at a position of a tensor, between -0.5 and 0.5: an integer hash that `tests/resnet18_expected.py` computes too.
    fn number(name: &str, position: u32) -> f32 {
        let seed = name.bytes().fold(7u32, |sum, byte| sum.wrapping_mul(31).wrapping_add(u32::from(byte)));
        let mut x = position.wrapping_mul(2_654_435_761).wrapping_add(seed);
        x = (x ^ (x >> 15)).wrapping_mul(0x2c1b_3c6d);
        x = (x ^ (x >> 12)).wrapping_mul(0x297a_2d39);
        x ^= x >> 15;
        (x >> 8) as f32 / 16_777_216.0 - 0.5
    }

    /// Weights by formula, so that none are stored.
    fn tensors() -> Tensors {
        let make = |(name, form): (String, TensorSpec)| {
            let count: i64 = form.shape.iter().product();
            let inputs: i64 = form.shape[1..].iter().product();
            let value = |position: u32| {
                let chance = number(&name, position);
                match name.rsplit('.').next() {
                    Some("running_var") => 1.0 + chance,
                    Some("weight") if form.shape.len() == 1 => 1.0 + 0.4 * chance,
                    Some("weight") => chance * (14.0 / inputs as f32).sqrt(),
                    _ => 0.4 * chance,
                }
            };
            let numbers: Vec<f32> = (0..count as u32).map(value).collect();
            let tensor = Tensor::from_slice(&numbers).view(form.shape.as_slice());
            (name, tensor)
        };
        forms().into_iter().map(make).collect()
    }

    /// Writes those weights as a file.
    pub(in crate::nets) fn write_weights(path: &Path) {
        weights::write(path, &tensors(), &BTreeMap::new()).unwrap();
    }

    #[test]
    fn it_computes_what_torchvision_computes() {
        let _chance = crate::nets::testing::chance();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("resnet18.safetensors");
        let mut all = tensors();
        all.insert("fc.weight".into(), Tensor::from_slice(&[0f32]));
        all.insert("bn1.num_batches_tracked".into(), Tensor::from(3i64));
        weights::write(&path, &all, &BTreeMap::new()).unwrap();
        let net = ResNet18::read(&path, Device::Cpu).unwrap();
        let image: Vec<u8> = (0..3 * 224 * 224).map(|i| ((number("image", i) + 0.5) * 256.0) as u8).collect();
        let maps = net.share().encode(&[image.clone(), image]);
        assert_eq!(maps.size(), [2, FEATURES, 7, 7]);
        let flat: Vec<f32> = maps.get(1).flatten(0, -1).try_into().unwrap();
        // torchvision 0.26.0 with torch 2.11.0; every 392nd number of 512 x 7 x 7, see tests/resnet18_expected.py.
        for (i, expected) in EXPECTED.into_iter().enumerate() {
            let found = flat[392 * i];
            assert!((found - expected).abs() < 1e-4, "{i}: {found}, not {expected}");
        }
        assert!(EXPECTED.iter().filter(|&&number| number > 0.1).count() > 20);
    }

    #[test]
    fn what_is_missing_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("other.safetensors");
        let few: Tensors =
            [("conv1.weight".to_string(), Tensor::from_slice(&[0f32])), ("head".into(), Tensor::from(1f32))].into();
        weights::write(&path, &few, &BTreeMap::new()).unwrap();
        let error = format!("{:#}", ResNet18::read(&path, Device::Cpu).unwrap_err());
        for wanted in
            ["layer4.0.downsample.1.running_var", "unknown head", "conv1.weight is Float[1]", "other.safetensors"]
        {
            assert!(error.contains(wanted), "{wanted}: {error}");
        }
    }

    #[rustfmt::skip]
    const EXPECTED: [f32; 64] = [
        0.0, 1.59039, 0.0, 2.829638, 6.66832, 4.653997, 0.638719, 0.0, 0.0, 4.099325,
        0.459895, 2.418564, 1.123649, 7.36107, 0.0, 1.220538, 0.0, 6.105746, 0.0, 3.06038,
        1.766012, 0.0, 0.0, 0.826398, 5.207397, 0.0, 9.167113, 5.360849, 0.0, 6.117403,
        5.47023, 2.347857, 0.0, 1.205469, 2.260578, 4.514328, 3.599066, 2.20234, 9.803945, 0.0,
        0.0, 2.756832, 0.0, 1.030056, 0.755769, 0.0, 0.0, 0.0, 2.72169, 1.03927,
        3.232743, 0.038314, 3.870729, 0.0, 0.0, 0.0, 7.590761, 3.005496, 2.571429, 9.360991,
        0.07725, 8.212075, 7.1559, 1.934957,
    ];
}
