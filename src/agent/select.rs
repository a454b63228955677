//! From the two heads to an action. By [`DecisionRule::Mass`] the heads are two factors: an interaction is as likely as its action
//! times its class. Pairs that are impossible now are masked and the rest renormalised, so an action whose only candidates are
//! things that nobody asked for is as unlikely as they are. What the critic thinks better than usual is made likelier, where the
//! agent weighs so. By [`DecisionRule::Paper`] impossible actions are masked, and the class is chosen after the action. The
//! instance is the nearest of its class.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::decision::{ActionDistribution, Decision};
use super::decision_rule::DecisionRule;
use super::value_estimates::AdvantageScale;
use crate::domain::{Action, ActionType, Class};
use crate::house::view::{Candidate, nearest};

/// How an entry is taken from a distribution.
pub(crate) enum Selection<'a> {
    /// The likeliest.
    Greedy,
    /// By chance.
    Sample(&'a mut ChaCha8Rng),
}

/// What the networks say of one situation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Heads<'a> {
    /// Logits of the 12 actions.
    pub(crate) actions: &'a [f32],
    /// Logits of the 82 classes.
    pub(crate) objects: &'a [f32],
    /// What the critic has to say; absent where the policy decides alone.
    pub(crate) advantage_scale: Option<AdvantageScale<'a>>,
    /// How they become an action.
    pub(crate) rule: DecisionRule,
}

impl<'a> Heads<'a> {
    /// A policy's logits alone.
    #[cfg(test)]
    pub(crate) fn of(actions: &'a [f32], objects: &'a [f32]) -> Heads<'a> {
        Heads { actions, objects, advantage_scale: None, rule: DecisionRule::Mass }
    }

    fn factor(&self, kind: ActionType, class: Option<usize>) -> f32 {
        let class = class.and_then(Class::from_index);
        self.advantage_scale.map_or(1.0, |advantage_scale| advantage_scale.factor(kind, class))
    }
}

/// Decides in one situation. Of the navigation actions those in `tried` are masked, unless that would leave none.
pub(crate) fn decide(
    heads: &Heads<'_>,
    candidates: &[Candidate],
    tried: &[ActionType],
    selection: Selection<'_>,
) -> Decision {
    let all_tried = ActionType::ALL.iter().all(|kind| kind.is_interaction() || tried.contains(kind));
    let possible = |kind: ActionType| match kind.is_interaction() {
        true => candidates.iter().any(|c| c.kind == kind),
        false => all_tried || !tried.contains(&kind),
    };
    let open: Vec<usize> = ActionType::ALL.into_iter().filter(|&kind| possible(kind)).map(ActionType::index).collect();
    let shares = weigh(heads, &open, candidates);
    let likeliest = open[argmax(&shares)];
    let greedy = complete(likeliest, heads, candidates, &mut Selection::Greedy);
    let (action, shown) = match selection {
        Selection::Greedy => (greedy, likeliest),
        Selection::Sample(rng) => {
            let drawn = open[draw(&shares, rng)];
            (complete(drawn, heads, candidates, &mut Selection::Sample(rng)), drawn)
        }
    };
    let mut probabilities = [None; ActionType::COUNT];
    for (&index, &share) in open.iter().zip(&shares) {
        probabilities[index] = Some(share);
    }
    let entropy = -shares.iter().filter(|&&p| p > 0.0).map(|p| p * p.ln()).sum::<f32>();
    let distribution = ActionDistribution {
        actions: probabilities,
        objects: ranking(heads.objects, candidates, shown, &open, &shares),
        choices: open.iter().flat_map(|&index| choices(ActionType::ALL[index], heads, candidates)).collect(),
        entropy,
        greedy,
    };
    Decision { action, distribution: Some(distribution), values: None, done: None, own: None }
}

/// The share of each possible action. By [`DecisionRule::Mass`] times that of its candidates among all classes, each choice weighed
/// by its advantage, renormalised.
fn weigh(heads: &Heads<'_>, open: &[usize], candidates: &[Candidate]) -> Vec<f32> {
    let shares = softmax_over(heads.actions, open);
    if heads.rule == DecisionRule::Paper {
        return shares;
    }
    let all: Vec<usize> = (1..heads.objects.len().min(Class::VOCABULARY)).collect();
    let classes = softmax_over(heads.objects, &all);
    let mass = |kind: ActionType| {
        let mut named = classes_of(kind, candidates);
        named.retain(|class| (1..=classes.len()).contains(class));
        named.into_iter().map(|class| classes[class - 1] * heads.factor(kind, Some(class))).sum::<f32>()
    };
    let weight = |(&index, share): (&usize, &f32)| {
        let kind = ActionType::ALL[index];
        share * if kind.is_interaction() { mass(kind) } else { heads.factor(kind, None) }
    };
    let weights: Vec<f32> = open.iter().zip(&shares).map(weight).collect();
    let sum: f32 = weights.iter().sum();
    match sum.is_finite() && sum > 0.0 {
        true => weights.into_iter().map(|weight| weight / sum).collect(),
        false => shares,
    }
}

