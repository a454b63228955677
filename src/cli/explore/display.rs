//! How the explorer is shown: on a screen, or in plain lines.

use std::io::{BufReader, IsTerminal};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use etcetera::BaseStrategy;

use super::origin::{Origin, kept_session};
use crate::agent::policy_source::PolicySource;
use crate::agent::registry::PolicyKind;
use crate::cli::exit_status::ExitStatus;
use crate::cli::logging;
use crate::cli::streams::{Printable, StandardOutput};
use crate::data::text_file;
use crate::explore::exploration::Exploration;
use crate::explore::plain;
use crate::explore::plain_input::PlainInput;
use crate::explore::remote::{self, OpenRemote};
use crate::tui::config::ExplorerConfig;
use crate::tui::graphics::Protocol;
use crate::tui::opening::Opening;
use crate::tui::screen;
use crate::tui::update::ExitReason;

/// How the explorer is shown.
#[derive(Args)]
pub(crate) struct Display {
    /// How to show pictures
    #[arg(long, value_enum, default_value = "auto")]
    graphics: GraphicsName,
    /// No screen: a verb a line on standard input, a line a step on standard output
    #[arg(long)]
    pub(super) plain: bool,
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
            let out = Printable::new(StandardOutput::lock());
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
    pub(crate) fn show_remote(self, manual: bool, open: OpenRemote, agent: PolicySource) -> anyhow::Result<ExitStatus> {
        if self.plain {
            let (input, control) = PlainInput::steered(BufReader::new(std::io::stdin()))?;
            let out = Printable::new(StandardOutput::lock());
            let _listens = control.listen();
            let obeyed = remote::plain::run(open()?, &agent, input, &control, out)? || std::io::stdin().is_terminal();
            return Ok(if obeyed { ExitStatus::Ok } else { ExitStatus::SomeFailed });
        }
        let options = self.screen_options(PolicyKind::Random, manual)?;
        Ok(match crate::tui::remote::run(options, open, agent)? {
            ExitReason::Signal(_) => ExitStatus::Interrupted,
            ExitReason::Asked | ExitReason::ToList | ExitReason::WorkerGone => ExitStatus::Ok,
        })
    }

    /// The same on the screen; `opening` says what is opened, once it is known that there is a screen, and `list` what there is to
    /// come back to.
    pub(super) fn show_screen(
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
pub(crate) fn settings() -> anyhow::Result<ExplorerConfig> {
    let Ok(base) = etcetera::choose_base_strategy() else { return Ok(ExplorerConfig::default()) };
    let path = base.config_dir().join("sprint").join("explorer.toml");
    match text_file::read(&path) {
        Ok(text) => ExplorerConfig::parse(&text).with_context(|| path.display().to_string()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(ExplorerConfig::default()),
        Err(error) => Err(error).with_context(|| format!("cannot read {}", path.display())),
    }
}

#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum GraphicsName {
    Auto,
    Kitty,
    Iterm2,
    Sixel,
    Halfblocks,
    Ascii,
}

impl GraphicsName {
    /// The way to show pictures; nothing where it has to be found out.
    pub(crate) fn protocol(self) -> Option<Protocol> {
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
