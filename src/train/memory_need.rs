//! How much memory an update takes on its device, before it is taken, and in how many parts it fits.

use std::fmt;

use tch::Device;

use super::preset::Preset;
use crate::algo::chain::PairSource;
use crate::nets::critic::CriticSpec;
use crate::nets::device;
use crate::nets::policy::PolicySpec;
use crate::nets::precision::Precision;
use crate::nets::visual::SIDE;

/// Cells of a map.
const CELLS: u64 = (SIDE * SIDE) as u64;
/// What a trunk keeps of each convolution for the gradient: its output, the norm's and the modulated one.
const KEPT: u64 = 3;
/// Batches of 16-bit maps that are at hand at once: one in use, and those that wait.
const BATCHES: u64 = 4;
/// Of what is free, what may be planned for: libtorch's own work space is not counted.
const USABLE: f64 = 0.8;

/// Bytes, in words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Bytes(pub(crate) u64);

impl fmt::Display for Bytes {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let megabytes = self.0 as f64 / 1e6;
        if megabytes < 1000.0 { write!(out, "{megabytes:.0} MB") } else { write!(out, "{:.1} GB", megabytes / 1e3) }
    }
}

/// About how much memory the updates of a preset take, where each is computed in so many parts: weights with their gradients and
/// moments, observations, and what is kept for the gradients.
pub(crate) fn of_updates(preset: &Preset, features: i64, parts: usize) -> Bytes {
    let policy = &preset.policy;
    let channels = policy.history as u64 * features as u64;
    let part = |items: usize| items.div_ceil(parts) as u64;
    let (base, pairs) = (part(preset.training.batch_size), preset.chaining.as_ref().map_or(0, |c| part(c.batch_size)));
    let joint = preset.chaining.as_ref().is_some_and(|chaining| chaining.aggregate_weight > 0.0);
    let items = base + pairs * if joint { 3 } else { 1 };
    let trunks = preset.critic.as_ref().map_or(0, |critic| if critic.shared_trunk { 1 } else { 3 });
    let observation = channels * CELLS;
    let seen = if preset.critic.is_some() { 2 } else { 1 };
    // Pairs from a pool have observations of their own.
    let own = match &preset.chaining {
        Some(chaining) if chaining.pairs != PairSource::InBatch => base + 2 * pairs,
        _ => base,
    };
    let width = if preset.precision == Precision::Mixed { 2 } else { 4 };
    let kept = |channels: &[i64; 4]| channels.iter().sum::<i64>() as u64 * CELLS * KEPT;
    let activations = items
        * (kept(&policy.channels) + preset.critic.as_ref().map_or(0, |critic| trunks * kept(&critic.channels)))
        * width;
    // Each goal is seen once by the policy and once by the critic, at full width.
    let goals = policy.goal_channels.as_ref().map_or(0, |seen_by| {
        let seers = 1 + u64::from(preset.critic.is_some());
        let distinct = if own > base { base + 3 * pairs } else { base };
        distinct * (observation * 4 + seers * kept(seen_by) * width)
    });
    let observations = own * observation * seen * width
        + preset.training.batch_size as u64 * channels * CELLS * 2 * BATCHES * (policy.history as u64 + 1)
            / policy.history.max(1) as u64;
    // A weight, its gradient and two moments; of the critic the target, too.
    let weights = 4 * 4 * policy_numbers(policy, channels)
        + preset.critic.as_ref().map_or(0, |critic| 5 * 4 * critic_numbers(critic, policy, channels, trunks));
    Bytes(activations + goals + observations + weights)
}

fn trunk_numbers(channels: &[i64; 4], from: u64, conditioning: u64) -> u64 {
    let mut below = from;
    let mut numbers = 0;
    for (position, &to) in channels.iter().enumerate() {
        let kernel = if position == 0 { 1 } else { 9 };
        numbers += to as u64 * (kernel * below + 2 * conditioning);
        below = to as u64;
    }
    numbers
}

fn dense_numbers(channels: &[i64; 4], downsample: bool, hidden: &[i64], conditioning: u64) -> u64 {
    let side = if downsample { (SIDE + 1) / 2 } else { SIDE } as u64;
    let mut below = channels[3] as u64 * side * side + conditioning;
    let mut numbers = 0;
    for &to in hidden {
        numbers += below * to as u64;
        below = to as u64;
    }
    numbers
}

