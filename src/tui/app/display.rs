//! The terminal, and the picture in it.

use std::sync::Arc;

use ratatui::layout::Size;

use crate::tui::graphics::Picture;
use crate::tui::graphics::Protocol;
use crate::tui::graphics::coarse::COARSEST;
use crate::tui::graphics::letters::{Letters, Names};
use crate::tui::theme::Ability;

/// How pictures are shown, and why.
#[derive(Clone, Debug)]
pub struct Graphics {
    /// By which protocol.
    pub protocol: Protocol,
    /// Why by that one.
    pub reason: String,
    /// The pixels of a character cell, width and height.
    pub cell_pixels: (u16, u16),
    /// Sequences have to pass through tmux.
    pub in_tmux: bool,
}

/// What is known of the terminal.
pub struct TerminalState {
    /// Its size in character cells.
    pub(crate) size: Size,
    /// What it can show.
    pub(crate) ability: Ability,
    /// How it shows pictures.
    pub(crate) graphics: Graphics,
    /// Its mouse is heard.
    pub(crate) mouse: bool,
}

/// The frame as it is shown.
#[derive(Default)]
pub struct FrameState {
    /// The frame, encoded.
    pub(crate) picture: Option<Picture>,
    /// The letters of the scene's classes.
    pub(crate) letters: Arc<Letters>,
    /// The classes of the instances in the frame.
    pub(crate) names: Arc<Names>,
}

/// What pictures cost on the wire, in bytes.
#[derive(Default)]
pub struct Traffic {
    /// The most that a step may cost.
    pub(crate) limit: Option<u64>,
    /// The most that a picture may cost on the link as it is, where that is slow.
    pub(crate) link: Option<u64>,
    /// Pictures of runs are left out: the coarsest cost more than the link can take in time.
    pub(crate) spares_runs: bool,
    /// The next picture is asked for in full, whatever it costs.
    pub(crate) is_full: bool,
    /// The budget that even the coarsest picture as a sequence did not keep to, and was shown in block characters instead.
    too_large: Option<u64>,
    /// How coarse pictures are to keep to that.
    pub(crate) coarseness: u8,
    /// What the newest step cost.
    pub(crate) of_step: Option<u64>,
    /// What a second cost, over the last while.
    pub(crate) of_second: Option<u64>,
    /// What was written beyond what the steps so far may cost.
    pub(crate) debt: u64,
    /// Steps since a picture was left out for that.
    pub(crate) left_out: u32,
}

/// Steps after which a picture is shown whatever the others cost.
const LONGEST_WAIT: u32 = 10;

/// A picture that costs so many times what it may is far too much.
const FAR_TOO_MUCH: u64 = 2;

impl Traffic {
    /// Takes in what the newest steps cost. Pictures get coarser or finer, so that steps keep to what they may cost; where the
    /// coarsest still cost more, pictures are left out until that is made up for.
    pub(crate) fn keep_to_limit(&mut self, bytes: u64, steps: u32) {
        let Some(most) = self.limit else { return };
        if steps == 0 {
            self.debt = 0;
            return;
        }
        let may = most * u64::from(steps);
        self.debt = (self.debt + bytes).saturating_sub(may);
        self.left_out = if self.debt > 0 { self.left_out + steps } else { 0 };
        if self.left_out >= LONGEST_WAIT {
            (self.debt, self.left_out) = (0, 0);
        }
        if bytes > may {
            self.coarseness = (self.coarseness + 1).min(COARSEST);
        } else if 3 * bytes < may && self.debt == 0 {
            self.coarseness = self.coarseness.saturating_sub(1);
        }
    }

    /// Takes in what a frame with a new picture cost over the link as it is. Pictures get coarser, so that a key that is pressed
    /// behind one is answered in time; where the coarsest cost far more, runs show none.
    pub(crate) fn keep_to_link(&mut self, bytes: u64, link: Option<u64>) {
        self.link = link;
        let Some(most) = link else {
            if self.limit.is_none() {
                self.coarseness = 0;
            }
            self.spares_runs = false;
            return;
        };
        // Once left out, they are shown again when one keeps to the link: one of a pause may happen to be cheap.
        let may = if self.spares_runs { most } else { FAR_TOO_MUCH * most };
        self.spares_runs = bytes > may && self.coarseness >= COARSEST;
        if bytes > most {
            let steps = if bytes > FAR_TOO_MUCH * most { 2 } else { 1 };
            self.coarseness = (self.coarseness + steps).min(COARSEST);
        } else if self.limit.is_none() && 4 * bytes < most {
            self.coarseness = self.coarseness.saturating_sub(1);
        }
    }

    /// The most that a picture may cost where it is one escape sequence.
    pub(crate) fn budget(&self) -> Option<u64> {
        if self.is_full { Some(u64::MAX) } else { self.limit.into_iter().chain(self.link).min() }
    }

