//! What a trained agent carries from step to step of an episode.

use std::collections::{HashMap, VecDeque};
use std::hash::{DefaultHasher, Hasher};
use std::sync::{Arc, Mutex};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tch::Tensor;

use super::policy::Decision;
use super::select::{self, Selection};
use crate::domain::{ActionType, Class};
use crate::house::view::Candidate;
use crate::nets::embedding_cache::Embedder;

/// A sentence encoder with its cache, which several policies may share.
pub type SharedEmbedder = Arc<Mutex<Embedder>>;

/// How a view can be left: what is done, and to which class of things.
type Way = (ActionType, Option<Class>);

/// The last frames, what did not work, what was told, and chance.
#[derive(Debug)]
pub struct Memory {
    /// The maps of the last frames, oldest first, and the step that the last one belongs to.
    seen: VecDeque<Tensor>,
    seen_at: Option<u32>,
    last_image: Vec<u8>,
    /// How each view was left since something was last taken, put or cut, by the image's digest.
    left_by: HashMap<u64, Vec<Way>>,
    last_choice: Option<Way>,
    /// The instruction that was read last, with what the networks take for it.
    read: Option<(String, Tensor)>,
    rng: ChaCha8Rng,
}

impl Default for Memory {
    fn default() -> Memory {
        Memory {
            seen: VecDeque::new(),
            seen_at: None,
            last_image: Vec::new(),
            left_by: HashMap::new(),
            last_choice: None,
            read: None,
            rng: ChaCha8Rng::seed_from_u64(0),
        }
    }
}

impl Clone for Memory {
    /// The maps and what was told are shared, not copied: nothing ever writes into them.
    fn clone(&self) -> Memory {
        Memory {
            seen: self.seen.iter().map(Tensor::shallow_clone).collect(),
            seen_at: self.seen_at,
            last_image: self.last_image.clone(),
            left_by: self.left_by.clone(),
            last_choice: self.last_choice,
            read: self.read.as_ref().map(|(text, told)| (text.clone(), told.shallow_clone())),
            rng: self.rng.clone(),
        }
    }
}

impl Memory {
    /// Forgets the past: a new episode starts.
    pub fn begin(&mut self, seed: u64) {
        self.seen.clear();
        self.last_image.clear();
        self.left_by.clear();
        self.last_choice = None;
        self.seen_at = None;
        // The next episode's goal may look different, whatever its instruction.
        self.read = None;
        self.rng = ChaCha8Rng::seed_from_u64(seed);
    }

    /// The map of an image that looks as the last one did; nothing where the image is new.
    pub fn map_of(&self, image: &[u8]) -> Option<Tensor> {
        self.seen.back().filter(|_| self.last_image == image).map(Tensor::shallow_clone)
    }

    /// Notes how the last view was left. Until something is taken, put or cut, the same way leads to where the agent has been:
    /// a wall that it stands before, a round that it goes, a door that it opens and shuts.
    pub fn look(&mut self, image: &[u8], step: u32) {
        let (stepped, changed) = (self.seen_at != Some(step), self.last_image != image);
        if stepped && let Some(way) = self.last_choice {
            if changed && matches!(way.0, ActionType::Pickup | ActionType::Put | ActionType::Slice) {
                self.left_by.clear();
            } else {
                self.left_by.entry(digest(&self.last_image)).or_default().push(way);
            }
        }
        if changed {
            image.clone_into(&mut self.last_image);
        }
    }

