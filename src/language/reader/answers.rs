//! Answers to which class is meant: ranked by what was learned and by what speaks for a class.

use super::model::{Head, softmax};
use super::reading::Alternative;
use crate::domain::Class;

/// Alternatives that are kept.
pub(super) const ALTERNATIVES: usize = 3;

/// How much likelier a class gets by its usual name, beside what was learned.
const OUTRIGHT: f32 = 1.5;

/// A class with its probability, and the ones behind it.
pub(super) struct Answer {
    pub class: Option<Class>,
    pub probability: f32,
    pub others: Vec<(Class, f32)>,
}

impl Answer {
    /// Leaves open which class it is: "it" where nothing was named.
    pub(super) fn leave_open(&mut self) {
        if let Some(class) = self.class.take() {
            self.others.insert(0, (class, self.probability));
            self.others.truncate(ALTERNATIVES);
        }
    }
}

/// A thing does not go into itself: of two answers that are the same, the one that loses less by it is the next best.
fn set_apart(object: &mut Answer, holder: &mut Answer) {
    if object.class != holder.class {
        return;
    }
    let next = |answer: &Answer| answer.others.first().map_or(0.0, |other| other.1);
    let keeps_object = object.probability * next(holder) > next(object) * holder.probability;
    let other = if keeps_object { holder } else { object };
    if !other.others.is_empty() {
        let (class, probability) = other.others.remove(0);
        (other.class, other.probability) = (Some(class), probability);
    }
}

/// No two of a unit's things are the same.
pub(super) fn set_all_apart(object: &mut Answer, holder: &mut Option<Answer>, place: &mut Option<Answer>) {
    // A change may bring about another pair that is the same.
    for _ in 0..3 {
        if let Some(holder) = holder {
            set_apart(object, holder);
            if let Some(place) = place {
                set_apart(holder, place);
            }
        }
        if let Some(place) = place {
            set_apart(object, place);
        }
    }
}

/// The classes that may be meant, the likeliest first.
pub(super) fn ranked(
    head: &Head,
    features: &[u32],
    outright: Option<Class>,
    may: impl Fn(Class) -> bool,
    evidence: impl Fn(Class) -> f32,
) -> Vec<(Option<Class>, f32)> {
    let scores = head.scores(features);
    let classes: Vec<Option<Class>> = head.labels().iter().map(|label| Class::named(label)).collect();
    let kept: Vec<(Option<Class>, f32)> = classes
        .into_iter()
        .map(|class| class.filter(|&class| class != Class::NONE))
        .zip(scores)
        .filter(|(class, _)| class.is_none_or(&may))
        .collect();
    let evident = |(class, score): &(Option<Class>, f32)| score + class.map_or(1.0, &evidence).ln();
    let p = softmax(&kept.iter().map(evident).collect::<Vec<_>>());
    let mut all: Vec<(Option<Class>, f32)> = kept.into_iter().map(|(class, _)| class).zip(p).collect();
    // What a name speaks for its class decides, but makes nothing more certain.
    let weight =
        |&(class, p): &(Option<Class>, f32)| if class.is_some() && class == outright { p * OUTRIGHT } else { p };
    all.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
    all
}

pub(super) fn alternatives(answer: &Answer, is_receptacle: bool) -> Vec<Alternative> {
    answer.others.iter().map(|&(class, probability)| Alternative { is_receptacle, class, probability }).collect()
}