/// The classes that an action could name now, by index.
fn classes_of(kind: ActionType, candidates: &[Candidate]) -> Vec<usize> {
    let mut classes: Vec<usize> = candidates.iter().filter(|c| c.kind == kind).map(|c| c.class.index()).collect();
    classes.sort_unstable();
    classes.dedup();
    classes
}

/// How many object classes a distribution lists.
const LISTED: usize = 12;

/// The likeliest classes before restriction, each with whether it is a candidate of the interaction at hand: the shown
/// action, or the likeliest possible interaction when that is navigation.
fn ranking(
    objects: &[f32],
    candidates: &[Candidate],
    shown: usize,
    open: &[usize],
    shares: &[f32],
) -> Vec<(Class, f32, bool)> {
    let interaction = |index: usize| ActionType::from_index(index).filter(|kind| kind.is_interaction());
    let likeliest = open.iter().zip(shares).filter(|(index, _)| interaction(**index).is_some());
    let likeliest = likeliest.max_by(|a, b| a.1.total_cmp(b.1)).and_then(|(&index, _)| interaction(index));
    let kind = interaction(shown).or(likeliest);
    let classes: Vec<usize> = (1..objects.len().min(Class::VOCABULARY)).collect();
    let shares = softmax_over(objects, &classes);
    let mut ranked: Vec<(Class, f32, bool)> = classes
        .iter()
        .zip(shares)
        .filter_map(|(&index, share)| {
            let class = Class::from_index(index)?;
            Some((class, share, kind.is_some_and(|kind| nearest(candidates, kind, class).is_some())))
        })
        .collect();
    ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
    ranked.truncate(LISTED);
    ranked
}

/// Adds the target to a kind of action.
fn complete(index: usize, heads: &Heads<'_>, candidates: &[Candidate], selection: &mut Selection<'_>) -> Action {
    let kind = ActionType::ALL[index];
    let choices = choices(kind, heads, candidates);
    if choices.is_empty() {
        return Action::navigate(kind);
    }
    let shares: Vec<f32> = choices.iter().map(|choice| choice.2).collect();
    let chosen = match selection {
        Selection::Greedy => argmax(&shares),
        Selection::Sample(rng) => draw(&shares, rng),
    };
    nearest(candidates, kind, choices[chosen].1).map_or_else(|| Action::navigate(kind), Candidate::action)
}

/// The classes that an interaction could name now, each with its weight among them; none for navigation.
fn choices(kind: ActionType, heads: &Heads<'_>, candidates: &[Candidate]) -> Vec<(ActionType, Class, f32)> {
    let mut classes = classes_of(kind, candidates);
    classes.retain(|&class| class < heads.objects.len());
    let shares = softmax_over(heads.objects, &classes);
    let weighed = |(&class, share): (&usize, f32)| {
        Some((kind, Class::from_index(class)?, share * heads.factor(kind, Some(class))))
    };
    classes.iter().zip(shares).filter_map(weighed).collect()
}

/// The softmax of some entries of `logits`; uniform when they underflow or are not numbers.
fn softmax_over(logits: &[f32], entries: &[usize]) -> Vec<f32> {
    let highest = entries.iter().map(|&i| logits[i]).fold(f32::NEG_INFINITY, f32::max);
    let weights: Vec<f32> = entries.iter().map(|&i| (logits[i] - highest).exp()).collect();
    let sum: f32 = weights.iter().sum();
    if !sum.is_finite() || sum <= 0.0 {
        return vec![1.0 / entries.len().max(1) as f32; entries.len()];
    }
    weights.into_iter().map(|weight| weight / sum).collect()
}

/// The first of the largest.
fn argmax(shares: &[f32]) -> usize {
    shares.iter().enumerate().fold(0, |best, (i, &share)| if share > shares[best] { i } else { best })
}

