//! What verifying finds: how two records of an episode differ, and what all of a run's come to.

use serde::Serialize;

use crate::episode::record::{Episode, RemoteStep, TraceStep};
use crate::episode::rollout::EndedBy;
use crate::language::count::counted;

/// What came of verifying.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Episodes that were played again.
    pub(crate) episodes: usize,
    /// Steps that were the same.
    pub(crate) steps: usize,
    /// Of these, steps whose choice was made again too; the others were a person's, or a policy's that is not at hand.
    pub(crate) choices: usize,
    /// What differed, an entry an episode.
    pub(crate) differences: Vec<Difference>,
    /// Policies that were not at hand, so that only what their actions came to was compared.
    pub(crate) missing: Vec<String>,
    /// How many of the episodes were played as the tasks ask: from the start, in the task's own words.
    pub(crate) plain: usize,
    /// How many such episodes the run's summary tells of, where there is one.
    pub(crate) summarised: Option<usize>,
}

impl Verdict {
    /// Whether everything came out the same, and nothing is gone.
    pub(crate) fn is_equal(&self) -> bool {
        self.differences.is_empty() && self.summarised.is_none_or(|count| count == self.plain)
    }
}

/// The first difference of an episode.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Difference {
    /// Which episode of the run, from 1.
    pub(crate) episode: usize,
    pub(crate) task: String,
    #[serde(flatten)]
    pub(crate) mismatch: Mismatch,
}

/// Where a record and the same played again part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Mismatch {
    /// At which step, from 1; 0 for the start or the whole.
    pub(crate) step: u32,
    pub(crate) what: &'static str,
    /// What the run says.
    pub(crate) recorded: String,
    /// What it is now.
    pub(crate) found: String,
}

/// How far a record agrees.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Agreement {
    pub(super) steps: usize,
    /// Of the steps, those that a policy chose again.
    pub(super) choices: usize,
    /// Why it agrees no further.
    pub(super) mismatch: Option<Mismatch>,
}

impl Mismatch {
    pub(super) fn at(step: u32, what: &'static str, recorded: impl ToString, found: impl ToString) -> Mismatch {
        Mismatch { step, what, recorded: recorded.to_string(), found: found.to_string() }
    }

    /// The difference between a recorded step and the same taken again, where there is one.
    pub(super) fn of_step(step: u32, recorded: &TraceStep, found: &TraceStep) -> Option<Mismatch> {
        let what = match () {
            () if found.outcome != recorded.outcome => "outcome",
            () if found.subtask != recorded.subtask || found.class != recorded.class => "subtask",
            () if found.own != recorded.own => {
                return Some(Mismatch::at(step, "what is seen", seen(recorded), seen(found)));
            }
            () => return None,
        };
        let text = |step: &TraceStep| format!("{}, subtask {:?}, class {:?}", step.outcome, step.subtask, step.class);
        Some(Mismatch::at(step, what, text(recorded), text(found)))
    }

    /// The difference between what an episode says that it came to and what its own steps come to.
    pub(super) fn of_counts(episode: &Episode, ended_by: EndedBy) -> Option<Mismatch> {
        let own = episode.trace.get(episode.prefix_steps as usize..).unwrap_or_default();
        let completed = TraceStep::completed(episode.own_steps());
        let mut counted = Episode { completed, steps: own.len() as u32, trace: Vec::new(), ..episode.clone() };
        counted.success = counted.is_success(ended_by);
        let (recorded, found) = (counts(episode), counts(&counted));
        (recorded != found).then(|| Mismatch::at(0, "result", recorded, found))
    }

    /// The difference between what an episode came to and what the same played again did.
    pub(super) fn of_results(recorded: &Episode, found: &Episode) -> Option<Mismatch> {
        let (recorded, found) = (counts(recorded), counts(found));
        (recorded != found).then(|| Mismatch::at(0, "result", recorded, found))
    }
}

/// What an environment with actions of its own showed after a step, in words.
fn seen(step: &TraceStep) -> String {
    let earned = |own: &RemoteStep| own.reward.map_or(String::new(), |reward| format!(", reward {reward}"));
    step.own.as_ref().map_or_else(|| "nothing".into(), |own| format!("{}{}", own.seen, earned(own)))
}

fn counts(episode: &Episode) -> String {
    let own =
        episode.agent_end.map_or(String::new(), |held| format!(", ended by the agent with everything held {held}"));
    let (completed, steps) = (counted(episode.completed, "subtask"), counted(episode.steps, "step"));
    format!("{completed}, {steps}, success {}{own}", episode.success)
}
