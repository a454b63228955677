use tch::{Device, Kind};

use super::*;
use crate::algo::adamw::AdamWConfig;
use crate::algo::batch::ChainedPairs;
use crate::algo::chain::{BatchNormStatistics, Bootstrap, PairSource, PolicyExtraction};
use crate::algo::iql::Iql;
use crate::algo::schedule::Schedule;
use crate::nets::critic::{Critic, CriticInputs, CriticSpec};
use crate::nets::policy::PolicySpec;
use crate::nets::shared_rows::SharedRows;
use crate::nets::visual::SIDE;

const STATES: i64 = 3;
const TEXTS: i64 = 3;

struct Nets {
    policy: PolicyNet,
    store: nn::VarStore,
    online: (Critic, nn::VarStore),
    target: (Critic, nn::VarStore),
}

/// Tiny networks over states and texts that are told apart at a glance.
fn nets() -> Nets {
    tch::manual_seed(7);
    let [policy_store, online, target] = [0; 3].map(|_| nn::VarStore::new(Device::Cpu));
    let policy = PolicySpec {
        history: 1,
        embedding: TEXTS,
        channels: [6; 4],
        downsample: false,
        hidden: vec![24],
        dropout: 0.0,
        goal_channels: None,
        attention: None,
    };
    let critic = CriticSpec {
        channels: [6; 4],
        downsample: false,
        hidden: vec![24],
        dropout: 0.0,
        action_embedding: 4,
        object_embedding: 2,
        shared_trunk: true,
    };
    let inputs = CriticInputs { channels: STATES, conditioning: TEXTS, goal: None };
    Nets {
        policy: PolicyNet::new(&policy_store.root(), &policy, STATES),
        store: policy_store,
        online: (Critic::new(&online.root(), &critic, inputs), online),
        target: (Critic::new(&target.root(), &critic, inputs), target),
    }
}

const IQL: Iql = Iql {
    discount: 0.9,
    expectile: 0.7,
    temperature: 3.0,
    weight_cap: 100.0,
    target_update_rate: 0.05,
    cloning_fraction: 0.0,
    advantage_scale: 0.0,
};

const CHAINING: Chaining = Chaining {
    pairs: PairSource::Pool(1),
    ranked: false,
    feasible_share: 0.0,
    weigh_by_value: false,
    batch_size: 4,
    bootstrap: Bootstrap::NextValue,
    policy_extraction: PolicyExtraction::Both,
    batch_norm_statistics: BatchNormStatistics::WholeBatch,
    loss_weight: 1.0,
    chain_weight: 0.5,
    aggregate_weight: 0.5,
};

fn optimisation(steps: u64) -> Optimisation {
    Optimisation {
        steps,
        batch_size: 1,
        schedule: Schedule { learning_rate: 8e-3, warmup_steps: 10, final_fraction: 0.01 },
        adamw: AdamWConfig { beta1: 0.9, beta2: 0.999, epsilon: 1e-8, weight_decay: 0.0 },
    }
}

fn update<'a>(nets: &'a Nets, steps: u64, iql: Iql, chaining: Option<Chaining>) -> Update<'a> {
    let critic = CriticLearner::new(
        (&nets.online.0, &nets.online.1),
        (&nets.target.0, &nets.target.1),
        optimisation(steps),
        iql,
        1,
    );
    Update::new((&nets.policy, &nets.store), Some(critic), chaining, optimisation(steps), 1)
}

/// A state as a picture: one channel is lit.
fn look(states: &[i64]) -> Tensor {
    Tensor::from_slice(states)
        .one_hot(STATES)
        .to_kind(Kind::Float)
        .reshape([-1, STATES, 1, 1])
        .expand([-1, STATES, SIDE, SIDE], false)
        .contiguous()
}

fn say(texts: &[i64]) -> Tensor {
    Tensor::from_slice(texts).one_hot(TEXTS).to_kind(Kind::Float)
}