fn draw(shares: &[f32], rng: &mut ChaCha8Rng) -> usize {
    let mut left = rng.random::<f32>() * shares.iter().sum::<f32>();
    for (i, share) in shares.iter().enumerate() {
        left -= share;
        if left < 0.0 {
            return i;
        }
    }
    argmax(shares)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::agent::value_estimates::{ChoiceValue, Values};
    use crate::domain::Instance;

    fn candidate(kind: ActionType, class: &str, index: u16, distance: f32) -> Candidate {
        Candidate { kind, instance: Instance::Object(index), class: Class::named(class).unwrap(), distance }
    }

    fn objects(favourite: &str) -> Vec<f32> {
        let mut logits = vec![0.0; Class::VOCABULARY];
        logits[Class::named(favourite).unwrap().index()] = 5.0;
        logits
    }

    fn actions(favourite: ActionType) -> Vec<f32> {
        let mut logits = vec![0.0; ActionType::COUNT];
        logits[favourite.index()] = 12.0;
        logits
    }

    #[test]
    fn an_interaction_without_a_candidate_is_never_chosen() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let candidates = [candidate(ActionType::Pickup, "Mug", 0, 500.0)];
        for favourite in ActionType::ALL {
            for _ in 0..40 {
                let decision = decide(
                    &Heads::of(&actions(favourite), &objects("Mug")),
                    &candidates,
                    &[],
                    Selection::Sample(&mut rng),
                );
                let kind = decision.action.kind;
                assert!(!kind.is_interaction() || kind == ActionType::Pickup);
                let thought = decision.distribution.unwrap();
                assert!(thought.actions[ActionType::Slice.index()].is_none());
                let sum: f32 = thought.actions.iter().flatten().sum();
                assert!((sum - 1.0).abs() < 1e-5 && thought.entropy >= 0.0);
            }
        }
    }

    #[test]
    fn the_class_is_restricted_to_the_candidates_and_the_nearest_instance_is_taken() {
        let candidates = [
            candidate(ActionType::Pickup, "Mug", 3, 400.0),
            candidate(ActionType::Pickup, "Mug", 7, 900.0),
            candidate(ActionType::Slice, "Apple", 1, 300.0),
        ];
        let decision =
            decide(&Heads::of(&actions(ActionType::Pickup), &objects("Apple")), &candidates, &[], Selection::Greedy);
        assert_eq!(decision.action, Action::interact(ActionType::Pickup, Instance::Object(3)));
        let (likeliest, _, possible) = decision.distribution.unwrap().objects[0];
        assert_eq!((likeliest.name(), possible), ("Apple", false));
    }

    #[test]
    fn an_action_is_unlikely_when_its_candidates_are() {
        let candidates = [candidate(ActionType::Pickup, "Mug", 3, 400.0)];
        let mut logits = vec![0.0; ActionType::COUNT];
        logits[ActionType::Pickup.index()] = 2.0;
        let choose = |wanted: &str| {
            decide(&Heads::of(&logits, &objects(wanted)), &candidates, &[], Selection::Greedy).action.kind
        };
        assert_eq!(choose("Mug"), ActionType::Pickup);
        assert_eq!(choose("Apple"), ActionType::MoveAhead);
    }

    #[test]
    fn by_the_papers_rule_the_likeliest_possible_action_is_taken_and_then_the_class() {
        let candidates =
            [candidate(ActionType::Pickup, "Mug", 3, 400.0), candidate(ActionType::Pickup, "Bowl", 4, 400.0)];
        let mut logits = vec![0.0; ActionType::COUNT];
        (logits[ActionType::Pickup.index()], logits[ActionType::Slice.index()]) = (2.0, 9.0);
        // Nobody asked for a mug or a bowl, the bowl is likelier than the mug, and nothing can be cut.
        let mut wanted = objects("Apple");
        wanted[Class::named("Bowl").unwrap().index()] = 1.0;
        let choose = |rule| {
            let heads = Heads { rule, ..Heads::of(&logits, &wanted) };
            decide(&heads, &candidates, &[], Selection::Greedy)
        };
        let taken = choose(DecisionRule::Paper);
        assert_eq!(taken.action, Action::interact(ActionType::Pickup, Instance::Object(4)));
        let share = taken.distribution.unwrap().actions[ActionType::Pickup.index()].unwrap();
        assert!((share - 2f32.exp() / (2f32.exp() + 5.0)).abs() < 1e-5, "{share}");
        assert_eq!(choose(DecisionRule::Mass).action.kind, ActionType::MoveAhead);
    }

    #[test]
    fn a_choice_is_as_many_times_as_likely_as_its_advantage_says() {
        let class = |name| Class::named(name).unwrap();
        let candidates =
            [candidate(ActionType::Pickup, "Mug", 3, 400.0), candidate(ActionType::Pickup, "Apple", 4, 400.0)];
        let value = |kind, class, q| ChoiceValue { kind, class, q };
        let values = Values {
            state: 0.5,
            choices: vec![
                value(ActionType::MoveAhead, None, 0.5 + 2f32.ln()),
                value(ActionType::Pickup, Some(class("Apple")), 0.5 + 3f32.ln()),
                value(ActionType::Pickup, Some(class("Mug")), 0.5),
            ],
        };
        let (logits, classes) = ([0.0; ActionType::COUNT], [0.0; Class::VOCABULARY]);
        let alone = Heads::of(&logits, &classes);
        let weighed = Heads { advantage_scale: Some(AdvantageScale { values: &values, weight: 1.0 }), ..alone };
        let [before, after] =
            [alone, weighed].map(|heads| decide(&heads, &candidates, &[], Selection::Greedy).distribution);
        let (before, after) = (before.unwrap(), after.unwrap());
        let times = |kind: ActionType| {
            let odds =
                |thought: &ActionDistribution| thought.actions[kind.index()].unwrap() / thought.actions[1].unwrap();
            odds(&after) / odds(&before)
        };
        assert!(
            (times(ActionType::MoveAhead) - 2.0).abs() < 1e-4,
            "twice as likely against a turn of no known advantage"
        );
        assert!(
            (times(ActionType::Pickup) - 2.0).abs() < 1e-4,
            "three times the apple and once the mug, as likely before"
        );
        let apple = after.joint(&candidates).into_iter().find(|choice| choice.1 == Some(class("Apple"))).unwrap().2;
        let share = apple / after.actions[ActionType::Pickup.index()].unwrap();
        assert!((share - 0.75).abs() < 1e-4, "three times the mug, in what is shown, too: {share}");
        let pick = |heads: &Heads<'_>| complete(ActionType::Pickup.index(), heads, &candidates, &mut Selection::Greedy);
        let taken = |index| Action::interact(ActionType::Pickup, Instance::Object(index));
        assert_eq!((pick(&alone), pick(&weighed)), (taken(4), taken(4)));
        let mug = objects("Mug");
        let weight = |weight| Heads {
            objects: &mug,
            advantage_scale: Some(AdvantageScale { values: &values, weight }),
            ..alone
        };
        assert_eq!(
            [1.0, 9.0].map(|times| pick(&weight(times))),
            [taken(3), taken(4)],
            "the policy's own wish counts too"
        );
    }

    #[test]
    fn what_led_nowhere_is_not_tried_again() {
        let choose = |tried: &[ActionType]| {
            decide(&Heads::of(&actions(ActionType::MoveAhead), &objects("Mug")), &[], tried, Selection::Greedy)
                .action
                .kind
        };
        assert_eq!(choose(&[]), ActionType::MoveAhead);
        assert_eq!(choose(&[ActionType::MoveAhead]), ActionType::RotateLeft);
        assert_eq!(choose(&ActionType::ALL), ActionType::MoveAhead);
    }

    #[test]
    fn sampling_follows_the_probabilities_and_greedy_does_not_vary() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut logits = vec![f32::NEG_INFINITY; ActionType::COUNT];
        (logits[0], logits[1]) = (0.0, 3f32.ln());
        let mut turns = 0;
        for _ in 0..2000 {
            let decision = decide(&Heads::of(&logits, &objects("Mug")), &[], &[], Selection::Sample(&mut rng));
            turns += usize::from(decision.action.kind == ActionType::RotateLeft);
            assert_eq!(decision.distribution.unwrap().greedy.kind, ActionType::RotateLeft);
        }
        assert!((1400..1600).contains(&turns), "{turns}");
    }

    #[test]
    fn all_probability_on_masked_actions_leaves_a_uniform_choice() {
        let mut logits = vec![f32::NEG_INFINITY; ActionType::COUNT];
        logits[ActionType::Slice.index()] = 0.0;
        let thought = decide(&Heads::of(&logits, &objects("Mug")), &[], &[], Selection::Greedy).distribution.unwrap();
        assert_eq!(thought.actions[0], Some(0.2));
    }
}
