//! Which spans people are asked about: drawn by chance, of each length as many as of any other.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use anyhow::ensure;
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::data::Dataset;
use crate::data::annotations::SpanKey;
use crate::domain::Trajectory;
use crate::eval::tasks::sample::annotators;
use crate::language::passage::Passage;

/// Which spans to draw, and how many. The same selection of a dataset gives the same spans to everybody; asking for more keeps
/// the first ones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SpanSelection {
    /// Skills of a span; these lengths take turns.
    pub(crate) lengths: Vec<usize>,
    /// Spans in all.
    pub(crate) count: usize,
    /// Of which split.
    pub(crate) split: String,
    pub(crate) seed: u64,
}

/// A run of skills that a person is asked about.
#[derive(Clone, Debug)]
pub(crate) struct AnnotationSpan {
    pub(crate) trajectory: Arc<Trajectory>,
    /// How it is kept.
    pub(crate) key: SpanKey,
}

impl AnnotationSpan {
    /// The span of that name in its trajectory; nothing when the trajectory holds another one by now.
    pub(crate) fn named(trajectory: &Arc<Trajectory>, key: &SpanKey) -> Option<AnnotationSpan> {
        let span = AnnotationSpan { trajectory: trajectory.clone(), key: key.clone() };
        let (annotator, skills) = (usize::try_from(key.annotator).ok()?, span.skills());
        let annotation = trajectory.annotations.get(annotator).filter(|_| !skills.is_empty())?;
        let digest = Passage::of(trajectory, annotation, skills)?.digest();
        (digest == key.input).then_some(span)
    }

    /// Its skills in the trajectory.
    pub(crate) fn skills(&self) -> Range<usize> {
        usize::from(self.key.skills[0])..usize::from(self.key.skills[1])
    }

    /// What is to be summed up: a sentence for each skill.
    pub(crate) fn sentences(&self) -> &[String] {
        let annotation = self.trajectory.annotations.get(self.key.annotator as usize);
        annotation.and_then(|annotation| annotation.steps.get(self.skills())).unwrap_or_default()
    }
}

/// Draws spans. Left out are wholes that training must not see, and wholes of which people wrote a sentence already, as they did of
/// all of ALFRED's.
///
/// # Errors
/// When the dataset cannot be read, or holds none.
pub(crate) fn draw(dataset: &Dataset, selection: &SpanSelection) -> anyhow::Result<Vec<AnnotationSpan>> {
    dataset.check_split(&selection.split)?;
    let manifest = dataset.manifest();
    let has_goals = manifest.source == "alfred";
    // The spans of each length: a trajectory's number, and the first skill.
    let mut there: BTreeMap<usize, Vec<(u32, u8)>> = selection.lengths.iter().map(|&of| (of, Vec::new())).collect();
    for (number, trajectory) in (0..).zip(dataset.trajectories()?) {
        let trajectory = trajectory?;
        if trajectory.split != selection.split {
            continue;
        }
        let skills = trajectory.skills.len();
        let is_told = has_goals || manifest.held_out.contains(&trajectory.id);
        for (&length, spans) in &mut there {
            let firsts = (0..skills).take_while(|first| first + length <= skills);
            let free = firsts.filter(|first| !(is_told && length == skills) && first + length <= skills);
            let said = free.filter(|&first| !annotators(&trajectory, first..first + length).is_empty());
            spans.extend(said.map(|first| (number, first as u8)));
        }
    }
    for (&length, spans) in &mut there {
        spans.shuffle(&mut rng(selection.seed, length as u64, 0));
        spans.reverse();
    }
    let mut chosen: Vec<(u32, u8, usize)> = Vec::new();
    while chosen.len() < selection.count {
        let before = chosen.len();
        for (&length, spans) in &mut there {
            let next = spans.pop().filter(|_| chosen.len() < selection.count);
            chosen.extend(next.map(|(number, first)| (number, first, length)));
        }
        if chosen.len() == before {
            break;
        }
    }
    ensure!(
        !chosen.is_empty(),
        "{} holds no span of {:?} skills in split {:?} that people could be asked about",
        dataset.folder().display(),
        selection.lengths,
        selection.split
    );
    let mut trajectories: BTreeMap<u32, Arc<Trajectory>> = BTreeMap::new();
    for (number, trajectory) in (0..).zip(dataset.trajectories()?) {
        if chosen.iter().any(|&(of, ..)| of == number) {
            trajectories.insert(number, Arc::new(trajectory?));
        }
    }
    let span = |&(number, first, length): &(u32, u8, usize)| {
        let trajectory = trajectories.get(&number)?;
        let skills = usize::from(first)..usize::from(first) + length;
        let wrote = annotators(trajectory, skills.clone());
        let annotator = *wrote
            .get(rng(selection.seed, u64::from(number), skills.start as u64 + 1).random_range(0..wrote.len().max(1)))?;
        let input = Passage::of(trajectory, &trajectory.annotations[annotator], skills.clone())?.digest();
        let key = SpanKey {
            trajectory: trajectory.id.clone(),
            annotator: annotator as u32,
            skills: [skills.start as u8, skills.end as u8],
            input,
        };
        Some(AnnotationSpan { trajectory: trajectory.clone(), key })
    };
    Ok(chosen.iter().filter_map(span).collect())
}

