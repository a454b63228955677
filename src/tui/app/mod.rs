//! The explorer's state: everything that the screen shows.

mod display;
mod input;
mod pages;
mod session_state;

pub use display::{FrameState, Graphics, TerminalState, Traffic};
pub(crate) use input::{HelpState, InputState};
pub(crate) use pages::{
    ActionsPageState, BranchesPageState, ChainPageState, ComparePageState, MainPageState, MindPageState, ValueMapState,
    WorldPageState,
};
pub(crate) use session_state::SessionState;

use ratatui::layout::{Rect, Size};

use super::config::ExplorerConfig;
use super::graphics::Job;
use super::graphics::labels::ThingLabel;
use super::graphics::overlay::Overlay;
use super::layout::ScreenLayout;
use super::log::{EventLog, LogEntry, Tone};
use super::theme::Ability;
use crate::agent::registry::PolicyKind;
use crate::explore::exploration::SessionSnapshot;
use crate::explore::verb::ExplorerPage;
use crate::house::view::Candidate;

/// Columns that a picture needs so that its labels have names.
const NAMED: u16 = 60;

/// Everything that the screen shows.
pub struct App {
    /// The terminal: size, colours, pictures, mouse.
    pub(crate) terminal: TerminalState,
    /// What a person has set.
    pub(crate) config: ExplorerConfig,
    /// What keys mean, and what was typed.
    pub(crate) input: InputState,
    /// What was last told of the session.
    pub(crate) session: SessionState,
    /// The page that is shown.
    pub(crate) page: ExplorerPage,
    /// The main page.
    pub(crate) main: MainPageState,
    /// The page of branches.
    pub(crate) branches: BranchesPageState,
    /// The page of the policy's choices.
    pub(crate) mind: MindPageState,
    /// The page of the house.
    pub(crate) world: WorldPageState,
    /// The page of two instructions.
    pub(crate) compare: ComparePageState,
    /// The page of a chain.
    pub(crate) chain: ChainPageState,
    /// The page of every action.
    pub(crate) actions: ActionsPageState,
    /// The values on the map.
    pub(crate) value_map: ValueMapState,
    /// The frame as it was encoded last.
    pub(crate) frame: FrameState,
    /// What pictures cost.
    pub(crate) traffic: Traffic,
    /// What happened, for the log panel.
    pub(crate) log: EventLog,
    /// What was noted since the last key.
    pub(crate) notice: Option<LogEntry>,
}

impl App {
    /// Nothing seen yet.
    pub fn new(size: Size, graphics: Graphics, ability: Ability, policy: PolicyKind, manual: bool) -> App {
        App {
            terminal: TerminalState { size, ability, graphics, mouse: false },
            config: ExplorerConfig::default(),
            input: InputState::new(manual),
            session: SessionState::new(policy),
            page: ExplorerPage::Main,
            main: MainPageState::default(),
            branches: BranchesPageState::default(),
            mind: MindPageState::default(),
            world: WorldPageState::default(),
            compare: ComparePageState::default(),
            chain: ChainPageState::default(),
            actions: ActionsPageState::default(),
            value_map: ValueMapState::default(),
            frame: FrameState::default(),
            traffic: Traffic::default(),
            log: EventLog::default(),
            notice: None,
        }
    }

    /// Forgets what belonged to the house before.
    pub(crate) fn enter_episode(&mut self) {
        self.branches.divergence = None;
        self.compare = ComparePageState { selected: self.compare.selected, ..ComparePageState::default() };
        self.chain = ChainPageState { selected: self.chain.selected, ..ChainPageState::default() };
        (self.value_map.is_painted, self.value_map.map) = (false, None);
    }

    /// The line of the present page's list that is selected.
    pub(crate) fn selected(&self) -> usize {
        match self.page {
            ExplorerPage::Main | ExplorerPage::Frame => 0,
            ExplorerPage::Branches => self.branches.selected,
            ExplorerPage::Mind => self.mind.selected,
            ExplorerPage::World => self.world.selected,
            ExplorerPage::Compare => self.compare.selected,
            ExplorerPage::Chain => self.chain.selected,
            ExplorerPage::Actions => self.actions.selected,
        }
    }

    /// Selects a line of the present page's list.
    pub(crate) fn select(&mut self, line: usize) {
        match self.page {
            ExplorerPage::Main | ExplorerPage::Frame => {}
            ExplorerPage::Branches => self.branches.selected = line,
            ExplorerPage::Mind => self.mind.selected = line,
            ExplorerPage::World => self.world.selected = line,
            ExplorerPage::Compare => self.compare.selected = line,
            ExplorerPage::Chain => self.chain.selected = line,
            ExplorerPage::Actions => self.actions.selected = line,
        }
    }

    /// Where everything is.
    pub(crate) fn layout(&self) -> Option<ScreenLayout> {
        let screen = Rect::from((ratatui::layout::Position::ORIGIN, self.terminal.size));
        match self.page {
            ExplorerPage::Frame => ScreenLayout::frame_alone(screen),
            _ => ScreenLayout::of(screen),
        }
    }

    /// Whether the frame is all that is shown, asked for or for want of room.
    pub(crate) fn is_frame_alone(&self) -> bool {
        self.layout().is_some_and(|layout| layout.is_frame_alone)
    }

