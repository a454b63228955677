//! One vector from a text's token vectors, as a sentence-transformers pooling module says.

use std::path::Path;

use anyhow::{Context, bail};
use serde::Deserialize;
use tch::{Kind, Tensor};

use crate::data::text_file;

/// A way to pool; several are concatenated in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pooling {
    /// The first token's vector.
    First,
    /// The largest value of each unit.
    Max,
    /// The average.
    Mean,
    /// The sum divided by the square root of the number of tokens.
    MeanSqrt,
}

/// `1_Pooling/config.json`: the published field names, older and newer.
#[derive(Deserialize)]
struct PoolingFile {
    #[serde(default)]
    pooling_mode: Option<String>,
    #[serde(default)]
    pooling_mode_cls_token: bool,
    #[serde(default)]
    pooling_mode_max_tokens: bool,
    #[serde(default)]
    pooling_mode_mean_tokens: bool,
    #[serde(default)]
    pooling_mode_mean_sqrt_len_tokens: bool,
    #[serde(default)]
    pooling_mode_weightedmean_tokens: bool,
    #[serde(default)]
    pooling_mode_lasttoken: bool,
}

impl Pooling {
    /// The ways to pool that a module's `config.json` asks for.
    pub(super) fn read(path: &Path) -> anyhow::Result<Vec<Pooling>> {
        let text = text_file::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
        let file: PoolingFile = serde_json::from_str(&text).with_context(|| format!("{}", path.display()))?;
        if let Some(mode) = &file.pooling_mode {
            return Ok(vec![match mode.as_str() {
                "cls" => Pooling::First,
                "max" => Pooling::Max,
                "mean" => Pooling::Mean,
                "mean_sqrt_len_tokens" => Pooling::MeanSqrt,
                other => bail!("{}: pooling_mode {other:?} is not supported", path.display()),
            }]);
        }
        if file.pooling_mode_weightedmean_tokens || file.pooling_mode_lasttoken {
            bail!("{}: pooling by weighted mean or last token is not supported", path.display());
        }
        let modes: Vec<Pooling> = [
            (file.pooling_mode_cls_token, Pooling::First),
            (file.pooling_mode_max_tokens, Pooling::Max),
            (file.pooling_mode_mean_tokens, Pooling::Mean),
            (file.pooling_mode_mean_sqrt_len_tokens, Pooling::MeanSqrt),
        ]
        .into_iter()
        .filter_map(|(asked, mode)| asked.then_some(mode))
        .collect();
        anyhow::ensure!(!modes.is_empty(), "{}: no pooling mode is chosen", path.display());
        Ok(modes)
    }

    /// `[batch, hidden]` from token vectors `[batch, tokens, hidden]` and their mask `[batch, tokens]`.
    pub(super) fn pool(self, tokens: &Tensor, mask: &Tensor) -> Tensor {
        let mask = mask.to_kind(Kind::Float).unsqueeze(2);
        let count = || mask.sum_dim_intlist(1, false, Kind::Float).clamp_min(1e-9);
        let sum = || (tokens * &mask).sum_dim_intlist(1, false, Kind::Float);
        match self {
            Pooling::First => tokens.select(1, 0),
            Pooling::Max => tokens.masked_fill(&mask.eq(0.0), f64::from(f32::MIN)).amax(1, false),
            Pooling::Mean => sum() / count(),
            Pooling::MeanSqrt => sum() / count().sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padding_does_not_count_in_any_way_of_pooling() {
        let tokens = Tensor::from_slice(&[1.0f32, -4.0, 3.0, -2.0, 100.0, 100.0]).reshape([1, 3, 2]);
        let mask = Tensor::from_slice(&[1i64, 1, 0]).reshape([1, 3]);
        let check = |mode: Pooling, expected: [f32; 2]| {
            let pooled: Vec<f32> = Vec::try_from(mode.pool(&tokens, &mask).flatten(0, -1)).unwrap();
            assert!(pooled.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{mode:?}: {pooled:?}");
        };
        check(Pooling::First, [1.0, -4.0]);
        check(Pooling::Max, [3.0, -2.0]);
        check(Pooling::Mean, [2.0, -3.0]);
        check(Pooling::MeanSqrt, [4.0 / 2f32.sqrt(), -6.0 / 2f32.sqrt()]);
    }
}
