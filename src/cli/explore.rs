//! `sprint explore`: opens what the explorer starts in, and starts it.

use std::io::{BufReader, IsTerminal, Write};
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use etcetera::BaseStrategy;

use super::environment::EnvironmentChoice;
use super::exit_status::ExitStatus;
use super::policies::Deciding;
use super::policy_name::{Elsewhere, ElsewhereOptions, PolicyName, PolicyNameParser};
use super::recorded::recorded;
use super::streams::Printable;
use super::wish_reader::WishReaderArgs;
use super::{checkpoint, logging, value_names};
use crate::agent::policy_source::{self, PolicySource};
use crate::agent::registry::{Policies, PolicyKind};
use crate::data::{dataset::Dataset, taskset, text_file};
use crate::domain::Room;
use crate::episode::scenes::Scenes;
use crate::episode::wish::Expect;
use crate::explore::elsewhere::{self, OpenOwn, OwnExploration};
use crate::explore::episode_source::{EpisodeOrigin, EpisodeSource};
use crate::explore::exploration::Exploration;
use crate::explore::kept_session::KeptSession;
use crate::explore::plain;
use crate::explore::plain_input::PlainInput;
use crate::explore::start_list::{self, Start, StartFolders};
use crate::tui::config::ExplorerConfig;
use crate::tui::graphics::Protocol;
use crate::tui::opening::Opening;
use crate::tui::screen;
use crate::tui::update::ExitReason;

/// Where the explorer starts, and who acts.
#[derive(Args)]
pub(crate) struct Explore {
    #[command(flatten)]
    from: Origin,
    #[command(flatten)]
    display: Display,
    /// Who acts at first [default: agent]
    #[arg(long, value_name = "POLICY", value_parser = PolicyNameParser::EXPLORER)]
    policy: Option<PolicyName>,
    #[command(flatten)]
    elsewhere: ElsewhereOptions,
    /// Print a file of settings with a comment on each, and end
    #[arg(long)]
    print_config: bool,
}

/// Where the explorer starts.
#[derive(Args, Clone)]
pub(crate) struct Origin {
    /// The agent's checkpoint: its folder, its name among checkpoints/, or ORG/NAME[@REVISION] on the Hub [default: the
    /// shipped one]
    #[arg(long, value_name = "DIR|NAME")]
    checkpoint: Option<PathBuf>,
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
    /// A policy from elsewhere, which acts as the agent.
    #[arg(skip)]
    other_policy: Option<(Elsewhere, ElsewhereOptions)>,
}

/// How the explorer is shown.
#[derive(Args)]
pub(crate) struct Display {
    /// How to show pictures
    #[arg(long, value_enum, default_value = "auto")]
    graphics: GraphicsName,
    /// No screen: a verb a line on standard input, a line a step on standard output
    #[arg(long)]
    plain: bool,
    /// The most that a step's picture may cost on the wire; pictures get coarser to keep to it
    #[arg(long, value_name = "KB")]
    bandwidth: Option<u32>,
    /// Wait for a key before the first step
    #[arg(long)]
    paused: bool,
}

impl Display {
    /// Explores until the person leaves.
    ///
    /// # Errors
    /// When the exploration cannot be opened, or there is no terminal.
    pub(crate) fn show(
        self,
        kind: PolicyKind,
        manual: bool,
        from: &Origin,
        open: impl FnOnce() -> anyhow::Result<Exploration> + Send + 'static,
    ) -> anyhow::Result<ExitStatus> {
        if self.plain {
            let (input, control) = PlainInput::steered(BufReader::new(std::io::stdin()))?;
            let out = Printable::new(std::io::stdout().lock());
            let _listens = control.listen();
            // At a terminal a person has seen what was refused; of a script nobody may have.
            let obeyed = plain::run(open()?, input, &control, out)? || std::io::stdin().is_terminal();
            return Ok(if obeyed { ExitStatus::Ok } else { ExitStatus::SomeFailed });
        }
        self.show_screen(kind, manual, || Opening::Named(Box::new(open)), || from.list())
    }

    /// Explores an environment with actions of its own until the person leaves.
    ///
    /// # Errors
    /// When the environment cannot be reached, or there is no terminal.
    pub(crate) fn show_elsewhere(self, manual: bool, open: OpenOwn, agent: PolicySource) -> anyhow::Result<ExitStatus> {
        if self.plain {
            let (input, control) = PlainInput::steered(BufReader::new(std::io::stdin()))?;
            let out = Printable::new(std::io::stdout().lock());
            let _listens = control.listen();
            let obeyed =
                elsewhere::plain::run(open()?, &agent, input, &control, out)? || std::io::stdin().is_terminal();
            return Ok(if obeyed { ExitStatus::Ok } else { ExitStatus::SomeFailed });
        }
        let options = self.screen_options(PolicyKind::Random, manual)?;
        Ok(match crate::tui::elsewhere::run(options, open, agent)? {
            ExitReason::Signal(_) => ExitStatus::Interrupted,
            ExitReason::Asked | ExitReason::ToList | ExitReason::WorkerGone => ExitStatus::Ok,
        })
    }