    /// Adds the map of the frame at `step`; the last `history` maps as one observation. Before the first frames there was
    /// the first one.
    pub fn observe(&mut self, map: Tensor, step: u32, history: usize) -> Tensor {
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

    /// What the agent is told: asked of `hear` once an instruction.
    ///
    /// # Errors
    /// When `hear` fails.
    pub fn told(&mut self, instruction: &str, hear: impl FnOnce() -> anyhow::Result<Tensor>) -> anyhow::Result<Tensor> {
        if let Some((text, told)) = &self.read
            && text == instruction
        {
            return Ok(told.shallow_clone());
        }
        let told = hear()?;
        // Another instruction may lead the same way again.
        self.left_by.clear();
        self.read = Some((instruction.to_string(), told.shallow_clone()));
        Ok(told)
    }

    /// Decides from the logits of both heads, and remembers the choice. No view is left twice in the same way while there is
    /// another.
    pub fn decide(&mut self, actions: &[f32], objects: &[f32], candidates: &[Candidate], samples: bool) -> Decision {
        let selection = if samples { Selection::Sample(&mut self.rng) } else { Selection::Greedy };
        let tried = self.left_by.get(&digest(&self.last_image)).map_or(&[][..], Vec::as_slice);
        let is_new = |candidate: &&Candidate| !tried.contains(&(candidate.kind, Some(candidate.class)));
        let candidates: Vec<Candidate> = candidates.iter().filter(is_new).copied().collect();
        let tried: Vec<ActionType> = tried.iter().filter(|way| way.1.is_none()).map(|way| way.0).collect();
        let decision = select::decide(actions, objects, &candidates, &tried, selection);
        let named = candidates.iter().find(|candidate| candidate.action() == decision.action);
        self.last_choice = Some((decision.action.kind, named.map(|candidate| candidate.class)));
        decision
    }
}

/// Tells images apart.
fn digest(image: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(image);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use tch::{Device, Kind};

    use super::*;
    use crate::domain::Instance;

    fn map(value: f32) -> Tensor {
        Tensor::full([1, 2, 2, 2], f64::from(value), (Kind::Float, Device::Cpu))
    }

    /// Decides at views in turn, each a step, by logits that like picking up best, and then the first actions.
    fn choices(memory: &mut Memory, views: &[u8], candidates: &[Candidate]) -> Vec<ActionType> {
        let like = |kind: ActionType| if kind == ActionType::Pickup { 20.0 } else { -(kind.index() as f32) };
        let logits = ActionType::ALL.map(like);
        let first = memory.seen_at.map_or(0, |step| step + 1);
        let choose = |(step, view): (u32, &u8)| {
            memory.look(&[*view], step);
            let _ = memory.observe(map(0.0), step, 5);
            memory.decide(&logits, &[0.0; 82], candidates, false).action.kind
        };
        (first..).zip(views).map(choose).collect()
    }

    #[test]
    fn no_door_is_opened_and_shut_in_rounds() {
        use ActionType::{Close, MoveAhead, Open, Pickup, RotateLeft};
        let at_cabinet = |kind| Candidate {
            kind,
            instance: Instance::Fixture(0),
            class: Class::named("Cabinet").unwrap(),
            distance: 0.0,
        };
        let mut memory = Memory::default();
        memory.begin(1);
        let mut leave = |view: u8, kind: ActionType, step: u32| {
            memory.look(&[view], step);
            let _ = memory.observe(map(0.0), step, 5);
            let logits = ActionType::ALL.map(|it| if it.is_interaction() { 9.0 } else { -(it.index() as f32) });
            memory.decide(&logits, &[0.0; 82], &[at_cabinet(kind)], false).action.kind
        };
        let (shut, open) = (7, 8);
        assert_eq!([leave(shut, Open, 0), leave(open, Close, 1)], [Open, Close]);
        assert_eq!([leave(shut, Open, 2), leave(shut, Open, 3)], [MoveAhead, RotateLeft]);
        assert_eq!(leave(9, Pickup, 4), Pickup);
        assert_eq!([leave(shut, Open, 5), leave(open, Close, 6)], [Open, Close]);
    }

    #[test]
    fn no_view_is_left_twice_in_the_same_way_until_something_is_moved_or_told() {
        use ActionType::{LookUp, MoveAhead, Pickup, RotateLeft, RotateRight};
        let mut memory = Memory::default();
        let tell = |memory: &mut Memory, text: &str| drop(memory.told(text, || Ok(map(0.0))).unwrap());
        memory.begin(1);
        tell(&mut memory, "Go.");
        assert_eq!(
            choices(&mut memory, &[7, 7, 8, 7, 8], &[]),
            [MoveAhead, RotateLeft, MoveAhead, RotateRight, RotateLeft]
        );
        tell(&mut memory, "Go.");
        assert_eq!(choices(&mut memory, &[7], &[]), [LookUp]);
        tell(&mut memory, "Come.");
        assert_eq!(choices(&mut memory, &[7, 7], &[]), [MoveAhead, RotateLeft]);
        let mug = Candidate {
            kind: Pickup,
            instance: Instance::Object(0),
            class: Class::named("Mug").unwrap(),
            distance: 0.0,
        };
        assert_eq!(choices(&mut memory, &[7], &[mug]), [Pickup]);
        assert_eq!(choices(&mut memory, &[9, 7], &[]), [MoveAhead; 2]);
    }

    #[test]
    fn a_copy_goes_on_exactly_as_the_original_does() {
        let mut memory = Memory::default();
        memory.begin(5);
        for step in 0..3u8 {
            memory.look(&[step], u32::from(step));
            let _ = memory.observe(map(f32::from(step)), u32::from(step), 5);
        }
        let copy = memory.clone();
        let go_on = |mut memory: Memory| {
            let mut trace = Vec::new();
            for step in 3..12u8 {
                memory.look(&[step / 4], u32::from(step));
                let seen = memory.observe(map(f32::from(step)), u32::from(step), 5);
                let decision = memory.decide(&[0.1; ActionType::COUNT], &[0.0; 82], &[], true);
                trace.push((Vec::<f32>::try_from(seen.flatten(0, -1)).unwrap(), decision.action));
            }
            trace
        };
        assert_eq!(go_on(memory), go_on(copy));
    }
}
