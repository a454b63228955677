//! Merging GotoLocation: each walk is prepended to the skill that follows it.

use crate::language::instruction;

/// How the steps of a plan are renumbered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct GotoMerge {
    gotos: Vec<usize>,
}

impl GotoMerge {
    /// From the numbers of the plan's GotoLocation steps.
    pub(crate) fn new(mut gotos: Vec<usize>) -> GotoMerge {
        gotos.sort_unstable();
        GotoMerge { gotos }
    }

    /// Whether the step of that number is a GotoLocation.
    pub(crate) fn is_goto(&self, step: usize) -> bool {
        self.gotos.binary_search(&step).is_ok()
    }

    /// The merged number of the skill that the step of that number belongs to.
    pub(crate) fn skill(&self, step: usize) -> usize {
        let step = step + usize::from(self.is_goto(step));
        step - self.gotos.partition_point(|&goto| goto < step)
    }

    /// The sentences of the merged skills: those of the walks are dropped.
    pub(crate) fn sentences(&self, steps: &[String]) -> Vec<String> {
        let kept = steps.iter().enumerate().filter(|(step, _)| !self.is_goto(*step));
        kept.map(|(_, sentence)| instruction::visible(sentence)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_belongs_to_the_skill_that_follows_it() {
        let merge = GotoMerge::new(vec![0, 2, 5]);
        let skills: Vec<_> = (0..7).map(|step| merge.skill(step)).collect();
        assert_eq!(skills, [0, 0, 1, 1, 2, 3, 3]);
    }

    #[test]
    fn only_the_sentences_of_skills_are_kept() {
        let steps: Vec<_> = ["walk", "take it", "walk on", "put it down"].map(String::from).into();
        assert_eq!(GotoMerge::new(vec![0, 2]).sentences(&steps), ["take it", "put it down"]);
    }
}
