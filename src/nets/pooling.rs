//! One vector from a text's token vectors, as a sentence-transformers pooling module says.

use std::path::Path;

use anyhow::{Context, bail, ensure};
use serde::Deserialize;
use tch::{Kind, Tensor};

use super::encoder_settings::Settings;

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

/// The flags of older files, in the order in which what they pool is joined.
const FLAGS: [(&str, Option<Pooling>); 6] = [
    ("pooling_mode_cls_token", Some(Pooling::First)),
    ("pooling_mode_max_tokens", Some(Pooling::Max)),
    ("pooling_mode_mean_tokens", Some(Pooling::Mean)),
    ("pooling_mode_mean_sqrt_len_tokens", Some(Pooling::MeanSqrt)),
    ("pooling_mode_weightedmean_tokens", None),
    ("pooling_mode_lasttoken", None),
];

/// The newer files' way to name them: one, or a list.
#[derive(Deserialize)]
#[serde(untagged)]
enum Named {
    One(String),
    Several(Vec<String>),
}

impl Pooling {
    /// The ways to pool that a module's `config.json` asks for, with the newer or the older field names, for token vectors of so
    /// many numbers; and the settings in it that nothing reads.
    pub(super) fn read(path: &Path, hidden: i64) -> anyhow::Result<(Vec<Pooling>, Option<String>)> {
        let name = path.display();
        ensure!(path.exists(), "{name} cannot be read: it is not there");
        let mut file = Settings::read(path)?;
        for field in ["word_embedding_dimension", "embedding_dimension"] {
            if let Some(width) = file.take::<i64>(field)? {
                ensure!(width == hidden, "{name}: {field} is {width}, the model's hidden_size is {hidden}");
            }
        }
        file.pass_over(&["include_prompt"]);
        let named =
            match file.take::<Named>("pooling_mode").with_context(|| format!("{name}: neither a name nor a list"))? {
                Some(Named::One(mode)) => Some(mode),
                Some(Named::Several(mut modes)) if modes.len() == 1 => modes.pop(),
                Some(Named::Several(modes)) => {
                    bail!("{name}: pooling_mode lists {:?}; one way to pool is supported, not several at once", modes)
                }
                None => None,
            };
        let mut modes = Vec::new();
        for (field, mode) in FLAGS {
            // A file of the newer form may hold the flags too.
            if file.take::<bool>(field)?.unwrap_or(false) && named.is_none() {
                modes.push(mode.with_context(|| format!("{name}: {field} is not supported"))?);
            }
        }
        if let Some(mode) = named {
            modes.push(match mode.as_str() {
                "cls" => Pooling::First,
                "max" => Pooling::Max,
                "mean" => Pooling::Mean,
                "mean_sqrt_len_tokens" => Pooling::MeanSqrt,
                other => bail!("{name}: pooling_mode {other:?} is not supported"),
            });
        }
        ensure!(!modes.is_empty(), "{name}: no pooling mode is chosen");
        Ok((modes, file.unread()))
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
    fn a_list_of_one_way_to_pool_is_taken_and_what_is_not_supported_is_refused_in_words() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("config.json");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Pooling::read(&path, 32).map_err(|error| format!("{error:#}"))
        };
        let taken = |text: &str| read(text).unwrap().0;
        assert_eq!(taken(r#"{"pooling_mode": ["mean"]}"#), [Pooling::Mean]);
        assert_eq!(taken(r#"{"pooling_mode": "cls", "pooling_mode_mean_tokens": true}"#), [Pooling::First]);
        let both = r#"{"embedding_dimension": 32, "pooling_mode_mean_tokens": true, "pooling_mode_cls_token": true}"#;
        assert_eq!(taken(both), [Pooling::First, Pooling::Mean]);
        for (text, told) in [
            (r#"{"pooling_mode": ["mean", "cls"]}"#, "one way to pool is supported"),
            (r#"{"pooling_mode": []}"#, "one way to pool is supported"),
            (r#"{"pooling_mode": ["lasttoken"]}"#, "lasttoken"),
            (r#"{"pooling_mode": 3}"#, "pooling_mode"),
            (r#"{"pooling_mode_lasttoken": true}"#, "pooling_mode_lasttoken"),
            (r#"{"pooling_mode": "mean", "word_embedding_dimension": 31}"#, "word_embedding_dimension"),
        ] {
            let error = read(text).err().unwrap();
            assert!(error.contains(told) && error.contains("config.json"), "{error}");
        }
        let unread = read(r#"{"pooling_mode": "mean", "weights": [1, 2]}"#).unwrap().1;
        assert_eq!(unread.as_deref(), Some("config.json: weights"));
    }

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
