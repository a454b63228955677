//! All that the screen of annotation shows, and how keys change it.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use crossterm::event::{KeyEvent, KeyEventKind};
use ratatui::layout::{Rect, Size};
use ratatui::style::Style;

use super::keys::{AnnotateKey, meaning};
use crate::episode::scenes::Scenes;
use crate::explore::annotation::agreement::agreement;
use crate::explore::annotation::export::everybody;
use crate::explore::annotation::film::{Film, FilmCamera};
use crate::explore::annotation::session::{AnnotationSession, Answer};
use crate::explore::side_by_side::in_a_row;
use crate::tui::app::{Graphics, Traffic};
use crate::tui::editor::Editor;
use crate::tui::graphics::letters::{self, Letters};
use crate::tui::graphics::overlay::Overlay;
use crate::tui::graphics::{Job, Picture};
use crate::tui::theme::{Ability, Scheme, THEME};
use crate::tui::view::annotate_layout::{AnnotateLayout, Sight};

/// What is known of the terminal.
pub(crate) struct ScreenFacts {
    pub(crate) size: Size,
    pub(crate) graphics: Graphics,
    pub(crate) ability: Ability,
    pub(crate) scheme: Scheme,
}

/// Something to be done about a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AnnotateEffect {
    /// Draw and encode the picture.
    Encode,
    /// Draw the whole screen again.
    Repaint,
    /// Give the terminal back and stop.
    Stop,
    Leave,
}

/// What fills the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AnnotatePage {
    /// The span that is asked about, or the end.
    Span,
    Help,
    Agreement,
}

/// The film of the span that is asked about, and what draws it.
#[derive(Clone)]
pub(crate) struct Reel {
    pub(crate) film: Arc<Film>,
    camera: Arc<Mutex<FilmCamera>>,
}

/// All that the screen shows.
pub(crate) struct AnnotateState {
    pub(crate) session: AnnotationSession,
    scenes: Scenes,
    pub(crate) dataset: PathBuf,
    pub(crate) screen: ScreenFacts,
    pub(crate) page: AnnotatePage,
    /// The film, or why there is none.
    pub(crate) reel: Result<Reel, String>,
    pub(crate) shot: usize,
    is_playing: bool,
    /// Films begin by themselves.
    autoplays: bool,
    /// The ends of all steps in a row, in place of the film.
    pub(crate) shows_strip: bool,
    pub(crate) editor: Editor,
    /// Sentences that were left before they were kept, by the span's place.
    drafts: HashMap<usize, String>,
    pub(crate) message: Option<(String, Style)>,
    pub(crate) agreement: Vec<String>,
    pub(crate) picture: Option<Picture>,
    pub(crate) traffic: Traffic,
    pub(crate) leaves: bool,
}

impl AnnotateState {
    /// At the first span without an answer.
    pub(crate) fn new(
        session: AnnotationSession,
        scenes: Scenes,
        dataset: PathBuf,
        screen: ScreenFacts,
        autoplays: bool,
    ) -> AnnotateState {
        let mut state = AnnotateState {
            session,
            scenes,
            dataset,
            screen,
            page: AnnotatePage::Span,
            reel: Err(String::new()),
            shot: 0,
            is_playing: false,
            autoplays,
            shows_strip: false,
            editor: Editor::default(),
            drafts: HashMap::new(),
            message: None,
            agreement: Vec::new(),
            picture: None,
            traffic: Traffic::default(),
            leaves: false,
        };
        state.enter();
        state
    }

    /// Shows the span that is asked about now.
    fn enter(&mut self) -> Vec<AnnotateEffect> {
        let film = self.session.span().map(|span| Film::of(span, &self.scenes));
        self.reel = match film {
            Some(Ok(film)) => Ok(Reel { camera: Arc::new(Mutex::new(film.camera())), film: Arc::new(film) }),
            Some(Err(problem)) => Err(format!("no film: {problem:#}")),
            None => Err(String::new()),
        };
        self.shot = 0;
        self.is_playing = self.autoplays && self.reel.is_ok();
        self.picture = None;
        let draft = self.drafts.get(&self.session.place().0).cloned();
        let text = draft.unwrap_or_else(|| self.kept());
        self.editor.open(&text);
        if self.session.span().is_none() {
            self.weigh();
        }
        vec![AnnotateEffect::Encode, AnnotateEffect::Repaint]
    }

