//! A session as it is kept while it goes on, in one file of the state folder: everything that was tried in one house.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::episode_source::EpisodeStart;
use crate::agent::registry::PolicyKind;
use crate::data::json;
use crate::domain::task::SceneRef;
use crate::domain::{Scene, Task, World};
use crate::episode::record::{Author, Episode};
use crate::house::generate;

/// Everything that was tried in one house, a branch an episode, and what was in hand.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct KeptSession {
    pub(crate) format_version: u32,
    /// The floor plan, unless it is one that is generated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) scene: Option<Scene>,
    pub(crate) reference: SceneRef,
    /// The house at the start.
    pub(crate) start: World,
    /// What the episode asks.
    pub(crate) task: Option<Task>,
    /// The episode ends at the task's horizon.
    pub(crate) limited: bool,
    /// Each branch under its name, as `task`.
    pub(crate) episodes: Vec<Episode>,
    /// The branch and the step in hand.
    pub(crate) branch: usize,
    pub(crate) step: u32,
    /// The kind of policy that acts.
    pub(crate) policy: String,
    /// The name of the checkpoint that is meant by the agent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) checkpoint: Option<String>,
    /// Who acts, with its chance.
    pub(crate) author: Author,
    /// Some of it is in no run folder.
    pub(crate) is_unsaved: bool,
}

impl KeptSession {
    /// The format version that is read and written.
    pub(crate) const FORMAT: u32 = 1;

    /// Reads a kept session.
    ///
    /// # Errors
    /// When there is none, or it is broken or of another version.
    pub(crate) fn read(path: &Path) -> anyhow::Result<KeptSession> {
        Ok(json::read::<KeptSession>(path, KeptSession::FORMAT)?.value)
    }

    /// How its episode begins.
    ///
    /// # Errors
    /// When its floor plan is missing.
    pub(crate) fn episode_start(&self) -> anyhow::Result<EpisodeStart> {
        let scene = match (&self.scene, &self.reference) {
            (Some(scene), _) => scene.clone(),
            (None, SceneRef::Generated { room, seed }) => generate::house(*room, *seed).0,
            (None, SceneRef::Remote) => anyhow::bail!("scene: missing"),
            (None, SceneRef::Named(name)) => anyhow::bail!("scene: the floor plan {name} is missing"),
        };
        Ok(EpisodeStart {
            scene: scene.into(),
            world: self.start.clone(),
            reference: self.reference.clone(),
            task: self.task.clone(),
            limited: self.limited,
        })
    }

    /// The kind of policy that acts; the agent where the name is unknown.
    pub(crate) fn kind(&self) -> PolicyKind {
        PolicyKind::ALL.into_iter().find(|kind| kind.name() == self.policy).unwrap_or(PolicyKind::Agent)
    }

    /// Where, how much, and what was told last, for a list.
    pub(crate) fn words(&self) -> (String, String) {
        let place = match &self.reference {
            SceneRef::Generated { room, seed } => format!("{} {seed}", room.spoken()),
            SceneRef::Named(name) => name.clone(),
            SceneRef::Remote => "another environment".into(),
        };
        let branches = match self.episodes.len() {
            0 | 1 => String::new(),
            many => format!(", {many} branches"),
        };
        let in_hand = self.episodes.get(self.branch);
        let told = in_hand.map_or("", |episode| {
            episode.wishes.last().map_or(episode.instruction.as_str(), |wish| wish.instruction.as_str())
        });
        (place, format!("step {}{branches}: {told}", self.step))
    }
}
