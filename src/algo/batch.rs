//! Batches: demonstrated transitions, chained pairs, and how an update lays them out.

use std::ops::Range;

use tch::{Kind, Tensor};

use super::chain::Chaining;
use crate::nets::precision::Precision;
use crate::nets::shared_rows::SharedRows;
use crate::nets::visual::SIDE;

/// Transitions (s, a, s′) under an instruction or goal z, n of each.
#[derive(Debug)]
pub(crate) struct Transitions {
    /// s: [n, channels, 7, 7] or [n, frames, channels, 7, 7], floats of any width.
    pub(crate) observation: Tensor,
    /// s′; absent where no critic reads it.
    pub(crate) next: Option<Tensor>,
    /// The rows of `observation` and `next` that are the items' `[n]`; absent where all are, in their order.
    pub(crate) rows: Option<Tensor>,
    /// z, as the networks take it.
    pub(crate) conditioning: SharedRows,
    /// Actions, by index [n].
    pub(crate) actions: Tensor,
    /// Object classes, by index `[n]`; 0 for navigation.
    pub(crate) objects: Tensor,
    /// The classes that the policy's object head learns, by index [n]; 0 for none.
    pub(crate) object_target: Tensor,
    /// r, [n] floats: 1 on the transition into a demonstrated span's last state.
    pub(crate) reward: Tensor,
    /// 1 where nothing follows: on the transition into the span's last state, [n] floats.
    pub(crate) terminal: Tensor,
    /// 1 where the action was executed and led to s′, 0 where it is a correction of what was executed, [n] floats.
    pub(crate) executed: Tensor,
}

impl Transitions {
    /// Some of the transitions, by their rows, under another conditioning. Observations are shared, not copied.
    pub(crate) fn picked(&self, rows: &Tensor, conditioning: SharedRows) -> Transitions {
        let of = |all: &Tensor| all.index_select(0, rows);
        Transitions {
            observation: self.observation.shallow_clone(),
            next: self.next.as_ref().map(Tensor::shallow_clone),
            rows: Some(self.rows.as_ref().map_or_else(|| rows.shallow_clone(), of)),
            conditioning,
            actions: of(&self.actions),
            objects: of(&self.objects),
            object_target: of(&self.object_target),
            reward: of(&self.reward),
            terminal: of(&self.terminal),
            executed: of(&self.executed),
        }
    }

    /// How many distinct observations there are.
    fn distinct(&self) -> i64 {
        self.observation.size()[0]
    }

    /// Which observation each item has.
    fn row_numbers(&self) -> Tensor {
        match &self.rows {
            Some(rows) => rows.shallow_clone(),
            None => Tensor::arange(self.distinct(), (Kind::Int64, self.observation.device())),
        }
    }
}

/// Pairs (A, B) of transitions to chain, m of them.
#[derive(Debug)]
pub(crate) struct ChainedPairs {
    /// Whether A and B are of the batch's base, so that their rows are its rows.
    pub(crate) of_base: bool,
    /// A's transitions under z_B.
    pub(crate) first: Transitions,
    /// 1 where equation 4 ends A, `[m]`.
    pub(crate) cut: Tensor,
    /// z of "A. B." for A, and B's transitions under the same; absent where equation 5 is off.
    pub(crate) joint: Option<(SharedRows, Transitions)>,
}

/// What one update learns from.
#[derive(Debug)]
pub struct Batch {
    /// Demonstrated skills under their own instructions.
    pub(crate) base: Transitions,
    /// Chained pairs.
    pub(crate) pairs: Option<ChainedPairs>,
}

/// The demonstrated skills themselves.
const BASE: &str = "";
/// Equation 4: A under z_B.
pub(super) const CHAIN: &str = "chain";
/// Equation 5: A under "A. B.".
pub(super) const AGG_A: &str = "aggregate_a";
/// Equation 5: B under "A. B.".
const AGG_B: &str = "aggregate_b";

/// Transitions that become one segment, relabelled with a conditioning and terminals that may not be their own.
struct SegmentSource<'a> {
    name: &'static str,
    weight: f64,
    /// Where its observations begin among the distinct ones of all.
    first_observation: i64,
    transitions: &'a Transitions,
    conditioning: &'a SharedRows,
    terminal: &'a Tensor,
}

/// Adjacent items that are averaged by themselves.
pub(super) struct Segment {
    /// Which it is; empty for the base.
    pub(crate) name: &'static str,
    start: i64,
    len: i64,
    /// Its share of the loss.
    pub(crate) weight: f64,
    /// Where its observations lie among the distinct ones of all, and what they are conditioned on.
    observations: Range<i64>,
    conditionings: Range<i64>,
}

impl Segment {
    /// This segment of a tensor over all items.
    pub(crate) fn of(&self, all: &Tensor) -> Tensor {
        all.narrow(0, self.start, self.len)
    }

    /// How many items it has.
    pub(crate) fn len(&self) -> i64 {
        self.len
    }

    /// Where it ends among all items.
    fn end(&self) -> i64 {
        self.start + self.len
    }

    /// A metric's name, prefixed by the segment's; the base has no prefix.
    pub(crate) fn label(&self, name: &str) -> String {
        if self.name == BASE { name.to_string() } else { format!("{}_{name}", self.name) }
    }
}