    /// The sentence of the span that is kept.
    fn kept(&self) -> String {
        match self.session.answer() {
            Some(Answer::Sentence(text)) => text.clone(),
            Some(Answer::Skipped) | None => String::new(),
        }
    }

    /// Holds everybody's answers against one another.
    fn weigh(&mut self) {
        self.agreement = match everybody(&self.dataset) {
            Ok(answers) => agreement(&answers).lines(),
            Err(problem) => vec![format!("{problem:#}")],
        };
    }

    /// Whether the film goes on by itself.
    pub(crate) fn is_playing(&self) -> bool {
        self.is_playing && self.page == AnnotatePage::Span && !self.shows_strip
    }

    /// Shows the next frame of the film.
    pub(crate) fn advance(&mut self) -> Vec<AnnotateEffect> {
        let Ok(reel) = &self.reel else { return Vec::new() };
        self.shot = (self.shot + 1).min(reel.film.last());
        self.is_playing &= self.shot < reel.film.last();
        // The last frame is shown whatever the others cost.
        if self.traffic.affords_picture() || !self.is_playing { vec![AnnotateEffect::Encode] } else { Vec::new() }
    }

    /// The terminal has that size.
    pub(crate) fn resize(&mut self, size: Size) -> Vec<AnnotateEffect> {
        if size == self.screen.size {
            return Vec::new();
        }
        self.screen.size = size;
        self.picture = None;
        self.editor.refit();
        vec![AnnotateEffect::Encode, AnnotateEffect::Repaint]
    }

    /// Takes in what was pasted.
    pub(crate) fn on_paste(&mut self, text: &str) {
        if self.page == AnnotatePage::Span && self.session.span().is_some() {
            self.editor.paste(text);
        }
    }

    /// Takes in a key.
    pub(crate) fn on_key(&mut self, key: KeyEvent) -> Vec<AnnotateEffect> {
        if key.kind == KeyEventKind::Release {
            return Vec::new();
        }
        let asked = meaning(key, self.editor.text().is_empty());
        match asked {
            Some(AnnotateKey::Leave) => return vec![AnnotateEffect::Leave],
            Some(AnnotateKey::Stop) => return vec![AnnotateEffect::Stop],
            _ if self.page != AnnotatePage::Span => {
                self.page = AnnotatePage::Span;
                return vec![AnnotateEffect::Encode, AnnotateEffect::Repaint];
            }
            _ => {}
        }
        let is_over = self.session.span().is_none();
        let Some(asked) = asked else {
            if !is_over {
                self.message = None;
                self.editor.key(key);
            }
            return Vec::new();
        };
        match asked {
            AnnotateKey::Keep if is_over => {
                self.session.go_to_first_open();
                let is_open = self.session.span().is_some();
                return if is_open { self.enter() } else { vec![AnnotateEffect::Leave] };
            }
            AnnotateKey::Keep => {
                let text = self.editor.text().to_owned();
                let kept = self.session.write(&text);
                return self.after(kept, || format!("kept: {}", text.trim()));
            }
            AnnotateKey::Skip => {
                let skipped = self.session.skip();
                return self.after(skipped, || "skipped; pgup goes back to it".into());
            }
            AnnotateKey::Back | AnnotateKey::Forward => {
                let (at, _) = self.session.place();
                if !is_over && self.editor.text() != self.kept() {
                    self.drafts.insert(at, self.editor.text().to_owned());
                }
                if asked == AnnotateKey::Back {
                    self.session.back()
                } else {
                    self.session.forward()
                }
                self.message = None;
                return if self.session.place().0 == at { Vec::new() } else { self.enter() };
            }
            AnnotateKey::Shot(by) => {
                return self.show_shot(|film, shot| shot.saturating_add_signed(by).min(film.last()));
            }
            AnnotateKey::Step(forward) => return self.show_shot(|film, shot| film.step_from(shot, forward)),
            AnnotateKey::Play => {
                let at_end = self.reel.as_ref().is_ok_and(|reel| self.shot >= reel.film.last());
                self.is_playing = self.reel.is_ok() && (self.shows_strip || !self.is_playing);
                if self.is_playing && at_end {
                    self.shot = 0;
                }
                self.shows_strip = false;
                self.picture = None;
            }
            AnnotateKey::Strip => {
                self.shows_strip = !self.shows_strip;
                self.picture = None;
            }
            AnnotateKey::Graphics => {
                let graphics = &mut self.screen.graphics;
                graphics.protocol = graphics.protocol.next();
                self.picture = None;
                self.message = Some((format!("pictures: {}", graphics.protocol.name()), THEME.note));
            }
            AnnotateKey::Restore => {
                let kept = self.kept();
                self.editor.open(&kept);
                return Vec::new();
            }
            AnnotateKey::Help => self.page = AnnotatePage::Help,
            AnnotateKey::Agreement => {
                self.weigh();
                self.page = AnnotatePage::Agreement;
            }
            AnnotateKey::Repaint => {}
            AnnotateKey::Leave | AnnotateKey::Stop => return Vec::new(),
        }
        vec![AnnotateEffect::Encode, AnnotateEffect::Repaint]
    }

