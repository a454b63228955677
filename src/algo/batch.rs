//! Batches: demonstrated transitions, chained pairs, and how an update lays them out.

use tch::Tensor;

use super::chain::Chaining;
use crate::nets::precision::Precision;
use crate::nets::visual::SIDE;

/// Transitions (s, a, s′) under an instruction or goal z, n of each.
#[derive(Debug)]
pub(crate) struct Transitions {
    /// s: [n, channels, 7, 7] or [n, frames, channels, 7, 7], floats of any width.
    pub(crate) observation: Tensor,
    /// s′; absent where no critic reads it.
    pub(crate) next: Option<Tensor>,
    /// z, as the networks take it.
    pub(crate) conditioning: Tensor,
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

/// Pairs (A, B) of transitions to chain, m of them.
#[derive(Debug)]
pub(crate) struct ChainedPairs {
    /// A's transitions under z_B.
    pub(crate) first: Transitions,
    /// 1 where equation 4 ends A, `[m]`.
    pub(crate) cut: Tensor,
    /// z of "A. B." for A, and B's transitions under the same; absent where equation 5 is off.
    pub(crate) joint: Option<(Tensor, Transitions)>,
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
    transitions: &'a Transitions,
    conditioning: &'a Tensor,
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

impl Batch {
    /// The batch and its relabelled copies, one after the other, with observations in `precision`.
    pub(super) fn relabelled(&self, chaining: Option<&Chaining>, precision: Precision) -> (Transitions, Vec<Segment>) {
        let base = &self.base;
        let segment = |name, weight, transitions, conditioning, terminal| SegmentSource {
            name,
            weight,
            transitions,
            conditioning,
            terminal,
        };
        let mut sources = vec![segment(BASE, 1.0, base, &base.conditioning, &base.terminal)];
        if let (Some(pairs), Some(chaining)) = (&self.pairs, chaining) {
            let (first, share) =
                (&pairs.first, chaining.loss_weight / (chaining.chain_weight + chaining.aggregate_weight));
            sources.push(segment(CHAIN, share * chaining.chain_weight, first, &first.conditioning, &pairs.cut));
            if let Some((joint, second)) = &pairs.joint {
                let share = share * chaining.aggregate_weight / 2.0;
                sources.push(segment(AGG_A, share, first, joint, &first.terminal));
                sources.push(segment(AGG_B, share, second, &second.conditioning, &second.terminal));
            }
        }
        let cat = |of: &dyn Fn(&SegmentSource<'_>) -> Tensor| match &sources[..] {
            [source] => of(source),
            sources => Tensor::cat(&sources.iter().map(of).collect::<Vec<_>>(), 0),
        };
        let own = |of: fn(&Transitions) -> &Tensor| cat(&|source| of(source.transitions).shallow_clone());
        let all = Transitions {
            observation: network_input(&own(|items| &items.observation), precision),
            next: base
                .next
                .is_some()
                .then(|| network_input(&own(|items| items.next.as_ref().unwrap_or(&items.observation)), precision)),
            conditioning: cat(&|source| source.conditioning.shallow_clone()),
            actions: own(|items| &items.actions),
            objects: own(|items| &items.objects),
            object_target: own(|items| &items.object_target),
            reward: own(|items| &items.reward),
            terminal: cat(&|source| source.terminal.shallow_clone()),
            executed: own(|items| &items.executed),
        };
        let mut start = 0;
        let segments = sources.iter().map(|source| {
            let len = source.terminal.size()[0];
            start += len;
            Segment { name: source.name, start: start - len, len, weight: source.weight }
        });
        (all, segments.collect())
    }
}

/// Observations as the networks take them: [n, channels, 7, 7].
pub(crate) fn network_input(observation: &Tensor, precision: Precision) -> Tensor {
    precision.cast(&observation.reshape([observation.size()[0], -1, SIDE, SIDE]))
}
