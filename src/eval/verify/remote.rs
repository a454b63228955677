//! Episodes in an environment in another process that nobody evaluates again as a whole: their recorded actions are taken again.

use anyhow::Context;

use super::verdict::{Agreement, Mismatch};
use crate::agent::Decision;
use crate::env::Environment;
use crate::env::remote::{RemoteEnvironment, Sessions};
use crate::episode::record::{Episode, TraceStep};
use crate::episode::rollout::Rollout;
use crate::run_dir::reader::RecordedRun;

/// How far a record agrees with the same actions taken again from the same seed.
///
/// # Errors
/// When the environment cannot be reached, or fails.
pub(super) fn retrace(run: &RecordedRun, episode: &Episode, sessions: &mut Sessions) -> anyhow::Result<Agreement> {
    let (name, seed) = run.task(episode)?.remote_episode().context("the task names no environment")?;
    let env = RemoteEnvironment::begin(sessions.get(0, name)?, seed)?;
    let mut agreement = Agreement::default();
    let start = env.fingerprint().unwrap_or_default();
    // An episode that could not be begun has no start.
    if !episode.start_hash.is_empty() && start != episode.start_hash {
        agreement.mismatch = Some(Mismatch::at(0, "start", &episode.start_hash, start));
        return Ok(agreement);
    }
    let mut rollout = Rollout::new(env, episode.instruction.clone(), None);
    for (number, recorded) in (1..).zip(&episode.trace) {
        let action = recorded.action_in(&rollout.env).with_context(|| format!("step {number}"))?;
        let tick = rollout.carry_out(Decision::of(action))?;
        agreement.mismatch = Mismatch::of_step(number, recorded, &TraceStep::of(&tick, &rollout));
        if agreement.mismatch.is_some() {
            break;
        }
        agreement.steps += 1;
    }
    Ok(agreement)
}
