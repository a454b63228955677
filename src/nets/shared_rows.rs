//! What several items of a batch may share: observations, and the goals or instructions that they are under. What is computed
//! of these alone is computed once for each: the first convolution of a trunk, which is its largest, and all that sees a goal.

use tch::{Kind, Tensor};

/// Distinct rows, and which of them each item has.
#[derive(Debug)]
pub(crate) struct SharedRows {
    /// The distinct ones [rows, ...].
    pub(crate) distinct: Tensor,
    /// The row of each item's among them `[items]`; absent where every item has its own.
    pub(crate) rows: Option<Tensor>,
}

impl From<Tensor> for SharedRows {
    /// Each item has its own.
    fn from(distinct: Tensor) -> SharedRows {
        SharedRows { distinct, rows: None }
    }
}

impl SharedRows {
    /// Each item has its own.
    pub(crate) fn own(distinct: &Tensor) -> SharedRows {
        distinct.shallow_clone().into()
    }

    /// One row, which all `items` have.
    pub(crate) fn repeated(one: &Tensor, items: i64) -> SharedRows {
        let rows = Tensor::zeros([items], (Kind::Int64, one.device()));
        SharedRows { distinct: one.shallow_clone(), rows: Some(rows) }
    }

    /// How many distinct rows there are.
    pub(crate) fn count(&self) -> i64 {
        self.distinct.size()[0]
    }

    /// Which of them each item has.
    pub(crate) fn numbers(&self) -> Tensor {
        match &self.rows {
            Some(rows) => rows.shallow_clone(),
            None => Tensor::arange(self.count(), (Kind::Int64, self.distinct.device())),
        }
    }

    /// Those of some items; they are shared, not copied.
    pub(crate) fn picked(&self, items: &Tensor) -> SharedRows {
        let rows = self.rows.as_ref().map_or_else(|| items.shallow_clone(), |rows| rows.index_select(0, items));
        SharedRows { distinct: self.distinct.shallow_clone(), rows: Some(rows) }
    }

    /// The items of several one after the other, and where the distinct rows of each begin. What two of them share is there once.
    pub(crate) fn joined(parts: &[&SharedRows]) -> (SharedRows, Vec<i64>) {
        let mut owners: Vec<(&Tensor, i64)> = Vec::new();
        let mut count = 0;
        let mut starts = Vec::new();
        for part in parts {
            let same = |owner: &&(&Tensor, i64)| {
                owner.0.data_ptr() == part.distinct.data_ptr() && owner.0.size() == part.distinct.size()
            };
            let known = owners.iter().find(same).map(|owner| owner.1);
            starts.push(known.unwrap_or(count));
            if known.is_none() {
                owners.push((&part.distinct, count));
                count += part.count();
            }
        }
        let rows = match parts {
            [part] => part.rows.as_ref().map(Tensor::shallow_clone),
            _ => {
                let numbers: Vec<Tensor> =
                    parts.iter().zip(&starts).map(|(part, start)| part.numbers() + *start).collect();
                Some(Tensor::cat(&numbers, 0))
            }
        };
        let distinct = match &owners[..] {
            [(owner, _)] => owner.shallow_clone(),
            owners => Tensor::cat(&owners.iter().map(|(owner, _)| *owner).collect::<Vec<_>>(), 0),
        };
        (SharedRows { distinct, rows }, starts)
    }

    /// What was computed of each distinct row, for every item.
    pub(crate) fn for_items(&self, computed: Tensor) -> Tensor {
        match &self.rows {
            Some(rows) => computed.index_select(0, rows),
            None => computed,
        }
    }

    /// How wide their numbers are.
    pub(crate) fn kind(&self) -> Kind {
        self.distinct.kind()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_parts_share_is_joined_once_and_every_item_keeps_its_row() {
        let goals = SharedRows::own(&Tensor::from_slice(&[10i64, 11, 12]));
        let others = SharedRows::own(&Tensor::from_slice(&[20i64, 21]));
        let swapped = goals.picked(&Tensor::from_slice(&[2i64, 0]));
        let (all, starts) = SharedRows::joined(&[&goals, &swapped, &others]);
        assert_eq!((all.count(), starts), (5, vec![0, 0, 3]));
        let of_items = Vec::<i64>::try_from(all.for_items(all.distinct.shallow_clone())).unwrap();
        assert_eq!(of_items, [10, 11, 12, 12, 10, 20, 21]);
        let (alone, _) = SharedRows::joined(&[&SharedRows::repeated(&goals.distinct.narrow(0, 1, 1), 3)]);
        assert_eq!(alone.count(), 1);
        assert_eq!(Vec::<i64>::try_from(alone.for_items(alone.distinct.shallow_clone())).unwrap(), [11; 3]);
    }
}