/// Transitions (state, text, action, next state, terminal).
fn transitions(rows: &[(i64, i64, i64, i64, f32)]) -> Transitions {
    let column = |of: fn(&(i64, i64, i64, i64, f32)) -> i64| rows.iter().map(of).collect::<Vec<i64>>();
    let actions = column(|row| row.2);
    Transitions {
        observation: look(&column(|row| row.0)),
        next: Some(look(&column(|row| row.3))),
        rows: None,
        conditioning: say(&column(|row| row.1)).into(),
        objects: Tensor::from_slice(&vec![0i64; rows.len()]),
        object_target: Tensor::from_slice(&vec![0i64; rows.len()]),
        actions: Tensor::from_slice(&actions),
        reward: Tensor::from_slice(&rows.iter().map(|row| row.4).collect::<Vec<f32>>()),
        terminal: Tensor::from_slice(&rows.iter().map(|row| row.4).collect::<Vec<f32>>()),
        executed: Tensor::ones([rows.len() as i64], (Kind::Float, Device::Cpu)),
    }
}

/// Two skills of one step, A from 0 to 1 and B from 1 to 2, by themselves and chained; "A. B." is text 2.
fn chained_skills() -> Batch {
    let (a, b) = ((0, 0, 0, 1, 1.0), (1, 1, 0, 2, 1.0));
    let many = |row| transitions(&[row; 4]);
    let base: Vec<_> = [a, b].into_iter().cycle().take(8).collect();
    let first = Transitions { conditioning: say(&[1; 4]).into(), ..many(a) };
    let cut = first.terminal.shallow_clone();
    let joint = Some((say(&[2; 4]).into(), Transitions { conditioning: say(&[2; 4]).into(), ..many(b) }));
    Batch { base: transitions(&base), pairs: Some(ChainedPairs { of_base: false, first, cut, joint }) }
}

/// The chain: action 0 leads from state 0 to state 1 and from there to the end, action 1 back to state 0.
const CHAIN_OF_TWO: [(i64, i64, i64, i64, f32); 4] =
    [(0, 0, 0, 1, 0.0), (0, 0, 1, 0, 0.0), (1, 0, 0, 2, 1.0), (1, 0, 1, 0, 0.0)];

/// Its fixed point: Q by state and action, V by state, the probability of action 0 by state.
fn solution() -> ([[f64; 2]; 2], [f64; 2], [f64; 2]) {
    let mut v = [0.0f64; 2];
    let mut q = [[0.0f64; 2]; 2];
    // Of two equally frequent numbers a > b the expectile is τ a + (1 − τ) b.
    let expectile = |q: [f64; 2]| 0.7 * q[0].max(q[1]) + 0.3 * q[0].min(q[1]);
    for _ in 0..1000 {
        q = [[0.9 * v[1], 0.9 * v[0]], [1.0, 0.9 * v[0]]];
        v = q.map(expectile);
    }
    let weight = |state: usize, action: usize| (3.0 * (q[state][action] - v[state])).exp();
    (q, v, [0, 1].map(|state| weight(state, 0) / (weight(state, 0) + weight(state, 1))))
}

