//! What a trained agent carries from step to step of an episode.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tch::Tensor;

use super::decision::Decision;
use super::loop_guard::LoopGuard;
use super::select::{self, Heads, Selection};
use crate::domain::Action;
use crate::house::view::Candidate;
use crate::nets::embedding_cache::Embedder;

/// A sentence encoder with its cache, which several policies may share.
pub(crate) type SharedEmbedder = Arc<Mutex<Embedder>>;

/// The last frames, what the loop guard knows, what conditions the agent, and random numbers.
#[derive(Debug)]
pub struct FrameHistory {
    /// The maps of the last frames, oldest first, and the step that the last one belongs to.
    seen: VecDeque<Tensor>,
    seen_at: Option<u32>,
    last_image: Vec<u8>,
    loop_guard: LoopGuard,
    /// The instruction that was read last, with what the networks take for it.
    read: Option<(String, Tensor)>,
    rng: ChaCha8Rng,
}

impl Default for FrameHistory {
    fn default() -> FrameHistory {
        FrameHistory {
            seen: VecDeque::new(),
            seen_at: None,
            last_image: Vec::new(),
            loop_guard: LoopGuard::default(),
            read: None,
            rng: ChaCha8Rng::seed_from_u64(0),
        }
    }
}

impl Clone for FrameHistory {
    /// The maps and what conditions it are shared, not copied: nothing ever writes into them.
    fn clone(&self) -> FrameHistory {
        FrameHistory {
            seen: self.seen.iter().map(Tensor::shallow_clone).collect(),
            seen_at: self.seen_at,
            last_image: self.last_image.clone(),
            loop_guard: self.loop_guard.clone(),
            read: self.read.as_ref().map(|(text, conditioning)| (text.clone(), conditioning.shallow_clone())),
            rng: self.rng.clone(),
        }
    }
}

impl FrameHistory {
    /// Forgets the past: a new episode starts.
    pub(crate) fn reset(&mut self, seed: u64) {
        self.seen.clear();
        self.last_image.clear();
        self.loop_guard = LoopGuard::default();
        self.seen_at = None;
        // The next episode's goal may look different, whatever its instruction.
        self.read = None;
        self.rng = ChaCha8Rng::seed_from_u64(seed);
    }

    /// The map of an image that looks as the last one did; nothing where the image is new.
    pub(crate) fn map_of(&self, image: &[u8]) -> Option<Tensor> {
        self.seen.back().filter(|_| self.last_image == image).map(Tensor::shallow_clone)
    }

    /// Looks at the image of a step, and notes what came of the last one.
    pub(crate) fn look(&mut self, image: &[u8], step: u32) {
        let changed = self.last_image != image;
        if self.seen_at != Some(step) {
            self.loop_guard.record(&self.last_image, changed);
        }
        if changed {
            image.clone_into(&mut self.last_image);
        }
    }

    /// Adds the map of the frame at `step`; the last `history` maps as one observation. Before the first frames there was
    /// the first one.
    pub(crate) fn observe(&mut self, map: Tensor, step: u32, history: usize) -> Tensor {
        if self.seen_at == Some(step) {
            self.seen.pop_back();
        }
        self.seen_at = Some(step);
        self.seen.push_back(map);
        while self.seen.len() > history {
            self.seen.pop_front();
        }
        let first = history - self.seen.len();
        let maps: Vec<&Tensor> = (0..history).map(|i| &self.seen[i.saturating_sub(first)]).collect();
        Tensor::cat(&maps, 1)
    }

    /// The map of the last frame that was observed.
    pub(crate) fn latest(&self) -> Option<&Tensor> {
        self.seen.back()
    }

    /// Remembers that another action was taken than the one that was decided.
    pub(crate) fn overrule(&mut self, action: Action, candidates: &[Candidate]) {
        self.loop_guard.chose(action, candidates);
    }