/// Of what turns a goal into the vector that an instruction would be.
fn goal_numbers(policy: &PolicySpec, channels: u64) -> u64 {
    let out = |own: &[i64; 4]| dense_numbers(own, policy.downsample, &[policy.embedding], 0);
    policy.goal_channels.as_ref().map_or(0, |own| trunk_numbers(own, channels, 0) + out(own))
}

fn policy_numbers(policy: &PolicySpec, channels: u64) -> u64 {
    let conditioning = policy.embedding as u64;
    goal_numbers(policy, channels)
        + trunk_numbers(&policy.channels, channels, conditioning)
        + dense_numbers(&policy.channels, policy.downsample, &policy.hidden, conditioning)
}

fn critic_numbers(critic: &CriticSpec, policy: &PolicySpec, channels: u64, trunks: u64) -> u64 {
    let conditioning = policy.embedding as u64;
    goal_numbers(policy, channels)
        + trunks * trunk_numbers(&critic.channels, channels, conditioning)
        + 3 * dense_numbers(&critic.channels, critic.downsample, &critic.hidden, conditioning)
}

/// In how many parts each update of a preset is computed on a device with `free` bytes: as few as fit, of powers of two.
///
/// # Errors
/// When not even single pairs of items fit.
pub(crate) fn parts_that_fit(preset: &Preset, features: i64, free: Bytes) -> anyhow::Result<usize> {
    let usable = Bytes((free.0 as f64 * USABLE) as u64);
    let most = preset.training.batch_size / 2;
    let mut parts = 1;
    loop {
        let need = of_updates(preset, features, parts);
        if need <= usable {
            return Ok(parts);
        }
        anyhow::ensure!(
            parts * 2 <= most,
            "an update takes about {need} even in {parts} parts, and {free} are free: take a smaller size"
        );
        parts *= 2;
    }
}

/// What the training will take, and where, in a sentence for the person who begins it; the parts that each update is computed in.
/// `asked` is a number of parts that the person or the training's beginning chose.
///
/// # Errors
/// When it does not fit.
pub(crate) fn plan(
    preset: &Preset,
    features: i64,
    device: Device,
    asked: Option<usize>,
) -> anyhow::Result<(usize, String)> {
    let free = device::free_memory(device).map(Bytes);
    let parts = match (asked, free) {
        (Some(parts), _) => parts,
        (None, Some(free)) => parts_that_fit(preset, features, free)?.max(preset.parts),
        (None, None) => preset.parts,
    };
    let need = of_updates(preset, features, parts);
    let place = if device == Device::Cpu { "of memory" } else { "of the GPU's memory" };
    let free = free.map_or_else(|| "how much is free is not known".into(), |free| format!("{free} are free"));
    let told = match parts {
        1 => format!("an update takes about {need} {place}; {free}"),
        _ => format!(
            "an update takes about {need} {place} in {parts} parts (--parts; {} in one); {free}",
            of_updates(preset, features, 1)
        ),
    };
    Ok((parts, told))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nets::resnet18::FEATURES;

    #[test]
    fn a_smaller_device_takes_more_parts_and_too_small_a_one_is_refused() {
        let preset = Preset::sized("sprint", Some("paper")).unwrap();
        let whole = of_updates(&preset, FEATURES, 1);
        assert!((5_000_000_000..40_000_000_000).contains(&whole.0), "{whole}");
        let parts = |free: u64| parts_that_fit(&preset, FEATURES, Bytes(free)).unwrap();
        assert_eq!(parts(2 * whole.0), 1);
        assert_eq!(parts(whole.0), 2);
        assert!(parts(whole.0 / 3) > 2);
        assert!(of_updates(&preset, FEATURES, 4) < of_updates(&preset, FEATURES, 2));
        let error = parts_that_fit(&preset, FEATURES, Bytes(1000)).unwrap_err().to_string();
        assert!(error.contains("even in 512 parts") && error.contains("take a smaller size"), "{error}");
    }

    #[test]
    fn what_is_counted_are_the_networks_weights() {
        for method in ["sprint", "am"] {
            let preset = Preset::named(method).unwrap();
            let features = preset.visual_encoder.features();
            let networks = crate::agent::checkpoint::Networks::new(
                crate::nets::visual_encoder::VisualEncoder::house(&preset.visual_encoder, Device::Cpu),
                &preset.policy,
                None,
                Device::Cpu,
            );
            let counted: usize = networks.policy_store.trainable_variables().iter().map(tch::Tensor::numel).sum();
            let estimated = policy_numbers(&preset.policy, (preset.policy.history * features) as u64) as f64;
            assert!((estimated / counted as f64 - 1.0).abs() < 0.1, "{method}: {estimated} and {counted}");
        }
    }
}