#[test]
fn small_networks_learn_the_right_answers_of_a_chain_of_two_states_to_a_hundredth() {
    let _chance = crate::nets::testing::chance();
    let nets = nets();
    // Many rows: over few, the running variance of a batch norm is larger than the batch's own by n / (n - 1).
    let rows: Vec<_> = CHAIN_OF_TWO.into_iter().cycle().take(64).collect();
    let batch = Batch { base: transitions(&rows), pairs: None };
    let mut update = update(&nets, 800, IQL, None);
    while !update.is_done() {
        update.update(&batch, false).unwrap();
    }
    let four = transitions(&CHAIN_OF_TWO);
    let (q, v, policy) = solution();
    let seen = SharedRows::own(&four.observation);
    let found = nets.target.0.min_q(&seen, &four.conditioning, &four.actions, &four.objects);
    let values = nets.online.0.value(&seen, &four.conditioning);
    let logits = tch::no_grad(|| nets.policy.forward(&four.observation, &four.conditioning.distinct, false));
    let shares = logits.actions.softmax(-1, Kind::Double);
    for (row, (state, action)) in [(0, 0), (0, 1), (1, 0), (1, 1)].into_iter().enumerate() {
        let row = row as i64;
        let check = |name: &str, found: f64, right: f64| {
            assert!((found - right).abs() < 0.01, "{name} of {state}, {action}: {found}, not {right}");
        };
        check("Q", found.double_value(&[row]), q[state][action]);
        check("V", values.double_value(&[row]), v[state]);
        check("policy", shares.double_value(&[row, 0]), policy[state]);
    }
}

#[test]
fn chaining_carries_the_value_of_the_second_skill_to_the_first() {
    let _chance = crate::nets::testing::chance();
    let nets = nets();
    let mut update = update(&nets, 300, IQL, Some(CHAINING));
    let mut numbers = BTreeMap::new();
    while !update.is_done() {
        numbers = update.update(&chained_skills(), true).unwrap();
    }
    let values = nets.online.0.value(&SharedRows::own(&look(&[0, 0, 1])), &say(&[1, 2, 2]).into());
    for i in 0..3 {
        // The joint costs nothing, and each skill is one step: all are worth 1.
        assert!((values.double_value(&[i]) - 1.0).abs() < 0.05, "{values}");
    }
    for name in
        ["chain_q_loss", "aggregate_a_value_loss", "aggregate_b_action_loss", "weight_max", "v_mean", "action_accuracy"]
    {
        assert!(numbers.contains_key(name), "{name} is not among {numbers:?}");
    }
}

#[test]
fn while_the_critic_warms_up_the_policy_clones_the_demonstrated_skills_alone() {
    let _chance = crate::nets::testing::chance();
    let warming = || Iql { cloning_fraction: 0.6, ..IQL };
    let one = |critic: bool| {
        let nets = nets();
        let mut update = match critic {
            true => update(&nets, 8, warming(), None),
            false => Update::new((&nets.policy, &nets.store), None, None, optimisation(8), 1),
        };
        let batch = Batch { base: transitions(&CHAIN_OF_TWO), pairs: None };
        (0..8).map(|_| update.update(&batch, false).unwrap()["action_loss"]).collect::<Vec<f64>>()
    };
    let (with, without) = (one(true), one(false));
    assert_eq!(with[..5], without[..5]);
    assert!(with[5] != without[5], "{with:?} {without:?}");
    let nets = nets();
    let mut update = update(&nets, 8, warming(), Some(CHAINING));
    let mut clones = || update.update(&chained_skills(), false).unwrap().contains_key("chain_action_loss");
    assert_eq!([0; 8].map(|_| clones()), [false, false, false, false, false, true, true, true]);
}

#[test]
fn of_equation_4_only_the_critic_learns_where_the_policy_extracts_the_joint_skills_alone() {
    let _chance = crate::nets::testing::chance();
    let losses = |chaining: Chaining| {
        let nets = nets();
        update(&nets, 1, IQL, Some(chaining)).update(&chained_skills(), false).unwrap()
    };
    let (both, joint) =
        (losses(CHAINING), losses(Chaining { policy_extraction: PolicyExtraction::Aggregate, ..CHAINING }));
    assert!(both.contains_key("chain_action_loss") && !joint.contains_key("chain_action_loss"), "{joint:?}");
    for name in ["chain_q_loss", "chain_value_loss", "aggregate_a_action_loss", "aggregate_b_action_loss"] {
        assert!(joint.contains_key(name), "{name} is not among {joint:?}");
    }
}