    /// What conditions the agent: asked of `condition` once an instruction.
    ///
    /// # Errors
    /// When `condition` fails.
    pub(crate) fn conditioning(
        &mut self,
        instruction: &str,
        condition: impl FnOnce() -> anyhow::Result<Tensor>,
    ) -> anyhow::Result<Tensor> {
        if let Some((text, conditioning)) = &self.read
            && text == instruction
        {
            return Ok(conditioning.shallow_clone());
        }
        let conditioning = condition()?;
        self.loop_guard.clear();
        self.read = Some((instruction.to_string(), conditioning.shallow_clone()));
        Ok(conditioning)
    }

    /// Decides from what the networks say, and remembers the choice. Where it is `guarded`, nothing that the loop guard knows to
    /// repeat is chosen while there is something else.
    pub(crate) fn decide(
        &mut self,
        heads: &Heads<'_>,
        candidates: &[Candidate],
        samples: bool,
        guarded: bool,
    ) -> Decision {
        let selection = if samples { Selection::Sample(&mut self.rng) } else { Selection::Greedy };
        let (candidates, tried) = match guarded {
            true => self.loop_guard.untried(&self.last_image, candidates),
            false => (candidates.to_vec(), Vec::new()),
        };
        let decision = select::decide(heads, &candidates, &tried, selection);
        self.loop_guard.chose(decision.action, &candidates);
        decision
    }
}

#[cfg(test)]
mod tests {
    use tch::{Device, Kind};

    use super::*;
    use crate::domain::ActionType;

    fn map(value: f32) -> Tensor {
        Tensor::full([1, 2, 2, 2], f64::from(value), (Kind::Float, Device::Cpu))
    }

    #[test]
    fn nothing_is_repeated_until_another_instruction_is_given() {
        use ActionType::{MoveAhead, RotateLeft, RotateRight};
        let mut memory = FrameHistory::default();
        memory.reset(1);
        let mut leave = |text: &str, step: u32| {
            drop(memory.conditioning(text, || Ok(map(0.0))).unwrap());
            memory.look(&[7], step);
            let _ = memory.observe(map(0.0), step, 5);
            let logits = ActionType::ALL.map(|kind| -(kind.index() as f32));
            memory.decide(&Heads::of(&logits, &[0.0; 82]), &[], false, true).action.kind
        };
        assert_eq!([leave("Go.", 0), leave("Go.", 1), leave("Go.", 2)], [MoveAhead, RotateLeft, RotateRight]);
        assert_eq!([leave("Come.", 3), leave("Come.", 4)], [MoveAhead, RotateLeft]);
    }

    #[test]
    fn without_a_loop_guard_the_likeliest_is_done_again_and_again() {
        let mut memory = FrameHistory::default();
        let logits = ActionType::ALL.map(|kind| -(kind.index() as f32));
        for step in 0..3 {
            memory.look(&[7], step);
            let _ = memory.observe(map(0.0), step, 5);
            let decision = memory.decide(&Heads::of(&logits, &[0.0; 82]), &[], false, false);
            assert_eq!(decision.action.kind, ActionType::MoveAhead);
        }
    }

    #[test]
    fn a_copy_goes_on_exactly_as_the_original_does() {
        let mut memory = FrameHistory::default();
        memory.reset(5);
        for step in 0..3u8 {
            memory.look(&[step], u32::from(step));
            let _ = memory.observe(map(f32::from(step)), u32::from(step), 5);
        }
        let copy = memory.clone();
        let go_on = |mut memory: FrameHistory| {
            let mut trace = Vec::new();
            for step in 3..12u8 {
                memory.look(&[step / 4], u32::from(step));
                let seen = memory.observe(map(f32::from(step)), u32::from(step), 5);
                let decision = memory.decide(&Heads::of(&[0.1; ActionType::COUNT], &[0.0; 82]), &[], true, true);
                trace.push((Vec::<f32>::try_from(seen.flatten(0, -1)).unwrap(), decision.action));
            }
            trace
        };
        assert_eq!(go_on(memory), go_on(copy));
    }
}
