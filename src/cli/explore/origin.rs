//! Where the explorer starts, and how that is opened.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};

use crate::agent::policy_source::{self, PolicySource};
use crate::agent::registry::{Policies, PolicyKind};
use crate::cli::environment::EnvironmentChoice;
use crate::cli::policies::Deciding;
use crate::cli::policy_name::{ExternalPolicy, ExternalPolicyOptions};
use crate::cli::recorded::recorded;
use crate::cli::wish_reader::WishReaderArgs;
use crate::cli::{logging, value_names};
use crate::data::{dataset::Dataset, taskset};
use crate::domain::Room;
use crate::episode::scenes::Scenes;
use crate::episode::wish::Expect;
use crate::explore::episode_source::{EpisodeOrigin, EpisodeSource};
use crate::explore::exploration::Exploration;
use crate::explore::kept_session::KeptSession;
use crate::explore::remote::{OpenRemote, RemoteExploration};
use crate::explore::session_file::SessionFile;
use crate::explore::start_list::{self, Start, StartFolders};
use crate::tui::opening::Opening;

/// Where the explorer starts.
#[derive(Args, Clone)]
pub(crate) struct Origin {
    /// The agent's checkpoint: its folder, its name among checkpoints/, or ORG/NAME[@REVISION] on the Hub [default: the
    /// shipped one]
    #[arg(long, value_name = "DIR|NAME")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Start where a demonstration of this scene of the dataset began
    #[arg(long, value_name = "NAME", conflicts_with = "task")]
    scene: Option<String>,
    /// Start at a task of a file: its number from 1, or its id
    #[arg(long, value_name = "FILE#N")]
    task: Option<String>,
    /// The dataset folder that --scene looks in
    #[arg(long, value_name = "DIR", default_value = DATA)]
    data: PathBuf,
    /// The kind of room of a generated house [default: kitchen]
    #[arg(long, value_parser = value_names::room(), conflicts_with_all = ["scene", "task"])]
    room: Option<Room>,
    #[command(flatten)]
    environment: EnvironmentChoice,
    #[command(flatten)]
    deciding: Deciding,
    /// What to tell the agent, in place of the task's own words
    #[arg(long, value_name = "TEXT")]
    instruction: Option<String>,
    /// What is made of typed instructions: read ones are graded like tasks, or nothing is expected of them
    #[arg(long, value_enum, default_value = "read")]
    expect: ExpectName,
    #[command(flatten)]
    reader: WishReaderArgs,
    /// The seed of the house and of chance [default: 0]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// An external policy, which acts as the agent.
    #[arg(skip)]
    pub(super) other_policy: Option<ExternalPolicy>,
    /// How such policies are dealt with.
    #[arg(skip)]
    pub(super) options: ExternalPolicyOptions,
}

#[derive(Clone, Copy, ValueEnum)]
enum ExpectName {
    Read,
    None,
}

/// The dataset folder where none is named.
const DATA: &str = "data";
/// Demonstrations of one scene that are kept at hand.
const DEMONSTRATIONS: usize = 20;

/// Where the last session is kept; those under way lie beside it.
pub(super) fn kept_session() -> PathBuf {
    logging::path().with_file_name("session.json")
}

impl Default for Origin {
    /// Nothing is named.
    fn default() -> Origin {
        Origin {
            checkpoint: None,
            scene: None,
            task: None,
            data: DATA.into(),
            room: None,
            environment: EnvironmentChoice::default(),
            deciding: Deciding::default(),
            instruction: None,
            expect: ExpectName::Read,
            reader: WishReaderArgs::default(),
            seed: None,
            other_policy: None,
            options: ExternalPolicyOptions::default(),
        }
    }
}

impl Origin {
    /// Who acts in an environment with actions of its own: chance, unless a policy that can was named.
    pub(super) fn external_policy(&self, kind: PolicyKind) -> anyhow::Result<PolicySource> {
        if let Some(checkpoint) = &self.checkpoint {
            return PolicySource::checkpoint(policy_source::folder_of(checkpoint), false, self.deciding.asked());
        }
        if let Some(named) = &self.other_policy {
            return named.open(self.options, false);
        }
        match kind {
            PolicyKind::Expert => Ok(PolicySource::expert()),
            PolicyKind::Random | PolicyKind::Agent => Ok(PolicySource::random()),
        }
    }

    /// How an exploration of another environment than House is opened, where one was named.
    pub(super) fn remote(&self, kind: PolicyKind) -> anyhow::Result<Option<OpenRemote>> {
        let task = match &self.task {
            None => None,
            Some(task) => {
                let (path, wanted) = taskset::split_reference(task);
                let set = taskset::read_told(&path)?.value;
                let index = taskset::pick(&set, wanted.unwrap_or("1")).with_context(|| path.display().to_string())?;
                set.tasks.into_iter().nth(index).filter(|task| task.env.is_some())
            }
        };
        let named = self.environment.remote().cloned();
        let Some(name) = named.or_else(|| task.as_ref().and_then(|task| task.env.clone())) else { return Ok(None) };
        if self.scene.is_some() || self.room.is_some() || (self.task.is_some() && task.is_none()) {
            bail!("--scene, --room and House's tasks are about House, but --env names {name}");
        }
        let (reach, agent) = (self.environment.reach(), self.external_policy(kind)?);
        let seed = self.seed.or_else(|| task.as_ref().and_then(|task| task.seed)).unwrap_or(0);
        let of_task = task.map(|task| task.instruction).filter(|instruction| !instruction.is_empty());
        let told = self.instruction.clone().or(of_task);
        Ok(Some(Box::new(move || RemoteExploration::new(&name, reach, agent, seed, told.as_deref()))))
    }

