//! Episodes that an evaluation played, played again by the very code that played them: many at once, in the same slots, so that
//! the policy decides bit for bit as it did.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::verdict::{Agreement, Mismatch};
use crate::agent::policy_source::PolicySource;
use crate::env::remote::RemoteSettings;
use crate::episode::record::{Episode, EpisodeKey};
use crate::episode::rollout::EndedBy;
use crate::eval::options::Options;
use crate::eval::plan::EvaluationPlan;
use crate::eval::worker_pool;
use crate::run_dir::episode_spec::EpisodeSpec;
use crate::run_dir::reader::RecordedRun;

/// Plays the episodes of `specs` again, and compares each as it ends.
///
/// # Errors
/// When a policy cannot be made.
pub(super) fn play_again(
    run: &RecordedRun,
    specs: &[EpisodeSpec],
    source: &PolicySource,
    jobs: usize,
    remote: &RemoteSettings,
    progress: &mut dyn FnMut(usize),
) -> anyhow::Result<BTreeMap<EpisodeKey, Agreement>> {
    let recorded: BTreeMap<EpisodeKey, &Episode> =
        run.episodes.iter().map(|episode| (episode.key(), episode)).collect();
    let plan = EvaluationPlan {
        tasks: run.set.tasks.clone().into(),
        scenes: Arc::new(run.scenes.clone()),
        remote: remote.clone(),
        read: Arc::default(),
        clock: Arc::default(),
        options: Options {
            jobs,
            end: run.manifest.end,
            step_by_step: run.manifest.step_by_step,
            sampling: run.manifest.sampling,
            deciding: run.manifest.deciding,
            ..Options::plain(run.manifest.grader)
        },
    };
    let mut compared = BTreeMap::new();
    let stop = Arc::new(AtomicBool::new(false));
    worker_pool::play(&plan, specs, &source.make, &stop, &mut |found| {
        let key = found.key();
        if let Some(recorded) = recorded.get(&key) {
            compared.insert(key, compare(recorded, &found, run.manifest.end));
        }
        progress(compared.len());
        Ok(())
    })?;
    Ok(compared)
}

/// How far a record agrees with the same episode played again.
fn compare(recorded: &Episode, found: &Episode, end: EndedBy) -> Agreement {
    let mut agreement = Agreement::default();
    agreement.mismatch = first_mismatch(recorded, found, end, &mut agreement);
    agreement
}

fn first_mismatch(recorded: &Episode, found: &Episode, end: EndedBy, agreed: &mut Agreement) -> Option<Mismatch> {
    if recorded.start_hash != found.start_hash {
        return Some(Mismatch::at(0, "start", &recorded.start_hash, &found.start_hash));
    }
    if recorded.instruction != found.instruction {
        return Some(Mismatch::at(0, "instruction", &recorded.instruction, &found.instruction));
    }
    for (number, step) in (1..).zip(&recorded.trace) {
        let is_choice = number > recorded.prefix_steps;
        let choice = |found: String| Some(Mismatch::at(number, "choice", step.action_in_words(), found));
        let Some(again) = found.trace.get(number as usize - 1) else {
            return choice(found.error.clone().unwrap_or_else(|| "the episode is over".into()));
        };
        if is_choice && !again.is_same_action(step) {
            return choice(again.action_in_words());
        }
        agreed.choices += usize::from(is_choice);
        if let Some(mismatch) = Mismatch::of_step(number, step, again) {
            return Some(mismatch);
        }
        agreed.steps += 1;
    }
    Mismatch::of_counts(recorded, end).or_else(|| Mismatch::of_results(recorded, found))
}
