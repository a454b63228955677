//! The explorer's state: everything that the screen shows.

use std::sync::Arc;

use ratatui::layout::{Rect, Size};

use super::config::Config;
use super::editor::Editor;
use super::graphics::classes::{Letters, Names};
use super::graphics::labels::Label;
use super::graphics::overlay::Overlay;
use super::graphics::{Job, Picture, Protocol};
use super::keys::Mode;
use super::layout::Layout;
use super::log::{Entry, Log, Tone};
use super::theme::Ability;
use crate::agent::registry::PolicyKind;
use crate::agent::{Decision, Values};
use crate::analysis::instruction_ab::Contrast;
use crate::analysis::value_map::ValueMap;
use crate::domain::Heading;
use crate::explore::breakpoints::Condition;
use crate::explore::chained::Chained;
use crate::explore::choices::Sort;
use crate::explore::session::Snapshot;
use crate::explore::timeline::Divergence;
use crate::explore::verb::Page;
use crate::explore::worker::{Going, Pace};
use crate::house::view::Candidate;

/// Columns that a picture needs so that its labels have names.
const NAMED: u16 = 60;
/// How pictures are shown, and why.
#[derive(Clone, Debug)]
pub struct Graphics {
    /// How.
    pub protocol: Protocol,
    /// Why.
    pub reason: String,
    /// The pixels of a character cell, width and height.
    pub cell_pixels: (u16, u16),
    /// Sequences have to pass through tmux.
    pub in_tmux: bool,
}

/// Everything that the screen shows.
pub struct App {
    /// The terminal's size.
    pub size: Size,
    /// What keys mean.
    pub mode: Mode,
    /// What is shown in place of the panels.
    pub page: Page,
    /// The line of a page's list that is selected.
    pub selected: usize,
    /// What keys meant before typing or help.
    pub under: Mode,
    /// What the terminal can show.
    pub ability: Ability,
    /// What a person has set.
    pub config: Config,
    /// How pictures are shown.
    pub graphics: Graphics,
    /// The newest state.
    pub now: Option<Box<Snapshot>>,
    /// Two instructions in one state.
    pub contrast: Option<Contrast>,
    /// In which state that was: the branch and the step.
    pub contrast_at: Option<(usize, u32)>,
    /// Values are painted on the map.
    pub paints_values: bool,
    /// The values, and the step of the house that they are for.
    pub landscape: Option<(Arc<ValueMap>, u32)>,
    /// The heading whose values are painted; the best without one.
    pub heading: Option<Heading>,
    /// The chain that is followed.
    pub chain: Option<Chained>,
    /// The same chain followed by another policy.
    pub rival: Option<Chained>,
    /// Work in the background.
    pub working: Option<String>,
    /// The most that a step may cost on the wire, in bytes.
    pub bandwidth: Option<u64>,
    /// How coarse pictures are to keep to that.
    pub coarseness: u8,
    /// What the policy would do next, and that in words.
    pub thought: Option<(Decision, String)>,
    /// What its critics say of the present state.
    pub values: Option<Values>,
    /// Who decides.
    pub policy: PolicyKind,
    /// How it goes on by itself, if it does.
    pub going: Option<Going>,
    /// Where runs stop.
    pub breaks: Vec<Condition>,
    /// How two branches part, where that was asked for.
    pub divergence: Option<Divergence>,
    /// How fast.
    pub pace: Pace,
    /// Something slow goes on.
    pub busy: Option<String>,
    /// Why the policy cannot go on.
    pub trouble: Option<String>,
    /// What happened.
    pub log: Log,
    /// What was noted since the last key.
    pub notice: Option<Entry>,
    /// The instruction line while somebody types.
    pub editor: Editor,
    /// The line of a verb while somebody types.
    pub palette: Editor,
    /// Instructions that make sense in this house.
    pub examples: Vec<String>,
    /// What the agent was told before the present instruction.
    pub replaced: Option<String>,
    /// The encoded frame.
    pub picture: Option<Picture>,
    /// The letters of the scene's classes.
    pub letters: Arc<Letters>,
    /// The classes of the instances in the frame.
    pub names: Arc<Names>,
    /// How the table of choices is sorted.
    pub sort: Sort,
    /// What the frame's panel shows.
    pub overlay: Overlay,
    /// Numbers are drawn into the picture.
    pub labels: bool,
    /// Which page of the interactions is shown, from 0.
    pub page_of_interactions: usize,
    /// Bytes that the newest step cost on the wire.
    pub bytes: Option<u64>,
    /// Bytes a second on the wire, over the last while.
    pub bytes_a_second: Option<u64>,
    /// The mouse is heard.
    pub mouse: bool,
    /// Nobody has explored here before: the last row says how to begin.
    pub newcomer: bool,
}

