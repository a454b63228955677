//! Mixed precision (Micikevicius et al., 2018): layers compute as wide as what they read, while their weights, the statistics
//! of batch norm and all losses keep 32 bits.

use serde::{Deserialize, Serialize};
use tch::{Kind, Tensor, nn};

/// How wide the numbers are that networks compute with while they learn; when they act, always 32 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Precision {
    /// 32 bits.
    #[default]
    Full,
    /// 16 bits with the range of 32 (bfloat16): no loss needs scaling.
    Mixed,
}

impl Precision {
    /// `maps` [n, channels, h, w] as a network in training is to see them. Narrow ones lie channel by channel in memory, as the
    /// kernels for them read it.
    pub(crate) fn cast(self, maps: &Tensor) -> Tensor {
        match self {
            Precision::Full => maps.to_kind(Kind::Float),
            Precision::Mixed => maps.permute([0, 2, 3, 1]).to_kind(Kind::BFloat16).contiguous().permute([0, 3, 1, 2]),
        }
    }
}

/// A layer of `x` [n, from].
pub(crate) fn linear(layer: &nn::Linear, x: &Tensor) -> Tensor {
    x.linear(&layer.ws.to_kind(x.kind()), layer.bs.as_ref().map(|bias| bias.to_kind(x.kind())))
}

/// The same in 32 bits, whatever the width of `x`.
pub(crate) fn linear_f32(layer: &nn::Linear, x: &Tensor) -> Tensor {
    linear(layer, &x.to_kind(Kind::Float))
}

/// A convolution of `x` [n, from, h, w] without bias, padded so that at a stride of 1 the places stay as many.
pub(crate) fn convolution(layer: &nn::Conv2D, x: &Tensor, stride: i64) -> Tensor {
    let padding = layer.ws.size()[2] / 2;
    x.conv2d(&layer.ws.to_kind(x.kind()), None::<Tensor>, [stride], [padding], [1], 1)
}

#[cfg(test)]
mod tests {
    use tch::Device;

    use super::*;

    /// How far apart two tensors are, in shares of the larger one's greatest number.
    fn apart(one: &Tensor, other: &Tensor) -> f64 {
        let (one, other) = (one.to_kind(Kind::Double), other.to_kind(Kind::Double));
        ((&one - &other).abs().max() / one.abs().max()).double_value(&[])
    }

    #[test]
    fn layers_compute_as_wide_as_what_they_read_and_nearly_the_same() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(3);
        let store = nn::VarStore::new(Device::Cpu);
        let config = nn::ConvConfig { padding: 1, stride: 2, bias: false, ..Default::default() };
        let conv = nn::conv2d(store.root() / "conv", 6, 8, 3, config);
        let layer = nn::linear(store.root() / "layer", 8 * 4 * 4, 5, Default::default());
        let maps = Tensor::rand([3, 6, 7, 7], (Kind::Half, Device::Cpu));
        let [full, mixed] = [Precision::Full, Precision::Mixed].map(|precision| {
            let x = convolution(&conv, &precision.cast(&maps), 2).flatten(1, -1);
            (linear(&layer, &x), linear_f32(&layer, &x))
        });
        assert_eq!([full.0.kind(), mixed.0.kind(), mixed.1.kind()], [Kind::Float, Kind::BFloat16, Kind::Float]);
        assert_eq!(full.0, maps.to_kind(Kind::Float).apply(&conv).flatten(1, -1).apply(&layer), "to the bit");
        let error = apart(&full.1, &mixed.1);
        assert!(0.0 < error && error < 0.02, "{error}");
    }
}