/// The items of several segments, one after the other.
pub(super) fn gather(segments: &[&Segment], all: &Tensor) -> Tensor {
    let adjacent = segments.windows(2).all(|pair| pair[0].end() == pair[1].start);
    match segments.first() {
        Some(first) if adjacent => all.narrow(0, first.start, segments.iter().map(|segment| segment.len).sum()),
        _ => Tensor::cat(&segments.iter().map(|segment| segment.of(all)).collect::<Vec<_>>(), 0),
    }
}

/// The observations of several segments, out of the distinct ones of all items.
pub(super) fn gather_observations(segments: &[&Segment], all: &Transitions) -> SharedRows {
    gather_shared(segments, &all.observation, all.rows.as_ref(), |segment| &segment.observations)
}

/// What several segments are conditioned on, out of the distinct ones of all items.
pub(super) fn gather_conditionings(segments: &[&Segment], all: &Transitions) -> SharedRows {
    gather_shared(segments, &all.conditioning.distinct, all.conditioning.rows.as_ref(), |segment| {
        &segment.conditionings
    })
}

fn gather_shared(
    segments: &[&Segment],
    distinct: &Tensor,
    rows: Option<&Tensor>,
    of: fn(&Segment) -> &Range<i64>,
) -> SharedRows {
    let start = segments.iter().map(|segment| of(segment).start).min().unwrap_or(0);
    let end = segments.iter().map(|segment| of(segment).end).max().unwrap_or(0);
    let rows = rows.map(|rows| gather(segments, rows) - start);
    // Those of the base alone are its items in their order.
    let in_order = segments.iter().all(|segment| segment.name == BASE && segment.len == end - start);
    SharedRows { distinct: distinct.narrow(0, start, end - start), rows: rows.filter(|_| !in_order) }
}

impl Batch {
    /// How many demonstrated items it has.
    pub(super) fn items(&self) -> i64 {
        self.base.actions.size()[0]
    }

    /// The batch and its relabelled copies, one after the other, with observations in `precision`, each once.
    pub(super) fn relabelled(&self, chaining: Option<&Chaining>, precision: Precision) -> (Transitions, Vec<Segment>) {
        let base = &self.base;
        let segment = |name, weight, (transitions, first_observation), conditioning, terminal| SegmentSource {
            name,
            weight,
            first_observation,
            transitions,
            conditioning,
            terminal,
        };
        let mut sources = vec![segment(BASE, 1.0, (base, 0), &base.conditioning, &base.terminal)];
        // What has observations of its own; those of pairs come after the base's.
        let mut owners = vec![base];
        if let (Some(pairs), Some(chaining)) = (&self.pairs, chaining) {
            let (first, share) =
                (&pairs.first, chaining.loss_weight / (chaining.chain_weight + chaining.aggregate_weight));
            let second = pairs.joint.as_ref().map(|(_, second)| second);
            let (mut at, mut second_at) = (0, 0);
            if !pairs.of_base {
                owners.push(first);
                owners.extend(second);
                (at, second_at) = (base.distinct(), base.distinct() + first.distinct());
            }
            sources.push(segment(CHAIN, share * chaining.chain_weight, (first, at), &first.conditioning, &pairs.cut));
            if let Some((joint, second)) = &pairs.joint {
                let share = share * chaining.aggregate_weight / 2.0;
                sources.push(segment(AGG_A, share, (first, at), joint, &first.terminal));
                sources.push(segment(AGG_B, share, (second, second_at), &second.conditioning, &second.terminal));
            }
        }
        let cat = |of: &dyn Fn(&SegmentSource<'_>) -> Tensor| match &sources[..] {
            [source] => of(source),
            sources => Tensor::cat(&sources.iter().map(of).collect::<Vec<_>>(), 0),
        };
        let own = |of: fn(&Transitions) -> &Tensor| cat(&|source| of(source.transitions).shallow_clone());
        let observations = |of: fn(&Transitions) -> &Tensor| match &owners[..] {
            [owner] => network_input(of(owner), precision),
            owners => {
                network_input(&Tensor::cat(&owners.iter().map(|owner| of(owner)).collect::<Vec<_>>(), 0), precision)
            }
        };
        let conditionings: Vec<&SharedRows> = sources.iter().map(|source| source.conditioning).collect();
        let (conditioning, starts) = SharedRows::joined(&conditionings);
        let all = Transitions {
            observation: observations(|items| &items.observation),
            next: base.next.is_some().then(|| observations(|items| items.next.as_ref().unwrap_or(&items.observation))),
            rows: (sources.len() > 1 || base.rows.is_some())
                .then(|| cat(&|source| source.transitions.row_numbers() + source.first_observation)),
            conditioning,
            actions: own(|items| &items.actions),
            objects: own(|items| &items.objects),
            object_target: own(|items| &items.object_target),
            reward: own(|items| &items.reward),
            terminal: cat(&|source| source.terminal.shallow_clone()),
            executed: own(|items| &items.executed),
        };
        let mut start = 0;
        let segments = sources.iter().zip(starts).map(|(source, said)| {
            let len = source.terminal.size()[0];
            start += len;
            let first = source.first_observation;
            Segment {
                name: source.name,
                start: start - len,
                len,
                weight: source.weight,
                observations: first..first + source.transitions.distinct(),
                conditionings: said..said + source.conditioning.count(),
            }
        });
        (all, segments.collect())
    }
}

/// Observations as the networks take them: [n, channels, 7, 7].
pub(crate) fn network_input(observation: &Tensor, precision: Precision) -> Tensor {
    precision.cast(&observation.reshape([observation.size()[0], -1, SIDE, SIDE]))
}