    /// The same on the screen; `opening` says what is opened, once it is known that there is a screen, and `list` what there is to
    /// come back to.
    fn show_screen(
        self,
        kind: PolicyKind,
        manual: bool,
        opening: impl FnOnce() -> Opening,
        list: impl Fn() -> Opening,
    ) -> anyhow::Result<ExitStatus> {
        let screen = self.screen_options(kind, manual)?;
        match screen::run(screen, opening(), list)? {
            ExitReason::Signal(_) => Ok(ExitStatus::Interrupted),
            ExitReason::Asked | ExitReason::ToList | ExitReason::WorkerGone => Ok(ExitStatus::Ok),
        }
    }

    /// What the screen is started with.
    fn screen_options(self, kind: PolicyKind, manual: bool) -> anyhow::Result<screen::ScreenOptions> {
        if !std::io::stdout().is_terminal() || !std::io::stdin().is_terminal() {
            bail!("the explorer needs a terminal; with --plain it reads verbs from standard input instead");
        }
        let protocol = self.graphics.protocol();
        let log = logging::open().ok();
        let (config, memory) = (settings()?, Some(logging::path().with_file_name("terminals.json")));
        let history = Some(logging::path().with_file_name("history"));
        let bandwidth = self.bandwidth.filter(|&kilobytes| kilobytes > 0).map(|kilobytes| 1000 * u64::from(kilobytes));
        let runs = !self.paused;
        let session = Some(kept_session());
        let policy = kind;
        Ok(screen::ScreenOptions { protocol, policy, manual, runs, config, memory, history, session, bandwidth, log })
    }

    /// The same, but waiting for a key before the first step.
    pub(crate) fn paused(self) -> Display {
        Display { paused: true, ..self }
    }
}

/// What the person has set in `sprint/explorer.toml` of the configuration folder.
pub(super) fn settings() -> anyhow::Result<ExplorerConfig> {
    let Ok(base) = etcetera::choose_base_strategy() else { return Ok(ExplorerConfig::default()) };
    let path = base.config_dir().join("sprint").join("explorer.toml");
    match text_file::read(&path) {
        Ok(text) => ExplorerConfig::parse(&text).with_context(|| path.display().to_string()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(ExplorerConfig::default()),
        Err(error) => Err(error).with_context(|| format!("cannot read {}", path.display())),
    }
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum GraphicsName {
    Auto,
    Kitty,
    Iterm2,
    Sixel,
    Halfblocks,
    Ascii,
}

impl GraphicsName {
    /// The way to show pictures; nothing where it has to be found out.
    pub(super) fn protocol(self) -> Option<Protocol> {
        match self {
            GraphicsName::Auto => None,
            GraphicsName::Kitty => Some(Protocol::Kitty),
            GraphicsName::Iterm2 => Some(Protocol::Iterm2),
            GraphicsName::Sixel => Some(Protocol::Sixel),
            GraphicsName::Halfblocks => Some(Protocol::HalfBlocks),
            GraphicsName::Ascii => Some(Protocol::Ascii),
        }
    }
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

impl Explore {
    /// Explores until the person leaves.
    ///
    /// # Errors
    /// When what it should start in cannot be opened, or there is no terminal.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        if self.print_config {
            write!(std::io::stdout(), "{}", ExplorerConfig::commented())?;
            return Ok(ExitStatus::Ok);
        }
        let manual = matches!(self.policy, Some(PolicyName::Manual));
        let kind = match self.policy {
            None | Some(PolicyName::Agent | PolicyName::Manual | PolicyName::Elsewhere(_)) => PolicyKind::Agent,
            Some(PolicyName::Expert) => PolicyKind::Expert,
            Some(PolicyName::Random) => PolicyKind::Random,
        };
        let is_named = self.policy.is_some() || self.from.is_named();
        // What is wrong with it is said before there is a screen.
        self.from.expect()?;
        let Explore { display, mut from, policy, elsewhere, .. } = self;
        from.checkpoint = from.checkpoint.as_deref().map(checkpoint::folder).transpose()?;
        if let Some(PolicyName::Elsewhere(named)) = &policy {
            if from.checkpoint.is_some() {
                bail!("--checkpoint names a trained agent, but --policy asks for another: leave one of them out");
            }
            from.other_policy = Some((named.clone(), elsewhere));
        }
        if let Some(open) = from.elsewhere(kind)? {
            if matches!(policy, Some(PolicyName::Agent)) {
                bail!("the trained agents act in House only: name --policy random or manual with --env");
            }
            let agent = from.policy_elsewhere(kind)?;
            return display.show_elsewhere(manual || policy.is_none(), open, agent);
        }
        if !is_named && !display.plain {
            return display.show_screen(kind, manual, || from.list(), || from.list());
        }
        // The screen shows what is wrong with an agent; a script is told by the exit code.
        let is_chosen = from.checkpoint.is_some() || from.other_policy.is_some();
        let needed = display.plain && is_chosen && kind == PolicyKind::Agent;
        let list = from.clone().unnamed();
        display.show(kind, manual, &list, move || {
            let mut exploration = from.exploration(kind)?;
            if needed {
                exploration.choose(kind)?;
            }
            Ok(exploration)
        })
    }
}

/// Where a session is kept as it goes on.
fn kept_session() -> PathBuf {
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
        }
    }
}

