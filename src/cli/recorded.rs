//! A recorded episode as the command line names it, found and opened.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, bail, ensure};

use super::recorded_policy::{RecordedPolicy, SoughtPolicy};
use super::streams::say;
use crate::agent::policy_source::{self, PolicySource};
use crate::agent::registry::{Policies, PolicyKind};
use crate::env::remote::RemoteSettings;
use crate::episode::record::Author;
use crate::explore::episode_source::{EpisodeOrigin, EpisodeSource};
use crate::explore::exploration::Exploration;
use crate::explore::remote::{OpenRemote, RemoteExploration};
use crate::run_dir::manifest::RunManifest;
use crate::run_dir::reader::RecordedRun;

/// One of a run's episodes, as the command line names it.
pub(crate) struct Reference {
    /// The episode's place in the run, from 0.
    pub(crate) episode: usize,
    /// The step; the start without.
    pub(crate) step: Option<u32>,
}

impl Reference {
    /// Reads `RUN[#EPISODE[:STEP]]` against what the run holds.
    ///
    /// # Errors
    /// When there is no such episode or step.
    pub(crate) fn find(text: &str, tasks: Option<&Path>) -> anyhow::Result<(Reference, RecordedRun)> {
        let (run, rest) = text.rsplit_once('#').unwrap_or((text, "1"));
        let run = PathBuf::from(run);
        let recorded = RecordedRun::open(&run, tasks)?;
        let place = |name: &str| {
            let numbered = name.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
            let by_id = || recorded.episodes.iter().position(|episode| episode.task == name);
            // A task may have a number for its id; what reports print are places.
            numbered.filter(|&at| at < recorded.episodes.len()).or_else(by_id)
        };
        // An id may hold a colon itself.
        let (name, step) = match (place(rest), rest.rsplit_once(':')) {
            (None, Some((name, step))) => {
                let step = step.parse().with_context(|| format!("{text}: {step:?} is not a step"))?;
                (name, Some(step))
            }
            _ => (rest, None),
        };
        let many = recorded.episodes.len();
        let episode = place(name).with_context(|| {
            format!("{}: there is no episode {name:?}; they are numbered 1 to {many}", run.display())
        })?;
        let last = recorded.episodes[episode].trace.len() as u32;
        ensure!(step.is_none_or(|step| step <= last), "{text}: the episode ends at step {last}");
        Ok((Reference { episode, step }, recorded))
    }
}

/// Finds a recorded episode as the command line names it; who acted, and how it is opened.
///
/// # Errors
/// When it cannot be read, or its tasks are not at hand. Opening fails where the simulator does not come to what was recorded.
pub(super) fn recorded(
    episode: &str,
    tasks: Option<&Path>,
    policy: &RecordedPolicy,
) -> anyhow::Result<(PolicyKind, impl FnOnce() -> anyhow::Result<Exploration> + Send + 'static)> {
    let (reference, recorded) = Reference::find(episode, tasks)?;
    let (at, task, _) = recorded.setting(&recorded.episodes[reference.episode])?;
    let (task, episode) = (task.clone(), recorded.episodes[reference.episode].clone());
    let author = recorded.author(at, &episode);
    let first = episode.trace.iter().filter_map(|step| step.author.as_ref()).find(|by| !by.is_hand());
    let acts = first.cloned().unwrap_or_else(|| author.clone());
    let kind = kind_of(&acts);
    policy.check(&recorded.manifest)?;
    let (checkpoint, sought) = (policy.checkpoint()?, policy.remote(&recorded, &acts)?);
    let explored = recorded.manifest.policy == RunManifest::EXPLORED;
    let open = move || -> anyhow::Result<Exploration> {
        let scenes = recorded.scenes;
        let start = EpisodeOrigin::Tasks { tasks: vec![task], index: 0 };
        let is_remote = sought.is_some();
        let agents = policy_source::agents(checkpoint.as_deref(), acts.deciding);
        let policies = Policies::new(sought.map(SoughtPolicy::agent).into_iter().chain(agents).collect());
        let source = EpisodeSource::new(start, 0, scenes);
        let mut exploration = Exploration::new(source, policies, kind, None)?;
        if explored {
            exploration.unlimited();
        }
        // Without its policy an episode can still be seen, step by step.
        exploration.know_places(recorded.places);
        let found = match is_remote {
            true => exploration.choose(kind),
            false => summon(&mut exploration, kind, &acts),
        };
        let thinks = found.is_ok();
        if thinks {
            exploration.begin_as(acts);
        }
        exploration.retrace(&episode, &author, thinks)?;
        exploration.seek(reference.step.unwrap_or(0));
        Ok(exploration)
    };
    Ok((kind, open))
}

/// A recorded episode in an environment with actions of its own, as the command line names it; `None` for one in House.
///
/// # Errors
/// When it cannot be read, or its tasks are not at hand. Opening fails where the environment cannot be reached.
pub(super) fn recorded_remotely(
    episode: &str,
    tasks: Option<&Path>,
    policy: &RecordedPolicy,
    remote: RemoteSettings,
) -> anyhow::Result<Option<(OpenRemote, PolicySource)>> {
    let (reference, recorded) = Reference::find(episode, tasks)?;
    let episode = recorded.episodes[reference.episode].clone();
    let task = recorded.task(&episode)?.clone();
    if task.env.is_none() {
        return Ok(None);
    }
    let at = recorded.set.tasks.iter().position(|other| other.id == task.id).unwrap_or(0);
    let author = recorded.author(at, &episode);
    let named = episode.trace.iter().filter_map(|step| step.author.as_ref()).find(|by| !by.is_hand());
    let acts = named.unwrap_or(&author);
    policy.check(&recorded.manifest)?;
    // Without its policy an episode can still be seen, step by step, and chance acts on.
    let (source, agent) = match policy.remote(&recorded, acts)? {
        None => {
            let decides = (acts.sampling, acts.deciding);
            let found = policy_source::find(&acts.policy, acts.checkpoint.as_deref(), decides, None).ok().flatten();
            let source = found.unwrap_or_else(PolicySource::random);
            (source.clone(), source)
        }
        Some(sought) => match sought.open() {
            Ok(source) => (source.clone(), source),
            Err(error) => {
                say(&format!("{error:#}"));
                let reason = format!("{error:#}");
                (PolicySource::random(), PolicySource::of(&acts.policy, Arc::new(move || bail!("{reason}"))))
            }
        },
    };
    let (places, now) = (recorded.places, source.place());
    let step = reference.step.unwrap_or(0);
    let open = move || {
        let mut exploration = RemoteExploration::open(&task, &episode, &author, remote, source, step)?;
        exploration.know_places(places.into_iter().chain(now));
        Ok(exploration)
    };
    Ok(Some((Box::new(open), agent)))
}

/// Which kind of policy an author is.
fn kind_of(author: &Author) -> PolicyKind {
    match author.policy.as_str() {
        "expert" => PolicyKind::Expert,
        "random" => PolicyKind::Random,
        _ => PolicyKind::Agent,
    }
}

/// Loads the policy that acted: for an agent the checkpoint of the same hash.
fn summon(exploration: &mut Exploration, kind: PolicyKind, author: &Author) -> anyhow::Result<()> {
    if kind != PolicyKind::Agent {
        return exploration.choose(kind);
    }
    for number in 1..=exploration.checkpoints().len() {
        exploration.checkpoint(&number.to_string())?;
        if exploration.author().checkpoint == author.checkpoint {
            return Ok(());
        }
    }
    anyhow::bail!("no checkpoint at hand has the hash that the run names")
}
