//! Summaries by rules: what a person would say of a run of skills in one short sentence, in the annotator's own nouns.

mod clauses;
mod naming;

use std::cell::RefCell;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::nouns::Noun;
use super::outcome::{ChainOutcome, outcomes};
use super::passage::{Passage, Summarizer, Summary, TakeSummary};
use super::task_wording::TaskWording;
use crate::domain::skill::SkillKind;

/// No summary has more words.
pub(crate) const LONGEST: usize = 29;

/// Sums up by rules.
pub(crate) struct Rules;

impl Summarizer for Rules {
    fn source(&self) -> &'static str {
        "rules"
    }

    fn version(&self) -> u32 {
        1
    }

    fn together(&self) -> usize {
        4096
    }

    fn summaries(&self, passages: &[Passage<'_>], take: &mut TakeSummary<'_>) -> anyhow::Result<()> {
        let texts: Vec<String> = passages.par_iter().map(summary).collect();
        texts.into_iter().map(Summary::Sentence).enumerate().try_for_each(|(index, text)| take(index, text))
    }
}

/// A passage in a sentence. The same passage always gives the same one.
pub(crate) fn summary(passage: &Passage<'_>) -> String {
    let digest = passage.seed();
    // Each manner is shorter than the one before.
    let mut sentence = String::new();
    for manner in [DetailLevel::Full, DetailLevel::Plain, DetailLevel::Last] {
        let builder = SummaryBuilder::new(passage, manner, ChaCha8Rng::seed_from_u64(digest));
        sentence = finish(&builder.sentence());
        if sentence.split(' ').count() <= LONGEST {
            break;
        }
    }
    sentence
}

/// How much a sentence says.
#[derive(Clone, Copy, PartialEq, Eq)]
enum DetailLevel {
    Full,
    /// Without words of looks.
    Plain,
    /// Only what comes about last.
    Last,
}

struct SummaryBuilder<'a> {
    story: TaskWording<'a>,
    nouns: Vec<Noun>,
    manner: DetailLevel,
    rng: RefCell<ChaCha8Rng>,
}

impl<'a> SummaryBuilder<'a> {
    fn new(passage: &Passage<'a>, manner: DetailLevel, rng: ChaCha8Rng) -> SummaryBuilder<'a> {
        let story = TaskWording { roles: passage.roles, subtasks: passage.subtasks, origins: &[] };
        let mut builder = SummaryBuilder { story, nouns: Vec::new(), manner, rng: RefCell::new(rng) };
        builder.nouns = (0..passage.roles.len() as u8).map(|role| builder.noun(passage, role)).collect();
        builder
    }

    fn chance(&self, probability: f64) -> bool {
        self.rng.borrow_mut().random_bool(probability)
    }

    fn one_of<'t>(&self, texts: &[&'t str]) -> &'t str {
        texts[self.rng.borrow_mut().random_range(0..texts.len() as u32) as usize]
    }

    /// The only state that was changed, of a thing that was whole and alone.
    fn only_change(&self, thing: u8) -> Option<SkillKind> {
        let changes = [SkillKind::Clean, SkillKind::Heat, SkillKind::Cool];
        let mut done = self.story.subtasks.iter().filter(|step| changes.contains(&step.skill) && step.object == thing);
        done.next().map(|step| step.skill).filter(|_| done.next().is_none())
    }

    fn cuts(&self) -> bool {
        self.story.subtasks.iter().any(|step| step.skill == SkillKind::Slice)
    }

    /// The knife that cut is put somewhere: nobody mentions that, unless it is all that is left to say.
    fn is_aside(&self, outcome: &ChainOutcome) -> bool {
        match outcome {
            ChainOutcome::Placed { things, .. } => {
                self.cuts() && things.iter().all(|&thing| self.story.class(thing).is_knife())
            }
            _ => false,
        }
    }

    fn sentence(&self) -> String {
        let mut outcomes = outcomes(&self.story);
        let last = outcomes.len().saturating_sub(1);
        let mut position = 0;
        outcomes.retain(|outcome| {
            position += 1;
            position > last
                || self.manner != DetailLevel::Last && (!self.is_aside(outcome) || last == 1 && self.chance(0.15))
        });
        let mut clauses: Vec<String> = Vec::new();
        for (number, outcome) in outcomes.iter().enumerate() {
            let clause = self.clause(outcome);
            let again = number > 0
                && ["put ", "place "]
                    .iter()
                    .any(|verb| clauses[number - 1].starts_with(verb) && clause.starts_with(verb))
                && !clauses[number - 1].contains(" and ")
                && !clause.contains(" and ")
                && self.chance(0.6);
            clauses.push(if again {
                clause.split_once(' ').map_or(String::new(), |(_, rest)| rest.into())
            } else {
                clause
            });
        }
        match clauses.as_slice() {
            [first, second] if !first.contains(" and ") => {
                format!("{first}{}{second}", self.one_of(&[" and ", " and ", " and ", ", then "]))
            }
            [first, second] => format!("{first}, then {second}"),
            [] => self.last_resort(),
            [others @ .., last] if !others.is_empty() => format!("{}, and {last}", others.join(", ")),
            _ => clauses.concat(),
        }
    }

    /// For chains that come to nothing that has a name.
    fn last_resort(&self) -> String {
        let last = self.story.subtasks.last().map_or(0, |step| step.receptacle.unwrap_or(step.object));
        format!("use {}", self.named(last).the(&[]))
    }
}