/// Random numbers of a purpose: no span's chance depends on another's.
fn rng(seed: u64, one: u64, other: u64) -> ChaCha8Rng {
    let mut key = [0; 32];
    for (part, number) in key.chunks_exact_mut(8).zip([seed, one, other]) {
        part.copy_from_slice(&number.to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}

#[cfg(test)]
mod tests {
    use super::super::testing;
    use super::*;

    #[test]
    fn lengths_take_turns_everybody_gets_the_same_and_more_keeps_the_first() {
        let folder = testing::dataset(&["a", "b"], &[]);
        let dataset = Dataset::open(folder.path()).unwrap();
        let keys = |count, seed| -> Vec<SpanKey> {
            let selection = SpanSelection { count, seed, ..testing::selection() };
            draw(&dataset, &selection).unwrap().into_iter().map(|span| span.key).collect()
        };
        let all = keys(99, 1);
        // Of three skills each: two runs of two, and the whole.
        assert_eq!(all.len(), 6);
        let lengths: Vec<u8> = all.iter().map(|key| key.skills[1] - key.skills[0]).collect();
        assert_eq!(lengths, [2, 3, 2, 3, 2, 2]);
        assert_eq!(keys(3, 1), all[..3]);
        assert_ne!(keys(99, 2), all);
        let mut distinct = all.clone();
        distinct.sort();
        distinct.dedup();
        assert_eq!(distinct.len(), 6, "no span twice");
    }

    #[test]
    fn a_whole_that_training_must_not_see_is_left_out_and_an_absent_length_or_split_is_named() {
        let folder = testing::dataset(&["a"], &["a"]);
        let dataset = Dataset::open(folder.path()).unwrap();
        let found = draw(&dataset, &testing::selection()).unwrap();
        assert!(found.len() == 2 && found.iter().all(|span| span.sentences().len() == 2));
        let error = |selection| draw(&dataset, &selection).unwrap_err().to_string();
        assert!(error(SpanSelection { lengths: vec![7], ..testing::selection() }).contains("[7] skills"));
        assert!(error(SpanSelection { split: "valid".into(), ..testing::selection() }).contains("it holds train"));
    }

    #[test]
    fn a_span_is_known_again_unless_its_words_are_others_now() {
        let folder = testing::dataset(&["a"], &[]);
        let span = testing::spans(folder.path()).remove(0);
        assert!(AnnotationSpan::named(&span.trajectory, &span.key).is_some());
        let mut other = (*span.trajectory).clone();
        other.annotations[span.key.annotator as usize].steps[1] = "Sell it.".into();
        assert!(AnnotationSpan::named(&Arc::new(other), &span.key).is_none());
        for skills in [[2, 1], [0, 9]] {
            assert!(AnnotationSpan::named(&span.trajectory, &SpanKey { skills, ..span.key.clone() }).is_none());
        }
    }
}
