//! FiLM: a sentence scales and shifts the channels of a convolution (Perez et al., 2018).

use tch::Tensor;
use tch::nn::{self, Init};

use super::precision;

/// Per-channel scale and shift, read off a sentence embedding. It starts as the identity.
#[derive(Debug)]
pub(crate) struct Film {
    scale: nn::Linear,
    shift: nn::Linear,
}

impl Film {
    /// Modulates `channels` channels by an embedding of `width` numbers.
    pub(crate) fn new(path: &nn::Path<'_>, width: i64, channels: i64) -> Film {
        let zero = nn::LinearConfig { ws_init: Init::Const(0.0), bs_init: Some(Init::Const(0.0)), bias: true };
        Film {
            scale: nn::linear(path / "scale", width, channels, zero),
            shift: nn::linear(path / "shift", width, channels, zero),
        }
    }

    /// `features` [n, channels, h, w] by `sentence` [n, width].
    pub(crate) fn forward(&self, features: &Tensor, sentence: &Tensor) -> Tensor {
        let spread = |per_channel: Tensor| per_channel.unsqueeze(-1).unsqueeze(-1);
        // In place, as much as the gradient allows: for maps this small memory costs as much as arithmetic.
        let mut scaled = features * (spread(precision::linear(&self.scale, sentence)) + 1.0);
        scaled += spread(precision::linear(&self.shift, sentence));
        scaled
    }
}

#[cfg(test)]
mod tests {
    use tch::{Device, Kind};

    use super::*;

    #[test]
    fn film_starts_as_the_identity_and_then_follows_the_sentence() {
        let _chance = crate::nets::testing::chance();
        let store = nn::VarStore::new(Device::Cpu);
        let mut film = Film::new(&store.root(), 3, 2);
        let features = Tensor::rand([1, 2, 4, 4], (Kind::Float, Device::Cpu));
        let sentence = Tensor::from_slice(&[1.0f32, 0.0, 0.0]).unsqueeze(0);
        assert_eq!(film.forward(&features, &sentence), features);
        tch::no_grad(|| {
            let _ = film.scale.ws.f_copy_(&Tensor::from_slice2(&[[1.0f32, 0.0, 0.0], [0.0, 0.0, 0.0]]));
            let _ = film.shift.ws.f_copy_(&Tensor::from_slice2(&[[0.0f32, 0.0, 0.0], [5.0, 0.0, 0.0]]));
        });
        let seen = film.forward(&features, &sentence);
        assert_eq!(seen.select(1, 0), features.select(1, 0) * 2.0);
        assert_eq!(seen.select(1, 1), features.select(1, 1) + 5.0);
    }
}