/// A capital and a full stop.
fn finish(clause: &str) -> String {
    super::instruction::normalise(clause)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::domain::{Class, Role, Subtask};
    use crate::house::testing::{put_subtask, role, slice_role, subtask};
    use crate::language::nouns;

    /// Summaries of a passage whose sentences differ slightly, so that chance differs.
    fn ways(roles: &[Role], subtasks: &[Subtask], sentences: &[&str]) -> Vec<String> {
        let say = |way: usize| {
            let sentences: Vec<String> = sentences.iter().map(|text| format!("{text}{}", " ".repeat(way))).collect();
            summary(&Passage { roles, subtasks, sentences: &sentences })
        };
        (0..60).map(say).collect()
    }

    fn all(ways: &[String], test: impl Fn(&str) -> bool) {
        for way in ways {
            assert!(test(way), "{way}");
        }
    }

    fn any(ways: &[String], wanted: &str) {
        assert!(ways.iter().any(|way| way == wanted), "{wanted} is none of {ways:#?}");
    }

    #[test]
    fn picking_up_is_implied_and_what_was_done_to_a_thing_becomes_an_adjective() {
        let roles = [role("Cup"), role("Cabinet")];
        let subtasks = [subtask(SkillKind::Pickup, 0), subtask(SkillKind::Clean, 0), put_subtask(0, 1)];
        let texts = ["Pick up the wine glass.", "Rinse the glass in the sink.", "Put it in the lower cabinet."];
        let ways = ways(&roles, &subtasks, &texts);
        any(&ways, "Put a rinsed wine glass in the cabinet.");
        any(&ways, "Wash the glass and place it in the cabinet.");
        all(&ways, |way| !way.contains("ick up") && way.contains("glass"));
    }

    #[test]
    fn nobody_mentions_the_knife_that_cut() {
        let roles = [role("ButterKnife"), role("Apple"), role("Sink"), slice_role("Apple"), role("Fridge")];
        let subtasks = [
            subtask(SkillKind::Pickup, 0),
            subtask(SkillKind::Slice, 1),
            put_subtask(0, 2),
            subtask(SkillKind::Pickup, 3),
            subtask(SkillKind::Heat, 3),
            put_subtask(3, 4),
        ];
        let texts = [
            "Take the knife.",
            "Cut the apple.",
            "Leave it.",
            "Take a slice.",
            "Heat it.",
            "Put it in the refrigerator.",
        ];
        let whole = ways(&roles, &subtasks, &texts);
        any(&whole, "Put a heated slice of apple in the refrigerator.");
        let quiet = whole.iter().filter(|way| !way.contains("knife") && way.contains("refrigerator")).count();
        assert!(quiet > 45, "{whole:#?}");
        any(&ways(&roles, &subtasks[..2], &texts[..2]), "Slice an apple.");
        all(&ways(&roles, &subtasks[..3], &texts[..3]), |way| way.contains("knife") && way.contains("sink"));
        all(&ways(&roles, &subtasks[..4], &texts[..4]), |way| way.contains("apple"));
    }

    #[test]
    fn two_of_a_kind_are_told_together_and_two_kinds_are_joined() {
        let roles = [role("Mug"), role("Desk"), role("Mug"), role("Pen")];
        let take_and_put = |thing| [subtask(SkillKind::Pickup, thing), put_subtask(thing, 1)];
        let texts = ["Take the red mug.", "Put it on the desk.", "Take it.", "Put it on the desk."];
        let two = ways(&roles, &[take_and_put(0), take_and_put(2)].concat(), &texts);
        any(&two, "Put two mugs on the desk.");
        let mixed = ways(&roles, &[take_and_put(0), take_and_put(3)].concat(), &texts);
        all(&mixed, |way| {
            way.contains("mug") && way.contains("pen") && way.contains(" and ") || way.contains(", then ")
        });
        let another = ways(&roles, &[put_subtask(0, 1), subtask(SkillKind::Pickup, 2)], &texts[1..3]);
        any(&another, "Put the mug on the desk and pick up another mug.");
    }

    #[test]
    fn what_lies_in_a_thing_goes_along() {
        let roles = [role("Spoon"), role("Bowl"), role("DiningTable")];
        let subtasks = [put_subtask(0, 1), subtask(SkillKind::Pickup, 1), put_subtask(1, 2)];
        let texts = ["Put the spoon in the blue bowl.", "Take the bowl.", "Put it on the table."];
        let ways = ways(&roles, &subtasks, &texts);
        any(&ways, "Put the spoon in a blue bowl and put it on the table.");
        all(&ways, |way| way.contains("spoon") && way.contains("bowl") && way.contains("table"));
    }

    #[test]
    fn a_lamp_is_for_looking() {
        let roles = [role("Book"), role("FloorLamp")];
        let subtasks = [subtask(SkillKind::Pickup, 0), subtask(SkillKind::Toggle, 1)];
        let ways = ways(&roles, &subtasks, &["Take the book from the bed.", "Turn on the tall lamp."]);
        any(&ways, "Examine the book by the light of the tall lamp.");
    }

    #[test]
    fn the_same_passage_has_one_summary() {
        let roles = [role("Book"), role("Desk")];
        let subtasks = [subtask(SkillKind::Pickup, 0), put_subtask(0, 1)];
        let sentences = ["Take the book.".to_string(), "Put it down.".to_string()];
        let passage = Passage { roles: &roles, subtasks: &subtasks, sentences: &sentences };
        let mut texts = Vec::new();
        let mut take = |index, text| {
            texts.push((index, text));
            Ok(())
        };
        Rules.summaries(&[passage, passage], &mut take).unwrap();
        assert_eq!(texts, [0, 1].map(|index| (index, Summary::Sentence(summary(&passage)))));
    }

    prop_compose! {
        /// A skill about some of eight roles, the last two of which are slices.
        fn any_step()(kind in 0..7usize, object in 0..8u8, place in 0..6u8) -> Subtask {
            match SkillKind::ALL[kind] {
                SkillKind::Put => put_subtask(object, place),
                kind @ (SkillKind::Slice | SkillKind::Toggle) => subtask(kind, object % 6),
                kind => subtask(kind, object),
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_span_gives_one_short_sentence_that_names_the_last_target(
            subtasks in proptest::collection::vec(any_step(), 2..=10),
            classes in proptest::collection::vec(1..Class::VOCABULARY, 6),
            text in "[a-z ,.é]{0,60}",
        ) {
            let mut roles: Vec<Role> = classes
                .iter()
                .filter_map(|&class| Class::from_index(class))
                .map(|class| Role { class, slice: false, bound: None, expert: None })
                .collect();
            roles.extend(["Apple", "Bread"].map(slice_role));
            let sentences = vec![text; subtasks.len()];
            let text = summary(&Passage { roles: &roles, subtasks: &subtasks, sentences: &sentences });
            let last = &subtasks[subtasks.len() - 1];
            let class = roles[usize::from(last.receptacle.unwrap_or(last.object))].class;
            prop_assert!(text.split(' ').count() <= LONGEST && text.ends_with('.'), "{}", text);
            prop_assert!(text.matches('.').count() == 1, "{}", text);
            prop_assert!(nouns::names(&text, class), "{} does not name {}", text, class);
        }
    }
}
