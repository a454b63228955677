//! Training items: (span, t), a run of adjacent skills with the sentence of one annotator, and a step in it.

use std::collections::HashMap;
use std::ops::Range;

use anyhow::Context;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};

use super::json::hex;
use super::selection::{Composites, DataSelection, HistoryStart, ObjectTarget};
use super::summaries::Summaries;
use crate::domain::trajectory::Annotation;
use crate::domain::{ActionType, Trajectory};
use crate::language::instruction::normalise;
use crate::language::passage::{Passage, concatenated};

/// What a policy should do at a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ActionLabel {
    /// Position in the action head.
    pub action: u8,
    /// Position in the object head; 0 for navigation.
    pub object: u8,
    /// Whether it was executed and led to the next frame; otherwise it is a correction.
    pub executed: bool,
}

/// What items are made of.
pub struct ItemSource<'a> {
    /// The trajectories, in the order of their frames.
    pub trajectories: &'a [Trajectory],
    /// Which of them are kept apart from training.
    pub apart: &'a [bool],
    /// Those of which the whole must not be learned as one span.
    pub held_out: &'a [String],
    /// What composite spans are called; needed for [`Composites::Labels`] alone.
    pub summaries: &'a Summaries,
}

/// A run of adjacent skills in one annotator's words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Span {
    /// The trajectory's position.
    pub trajectory: u32,
    /// Its skills in the trajectory; one of them for a primitive.
    pub skills: Range<u8>,
    /// The position of the trajectory's first frame among all frames.
    pub first: u32,
    /// The span's first step, as a frame.
    pub start: u32,
    /// The frame after its last step: the state in which it is done.
    pub end: u32,
    /// Position in [`Items::texts`].
    pub text: u32,
}

impl Span {
    /// Whether it is a single skill.
    pub fn is_primitive(&self) -> bool {
        self.skills.len() == 1
    }
}

/// Every item of a dataset. Frames are numbered through: each trajectory has one more than it has actions.
#[derive(Clone, Debug, Default)]
pub struct Items {
    /// One label a frame; the last frame of a trajectory has none, nor has one from which nothing can be learned.
    pub labels: Vec<Option<ActionLabel>>,
    /// Distinct texts, normalised.
    pub texts: Vec<String>,
    /// Spans to learn from.
    pub training: Vec<Span>,
    /// Spans of the trajectories that are kept apart.
    pub held_out: Vec<Span>,
    /// The number of each trajectory's first frame, and at the end the number of frames.
    pub firsts: Vec<u32>,
    /// Of each trajectory of several skills whose whole must not be learned: the frames from the end of its first skill to the
    /// beginning of its last one.
    pub withheld: HashMap<u32, Range<u32>>,
    /// How far back observations reach.
    pub history_start: HistoryStart,
    /// What the object head learns.
    pub object_target: ObjectTarget,
}

/// A drawn item: the transition from `frame` to the frame after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Item {
    /// The first frame that it may show: history does not reach behind it.
    pub first: u32,
    /// The present frame.
    pub frame: u32,
    /// The frame after the span's last step: the transition into it is rewarded and ends the span.
    pub end: u32,
    /// Position in [`Items::texts`].
    pub text: u32,
}