#[test]
fn a_chained_item_weighs_what_its_critic_thinks_of_the_pair() {
    let _chance = crate::nets::testing::chance();
    let numbers = |weigh_by_value: bool| {
        let nets = nets();
        let chaining = Chaining { weigh_by_value, ..CHAINING };
        update(&nets, 1, IQL, Some(chaining)).update(&chained_skills(), true).unwrap()
    };
    let (plain, weighed) = (numbers(false), numbers(true));
    for name in ["chain_weight_mean", "aggregate_a_weight_mean", "aggregate_b_weight_mean"] {
        let factor = weighed[name] / plain[name];
        assert!((0.0..0.9).contains(&factor), "{name}: a fresh critic thinks little of it: {factor}");
    }
    assert_eq!(plain["weight_mean"], weighed["weight_mean"]);
    assert_eq!(plain["chain_q_loss"], weighed["chain_q_loss"], "the critic learns as before");
}

#[test]
fn chained_items_leave_the_statistics_of_demonstrated_ones_alone_where_the_preset_says_so() {
    let _chance = crate::nets::testing::chance();
    let means = |chaining: Option<Chaining>| {
        let nets = nets();
        update(&nets, 1, IQL, chaining).update(&chained_skills(), false).unwrap();
        nets.store.variables().into_iter().filter(|(name, _)| name.ends_with("running_mean")).collect::<Tensors>()
    };
    let apart = Chaining { batch_norm_statistics: BatchNormStatistics::Demonstrations, ..CHAINING };
    assert_eq!(means(Some(apart)), means(None));
    assert!(means(Some(CHAINING)) != means(None));
}

#[test]
fn the_policy_learns_what_would_have_been_right_and_the_critic_does_not() {
    let _chance = crate::nets::testing::chance();
    // The last transition ends the skill, or does not: only a critic can tell.
    let losses = |executed: f32, terminal: f32| {
        let nets = nets();
        let mut rows = CHAIN_OF_TWO;
        rows[3].4 = terminal;
        let base = Transitions { executed: Tensor::from_slice(&[1.0, 1.0, 1.0, executed]), ..transitions(&rows) };
        update(&nets, 1, IQL, None).update(&Batch { base, pairs: None }, false).unwrap()
    };
    let (loss, other) = (losses(0.0, 0.0), losses(0.0, 1.0));
    assert_eq!(loss, other);
    assert!(losses(1.0, 0.0)["q_loss"] != losses(1.0, 1.0)["q_loss"]);
    assert_eq!(loss["action_loss"], losses(1.0, 0.0)["action_loss"]);
}

#[test]
fn a_reward_need_not_end_anything_and_an_end_need_not_be_rewarded() {
    let _chance = crate::nets::testing::chance();
    let nets = nets();
    // Half a reward on the way to state 1 and half at the end; the other action ends it for nothing.
    let mut base = transitions(
        &[(0, 0, 0, 1, 0.0), (0, 0, 1, 2, 1.0), (1, 0, 0, 2, 1.0), (1, 0, 1, 2, 1.0)]
            .into_iter()
            .cycle()
            .take(64)
            .collect::<Vec<_>>(),
    );
    base.reward = Tensor::from_slice(&[0.5f32, 0.0, 0.5, 0.0]).repeat([16]);
    let batch = Batch { base, pairs: None };
    let mut update = update(&nets, 600, IQL, None);
    while !update.is_done() {
        update.update(&batch, false).unwrap();
    }
    let at = |state, action: i64| {
        let one = Tensor::from_slice(&[action]);
        nets.target
            .0
            .min_q(&SharedRows::own(&look(&[state])), &say(&[0]).into(), &one, &Tensor::from_slice(&[0i64]))
            .double_value(&[0])
    };
    let v = nets.online.0.value(&SharedRows::own(&look(&[1])), &say(&[0]).into()).double_value(&[0]);
    assert!((v - 0.35).abs() < 0.02, "the 0.7-expectile of 0.5 and 0: {v}");
    for (state, action, right) in [(0, 0, 0.5 + 0.9 * 0.35), (0, 1, 0.0), (1, 0, 0.5), (1, 1, 0.0)] {
        assert!((at(state, action) - right).abs() < 0.03, "Q of {state}, {action}: {}", at(state, action));
    }
}