    /// What is made of what is typed.
    pub(super) fn expect(&self) -> anyhow::Result<Expect> {
        match (self.expect, self.reader.open()?) {
            (ExpectName::None, Some(_)) => bail!("--expect none reads nothing: leave out --reader"),
            (ExpectName::None, None) => Ok(Expect::None),
            (ExpectName::Read, Some(served)) => Ok(Expect::ReadBy(served)),
            (ExpectName::Read, None) => Ok(Expect::Read),
        }
    }

    /// Whether the command line says where to start, or with whom.
    pub(super) fn is_named(&self) -> bool {
        let texts = [&self.scene, &self.task, &self.instruction];
        texts.iter().any(|text| text.is_some())
            || self.checkpoint.is_some()
            || self.room.is_some()
            || self.seed.is_some()
            || self.environment.remote().is_some()
            || !self.deciding.asked().is_none()
    }

    /// The same without what was named: where to look, and what is made of what is typed.
    pub(super) fn unnamed(self) -> Origin {
        let Origin { data, expect, reader, options, .. } = self;
        Origin { data, expect, reader, options, ..Origin::default() }
    }

    /// Everything that there is to start with, and how it is opened.
    pub(super) fn list(&self) -> Opening {
        let folders = StartFolders {
            session: kept_session(),
            data: self.data.clone(),
            here: ".".into(),
            checkpoints: policy_source::checkpoints(),
        };
        let from = self.clone();
        Opening::Picked(start_list::list(&folders), Arc::new(move |start| from.open(start)))
    }

    /// Opens what was picked from the list.
    fn open(&self, start: &Start) -> anyhow::Result<Exploration> {
        let mut from = self.clone();
        match start {
            Start::Session(path) => {
                // From here on nobody else takes it up.
                let taken = SessionFile::take(path, &kept_session())?;
                let kept = KeptSession::read(path)?;
                let agents = policy_source::agents(None, kept.author.deciding);
                let meant = kept.checkpoint.as_deref().and_then(|name| name.parse::<ExternalPolicy>().ok());
                let external = meant.iter().map(|named| named.agent(self.options));
                let policies = Policies::new(external.chain(agents).collect());
                let taken_up = Exploration::take_up(&kept, policies).context("the session cannot be taken up")?;
                return Ok(taken_up.taken_from(taken).reading_as(self.expect()?));
            }
            Start::Run { folder, number } => {
                let (_, open) = recorded(&format!("{}#{number}", folder.display()), None, &self.options.into())?;
                return open();
            }
            Start::House { room, seed } => (from.room, from.seed) = (Some(*room), Some(*seed)),
            Start::FloorPlan(name) => from.scene = Some(name.clone()),
            Start::Task { file, number } => from.task = Some(format!("{}#{number}", file.display())),
            Start::Checkpoint(folder) => from.checkpoint = Some(folder.clone()),
        }
        from.exploration(PolicyKind::Agent)
    }

    pub(super) fn exploration(&self, kind: PolicyKind) -> anyhow::Result<Exploration> {
        let (start, scenes) = self.start()?;
        let source = EpisodeSource::new(start, self.seed.unwrap_or(0), scenes);
        let asked = self.deciding.asked();
        let remote = self.other_policy.iter().map(|named| named.agent(self.options));
        let agents = policy_source::agents(self.checkpoint.as_deref(), asked);
        let policies = Policies::new(remote.chain(agents).collect());
        let exploration = Exploration::new(source, policies, kind, None)?.deciding(asked);
        exploration.expecting(self.expect()?, self.instruction.as_deref())
    }

    fn start(&self) -> anyhow::Result<(EpisodeOrigin, Scenes)> {
        if let Some(task) = &self.task {
            let (path, wanted) = taskset::split_reference(task);
            let set = taskset::read_told(&path)?.value;
            let scenes = Scenes::of(&path, &set);
            let index = taskset::pick(&set, wanted.unwrap_or("1")).with_context(|| path.display().to_string())?;
            return Ok((EpisodeOrigin::Tasks { tasks: set.tasks, index }, scenes));
        }
        let none = Scenes::in_folder(None);
        if let Some(name) = &self.scene {
            let dataset = Dataset::open(&self.data)?;
            let scene = dataset.scene(name)?;
            let mut trajectories = Vec::new();
            for trajectory in dataset.trajectories()? {
                let trajectory = trajectory?;
                if matches!(&trajectory.scene, crate::domain::task::SceneRef::Named(other) if other == name) {
                    trajectories.push(trajectory);
                }
                if trajectories.len() == DEMONSTRATIONS {
                    break;
                }
            }
            if trajectories.is_empty() {
                bail!("{}: no demonstration was recorded in {name}", self.data.display());
            }
            return Ok((EpisodeOrigin::Recorded { scene, trajectories }, none));
        }
        Ok((EpisodeOrigin::Generated(self.room.unwrap_or(Room::Kitchen)), none))
    }
}
