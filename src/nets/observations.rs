//! Observations of a batch of which several items may share one. What comes before the instruction is computed once for each
//! distinct observation: the first convolution of a trunk, which is its largest.

use tch::{Kind, Tensor};

/// Observations, and which of them each item has.
#[derive(Debug)]
pub(crate) struct Observations {
    /// The distinct ones [observations, channels, 7, 7].
    pub(crate) maps: Tensor,
    /// The row of each item's among them `[items]`; absent where every item has its own.
    pub(crate) rows: Option<Tensor>,
}

impl Observations {
    /// Each item has its own.
    pub(crate) fn distinct(maps: &Tensor) -> Observations {
        Observations { maps: maps.shallow_clone(), rows: None }
    }

    /// What was computed of each distinct observation, for every item.
    pub(crate) fn for_items(&self, computed: Tensor) -> Tensor {
        match &self.rows {
            Some(rows) => computed.index_select(0, rows),
            None => computed,
        }
    }

    /// How wide their numbers are.
    pub(crate) fn kind(&self) -> Kind {
        self.maps.kind()
    }
}
