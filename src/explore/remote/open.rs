//! A recorded episode in an environment with actions of its own, opened again.

use anyhow::Context;

use super::exploration::RemoteExploration;
use crate::agent::Decision;
use crate::agent::policy_source::PolicySource;
use crate::domain::Task;
use crate::env::remote::RemoteSettings;
use crate::episode::record::{Author, Episode};

impl RemoteExploration {
    /// Takes the steps of a recorded episode again, and stays at that one of them. Where something else is seen than was
    /// recorded, it says so and stays usable.
    ///
    /// # Errors
    /// When the environment cannot be reached, or has a recorded action no longer.
    pub(crate) fn open(
        task: &Task,
        episode: &Episode,
        author: &Author,
        remote: RemoteSettings,
        source: PolicySource,
        step: u32,
    ) -> anyhow::Result<RemoteExploration> {
        let (name, seed) = task.remote_episode().context("the task plays in House")?;
        let mut exploration = RemoteExploration::new(name, remote, source, seed, None)?;
        if exploration.tree.start().observation.digest != episode.start_hash {
            exploration.differs_at = Some(0);
        }
        let mission = exploration.mission();
        let tell = |exploration: &mut RemoteExploration, text: &str| match text == mission {
            true => exploration.instruct(""),
            false => exploration.instruct(text),
        };
        if !episode.instruction.is_empty() {
            tell(&mut exploration, &episode.instruction)?;
        }
        let mut author = author.clone();
        for (number, recorded) in (1..).zip(&episode.trace) {
            if let Some(told) = &recorded.instruction {
                tell(&mut exploration, told)?;
            }
            if let Some(by) = &recorded.author {
                author = by.clone();
            }
            let action = recorded.action_in(&exploration.rollout.env).with_context(|| format!("step {number}"))?;
            // The policy sees this state too; what it cannot decide is no reason not to show it.
            let _ = exploration.decide();
            exploration.carry_out(Decision::of(action), author.clone())?;
            let taken = exploration.tree.present().taken.as_ref();
            let is_same = taken.is_some_and(|taken| taken.record.own == recorded.own);
            if !is_same && exploration.differs_at.is_none() {
                exploration.differs_at = Some(number);
            }
            if exploration.end().is_some() {
                break;
            }
        }
        exploration.was_retraced = true;
        exploration.seek(step);
        exploration.saved = exploration.tree.len();
        Ok(exploration)
    }
}