impl Items {
    /// All primitives, and the composites that are selected, once for each aligned annotation. Dropped are the wholes that
    /// [`ItemSource::held_out`] names, spans in which nothing has a label, and those of which nothing is said but white space and
    /// marks. `labels` are those of all frames; without [`DataSelection::corrections`] corrections are left out.
    ///
    /// # Errors
    /// When composites should have labels and one has none.
    pub fn of(
        source: &ItemSource<'_>,
        labels: Vec<Option<ActionLabel>>,
        selection: &DataSelection,
    ) -> anyhow::Result<Items> {
        let learned = |label: &ActionLabel| label.executed || selection.corrections;
        let labels = labels.into_iter().map(|label| label.filter(learned)).collect();
        let mut items = Items {
            labels,
            firsts: vec![0],
            history_start: selection.history_start,
            object_target: selection.object_target,
            ..Items::default()
        };
        let mut numbers = HashMap::new();
        let mut first = 0;
        for (position, trajectory) in source.trajectories.iter().enumerate() {
            let apart = source.apart.get(position).copied().unwrap_or(false);
            if source.held_out.contains(&trajectory.id) && trajectory.skills.len() > 1 {
                let at = |skill| first + trajectory.skill_range(skill).start as u32;
                items.withheld.insert(position as u32, at(1)..at(trajectory.skills.len() - 1));
            }
            for annotation in &trajectory.annotations {
                for (skills, text) in told(source, selection, trajectory, annotation)? {
                    let (from, to) =
                        (trajectory.skill_range(skills.start).start, trajectory.skill_range(skills.end - 1).end);
                    let text = normalise(&text);
                    let frames = first as usize + from..first as usize + to;
                    if text.is_empty() || !frames.clone().any(|frame| items.is_labelled(frame)) {
                        continue;
                    }
                    let text = *numbers.entry(text).or_insert_with_key(|text| {
                        items.texts.push(text.clone());
                        items.texts.len() as u32 - 1
                    });
                    let span = Span {
                        trajectory: position as u32,
                        skills: skills.start as u8..skills.end as u8,
                        first,
                        start: frames.start as u32,
                        end: frames.end as u32,
                        text,
                    };
                    if apart { &mut items.held_out } else { &mut items.training }.push(span);
                }
            }
            first += trajectory.actions.len() as u32 + 1;
            items.firsts.push(first);
        }
        Ok(items)
    }

    /// A batch of items: spans uniformly, then a labelled step uniformly. A function of seed and step alone, so that a resumed
    /// training draws what the uninterrupted one would have.
    pub fn draw(&self, spans: &[Span], seed: u64, step: u64, batch: usize) -> Vec<Item> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(step + 1);
        let draw = |_| self.step_of(&spans[rng.random_range(0..spans.len())], &mut rng);
        if spans.is_empty() { Vec::new() } else { (0..batch).map(draw).collect() }
    }

    /// A labelled step of a span of these items, uniformly: there is one in each.
    pub(crate) fn step_of(&self, span: &Span, rng: &mut ChaCha8Rng) -> Item {
        loop {
            let frame = rng.random_range(span.start..span.end);
            if self.is_labelled(frame as usize) {
                return Item {
                    first: self.history_start.first(span.first, span.start, rng),
                    frame,
                    end: span.end,
                    text: span.text,
                };
            }
        }
    }

    /// The text "A. B." of two texts, by their numbers.
    pub(crate) fn joint_text(&self, first: u32, second: u32) -> String {
        format!("{} {}", self.texts[first as usize], self.texts[second as usize])
    }

    /// The class that the object head learns to name at an item's frame; 0 where there is none.
    pub(crate) fn object_target(&self, item: &Item) -> u8 {
        let last = match self.object_target {
            ObjectTarget::Current => item.frame + 1,
            ObjectTarget::Next => item.end,
        };
        let labels = self.labels.get(item.frame as usize..last as usize).unwrap_or_default();
        labels.iter().flatten().map(|label| label.object).find(|&object| object > 0).unwrap_or(0)
    }

    /// Identifies what is learned, and under which texts: the first 16 digits of the sha256 of all spans and texts.
    pub(crate) fn digest(&self) -> String {
        let mut hash = Sha256::new();
        for span in self.training.iter().chain(&self.held_out) {
            let Span { trajectory, skills, first, start, end, text } = span;
            let numbers = [*trajectory, skills.start.into(), skills.end.into(), *first, *start, *end, *text];
            numbers.iter().for_each(|number| hash.update(number.to_le_bytes()));
        }
        for text in &self.texts {
            hash.update(text);
            hash.update([0]);
        }
        hex(&hash.finalize())[..16].to_string()
    }

    /// Each action's share of what is drawn to learn from, in the order of the action head.
    pub(crate) fn action_shares(&self) -> Vec<f32> {
        let mut shares = vec![0.0; ActionType::COUNT];
        for span in &self.training {
            let labels = self.labels.get(span.start as usize..span.end as usize).unwrap_or_default();
            let actions = || labels.iter().flatten().map(|label| usize::from(label.action));
            let each = 1.0 / actions().count().max(1) as f64;
            actions().for_each(|action| shares[action] += each);
        }
        let spans = self.training.len().max(1) as f64;
        shares.into_iter().map(|share| (share / spans) as f32).collect()
    }

    fn is_labelled(&self, frame: usize) -> bool {
        self.labels.get(frame).is_some_and(Option::is_some)
    }

    /// The frames that an item may be asked to reach: what is left of its trajectory. Where the whole must not be learned, its
    /// last skill is no goal within its first one.
    pub(crate) fn goals(&self, item: &Item) -> Range<u32> {
        let next = self.firsts.partition_point(|&first| first <= item.frame);
        let end = self.firsts.get(next).copied().unwrap_or(item.end + 1);
        let withheld = self.withheld.get(&(next as u32).wrapping_sub(1)).filter(|inner| item.frame < inner.start);
        item.frame + 1..withheld.map_or(end, |inner| inner.end + 1)
    }
}

