//! Batches: demonstrated transitions, chained pairs, and how an update lays them out.

use tch::Tensor;

use super::chain::Chaining;
use crate::nets::precision::Precision;
use crate::nets::visual::SIDE;

/// Transitions (s, a, s′) with what the agent was told, n of each.
#[derive(Debug)]
pub struct Transitions {
    /// s: [n, channels, 7, 7] or [n, frames, channels, 7, 7], floats of any width.
    pub observation: Tensor,
    /// s′; absent where nothing judges it.
    pub next: Option<Tensor>,
    /// z, as the networks take it.
    pub told: Tensor,
    /// Actions, by index `[n]`.
    pub actions: Tensor,
    /// Object classes, by index `[n]`; 0 for navigation.
    pub objects: Tensor,
    /// The classes that the policy's object head learns to name, by index `[n]`; 0 for none.
    pub named: Tensor,
    /// 1 on the transition into the span's last state, `[n]` floats.
    pub terminal: Tensor,
    /// 1 where the action was taken and led to s′, 0 where it is only what would have been right, `[n]` floats.
    pub taken: Tensor,
}

/// Pairs of transitions to chain, m of them.
#[derive(Debug)]
pub struct Pairs {
    /// A's transitions, told z_B.
    pub first: Transitions,
    /// 1 where equation 4 ends A, `[m]`.
    pub cut: Tensor,
    /// "A. B." as A is told it, and B's transitions told the same; absent where equation 5 is off.
    pub joint: Option<(Tensor, Transitions)>,
}

/// What one update learns from.
#[derive(Debug)]
pub struct Batch {
    /// Demonstrated skills as they were described.
    pub base: Transitions,
    /// Chained pairs.
    pub pairs: Option<Pairs>,
}

/// The demonstrated skills themselves.
const BASE: &str = "";
/// Equation 4: A told z_B.
pub(super) const CHAIN: &str = "chain";
/// Equation 5: A told "A. B.".
pub(super) const AGG_A: &str = "lead";
/// Equation 5: B told "A. B.".
const AGG_B: &str = "follow";

/// A part to be: its name and weight, the transitions, what they are told, and where they end.
type Row<'a> = (&'static str, f64, &'a Transitions, &'a Tensor, &'a Tensor);

/// Items that are averaged by themselves.
pub(super) struct Segment {
    /// Which it is; empty for the base.
    pub name: &'static str,
    start: i64,
    len: i64,
    /// Its share of the loss.
    pub weight: f64,
}

impl Segment {
    /// This part of a tensor over all items.
    pub fn of(&self, all: &Tensor) -> Tensor {
        all.narrow(0, self.start, self.len)
    }

    /// How many items it has.
    pub fn len(&self) -> i64 {
        self.len
    }

    /// Where it ends among all items.
    fn end(&self) -> i64 {
        self.start + self.len
    }

    /// What a number of this part is called.
    pub fn label(&self, name: &str) -> String {
        if self.name == BASE { name.to_string() } else { format!("{}_{name}", self.name) }
    }
}

/// The items of several parts, one after the other.
pub(super) fn of_all(parts: &[&Segment], all: &Tensor) -> Tensor {
    let adjacent = parts.windows(2).all(|pair| pair[0].end() == pair[1].start);
    match parts.first() {
        Some(first) if adjacent => all.narrow(0, first.start, parts.iter().map(|part| part.len).sum()),
        _ => Tensor::cat(&parts.iter().map(|part| part.of(all)).collect::<Vec<_>>(), 0),
    }
}

impl Batch {
    /// The batch and its relabelled copies, one after the other, seen with `precision`.
    pub(super) fn relabelled(&self, chaining: Option<&Chaining>, precision: Precision) -> (Transitions, Vec<Segment>) {
        let base = &self.base;
        let mut rows: Vec<Row<'_>> = vec![(BASE, 1.0, base, &base.told, &base.terminal)];
        if let (Some(pairs), Some(chaining)) = (&self.pairs, chaining) {
            let (first, share) = (&pairs.first, chaining.weight / (chaining.chain + chaining.aggregate));
            rows.push((CHAIN, share * chaining.chain, first, &first.told, &pairs.cut));
            if let Some((told, second)) = &pairs.joint {
                let share = share * chaining.aggregate / 2.0;
                rows.push((AGG_A, share, first, told, &first.terminal));
                rows.push((AGG_B, share, second, &second.told, &second.terminal));
            }
        }
        let cat = |of: &dyn Fn(&Row<'_>) -> Tensor| match &rows[..] {
            [row] => of(row),
            rows => Tensor::cat(&rows.iter().map(of).collect::<Vec<_>>(), 0),
        };
        let next = |row: &Row<'_>| row.2.next.as_ref().unwrap_or(&row.2.observation).shallow_clone();
        let all = Transitions {
            observation: seen(&cat(&|row| row.2.observation.shallow_clone()), precision),
            next: base.next.is_some().then(|| seen(&cat(&next), precision)),
            told: cat(&|row| row.3.shallow_clone()),
            actions: cat(&|row| row.2.actions.shallow_clone()),
            objects: cat(&|row| row.2.objects.shallow_clone()),
            named: cat(&|row| row.2.named.shallow_clone()),
            terminal: cat(&|row| row.4.shallow_clone()),
            taken: cat(&|row| row.2.taken.shallow_clone()),
        };
        let mut start = 0;
        let part = |&(name, weight, _, _, terminal): &Row<'_>| {
            let len = terminal.size()[0];
            start += len;
            Segment { name, start: start - len, len, weight }
        };
        let parts = rows.iter().map(part).collect();
        (all, parts)
    }
}

/// Observations as the networks take them: [n, channels, 7, 7].
pub fn seen(observation: &Tensor, precision: Precision) -> Tensor {
    precision.shown(&observation.reshape([observation.size()[0], -1, SIDE, SIDE]))
}