impl Origin {
    /// Who acts in an environment with actions of its own: chance, unless a policy that can was named.
    fn policy_elsewhere(&self, kind: PolicyKind) -> anyhow::Result<PolicySource> {
        if let Some(checkpoint) = &self.checkpoint {
            return PolicySource::checkpoint(policy_source::folder_of(checkpoint), false, self.deciding.asked());
        }
        if let Some((named, options)) = &self.other_policy {
            return named.open(*options, false);
        }
        match kind {
            PolicyKind::Expert => Ok(PolicySource::expert()),
            PolicyKind::Random | PolicyKind::Agent => Ok(PolicySource::random()),
        }
    }

    /// How an exploration of another environment than House is opened, where one was named.
    fn elsewhere(&self, kind: PolicyKind) -> anyhow::Result<Option<OpenOwn>> {
        let task = match &self.task {
            None => None,
            Some(task) => {
                let (path, wanted) = taskset::split_reference(task);
                let set = taskset::read_told(&path)?.value;
                let index = taskset::pick(&set, wanted.unwrap_or("1")).with_context(|| path.display().to_string())?;
                set.tasks.into_iter().nth(index).filter(|task| task.env.is_some())
            }
        };
        let named = self.environment.elsewhere().cloned();
        let Some(name) = named.or_else(|| task.as_ref().and_then(|task| task.env.clone())) else { return Ok(None) };
        if self.scene.is_some() || self.room.is_some() || (self.task.is_some() && task.is_none()) {
            bail!("--scene, --room and House's tasks are about House, but --env names {name}");
        }
        let (reach, agent) = (self.environment.reach(), self.policy_elsewhere(kind)?);
        let seed = self.seed.or_else(|| task.as_ref().and_then(|task| task.seed)).unwrap_or(0);
        let of_task = task.map(|task| task.instruction).filter(|instruction| !instruction.is_empty());
        let told = self.instruction.clone().or(of_task);
        Ok(Some(Box::new(move || OwnExploration::new(&name, reach, agent, seed, told.as_deref()))))
    }

    /// What is made of what is typed.
    fn expect(&self) -> anyhow::Result<Expect> {
        match (self.expect, self.reader.open()?) {
            (ExpectName::None, Some(_)) => bail!("--expect none reads nothing: leave out --reader"),
            (ExpectName::None, None) => Ok(Expect::None),
            (ExpectName::Read, Some(served)) => Ok(Expect::ReadBy(served)),
            (ExpectName::Read, None) => Ok(Expect::Read),
        }
    }

    /// Whether the command line says where to start, or with whom.
    fn is_named(&self) -> bool {
        let texts = [&self.scene, &self.task, &self.instruction];
        texts.iter().any(|text| text.is_some())
            || self.checkpoint.is_some()
            || self.room.is_some()
            || self.seed.is_some()
            || self.environment.elsewhere().is_some()
            || !self.deciding.asked().is_none()
    }

    /// The same without what was named: where to look, and what is made of what is typed.
    fn unnamed(self) -> Origin {
        Origin { data: self.data, expect: self.expect, reader: self.reader, ..Origin::default() }
    }

    /// Everything that there is to start with, and how it is opened.
    fn list(&self) -> Opening {
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
                let kept = KeptSession::read(path)?;
                let policies = Policies::new(policy_source::agents(None, kept.author.deciding));
                let taken_up = Exploration::take_up(&kept, policies).context("the last session cannot be taken up")?;
                return Ok(taken_up.taken_from(path.clone()).reading_as(self.expect()?));
            }
            Start::Run { folder, number } => {
                let (_, open) = recorded(&format!("{}#{number}", folder.display()), None, None)?;
                return open();
            }
            Start::House { room, seed } => (from.room, from.seed) = (Some(*room), Some(*seed)),
            Start::FloorPlan(name) => from.scene = Some(name.clone()),
            Start::Task { file, number } => from.task = Some(format!("{}#{number}", file.display())),
            Start::Checkpoint(folder) => from.checkpoint = Some(folder.clone()),
        }
        from.exploration(PolicyKind::Agent)
    }

    fn exploration(&self, kind: PolicyKind) -> anyhow::Result<Exploration> {
        let (start, scenes) = self.start()?;
        let source = EpisodeSource::new(start, self.seed.unwrap_or(0), scenes);
        let asked = self.deciding.asked();
        let elsewhere = self.other_policy.iter().map(|(named, options)| named.agent(*options));
        let agents = policy_source::agents(self.checkpoint.as_deref(), asked);
        let policies = Policies::new(elsewhere.chain(agents).collect());
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