    /// The character cells that the picture fills, where the page has one.
    pub(crate) fn picture_area(&self) -> Option<Rect> {
        let layout = self.layout()?;
        match self.page {
            _ if layout.is_frame_alone => {
                Some(layout.picture(self.terminal.graphics.protocol, self.terminal.graphics.cell_pixels))
            }
            ExplorerPage::Main | ExplorerPage::Frame => {
                Some(layout.picture(self.terminal.graphics.protocol, self.terminal.graphics.cell_pixels))
            }
            ExplorerPage::Branches => {
                self.branches.divergence.as_ref()?.frames.as_ref()?;
                Some(layout.branches(self.rows(), self.wishes(), self.terminal.graphics.cell_pixels).frames)
            }
            ExplorerPage::Mind
            | ExplorerPage::World
            | ExplorerPage::Compare
            | ExplorerPage::Chain
            | ExplorerPage::Actions => None,
        }
    }

    /// The interactions on the present page, numbered from 1.
    pub(crate) fn page_of_candidates(&self) -> &[Candidate] {
        let Some(now) = &self.session.now else { return &[] };
        let size = self.layout().map_or(9, |layout| layout.interactions()).max(1);
        now.candidates.chunks(size).nth(self.main.interactions).unwrap_or(&[])
    }

    /// How many pages of interactions there are.
    pub(crate) fn pages(&self) -> usize {
        let size = self.layout().map_or(9, |layout| layout.interactions()).max(1);
        self.session.now.as_ref().map_or(0, |now| now.candidates.len().div_ceil(size))
    }

    /// How many wishes were told on the way to the present state.
    pub(crate) fn wishes(&self) -> usize {
        self.session.now.as_ref().map_or(0, |now| now.wishes.len())
    }

    /// How many rows the list of the present page has.
    pub(crate) fn rows(&self) -> usize {
        let Some(now) = &self.session.now else { return 0 };
        match self.page {
            ExplorerPage::Branches => now.time.branches.len(),
            ExplorerPage::World => now.scene.fixtures.len() + now.world.objects.len(),
            ExplorerPage::Mind => 5 + now.candidates.len(),
            ExplorerPage::Compare => self.compare.contrast.as_ref().map_or(0, |contrast| contrast.rows.len()),
            ExplorerPage::Chain => self.chain.own.as_ref().map_or(0, |chain| chain.links.len()),
            ExplorerPage::Actions => self.actions.lines.len(),
            ExplorerPage::Main | ExplorerPage::Frame => 0,
        }
    }

    /// The frame to be encoded, as things stand.
    pub(crate) fn job(&self) -> Option<Job> {
        let now = self.session.now.as_ref()?;
        let cells = self.picture_area()?.as_size();
        let pair = self.branches.divergence.as_ref().and_then(|divergence| divergence.frames.as_ref());
        let (frame, overlay) = match pair.filter(|_| self.page == ExplorerPage::Branches && !self.is_frame_alone()) {
            Some((pair, _)) => (pair.clone(), Overlay::Colour),
            None => (now.frame.clone(), self.main.overlay),
        };
        let plain = (self.page == ExplorerPage::Main || self.is_frame_alone()) && overlay != Overlay::Frames;
        let labels =
            if plain && self.main.numbers && self.session.run_mode.is_none() { self.labelled(now) } else { Vec::new() };
        (cells.width > 0 && cells.height > 0).then(|| Job {
            frame,
            overlay,
            coarseness: self.traffic.coarseness,
            budget: self.traffic.budget(),
            in_blocks: self.traffic.are_sequences_too_large(),
            in_tmux: self.terminal.graphics.in_tmux,
            recent: now.recent.clone(),
            letters: self.frame.letters.clone(),
            classes: self.frame.names.clone(),
            labels,
            protocol: self.terminal.graphics.protocol,
            cells,
            cell_pixels: self.terminal.graphics.cell_pixels,
        })
    }

    fn labelled(&self, now: &SessionSnapshot) -> Vec<ThingLabel> {
        let target = self.session.decision.as_ref().and_then(|(decision, _)| decision.action.target);
        // Names need room.
        let named = self.picture_area().is_some_and(|area| area.width >= NAMED);
        let mut labels: Vec<ThingLabel> = Vec::new();
        for sighting in &now.view.sightings {
            let numbers: Vec<String> = (1..)
                .zip(self.page_of_candidates())
                .filter(|(_, candidate)| candidate.instance == sighting.instance)
                .map(|(number, _): (usize, _)| number.to_string())
                .collect();
            let chosen = target == Some(sighting.instance);
            if chosen || !numbers.is_empty() {
                let number = if numbers.is_empty() { "*".into() } else { numbers.join(",") };
                let class = now.world.class_of(&now.scene, sighting.instance).filter(|_| named);
                let text = class.map_or(number.clone(), |class| format!("{number} {}", class.spoken()));
                labels.push(ThingLabel { bounds: sighting.bounds, text, chosen });
            }
        }
        // The chosen one is drawn last, over its neighbours.
        labels.sort_by_key(|label| label.chosen);
        labels
    }

    /// Adds a line to the log, and shows it on pages without one until the next key.
    pub(crate) fn note(&mut self, tone: Tone, text: impl Into<String>) {
        let entry = self.entry(tone, text);
        self.notice = Some(entry.clone());
        self.log.write(entry);
    }

    /// Adds a line to the log alone.
    pub(crate) fn write(&mut self, tone: Tone, text: impl Into<String>) {
        let entry = self.entry(tone, text);
        self.log.write(entry);
    }

    fn entry(&self, tone: Tone, text: impl Into<String>) -> LogEntry {
        let step = self.session.now.as_ref().map(|now| now.step);
        LogEntry { step, text: text.into(), outcome: String::new(), tone }
    }
}