    /// Whether pictures are shown in block characters, as their sequences were too large. They are not tried again until the
    /// link is much faster: pictures would go to and fro between the two.
    pub(crate) fn are_sequences_too_large(&self) -> bool {
        matches!((self.too_large, self.budget()), (Some(before), Some(now)) if now / FAR_TOO_MUCH < before)
    }

    /// Whether a picture was encoded before it was known how little the link takes.
    pub(crate) fn refuses(&self, picture: &Picture) -> bool {
        !picture.is_bounded && self.budget().is_some_and(|most| picture.sequence_bytes() > most)
    }

    /// Takes in a picture that is about to be shown; whether it is the first one in block characters.
    pub(crate) fn take_in(&mut self, picture: &Picture) -> bool {
        if !picture.protocol.floats() {
            return false;
        }
        let is_in_blocks = picture.sequence_bytes() == 0;
        let before = self.too_large;
        match (is_in_blocks, before) {
            (true, None) => self.too_large = self.budget(),
            (true, Some(_)) => {}
            // One that was asked for in full says nothing.
            (false, _) if self.are_sequences_too_large() => {}
            (false, _) => self.too_large = None,
        }
        is_in_blocks && before.is_none()
    }

    /// Whether a run may show another picture.
    pub(crate) fn affords_picture(&self) -> bool {
        !self.spares_runs && (self.limit.is_none() || self.debt == 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::graphics::Content;

    #[test]
    fn pictures_that_cost_too_much_are_coarser_and_then_rarer_until_steps_keep_to_their_limit() {
        let mut traffic = Traffic { limit: Some(4000), ..Traffic::default() };
        let mut written = 0;
        for _ in 0..100 {
            // A picture of 9 kB, or of 6 at the coarsest, and a kB of text.
            let picture = if traffic.affords_picture() { 9000 - 1000 * u64::from(traffic.coarseness) } else { 0 };
            written += picture + 1000;
            traffic.keep_to_limit(picture + 1000, 1);
        }
        assert!((300_000..=410_000).contains(&written), "{written} bytes in 100 steps");
    }

    #[test]
    fn over_a_slow_link_pictures_are_coarser_and_left_out_of_runs_where_that_is_not_enough() {
        let mut traffic = Traffic::default();
        traffic.keep_to_link(9000, Some(1250));
        traffic.keep_to_link(6000, Some(1250));
        assert_eq!((traffic.coarseness, traffic.affords_picture()), (COARSEST, true));
        traffic.keep_to_link(1100, Some(1250));
        assert_eq!((traffic.coarseness, traffic.affords_picture()), (COARSEST, true));
        traffic.keep_to_link(8000, Some(1250));
        traffic.keep_to_link(2000, Some(1250));
        assert!(!traffic.affords_picture());
        traffic.keep_to_link(300, Some(1250));
        assert_eq!((traffic.coarseness, traffic.affords_picture()), (COARSEST - 1, true));
        traffic.keep_to_link(9000, None);
        assert_eq!((traffic.coarseness, traffic.affords_picture()), (0, true), "the link got better");
    }

    #[test]
    fn a_picture_from_before_the_link_was_known_is_encoded_anew_and_blocks_stay_until_it_is_much_faster() {
        let picture = |content: Content, is_bounded| Picture {
            protocol: Protocol::Sixel,
            cells: Size::new(1, 1),
            content,
            is_bounded,
            legend: Vec::new(),
        };
        let sixels = |bytes, is_bounded| picture(Content::Drawn("x".repeat(bytes)), is_bounded);
        let mut traffic = Traffic::default();
        assert!(!traffic.refuses(&sixels(9000, false)), "the link is fast");
        traffic.keep_to_link(9000, Some(1250));
        assert!(traffic.refuses(&sixels(9000, false)) && !traffic.refuses(&sixels(9000, true)));
        let blocks = picture(Content::Cells(Vec::new()), true);
        assert!(traffic.take_in(&blocks), "it is said once");
        assert!(!traffic.take_in(&blocks) && traffic.are_sequences_too_large());
        traffic.is_full = true;
        assert!(!traffic.are_sequences_too_large() && traffic.budget() == Some(u64::MAX));
        traffic.is_full = false;
        assert!(!traffic.take_in(&sixels(9000, true)) && traffic.are_sequences_too_large(), "the next is in blocks");
        traffic.keep_to_link(2000, Some(2000));
        assert!(traffic.are_sequences_too_large());
        traffic.keep_to_link(2000, Some(3000));
        assert!(!traffic.are_sequences_too_large());
    }

    #[test]
    fn no_limit_leaves_pictures_alone_and_text_alone_does_not_end_them() {
        let mut traffic = Traffic::default();
        traffic.keep_to_limit(1_000_000, 1);
        assert!(traffic.affords_picture() && traffic.coarseness == 0);
        let mut traffic = Traffic { limit: Some(1000), ..Traffic::default() };
        traffic.keep_to_limit(1_000_000, 1);
        let pictures = (0..40).filter(|_| {
            traffic.keep_to_limit(1900, 1);
            traffic.affords_picture()
        });
        assert_eq!(pictures.count(), 4);
    }
}
