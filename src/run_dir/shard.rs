//! A share of a run: one of several machines plays it, and the shares are merged afterwards.

use std::ops::Range;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// One of equal shares of a run's episodes, each a block in the run's order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(try_from = "Written")]
pub struct Shard {
    /// The number of this share, from 1.
    pub(crate) index: u32,
    /// How many shares the run has.
    pub(crate) of: u32,
}

/// A share as it stands in a file.
#[derive(Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct Written {
    index: u32,
    of: u32,
}

impl TryFrom<Written> for Shard {
    type Error = String;

    fn try_from(Written { index, of }: Written) -> Result<Shard, String> {
        match (1..=Shard::MOST).contains(&of) && (1..=of).contains(&index) {
            true => Ok(Shard { index, of }),
            false => Err(format!("{index}/{of}: shares are counted from 1 to N, at most {}", Shard::MOST)),
        }
    }
}

impl Shard {
    /// The most shares of a run.
    const MOST: u32 = 10_000;
    /// The folder under a run's own that holds its shares.
    pub(crate) const FOLDER: &str = "shards";

    /// The share of the job of a Slurm array, from what its environment says.
    ///
    /// # Errors
    /// When the variables are not there, or the array's numbers are not consecutive.
    pub(crate) fn of_slurm(variable: impl Fn(&str) -> Option<String>) -> Result<Shard, String> {
        let number = |name: &str| -> Result<u32, String> {
            let text = variable(name).ok_or_else(|| {
                format!("{name} is not set: --shard slurm is for a job of a Slurm array (sbatch --array)")
            })?;
            text.parse().map_err(|_| format!("{name} is {text:?}, not a number"))
        };
        let (id, of) = (number("SLURM_ARRAY_TASK_ID")?, number("SLURM_ARRAY_TASK_COUNT")?);
        let first = if variable("SLURM_ARRAY_TASK_MIN").is_some() { number("SLURM_ARRAY_TASK_MIN")? } else { 1 };
        let index = id.checked_sub(first).map(|place| place + 1);
        match index {
            Some(index) if index <= of => Ok(Shard { index, of }),
            _ => Err(format!("the array's numbers are not consecutive ({id} of {of} from {first}): use --array=1-N")),
        }
    }

    /// Which of `count` episodes are its own.
    pub(crate) fn range(self, count: usize) -> Range<usize> {
        let edge = |index: u32| (count as u128 * u128::from(index) / u128::from(self.of.max(1))) as usize;
        edge(self.index - 1)..edge(self.index)
    }

    /// Its folder, under the run's.
    pub(crate) fn folder(self) -> PathBuf {
        PathBuf::from(Shard::FOLDER).join(format!("{}-of-{}", self.index, self.of))
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        if text == "slurm" {
            return Shard::of_slurm(|name| std::env::var(name).ok());
        }
        let (index, of) = text.split_once('/').ok_or("write I/N, for example 2/8, or slurm")?;
        let number = |text: &str| text.parse::<u32>().map_err(|_| format!("{text:?} is not a number"));
        Shard::try_from(Written { index: number(index)?, of: number(of)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_cover_every_episode_once_and_in_order() {
        for count in [0, 1, 7, 100, 101] {
            for of in [1, 2, 3, 16] {
                let all: Vec<usize> = (1..=of).flat_map(|index| Shard { index, of }.range(count)).collect();
                assert_eq!(all, (0..count).collect::<Vec<_>>(), "{count} in {of}");
            }
        }
    }

    #[test]
    fn a_share_is_read_from_words_or_from_slurms_environment() {
        assert_eq!("2/8".parse(), Ok(Shard { index: 2, of: 8 }));
        for nonsense in ["0/3", "4/3", "1/0", "1", "a/b", "1/99999"] {
            assert!(nonsense.parse::<Shard>().is_err(), "{nonsense}");
        }
        for nonsense in [r#"{"index":0,"of":2}"#, r#"{"index":3,"of":2}"#, r#"{"index":1,"of":0}"#] {
            let error = serde_json::from_str::<Shard>(nonsense).unwrap_err().to_string();
            assert!(error.contains("counted from 1 to N"), "{error}");
        }
        let slurm = |id: &'static str, count: &'static str, min: Option<&'static str>| {
            Shard::of_slurm(move |name| match name {
                "SLURM_ARRAY_TASK_ID" => Some(id.into()),
                "SLURM_ARRAY_TASK_COUNT" => Some(count.into()),
                _ => min.map(String::from),
            })
        };
        assert_eq!(slurm("3", "4", None), Ok(Shard { index: 3, of: 4 }));
        assert_eq!(slurm("0", "4", Some("0")), Ok(Shard { index: 1, of: 4 }));
        assert!(slurm("9", "4", Some("1")).unwrap_err().contains("--array=1-N"));
        assert!(Shard::of_slurm(|_| None).unwrap_err().contains("SLURM_ARRAY_TASK_ID is not set"));
    }
}
