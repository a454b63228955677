//! How long an agent takes to decide.

use std::time::{Duration, Instant};

use anyhow::Context;
use serde::Serialize;

use super::baselines::Baselines;
use crate::agent::policy_source::PolicySource;
use crate::domain::Room;
use crate::env::Environment;
use crate::episode::rollout::Rollout;
use crate::house::{House, generate};

/// Episodes of [`STEPS`] steps, a house each.
pub(super) const EPISODES: u64 = 4;
const STEPS: u32 = 12;

/// An agent's decisions on one core; the frame is drawn already.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct DecisionTime {
    pub(crate) name: String,
    /// Milliseconds: the median, and the longest.
    pub(crate) decision_ms: f64,
    pub(crate) longest_ms: f64,
}

/// Lets the agent act for so many episodes in generated houses.
///
/// # Errors
/// Whatever the agent reports.
pub(super) fn measure(source: &PolicySource, episodes: u64, baselines: &mut Baselines) -> anyhow::Result<DecisionTime> {
    let mut policy = (source.make)()?;
    let mut times: Vec<Duration> = Vec::new();
    for (room, seed) in Room::ALL.into_iter().cycle().zip(0..episodes) {
        let (scene, world) = generate::house(room, seed);
        let instruction = "pick up the mug and put it on the table".to_owned();
        let mut rollout = Rollout::in_house(House::new(scene.into(), world), instruction, None, Some(STEPS));
        policy.reset(0, seed);
        while rollout.end().is_none() {
            rollout.env.frame()?;
            let begun = Instant::now();
            let decision = rollout.decide(policy.as_mut())?;
            times.push(begun.elapsed());
            rollout.carry_out(decision)?;
        }
    }
    times.sort_unstable();
    let median = *times.get(times.len() / 2).context("no decision was timed")?;
    let longest = times.last().copied().unwrap_or(median);
    baselines.compare(&format!("decision/{}", source.name), median);
    let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
    Ok(DecisionTime { name: source.name.clone(), decision_ms: milliseconds(median), longest_ms: milliseconds(longest) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_decides_is_timed_by_name() {
        let mut baselines = Baselines::shipped().unwrap();
        let time = measure(&PolicySource::random(), 1, &mut baselines).unwrap();
        assert!(time.decision_ms > 0.0 && time.longest_ms >= time.decision_ms, "{time:?}");
        assert_eq!(baselines.into_comparisons()[0].name, "decision/random");
    }
}
