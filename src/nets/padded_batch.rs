//! Texts of unlike lengths as a rectangle of tokens.

use tch::{Device, Kind, Tensor};

use super::opt::Rows;

/// Texts in a rectangle, each with padding before it.
pub(super) struct PaddedBatch {
    ids: Tensor,
    places: Tensor,
    hidden: Tensor,
}

impl PaddedBatch {
    /// Texts that begin at the place `first`.
    pub(super) fn of(texts: &[Vec<u32>], first: usize, device: Device) -> PaddedBatch {
        let longest = texts.iter().map(Vec::len).max().unwrap_or(0);
        let (mut ids, mut places, mut padding) = (Vec::new(), Vec::new(), Vec::new());
        for text in texts {
            let pads = longest - text.len();
            ids.extend(std::iter::repeat_n(0, pads).chain(text.iter().map(|&id| i64::from(id))));
            places.extend(std::iter::repeat_n(0, pads).chain((first..first + text.len()).map(|place| place as i64)));
            padding.push(pads as i64);
        }
        let shape = [texts.len() as i64, longest as i64];
        let column = Tensor::arange(longest as i64, (Kind::Int64, Device::Cpu));
        let padded = column.view([1, 1, 1, -1]).lt_tensor(&Tensor::from_slice(&padding).view([-1, 1, 1, 1]));
        let later = column.view([1, -1]).gt_tensor(&column.view([-1, 1])).view([1, 1, longest as i64, longest as i64]);
        PaddedBatch {
            ids: Tensor::from_slice(&ids).view(shape).to_device(device),
            places: Tensor::from_slice(&places).view(shape).to_device(device),
            hidden: padded.logical_or(&later).to_device(device),
        }
    }

    /// How many tokens a row has.
    pub(super) fn width(&self) -> i64 {
        self.ids.size()[1]
    }

    pub(super) fn rows(&self) -> Rows<'_> {
        Rows { ids: &self.ids, places: &self.places, hidden: &self.hidden }
    }

    pub(super) fn select(&self, rows: &Tensor) -> PaddedBatch {
        let of = |tensor: &Tensor| tensor.index_select(0, rows);
        PaddedBatch { ids: of(&self.ids), places: of(&self.places), hidden: of(&self.hidden) }
    }

    /// One more token in each row, after those that were read.
    pub(super) fn next(&self, tokens: &[i64]) -> PaddedBatch {
        let seen = self.hidden.narrow(2, self.hidden.size()[2] - 1, 1);
        let one = Tensor::zeros([tokens.len() as i64, 1, 1, 1], (Kind::Bool, self.ids.device()));
        PaddedBatch {
            ids: Tensor::from_slice(tokens).view([-1, 1]).to_device(self.ids.device()),
            places: self.places.narrow(1, self.places.size()[1] - 1, 1) + 1,
            hidden: Tensor::cat(&[seen, one], 3),
        }
    }
}
