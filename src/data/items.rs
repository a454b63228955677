//! Training items of behaviour cloning: (span, t), a span with its sentence and a step in it.

use std::collections::HashMap;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::domain::Trajectory;
use crate::language::instruction::normalise;

/// One frame's label.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Label {
    /// Position in the action head.
    pub action: u8,
    /// Position in the object head; 0 for navigation.
    pub object: u8,
}

/// A run of adjacent skills with the texts that describe it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Span {
    /// The position of the trajectory's first frame among all frames.
    pub first: u32,
    /// The span's first step, as a frame.
    pub start: u32,
    /// The frame after its last step.
    pub end: u32,
    /// Positions in [`Items::texts`].
    pub texts: Vec<u32>,
}

/// Every item of a dataset. Frames are numbered through: each trajectory has one more than it has actions.
#[derive(Clone, Debug, Default)]
pub struct Items {
    /// One label a frame; the last frame of a trajectory has none.
    pub labels: Vec<Option<Label>>,
    /// Distinct texts, normalised.
    pub texts: Vec<String>,
    /// Spans to learn from.
    pub training: Vec<Span>,
    /// Spans that are held out: whole trajectories.
    pub held_out: Vec<Span>,
}

/// Which spans and texts a method learns from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Selection {
    /// Spans of several skills.
    pub composites: Composites,
}

/// Spans of several skills, and what describes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Composites {
    /// Single skills only.
    None,
    /// Every span, with the dataset's labels.
    Labels,
    /// Every span, with its skills' sentences one after the other.
    Concat,
    /// Whole trajectories, with what their annotators said of them.
    Whole,
}

/// A drawn item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Item {
    /// The trajectory's first frame: history does not reach behind it.
    pub first: u32,
    /// The present frame.
    pub frame: u32,
    /// The frame after the span's last action: the transition into it is rewarded and ends the span.
    pub end: u32,
    /// The text.
    pub text: u32,
}

impl Items {
    /// The primitives and the whole of every trajectory; every `hold_out`th trajectory is held out. `labels` are those of
    /// all frames.
    pub fn of(trajectories: &[Trajectory], labels: Vec<Option<Label>>, hold_out: usize, selection: Selection) -> Items {
        let mut items = Items { labels, ..Items::default() };
        let mut numbers = HashMap::new();
        let mut first = 0;
        for (position, trajectory) in trajectories.iter().enumerate() {
            let mut spans = spans(trajectory, first, selection, &mut |text| {
                let text = normalise(text);
                *numbers.entry(text.clone()).or_insert_with(|| {
                    items.texts.push(text);
                    items.texts.len() as u32 - 1
                })
            });
            spans.retain(|span| span.start < span.end && !span.texts.is_empty());
            let held_out = hold_out > 0 && position % hold_out == hold_out - 1;
            if held_out { &mut items.held_out } else { &mut items.training }.extend(spans);
            first += trajectory.actions.len() as u32 + 1;
        }
        items
    }

    /// A batch of training items: spans uniformly, then a step uniformly, then one of the span's texts. A function of seed and step alone,
    /// so that a resumed training draws what the uninterrupted one would have.
    pub fn draw(spans: &[Span], seed: u64, step: u64, batch: usize) -> Vec<Item> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(step + 1);
        let draw = |_| {
            let span = &spans[rng.random_range(0..spans.len())];
            Item {
                first: span.first,
                frame: rng.random_range(span.start..span.end),
                end: span.end,
                text: span.texts[rng.random_range(0..span.texts.len())],
            }
        };
        if spans.is_empty() { Vec::new() } else { (0..batch).map(draw).collect() }
    }
}

fn spans(trajectory: &Trajectory, first: u32, selection: Selection, number: &mut impl FnMut(&str) -> u32) -> Vec<Span> {
    let count = trajectory.skills.len();
    let mut spans = Vec::new();
    for skill in 0..count {
        let range = trajectory.skill_range(skill);
        let aligned = trajectory.annotations.iter().filter(|annotation| annotation.steps.len() == count);
        let texts = aligned.map(|annotation| number(&annotation.steps[skill])).collect();
        spans.push(Span { first, start: first + range.start as u32, end: first + range.end as u32, texts });
    }
    if selection.composites == Composites::None {
        return spans;
    }
    let goals: Vec<u32> = trajectory.annotations.iter().map(|annotation| number(&annotation.goal)).collect();
    match &mut spans[..] {
        // Of a single skill, goal and step say the same.
        [only] => only.texts.extend(goals),
        _ => spans.push(Span { first, start: first, end: first + trajectory.actions.len() as u32, texts: goals }),
    }
    spans
}

impl Item {
    /// The frames of the observation, oldest first; before the trajectory's first frame there was the first one.
    pub fn stack(&self, history: u32) -> impl Iterator<Item = usize> + use<> {
        let (first, frame) = (self.first, self.frame);
        (0..history).map(move |i| frame.saturating_sub(history - 1 - i).max(first) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::task::SceneRef;
    use crate::domain::trajectory::Annotation;
    use crate::domain::{Action, ActionType, SkillKind, Subtask, World};

    const WHOLE: Selection = Selection { composites: Composites::Whole };

    fn trajectory(skill_starts: Vec<u32>, steps: usize) -> Trajectory {
        let skill = Subtask { skill: SkillKind::Pickup, object: 0, receptacle: None, closes: false, literal: None };
        Trajectory {
            id: "t".into(),
            split: "train".into(),
            scene: SceneRef::Named("s".into()),
            start: World::default(),
            actions: vec![Action::navigate(ActionType::MoveAhead); steps],
            roles: Vec::new(),
            skills: vec![skill; skill_starts.len()],
            annotations: vec![Annotation {
                goal: "all".into(),
                steps: (0..skill_starts.len()).map(|i| format!("step {i}")).collect(),
            }],
            skill_starts,
            goal: None,
            boxes: Vec::new(),
            choices: Vec::new(),
        }
    }

    #[test]
    fn a_trajectory_gives_its_primitives_and_its_whole() {
        let items = Items::of(&[trajectory(vec![0, 2], 5), trajectory(vec![0], 3)], Vec::new(), 0, WHOLE);
        let edges: Vec<(u32, u32, u32)> =
            items.training.iter().map(|span| (span.first, span.start, span.end)).collect();
        assert_eq!(edges, [(0, 0, 2), (0, 2, 5), (0, 0, 5), (6, 6, 9)]);
        assert_eq!(items.texts, ["step 0", "step 1", "all"].map(normalise));
        assert_eq!(items.training[3].texts, [0, 2]);
    }

    #[test]
    fn held_out_trajectories_are_whole_and_draws_depend_on_the_step_alone() {
        let items = Items::of(&[trajectory(vec![0], 4), trajectory(vec![0], 4)], Vec::new(), 2, WHOLE);
        assert_eq!((items.training.len(), items.held_out.len()), (1, 1));
        let draw = |step| Items::draw(&items.training, 7, step, 20);
        assert_eq!(draw(3), draw(3));
        assert_ne!(draw(3), draw(4));
    }

    #[test]
    fn history_repeats_the_first_frame() {
        let stack = |frame| Item { first: 10, frame, end: 20, text: 0 }.stack(5).collect::<Vec<_>>();
        assert_eq!(stack(11), [10, 10, 10, 10, 11]);
        assert_eq!(stack(16), [12, 13, 14, 15, 16]);
    }
}
