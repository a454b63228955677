//! Which spans are learned from, under which text, and how far back their observations reach.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Which runs of two or more skills are learned from, and under which text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Composites {
    /// None: single skills alone.
    None,
    /// All, under the summaries in the dataset's `labels.jsonl`.
    Labels,
    /// All, under the annotator's sentences one after the other.
    Concat,
    /// Whole trajectories alone, under what the annotator wrote of the whole.
    Whole,
}

/// How far back the frames of an observation reach.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HistoryStart {
    /// To what came before the span.
    #[default]
    Trajectory,
    /// To the span's start: there a new episode might begin.
    Span,
    /// Of half of the items to what came before, of half to the span's start.
    Either,
}

impl HistoryStart {
    /// The first frame that an observation may show, of those with which its trajectory and its span begin.
    pub(super) fn first(self, trajectory: u32, span: u32, rng: &mut ChaCha8Rng) -> u32 {
        match self {
            HistoryStart::Trajectory => trajectory,
            HistoryStart::Span => span,
            HistoryStart::Either => [trajectory, span][usize::from(rng.random_bool(0.5))],
        }
    }
}

/// Which class the policy's object head learns to name at a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObjectTarget {
    /// That of the thing the step interacts with; none on the way.
    #[default]
    Current,
    /// On the way that of the thing the span interacts with next.
    Next,
}

/// Which spans are learned from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataSelection {
    /// Spans of two or more skills.
    pub(crate) composites: Composites,
    /// Whose summaries, when there are several sources' in `labels.jsonl`, e.g. `rules`; of several (`people,rules`) the first that
    /// has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) label_source: Option<String>,
    /// Whether the policy learns too what would have been right where chance or a learner did something else.
    #[serde(default)]
    pub(crate) corrections: bool,
    /// How far back observations reach.
    #[serde(default)]
    pub(crate) history_start: HistoryStart,
    /// What the object head learns.
    #[serde(default)]
    pub(crate) object_target: ObjectTarget,
}

impl DataSelection {
    /// A selection of composites; with labels, of the only source there is.
    pub fn of(composites: Composites) -> DataSelection {
        DataSelection {
            composites,
            label_source: None,
            corrections: false,
            history_start: HistoryStart::Trajectory,
            object_target: ObjectTarget::Current,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_selection_is_written_in_kebab_case() {
        let read: DataSelection = toml::from_str("composites = \"labels\"\nlabel_source = \"rules\"").unwrap();
        assert_eq!(read, DataSelection { label_source: Some("rules".into()), ..DataSelection::of(Composites::Labels) });
        assert!(toml::from_str::<DataSelection>("composites = \"some\"").is_err());
    }
}
