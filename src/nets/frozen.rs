//! Frozen encoders: what turns frames into feature maps once it is no longer trained.

use tch::{Kind, Tensor, nn};

use crate::house::view::Frame;

/// A visual encoder that only computes.
pub(crate) trait FrameEncoder: Send {
    /// What it reads of a frame: planes of bytes, red, green, blue.
    fn image(&self, frame: &Frame) -> Vec<u8>;

    /// Channels of a map; a map has [`super::visual::SIDE`] rows and columns.
    fn features(&self) -> i64;

    /// Maps `[n, features, 7, 7]` of images, without gradients.
    fn encode(&self, images: &[Vec<u8>]) -> Tensor;

    /// Identifies its weights.
    fn digest(&self) -> &str;

    /// The same encoder for another thread; the weights are shared.
    fn share(&self) -> Box<dyn FrameEncoder>;
}

/// Images of one size as a tensor `[n, planes, side, side]` of bytes, laid out with the channels last: convolutions run faster so.
pub(super) fn stacked(images: &[Vec<u8>], planes: usize) -> Tensor {
    let side = images.first().map_or(0, |image| (image.len() / planes).isqrt() as i64);
    channels_last(&Tensor::from_slice(&images.concat()).view([images.len() as i64, planes as i64, side, side]))
}

fn channels_last(tensor: &Tensor) -> Tensor {
    tensor.permute([0, 2, 3, 1]).contiguous().permute([0, 3, 1, 2])
}

/// The parts of a batch norm, and what its variances are kept from 0 by.
pub(super) struct BatchNormParts<'a> {
    pub(super) weight: &'a Tensor,
    pub(super) bias: &'a Tensor,
    pub(super) mean: &'a Tensor,
    pub(super) variance: &'a Tensor,
    pub(super) epsilon: f64,
}

impl<'a> BatchNormParts<'a> {
    /// Of a trained layer with the usual epsilon; nothing when it has no weights.
    pub(super) fn of(norm: &'a nn::BatchNorm) -> Option<BatchNormParts<'a>> {
        let (weight, bias) = (norm.ws.as_ref()?, norm.bs.as_ref()?);
        Some(BatchNormParts { weight, bias, mean: &norm.running_mean, variance: &norm.running_var, epsilon: 1e-5 })
    }
}

/// A convolution without bias with the batch norm after it folded in.
#[derive(Debug)]
pub(super) struct FoldedConv {
    weight: Tensor,
    bias: Tensor,
    stride: i64,
    padding: i64,
}

impl FoldedConv {
    pub(super) fn new(weight: &Tensor, norm: Option<&BatchNormParts<'_>>, stride: i64) -> FoldedConv {
        tch::no_grad(|| {
            let padding = weight.size()[2] / 2;
            let (weight, bias) = match norm {
                Some(norm) => {
                    let scale = norm.weight / (norm.variance + norm.epsilon).sqrt();
                    (weight * scale.view([-1, 1, 1, 1]), norm.bias - norm.mean * scale)
                }
                None => (weight.copy(), Tensor::zeros([weight.size()[0]], (Kind::Float, weight.device()))),
            };
            FoldedConv { weight: channels_last(&weight.detach()), bias: bias.detach(), stride, padding }
        })
    }

    pub(super) fn forward(&self, x: &Tensor) -> Tensor {
        let (stride, padding) = ([self.stride; 2], [self.padding; 2]);
        x.conv2d(&self.weight, Some(&self.bias), stride, padding, [1, 1], 1)
    }

    pub(super) fn forward_relu(&self, x: &Tensor) -> Tensor {
        self.forward(x).relu_()
    }

    pub(super) fn share(&self) -> FoldedConv {
        FoldedConv { weight: self.weight.shallow_clone(), bias: self.bias.shallow_clone(), ..*self }
    }
}