/// The spans of a trajectory with what one annotator says of each.
fn told(
    source: &ItemSource<'_>,
    selection: &DataSelection,
    trajectory: &Trajectory,
    annotation: &Annotation,
) -> anyhow::Result<Vec<(Range<usize>, String)>> {
    let mut told = Vec::new();
    if annotation.steps.len() == trajectory.skills.len() {
        told.extend(annotation.steps.iter().enumerate().map(|(skill, step)| (skill..skill + 1, step.clone())));
    }
    if selection.composites == Composites::Whole {
        // Of a single skill, goal and step say the same.
        if !source.held_out.contains(&trajectory.id) && !trajectory.skills.is_empty() {
            told.push((0..trajectory.skills.len(), annotation.goal.clone()));
        }
        return Ok(told);
    }
    for skills in composites(trajectory, source.held_out) {
        let Some(passage) = Passage::of(trajectory, annotation, skills.clone()) else { break };
        let text = match selection.composites {
            Composites::Labels => source.summaries.find(&passage).map(str::to_owned).with_context(|| {
                format!("{}: skills {skills:?} have no label; `sprint relabel` writes what is missing", trajectory.id)
            })?,
            Composites::Concat => concatenated(passage.sentences),
            Composites::None | Composites::Whole => break,
        };
        told.push((skills, text));
    }
    Ok(told)
}

/// The runs of two or more skills of a trajectory, without the whole where that is held out.
pub(crate) fn composites(trajectory: &Trajectory, held_out: &[String]) -> Vec<Range<usize>> {
    let count = trajectory.skills.len();
    let mut runs: Vec<_> = (0..count).flat_map(|from| (from + 2..=count).map(move |to| from..to)).collect();
    if held_out.contains(&trajectory.id) {
        runs.retain(|run| run.len() < count);
    }
    runs
}

impl Item {
    /// The frames of the observation, oldest first; before the trajectory's first frame there was the first one.
    pub(crate) fn stack(&self, history: u32) -> impl Iterator<Item = usize> + use<> {
        stack(self.first, self.frame, history)
    }

    /// Whether the step ends the span: reward 1, and nothing after it.
    pub(crate) fn is_last(&self) -> bool {
        self.frame + 1 == self.end
    }
}

