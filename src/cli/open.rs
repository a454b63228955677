//! `sprint open`: a recorded episode in the explorer, at any of its steps, ready to go on or to fork.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;

use super::exit_status::ExitStatus;
use super::explore::Display;
use crate::agent::policy_source;
use crate::agent::registry::{Policies, PolicyKind};
use crate::episode::record::Author;
use crate::explore::episode_source::{EpisodeOrigin, EpisodeSource};
use crate::explore::exploration::Exploration;
use crate::run_dir::reader::RecordedRun;

/// Which episode, and how to show it.
#[derive(Args)]
pub(crate) struct Open {
    /// The run folder, with the episode (its number from 1, or its task's id) and the step: RUN, RUN#3, RUN#3:17
    #[arg(value_name = "RUN[#EPISODE[:STEP]]")]
    episode: String,
    /// The task file that the run was made from, where the folder does not hold it
    #[arg(long, value_name = "FILE")]
    tasks: Option<PathBuf>,
    /// The checkpoint folder of the run's agent [default: the one of the run's hash among checkpoints/]
    #[arg(long, value_name = "DIR")]
    checkpoint: Option<PathBuf>,
    #[command(flatten)]
    display: Display,
}

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

impl Open {
    /// Opens the episode.
    ///
    /// # Errors
    /// When it cannot be read, its tasks are not at hand, or the simulator does not come to what was recorded.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let (reference, recorded) = Reference::find(&self.episode, self.tasks.as_deref())?;
        let (at, task, _) = recorded.setting(&recorded.episodes[reference.episode])?;
        let (task, episode) = (task.clone(), recorded.episodes[reference.episode].clone());
        let author = recorded.author(at, &episode);
        let first = episode.trace.iter().filter_map(|step| step.author.as_ref()).find(|by| !by.is_hand());
        let acts = first.cloned().unwrap_or_else(|| author.clone());
        let kind = kind_of(&acts);
        let checkpoint = self.checkpoint.clone();
        let explored = recorded.manifest.policy == "explored";
        let open = move || -> anyhow::Result<Exploration> {
            let scenes = recorded.scenes;
            let start = EpisodeOrigin::Tasks { tasks: vec![task], index: 0 };
            let policies = Policies::new(policy_source::agents(checkpoint.as_deref()));
            let source = EpisodeSource::new(start, 0, scenes);
            let mut exploration = Exploration::new(source, policies, kind, None)?;
            if explored {
                exploration.unlimited();
            }
            // Without its policy an episode can still be seen, step by step.
            let found = summon(&mut exploration, kind, &acts);
            let thinks = found.is_ok();
            if thinks {
                exploration.begin_as(acts);
            }
            exploration.retrace(&episode, &author, thinks)?;
            exploration.seek(reference.step.unwrap_or(0));
            Ok(exploration)
        };
        self.display.paused().show(kind, false, open)
    }
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