    /// Goes on after an answer, or says why it could not be kept.
    fn after(&mut self, kept: anyhow::Result<()>, said: impl FnOnce() -> String) -> Vec<AnnotateEffect> {
        match kept {
            Ok(()) => {
                self.drafts.remove(&self.session.place().0.saturating_sub(1));
                self.message = Some((said(), THEME.good));
                self.enter()
            }
            Err(problem) => {
                self.message = Some((format!("{problem:#}"), THEME.bad));
                Vec::new()
            }
        }
    }

    fn show_shot(&mut self, shot: impl FnOnce(&Film, usize) -> usize) -> Vec<AnnotateEffect> {
        let Ok(reel) = &self.reel else { return Vec::new() };
        self.shot = shot(&reel.film, self.shot);
        self.is_playing = false;
        vec![AnnotateEffect::Encode]
    }

    /// Where everything is.
    pub(crate) fn layout(&self) -> Option<AnnotateLayout> {
        let area = Rect::from((ratatui::layout::Position::ORIGIN, self.screen.size));
        let sight = match &self.reel {
            Err(_) => Sight::None,
            Ok(reel) if self.shows_strip => Sight::Strip(reel.film.strip().len() as u32),
            Ok(_) => Sight::Film,
        };
        let sentences = self.session.span().map(|span| span.sentences()).unwrap_or_default();
        let Graphics { protocol, cell_pixels, .. } = self.screen.graphics;
        AnnotateLayout::of(area, sight, sentences, protocol, cell_pixels)
    }

    /// What draws the picture as things stand.
    pub(crate) fn drawing(&self) -> Option<impl FnOnce() -> Job + Send + use<>> {
        let (Ok(reel), AnnotatePage::Span) = (self.reel.clone(), self.page) else { return None };
        let cells = self.layout()?.picture.as_size();
        if cells.width == 0 || cells.height == 0 {
            return None;
        }
        let shots = if self.shows_strip { reel.film.strip() } else { vec![self.shot] };
        let Graphics { protocol, cell_pixels, in_tmux, .. } = self.screen.graphics;
        let (coarseness, budget) = (self.traffic.coarseness, self.traffic.budget());
        let in_blocks = self.traffic.are_sequences_too_large();
        Some(move || {
            let Reel { film, camera } = reel;
            let mut camera = camera.lock().unwrap_or_else(PoisonError::into_inner);
            let shots: Vec<_> = shots.iter().filter_map(|&shot| film.shots.get(shot)).collect();
            let frames: Vec<_> = shots.iter().map(|shot| camera.draw(shot)).collect();
            // Things only ever get more, as they are cut: the last state names all of them.
            let last = film.shots.last().map(|shot| &shot.world);
            Job {
                frame: Arc::new(in_a_row(&frames.iter().collect::<Vec<_>>())),
                overlay: Overlay::Colour,
                coarseness,
                budget,
                in_blocks,
                in_tmux,
                recent: Vec::new(),
                letters: Arc::new(last.map_or_else(Letters::default, |world| Letters::of(&film.scene, world))),
                classes: Arc::new(last.map(|world| letters::names(&film.scene, world)).unwrap_or_default()),
                labels: Vec::new(),
                protocol,
                cells,
                cell_pixels,
            }
        })
    }
}