impl App {
    /// Nothing seen yet.
    pub fn new(size: Size, graphics: Graphics, ability: Ability, policy: PolicyKind, manual: bool) -> App {
        let mode = if manual { Mode::Manual } else { Mode::Watch };
        App {
            size,
            mode,
            page: Page::Main,
            selected: 0,
            under: mode,
            ability,
            config: Config::default(),
            graphics,
            now: None,
            thought: None,
            values: None,
            policy,
            going: None,
            breaks: Vec::new(),
            divergence: None,
            contrast: None,
            contrast_at: None,
            paints_values: false,
            landscape: None,
            heading: None,
            chain: None,
            rival: None,
            working: None,
            bandwidth: None,
            coarseness: 0,
            pace: Pace::START,
            busy: Some("building the house".into()),
            trouble: None,
            log: Log::default(),
            notice: None,
            editor: Editor::default(),
            palette: Editor::default(),
            examples: Vec::new(),
            replaced: None,
            picture: None,
            letters: Arc::default(),
            names: Arc::default(),
            sort: Sort::Probability,
            overlay: Overlay::Colour,
            labels: true,
            page_of_interactions: 0,
            bytes: None,
            bytes_a_second: None,
            mouse: false,
            newcomer: false,
        }
    }

    /// What acts is called: a checkpoint's name, where one is loaded.
    pub fn acts(&self) -> &str {
        let loaded = self.now.as_ref().filter(|now| now.policy == self.policy).map(|now| now.acts.as_str());
        loaded.unwrap_or_else(|| self.policy.name())
    }

    /// Whether a person acts.
    pub fn by_hand(&self) -> bool {
        self.mode == Mode::Manual || (self.mode != Mode::Watch && self.under == Mode::Manual)
    }

    /// Where everything is.
    pub fn layout(&self) -> Option<Layout> {
        Layout::of(Rect::from((ratatui::layout::Position::ORIGIN, self.size)))
    }

    /// The character cells that the picture fills, where the page has one.
    pub fn picture_area(&self) -> Option<Rect> {
        let layout = self.layout()?;
        match self.page {
            Page::Main => Some(layout.picture(self.graphics.protocol, self.graphics.cell_pixels)),
            Page::Branches => {
                self.divergence.as_ref()?.sights.as_ref()?;
                Some(layout.branches(self.rows(), self.graphics.cell_pixels).frames)
            }
            Page::Mind | Page::World | Page::Compare | Page::Chain => None,
        }
    }

    /// The interactions on the present page, numbered from 1.
    pub fn page_of_candidates(&self) -> &[Candidate] {
        let Some(now) = &self.now else { return &[] };
        let size = self.layout().map_or(9, |layout| layout.interactions()).max(1);
        now.candidates.chunks(size).nth(self.page_of_interactions).unwrap_or(&[])
    }

    /// How many pages of interactions there are.
    pub fn pages(&self) -> usize {
        let size = self.layout().map_or(9, |layout| layout.interactions()).max(1);
        self.now.as_ref().map_or(0, |now| now.candidates.len().div_ceil(size))
    }

    /// How many rows the list of the present page has.
    pub fn rows(&self) -> usize {
        let Some(now) = &self.now else { return 0 };
        match self.page {
            Page::Branches => now.time.branches.len(),
            Page::World => now.scene.fixtures.len() + now.world.objects.len(),
            Page::Mind => 5 + now.candidates.len(),
            Page::Compare => self.contrast.as_ref().map_or(0, |contrast| contrast.rows.len()),
            Page::Chain => self.chain.as_ref().map_or(0, |chain| chain.links.len()),
            Page::Main => 0,
        }
    }

    /// The frame to be encoded, as things stand.
    pub fn job(&self) -> Option<Job> {
        let now = self.now.as_ref()?;
        let cells = self.picture_area()?.as_size();
        let pair = self.divergence.as_ref().and_then(|divergence| divergence.sights.as_ref());
        let (frame, overlay) = match pair.filter(|_| self.page == Page::Branches) {
            Some((pair, _)) => (pair.clone(), Overlay::Colour),
            None => (now.frame.clone(), self.overlay),
        };
        let plain = self.page == Page::Main && overlay != Overlay::Frames;
        let labels = if plain && self.labels && self.going.is_none() { self.labelled(now) } else { Vec::new() };
        (cells.width > 0 && cells.height > 0).then(|| Job {
            frame,
            overlay,
            coarseness: self.coarseness,
            in_tmux: self.graphics.in_tmux,
            recent: now.recent.clone(),
            letters: self.letters.clone(),
            classes: self.names.clone(),
            labels,
            protocol: self.graphics.protocol,
            cells,
            cell_pixels: self.graphics.cell_pixels,
        })
    }

    fn labelled(&self, now: &Snapshot) -> Vec<Label> {
        let target = self.thought.as_ref().and_then(|(decision, _)| decision.action.target);
        // Names need room.
        let named = self.picture_area().is_some_and(|area| area.width >= NAMED);
        let mut labels: Vec<Label> = Vec::new();
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
                labels.push(Label { bounds: sighting.bounds, text, chosen });
            }
        }
        // The chosen one is drawn last, over its neighbours.
        labels.sort_by_key(|label| label.chosen);
        labels
    }

    /// Adds a line to the log, and shows it on pages without one until the next key.
    pub fn note(&mut self, tone: Tone, text: impl Into<String>) {
        let step = self.now.as_ref().map(|now| now.step);
        let entry = Entry { step, text: text.into(), outcome: String::new(), tone };
        self.notice = Some(entry.clone());
        self.log.write(entry);
    }
}