#[test]
fn the_object_head_learns_its_targets_and_not_what_the_steps_interact_with() {
    let _chance = crate::nets::testing::chance();
    let loss = |objects: i64, target: i64| {
        let of_all = |class| Tensor::full([4], class, (Kind::Int64, Device::Cpu));
        let base =
            Transitions { objects: of_all(objects), object_target: of_all(target), ..transitions(&CHAIN_OF_TWO) };
        update(&nets(), 1, IQL, None).update(&Batch { base, pairs: None }, false).unwrap()["object_loss"]
    };
    assert_eq!((loss(0, 0), loss(1, 0)), (0.0, 0.0));
    assert!(loss(0, 1) > 0.0);
}

#[test]
fn a_batch_of_two_like_halves_in_two_parts_is_the_same_step() {
    let _chance = crate::nets::testing::chance();
    let step = |parts: &[Batch]| {
        let nets = nets();
        let mut update = update(&nets, 10, IQL, Some(CHAINING));
        let numbers = update.update_in_parts(parts, true).unwrap();
        let weights: Tensors = update.state().into_iter().map(|(name, tensor)| (name, tensor.copy())).collect();
        (numbers, weights)
    };
    let twice = |of: &Transitions| {
        let rows: Vec<i64> = (0..of.actions.size()[0]).chain(0..of.actions.size()[0]).collect();
        let rows = Tensor::from_slice(&rows);
        of.picked(&rows, of.conditioning.picked(&rows))
    };
    let half = chained_skills();
    let pairs = half.pairs.as_ref().unwrap();
    let joint = pairs.joint.as_ref().map(|(joint, second)| (SharedRows::joined(&[joint, joint]).0, twice(second)));
    let cut = Tensor::cat(&[&pairs.cut, &pairs.cut], 0);
    let whole = Batch {
        base: twice(&half.base),
        pairs: Some(ChainedPairs { of_base: false, first: twice(&pairs.first), cut, joint }),
    };
    let ((once, together), (parts, apart)) = (step(&[whole]), step(&[chained_skills(), chained_skills()]));
    // What is estimated of the next state sees the first part's running statistics in the second.
    for (name, number) in once.iter().filter(|(name, _)| !name.contains("q_loss")) {
        assert!((number - parts[name]).abs() < 1e-5, "{name}: {number} and {}", parts[name]);
    }
    // Its first moments are a tenth of the gradients.
    for (name, tensor) in together.iter().filter(|(name, _)| name.starts_with("policy.mean.")) {
        let difference = (tensor - &apart[name]).abs().max().double_value(&[]);
        assert!(difference < 1e-6, "{name}: {difference}");
    }
}

#[test]
fn a_loss_that_is_no_number_is_named_and_changes_no_weight() {
    let _chance = crate::nets::testing::chance();
    let nets = nets();
    let mut update = update(&nets, 10, IQL, None);
    let mut base = transitions(&CHAIN_OF_TWO);
    update.update(&Batch { base: transitions(&CHAIN_OF_TWO), pairs: None }, false).unwrap();
    let before: Tensors = update.state().into_iter().map(|(name, tensor)| (name, tensor.copy())).collect();
    base.terminal *= f64::NAN;
    let error = update.update(&Batch { base, pairs: None }, false).unwrap_err();
    assert_eq!((error.step, error.term.as_str()), (2, "q_loss"));
    let statistics = |name: &str| name.ends_with("running_mean") || name.ends_with("running_var");
    assert!(update.state().iter().all(|(name, tensor)| statistics(name) || *tensor == before[name]));
}
