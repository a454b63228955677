//! The screen on which a person annotates spans: keys in, a change of the state, one drawing for all that came.

mod keys;
pub(crate) mod state;

use std::fs::File;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use anyhow::Context;

pub(crate) use self::keys::KEYS;
use self::state::{AnnotateEffect, AnnotateState, ScreenFacts};
use super::graphics::encoder::PictureEncoder;
use super::graphics::{Protocol, inline};
use super::taken_terminal::{TakenTerminal, TerminalOptions};
use super::terminal::{self, WRITTEN};
use super::theme::Scheme;
use super::update::{ExitReason, Msg};
use crate::episode::scenes::Scenes;
use crate::explore::annotation::session::AnnotationSession;

/// How the screen is shown.
pub(crate) struct AnnotateScreen {
    /// How to show pictures; `None` to find out.
    pub(crate) protocol: Option<Protocol>,
    pub(crate) scheme: Scheme,
    /// The most that a picture may cost on the wire, in bytes.
    pub(crate) bandwidth: Option<u64>,
    /// Films wait for a key.
    pub(crate) paused: bool,
    /// Where it is remembered what a terminal answered.
    pub(crate) memory: Option<PathBuf>,
    /// Where libtorch's messages go.
    pub(crate) log: Option<File>,
    /// The dataset's folder.
    pub(crate) dataset: PathBuf,
}

/// How long a film shows a frame.
const SHOT: Duration = Duration::from_millis(250);

/// Asks about one span after the other until the person leaves.
///
/// # Errors
/// When there is no terminal.
pub(crate) fn run(screen: AnnotateScreen, session: AnnotationSession, scenes: Scenes) -> anyhow::Result<ExitReason> {
    let options =
        TerminalOptions { protocol: screen.protocol, memory: screen.memory.as_deref(), log: screen.log.as_ref() };
    let TakenTerminal { guard, mut display, graphics, ability, messages, tell } = TakenTerminal::take(&options)?;
    let facts = ScreenFacts { size: display.size()?, graphics, ability, scheme: screen.scheme };
    let mut state = AnnotateState::new(session, scenes, screen.dataset, facts, !screen.paused);
    state.traffic.limit = screen.bandwidth;
    let encoder = PictureEncoder::start(move |picture| tell.send(Msg::Picture(picture)).is_ok())?;
    let mut effects = vec![AnnotateEffect::Encode];
    // Something changed that is not drawn yet.
    let (mut is_stale, mut is_picture_new) = (true, false);
    let mut next_shot = Instant::now() + SHOT;
    let mut counted = WRITTEN.load(Ordering::Relaxed);
    let exit = loop {
        let size = display.size()?;
        effects.extend(state.resize(size));
        for effect in effects.drain(..) {
            match effect {
                AnnotateEffect::Encode => {
                    if let Some(drawing) = state.drawing() {
                        if state.screen.graphics.protocol == Protocol::Kitty {
                            terminal::holds_pictures(inline::kitty_forget(state.screen.graphics.in_tmux));
                        }
                        encoder.submit_drawing(drawing);
                    }
                }
                AnnotateEffect::Repaint => display.repaint()?,
                AnnotateEffect::Stop => display.stop()?,
                AnnotateEffect::Leave => state.leaves = true,
            }
        }
        if state.leaves {
            break ExitReason::Asked;
        }
        let mut wait = None;
        if is_stale {
            wait = display.show_when_ready(&state)?;
            is_stale = wait.is_some();
            if !is_stale && std::mem::take(&mut is_picture_new) {
                state.traffic.keep_to_link(display.cost(), display.affords());
            }
        }
        let shot = state.is_playing().then(|| next_shot.saturating_duration_since(Instant::now()));
        let msg = match wait.into_iter().chain(shot).min() {
            None => messages.recv().context("all threads are gone")?,
            Some(wait) => match messages.recv_timeout(wait) {
                Ok(msg) => msg,
                Err(RecvTimeoutError::Timeout) => {
                    if state.is_playing() && Instant::now() >= next_shot {
                        next_shot = Instant::now() + SHOT;
                        let written = WRITTEN.load(Ordering::Relaxed);
                        state.traffic.keep_to_limit(written - counted, 1);
                        counted = written;
                        effects = state.advance();
                        is_stale = true;
                    }
                    continue;
                }
                Err(RecvTimeoutError::Disconnected) => anyhow::bail!("all threads are gone"),
            },
        };
        is_stale |= !matches!(msg, Msg::Ready);
        match msg {
            Msg::Key(key) => {
                let was_playing = state.is_playing();
                effects = state.on_key(key);
                if !was_playing {
                    next_shot = Instant::now() + SHOT;
                }
            }
            Msg::Paste(text) => state.on_paste(&text),
            Msg::Picture(picture) => (state.picture, is_picture_new) = (Some(picture), true),
            Msg::Ready => display.answered(),
            Msg::StopAsked => display.stop()?,
            Msg::Continued => display.go_on()?,
            Msg::Signal(number) => break ExitReason::Signal(number),
            Msg::Mouse(_) | Msg::Resize(_) | Msg::Session(_) | Msg::Remote(_) | Msg::WorkerGone => {}
        }
    };
    drop(guard);
    Ok(exit)
}