/// `frame` and those before it, `history` in all, oldest first; none lies before `first`.
pub(crate) fn stack(first: u32, frame: u32, history: u32) -> impl Iterator<Item = usize> + use<> {
    (0..history).map(move |i| (frame + 1 + i).saturating_sub(history).max(first) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::trajectory::{self, Annotation};
    use crate::domain::{Action, ActionType, SkillKind, Subtask};

    fn trajectory(skill_starts: Vec<u32>, steps: usize) -> Trajectory {
        let skill = Subtask { skill: SkillKind::Pickup, object: 0, receptacle: None, closes: false, literal: None };
        Trajectory {
            actions: vec![Action::navigate(ActionType::MoveAhead); steps],
            roles: Vec::new(),
            skills: vec![skill; skill_starts.len()],
            annotations: vec![Annotation {
                goal: "all".into(),
                steps: (0..skill_starts.len()).map(|i| format!("step {i}")).collect(),
            }],
            skill_starts,
            ..trajectory::testing::empty("t", "s")
        }
    }

    fn items(trajectories: &[Trajectory], composites: Composites, held_out: &[String]) -> Items {
        let summaries = Summaries::default();
        let source = ItemSource { trajectories, apart: &[], held_out, summaries: &summaries };
        Items::of(&source, labels(trajectories), &DataSelection::of(composites)).unwrap()
    }

    fn labels(trajectories: &[Trajectory]) -> Vec<Option<ActionLabel>> {
        let of = |trajectory: &Trajectory| {
            let label = Some(ActionLabel { action: 0, object: 0, executed: true });
            std::iter::repeat_n(label, trajectory.actions.len()).chain([None])
        };
        trajectories.iter().flat_map(of).collect()
    }

    fn edges(items: &Items) -> Vec<(u32, u32, u32)> {
        items.training.iter().map(|span| (span.first, span.start, span.end)).collect()
    }

    #[test]
    fn a_trajectory_gives_its_primitives_and_its_whole() {
        let items = items(&[trajectory(vec![0, 2], 5), trajectory(vec![0], 3)], Composites::Whole, &[]);
        assert_eq!(edges(&items), [(0, 0, 2), (0, 2, 5), (0, 0, 5), (6, 6, 9), (6, 6, 9)]);
        assert_eq!(items.texts, ["step 0", "step 1", "all"].map(normalise));
        assert_eq!(items.firsts, [0, 6, 10]);
        assert_eq!(items.goals(&Item { first: 0, frame: 1, end: 2, text: 0 }), 2..6);
    }

    #[test]
    fn every_run_of_skills_is_a_span_and_a_held_out_whole_is_not() {
        let three = [trajectory(vec![0, 2, 3], 5)];
        let concat = items(&three, Composites::Concat, &[]);
        assert_eq!(edges(&concat), [(0, 0, 2), (0, 2, 3), (0, 3, 5), (0, 0, 3), (0, 0, 5), (0, 2, 5)]);
        assert_eq!(concat.texts[concat.training[3].text as usize], "Step 0. step 1.");
        assert_eq!(concat.training[5].skills, 1..3);
        let dropped = items(&three, Composites::Concat, &["t".to_string()]);
        assert_eq!(edges(&dropped), [(0, 0, 2), (0, 2, 3), (0, 3, 5), (0, 0, 3), (0, 2, 5)]);
        assert_eq!(items(&three, Composites::None, &[]).training.len(), 3);
        assert_ne!(concat.digest(), dropped.digest());
        let goals = |items: &Items, frame| items.goals(&Item { first: 0, frame, end: 5, text: 0 });
        assert_eq!([1, 2, 4].map(|frame| goals(&dropped, frame)), [2..4, 3..6, 5..6]);
        assert_eq!(goals(&concat, 1), 2..6);
    }

    #[test]
    fn a_held_out_trajectory_of_one_skill_is_learned_as_that_skill() {
        let one = items(&[trajectory(vec![0], 3)], Composites::Concat, &["t".to_string()]);
        assert_eq!(edges(&one), [(0, 0, 3)]);
        assert_eq!(one.goals(&Item { first: 0, frame: 0, end: 3, text: 0 }), 1..4);
    }

    #[test]
    fn a_span_without_its_label_is_an_error_that_says_what_to_do() {
        let summaries = Summaries::default();
        let source =
            ItemSource { trajectories: &[trajectory(vec![0, 2], 5)], apart: &[], held_out: &[], summaries: &summaries };
        let error = Items::of(&source, labels(source.trajectories), &DataSelection::of(Composites::Labels))
            .unwrap_err()
            .to_string();
        assert!(error.contains("skills 0..2") && error.contains("sprint relabel"), "{error}");
    }

    #[test]
    fn an_annotation_that_is_not_aligned_is_left_out() {
        let mut odd = trajectory(vec![0, 2], 5);
        odd.annotations[0].steps.pop();
        assert!(items(&[odd], Composites::Concat, &[]).training.is_empty());
    }

    #[test]
    fn trajectories_are_kept_apart_as_wholes_and_draws_depend_on_the_step_alone() {
        let (three, summaries) = ([(); 3].map(|()| trajectory(vec![0], 4)), Summaries::default());
        let source =
            ItemSource { trajectories: &three, apart: &[false, true, true], held_out: &[], summaries: &summaries };
        let items = Items::of(&source, labels(&three), &DataSelection::of(Composites::None)).unwrap();
        assert_eq!((items.training.len(), items.held_out.len()), (1, 2));
        let draw = |step| items.draw(&items.training, 7, step, 20);
        assert_eq!(draw(3), draw(3));
        assert_ne!(draw(3), draw(4));
        assert!(draw(3).iter().all(|item| item.frame < 4 && item.is_last() == (item.frame == 3)));
    }

    #[test]
    fn a_step_without_a_label_or_a_correction_unasked_for_is_never_drawn_and_a_span_of_them_is_left_out() {
        let one = [trajectory(vec![0, 2], 5)];
        let mut labels = labels(&one);
        labels[..2].fill(None);
        labels[3] = Some(ActionLabel { action: 0, object: 0, executed: false });
        let drawn = |corrections| {
            let summaries = Summaries::default();
            let source = ItemSource { trajectories: &one, apart: &[], held_out: &[], summaries: &summaries };
            let selection = DataSelection { corrections, ..DataSelection::of(Composites::Whole) };
            let items = Items::of(&source, labels.clone(), &selection).unwrap();
            assert_eq!(edges(&items), [(0, 2, 5), (0, 0, 5)]);
            let frames = items.draw(&items.training, 1, 0, 50).iter().map(|item| item.frame).collect();
            Vec::from_iter::<std::collections::BTreeSet<u32>>(frames)
        };
        assert_eq!(drawn(false), [2, 4]);
        assert_eq!(drawn(true), [2, 3, 4]);
    }

    #[test]
    fn history_repeats_the_first_frame() {
        let item = |frame| Item { first: 10, frame, end: 20, text: 0 };
        assert_eq!(item(11).stack(5).collect::<Vec<_>>(), [10, 10, 10, 10, 11]);
        assert_eq!(item(16).stack(5).collect::<Vec<_>>(), [12, 13, 14, 15, 16]);
    }

    #[test]
    fn observations_reach_back_as_far_as_the_selection_says() {
        let two = [trajectory(vec![0, 2], 5)];
        let firsts = |history_start| {
            let summaries = Summaries::default();
            let source = ItemSource { trajectories: &two, apart: &[], held_out: &[], summaries: &summaries };
            let selection = DataSelection { history_start, ..DataSelection::of(Composites::None) };
            let items = Items::of(&source, labels(&two), &selection).unwrap();
            let drawn = items.draw(&items.training, 1, 0, 50);
            let late = drawn.iter().filter(|item| item.frame >= 2);
            assert!(drawn.iter().all(|item| items.goals(item) == (item.frame + 1..6)));
            Vec::from_iter::<std::collections::BTreeSet<u32>>(late.map(|item| item.first).collect())
        };
        assert_eq!(
            [HistoryStart::Trajectory, HistoryStart::Span, HistoryStart::Either].map(firsts),
            [vec![0], vec![2], vec![0, 2]]
        );
    }

    #[test]
    fn on_the_way_what_comes_next_is_named_where_the_selection_says_so() {
        let two = [trajectory(vec![0, 3], 5)];
        let mut labels = labels(&two);
        labels[2] = Some(ActionLabel { action: 5, object: 7, executed: true });
        labels[4] = Some(ActionLabel { action: 6, object: 9, executed: true });
        let named = |object_target, end| -> Vec<u8> {
            let summaries = Summaries::default();
            let source = ItemSource { trajectories: &two, apart: &[], held_out: &[], summaries: &summaries };
            let selection = DataSelection { object_target, ..DataSelection::of(Composites::None) };
            let items = Items::of(&source, labels.clone(), &selection).unwrap();
            (0..end).map(|frame| items.object_target(&Item { first: 0, frame, end, text: 0 })).collect()
        };
        assert_eq!(named(ObjectTarget::Current, 5), [0, 0, 7, 0, 9]);
        assert_eq!(named(ObjectTarget::Next, 5), [7, 7, 7, 9, 9]);
        assert_eq!(named(ObjectTarget::Next, 4), [7, 7, 7, 0], "what comes after the span is not asked for");
    }

    #[test]
    fn an_action_has_the_share_of_the_draws_in_which_it_is_the_label() {
        let two = [trajectory(vec![0, 2], 6)];
        let summaries = Summaries::default();
        let source = ItemSource { trajectories: &two, apart: &[], held_out: &[], summaries: &summaries };
        let mut labels = labels(&two);
        labels[1] = Some(ActionLabel { action: 5, object: 1, executed: true });
        labels[2] = None;
        let items = Items::of(&source, labels, &DataSelection::of(Composites::None)).unwrap();
        let shares = items.action_shares();
        assert_eq!((shares[0], shares[5], shares[3]), (0.75, 0.25, 0.0), "half of the first of two skills");
        let drawn = items.draw(&items.training, 1, 0, 4000);
        let fifth = drawn.iter().filter(|item| item.frame == 1).count();
        assert!((900..1100).contains(&fifth), "{fifth}");
    }
}
