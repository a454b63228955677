//! One update, in the paper's order: relabel, judge, one policy step, one critic step, the target follows.

use std::collections::BTreeMap;
use std::path::Path;

use tch::{Device, Kind, Tensor, nn};

use super::bc;
use super::chain::{self, Chaining, Ends, Worth};
use super::iql::{self, Iql, Tracking};
use super::learner::{Learner, Optimisation};
use crate::nets::critic::{Critic, Judgement};
use crate::nets::policy::{Logits, PolicyNet};
use crate::nets::visual::SIDE;
use crate::nets::weights::{self, Tensors};

/// Transitions (s, a, s′) with what the agent was told, n of each.
#[derive(Debug)]
pub struct Transitions {
    /// s: [n, channels, 7, 7] or [n, frames, channels, 7, 7], floats of any width.
    pub observation: Tensor,
    /// s′; absent where nothing judges it.
    pub next: Option<Tensor>,
    /// z, as the networks take it.
    pub told: Tensor,
    /// Actions, by index [n].
    pub actions: Tensor,
    /// Object classes, by index [n]; 0 for navigation.
    pub objects: Tensor,
    /// 1 on the transition into the span's last state, [n] floats.
    pub terminal: Tensor,
}

/// Pairs of transitions to chain, m of them.
#[derive(Debug)]
pub struct Pairs {
    /// A's transitions, told z_B.
    pub first: Transitions,
    /// 1 where equation 4 ends A, [m].
    pub cut: Tensor,
    /// "A. B." as A is told it, and B's transitions told the same; absent where equation 5 is off.
    pub joint: Option<(Tensor, Transitions)>,
}

/// What one update learns from.
#[derive(Debug)]
pub struct Batch {
    /// Demonstrated skills as they were described.
    pub base: Transitions,
    /// Chained pairs.
    pub pairs: Option<Pairs>,
}

/// The demonstrated skills themselves.
const BASE: &str = "";
/// Equation 4: A told z_B.
const CHAIN: &str = "chain";
/// Equation 5: A told "A. B.".
const LEAD: &str = "lead";
/// Equation 5: B told "A. B.".
const FOLLOW: &str = "follow";

/// A part to be: its name and weight, the transitions, what they are told, and where they end.
type Row<'a> = (&'static str, f64, &'a Transitions, &'a Tensor, &'a Tensor);

/// Items that are averaged by themselves.
struct Part {
    name: &'static str,
    start: i64,
    len: i64,
    weight: f64,
}

impl Part {
    /// This part of a tensor over all items.
    fn of(&self, all: &Tensor) -> Tensor {
        all.narrow(0, self.start, self.len)
    }

    /// What a number of this part is called.
    fn label(&self, name: &str) -> String {
        if self.name == BASE { name.to_string() } else { format!("{}_{name}", self.name) }
    }
}

/// The losses by name, looked at before any weight is changed.
#[derive(Default)]
struct Terms {
    names: Vec<String>,
    tensors: Vec<Tensor>,
}

impl Terms {
    fn add(&mut self, name: String, tensor: &Tensor) {
        self.names.push(name);
        self.tensors.push(tensor.detach());
    }

    /// All of them, fetched at once.
    fn numbers(self, step: u64) -> Result<BTreeMap<String, f64>, NotFinite> {
        let stacked = Tensor::stack(&self.tensors, 0).to_kind(Kind::Double).to_device(Device::Cpu);
        let values = (0..self.tensors.len() as i64).map(|i| stacked.double_value(&[i]));
        let found: BTreeMap<String, f64> = self.names.into_iter().zip(values).collect();
        match found.iter().find(|(_, value)| !value.is_finite()) {
            Some((term, &value)) => Err(NotFinite { step, term: term.clone(), value }),
            None => Ok(found),
        }
    }
}

/// The critic under training.
pub struct CriticLearner<'a> {
    online: &'a Critic,
    target: &'a Critic,
    target_store: &'a nn::VarStore,
    learner: Learner<'a>,
    tracking: Tracking,
    iql: Iql,
}

impl<'a> CriticLearner<'a> {
    /// A critic with its optimiser, and the target that follows it; both at step 0.
    pub fn new(
        (online, store): (&'a Critic, &'a nn::VarStore),
        (target, target_store): (&'a Critic, &'a nn::VarStore),
        optimisation: Optimisation,
        iql: Iql,
        seed: u64,
    ) -> CriticLearner<'a> {
        let mut tracking = Tracking::new(store, target_store);
        tracking.follow(1.0);
        CriticLearner { online, target, target_store, learner: Learner::new(store, optimisation, seed), tracking, iql }
    }
}

/// A policy, and for IQL its critic, under training.
pub struct Update<'a> {
    policy: &'a PolicyNet,
    learner: Learner<'a>,
    critic: Option<CriticLearner<'a>>,
    chaining: Option<Chaining>,
}

/// A loss that is not a number; no weight was changed by it.
#[derive(Debug, thiserror::Error)]
#[error("step {step}: {term} is {value}; nothing was changed by this step, and the last saved state is kept")]
pub struct NotFinite {
    /// The step that failed, from 1.
    pub step: u64,
    /// The loss.
    pub term: String,
    /// What it came to.
    pub value: f64,
}

impl<'a> Update<'a> {
    /// Behaviour cloning, or with a critic IQL, or with `chaining` as well SPRINT.
    pub fn new(
        (policy, store): (&'a PolicyNet, &'a nn::VarStore),
        critic: Option<CriticLearner<'a>>,
        chaining: Option<Chaining>,
        optimisation: Optimisation,
        seed: u64,
    ) -> Update<'a> {
        Update { policy, learner: Learner::new(store, optimisation, seed), critic, chaining }
    }

    /// Steps taken.
    pub fn step(&self) -> u64 {
        self.learner.step()
    }

    /// Whether all steps are taken.
    pub fn is_done(&self) -> bool {
        self.learner.is_done()
    }

    /// Takes one step. Returns the losses by name; with `report` also weights, values and accuracies.
    ///
    /// # Errors
    /// [`NotFinite`].
    pub fn update(&mut self, batch: &Batch, report: bool) -> Result<BTreeMap<String, f64>, NotFinite> {
        self.learner.begin_step();
        let (all, parts) = self.relabel(batch);
        let mut terms = Terms::default();
        let judged = self.critic.as_ref().map(|critic| critic.judge(&all, &parts, self.chaining.as_ref()));
        let logits = self.policy.forward(&all.observation, &all.told, true);
        let policy_loss = policy_loss(&logits, &all, &parts, judged.as_ref().map(|judged| &judged.weights), &mut terms);
        let critic_loss = judged.as_ref().map(|judged| judged.loss(&parts, &mut terms));
        let mut numbers = terms.numbers(self.learner.step() + 1)?;
        self.learner.minimise(&policy_loss);
        if let (Some(critic), Some(loss)) = (&mut self.critic, critic_loss) {
            critic.learner.minimise(&loss);
            critic.tracking.follow(critic.iql.target_rate);
        }
        if report {
            let base = |all: &Tensor| all.narrow(0, 0, batch.base.actions.size()[0]);
            let shown = Logits { actions: base(&logits.actions), objects: base(&logits.objects) };
            let (actions, objects) = bc::accuracy(&shown, &batch.base.actions, &batch.base.objects);
            numbers.extend([("action_accuracy".into(), actions), ("object_accuracy".into(), objects)]);
            if let Some(judged) = &judged {
                judged.describe(&parts, &mut numbers);
            }
        }
        Ok(numbers)
    }

    /// The batch and its relabelled copies, one after the other.
    fn relabel(&self, batch: &Batch) -> (Transitions, Vec<Part>) {
        let base = &batch.base;
        let mut rows: Vec<Row<'_>> = vec![(BASE, 1.0, base, &base.told, &base.terminal)];
        if let (Some(pairs), Some(chaining)) = (&batch.pairs, &self.chaining) {
            let (first, share) = (&pairs.first, chaining.weight / (chaining.chain + chaining.aggregate));
            rows.push((CHAIN, share * chaining.chain, first, &first.told, &pairs.cut));
            if let Some((told, second)) = &pairs.joint {
                let share = share * chaining.aggregate / 2.0;
                rows.push((LEAD, share, first, told, &first.terminal));
                rows.push((FOLLOW, share, second, &second.told, &second.terminal));
            }
        }
        let cat = |of: &dyn Fn(&Row<'_>) -> Tensor| match &rows[..] {
            [row] => of(row),
            rows => Tensor::cat(&rows.iter().map(of).collect::<Vec<_>>(), 0),
        };
        let next = |row: &Row<'_>| row.2.next.as_ref().unwrap_or(&row.2.observation).shallow_clone();
        let all = Transitions {
            observation: seen(&cat(&|row| row.2.observation.shallow_clone())),
            next: base.next.is_some().then(|| seen(&cat(&next))),
            told: cat(&|row| row.3.shallow_clone()),
            actions: cat(&|row| row.2.actions.shallow_clone()),
            objects: cat(&|row| row.2.objects.shallow_clone()),
            terminal: cat(&|row| row.4.shallow_clone()),
        };
        let mut start = 0;
        let part = |&(name, weight, _, _, terminal): &Row<'_>| {
            let len = terminal.size()[0];
            start += len;
            Part { name, start: start - len, len, weight }
        };
        let parts = rows.iter().map(part).collect();
        (all, parts)
    }

    /// Every tensor of the training's state, by name.
    pub fn state(&self) -> Tensors {
        let mut tensors = prefixed("policy.", self.learner.state());
        if let Some(critic) = &self.critic {
            tensors.extend(prefixed("critic.", critic.learner.state()));
            tensors.extend(prefixed("target.", critic.target_store.variables().into_iter().collect()));
        }
        tensors
    }

    /// Takes up a state that was saved after `step` steps.
    ///
    /// # Errors
    /// When a tensor is missing, too many, or of another form; each is named with `path`, and nothing is changed.
    pub fn restore(&mut self, path: &Path, step: u64, tensors: &Tensors) -> anyhow::Result<()> {
        let own = self.state();
        weights::check(path, tensors, &own.iter().map(|(name, t)| (name.clone(), weights::Form::of(t))).collect())?;
        self.learner.restore(step, &part_of(tensors, "policy."))?;
        if let Some(critic) = &mut self.critic {
            critic.learner.restore(step, &part_of(tensors, "critic."))?;
            weights::copy(tensors, "target.", critic.target_store)?;
        }
        Ok(())
    }
}

/// What the critic makes of all items.
struct Judged {
    judgement: Judgement,
    /// min Q̄.
    target_q: Tensor,
    /// r + (1 − d) γ V(s′).
    bootstrap: Tensor,
    weights: Tensor,
    expectile: f64,
}

impl CriticLearner<'_> {
    fn judge(&self, all: &Transitions, parts: &[Part], chaining: Option<&Chaining>) -> Judged {
        let next = all.next.as_ref().unwrap_or(&all.observation);
        let target_q = self.target.least_q(&all.observation, &all.told, &all.actions, &all.objects);
        let next_value = self.online.value(next, &all.told);
        let judgement = self.online.judge(&all.observation, &all.told, &all.actions, &all.objects);
        let worth = parts.iter().find(|part| part.name == CHAIN).zip(chaining).map(|(part, chaining)| {
            let worth = match chaining.worth {
                Worth::NextValue => part.of(&next_value),
                Worth::PresentValue => part.of(&judgement.baseline),
                Worth::TargetQ => part.of(&target_q),
            };
            chain::as_reward(&worth, chaining.clip)
        });
        let rewards: Vec<Tensor> = parts
            .iter()
            .map(|part| match (part.name, &worth) {
                (CHAIN | LEAD, Some(worth)) => Ends::chained(&part.of(&all.terminal), worth).reward,
                _ => Ends::of_skill(&part.of(&all.terminal)).reward,
            })
            .collect();
        let bootstrap = iql::q_target(&Tensor::cat(&rewards, 0), &all.terminal, &next_value, self.iql.discount);
        let weights = iql::advantage_weights(&target_q, &judgement.baseline, self.iql.temperature, self.iql.weight_cap);
        Judged { judgement, target_q, bootstrap, weights, expectile: self.iql.expectile }
    }
}

impl Judged {
    fn loss(&self, parts: &[Part], terms: &mut Terms) -> Tensor {
        let value = iql::value_loss(&self.judgement.value, &self.target_q, self.expectile);
        let [one, other] = [0, 1].map(|k| iql::q_loss(&self.judgement.q[k], &self.bootstrap));
        let q = one + other;
        let part_loss = |part: &Part| {
            let (value, q) = (part.of(&value).mean(Kind::Float), part.of(&q).mean(Kind::Float));
            terms.add(part.label("value_loss"), &value);
            terms.add(part.label("q_loss"), &q);
            (value + q) * part.weight
        };
        parts.iter().map(part_loss).sum()
    }

    /// Weights and values, those of chaining by their parts' names.
    fn describe(&self, parts: &[Part], numbers: &mut BTreeMap<String, f64>) {
        let value = &self.judgement.baseline;
        for part in parts {
            let found = [
                ("weight_mean", part.of(&self.weights).mean(Kind::Double)),
                ("weight_max", part.of(&self.weights).max().to_kind(Kind::Double)),
                ("q_mean", part.of(&self.target_q).mean(Kind::Double)),
                ("v_mean", part.of(value).mean(Kind::Double)),
            ];
            numbers.extend(found.map(|(name, tensor)| (part.label(name), tensor.double_value(&[]))));
        }
    }
}

/// Weighted policy extraction over both heads: the action's surprise is averaged over a part's items, the object's over its
/// interactions. Without weights, behaviour cloning.
fn policy_loss(
    logits: &Logits,
    all: &Transitions,
    parts: &[Part],
    weights: Option<&Tensor>,
    terms: &mut Terms,
) -> Tensor {
    let weigh = |surprise: Tensor| weights.map_or_else(|| surprise.shallow_clone(), |weights| &surprise * weights);
    let bc::Surprise { action, object } = bc::surprise(logits, &all.actions, &all.objects);
    let (action, object, interactions) = (weigh(action), weigh(object), bc::interactions(&all.objects));
    let part_loss = |part: &Part| {
        let action = part.of(&action).mean(Kind::Float);
        let object = part.of(&object).sum(Kind::Float) / part.of(&interactions).sum(Kind::Float).clamp_min(1.0);
        terms.add(part.label("action_loss"), &action);
        terms.add(part.label("object_loss"), &object);
        (action + object) * part.weight
    };
    parts.iter().map(part_loss).sum()
}

/// Observations as the networks take them: [n, channels, 7, 7] in 32 bits.
pub fn seen(observation: &Tensor) -> Tensor {
    observation.to_kind(Kind::Float).reshape([observation.size()[0], -1, SIDE, SIDE])
}

fn prefixed(prefix: &str, tensors: Tensors) -> Tensors {
    tensors.into_iter().map(|(name, tensor)| (format!("{prefix}{name}"), tensor)).collect()
}

/// The tensors under `prefix`, without it.
fn part_of(tensors: &Tensors, prefix: &str) -> Tensors {
    let stripped =
        |(name, tensor): (&String, &Tensor)| Some((name.strip_prefix(prefix)?.to_string(), tensor.shallow_clone()));
    tensors.iter().filter_map(stripped).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algo::adamw::AdamWConfig;
    use crate::algo::chain::{Cut, Pairs as Source};
    use crate::algo::schedule::Schedule;
    use crate::nets::critic::{CriticSpec, Senses};
    use crate::nets::policy::PolicySpec;

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
            hidden: vec![24],
            dropout: 0.0,
            goal: None,
            attention: None,
        };
        let critic = CriticSpec {
            channels: [6; 4],
            hidden: vec![24],
            dropout: 0.0,
            action_embedding: 4,
            object_embedding: 2,
            shared_trunk: true,
        };
        let senses = Senses { channels: STATES, told: TEXTS, goal: None };
        Nets {
            policy: PolicyNet::new(&policy_store.root(), &policy, STATES),
            store: policy_store,
            online: (Critic::new(&online.root(), &critic, senses), online),
            target: (Critic::new(&target.root(), &critic, senses), target),
        }
    }

    const IQL: Iql = Iql { discount: 0.9, expectile: 0.7, temperature: 3.0, weight_cap: 100.0, target_rate: 0.05 };

    fn optimisation(steps: u64) -> Optimisation {
        Optimisation {
            steps,
            batch: 1,
            schedule: Schedule { learning_rate: 8e-3, warmup_steps: 10, final_share: 0.01 },
            adamw: AdamWConfig { beta1: 0.9, beta2: 0.999, epsilon: 1e-8, weight_decay: 0.0 },
        }
    }

    fn update<'a>(nets: &'a Nets, steps: u64, chaining: Option<Chaining>) -> Update<'a> {
        let critic = CriticLearner::new(
            (&nets.online.0, &nets.online.1),
            (&nets.target.0, &nets.target.1),
            optimisation(steps),
            IQL,
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
            told: say(&column(|row| row.1)),
            objects: Tensor::from_slice(&vec![0i64; rows.len()]),
            actions: Tensor::from_slice(&actions),
            terminal: Tensor::from_slice(&rows.iter().map(|row| row.4).collect::<Vec<f32>>()),
        }
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
        let mut update = update(&nets, 800, None);
        while !update.is_done() {
            update.update(&batch, false).unwrap();
        }
        let four = transitions(&CHAIN_OF_TWO);
        let (q, v, policy) = solution();
        let found = nets.target.0.least_q(&four.observation, &four.told, &four.actions, &four.objects);
        let values = nets.online.0.value(&four.observation, &four.told);
        let logits = tch::no_grad(|| nets.policy.forward(&four.observation, &four.told, false));
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
    fn chaining_carries_the_worth_of_the_second_skill_to_the_first() {
        let _chance = crate::nets::testing::chance();
        // A: 0 to 1. B: 1 to 2. "A. B." is text 2.
        let (a, b) = ((0, 0, 0, 1, 1.0), (1, 1, 0, 2, 1.0));
        let chaining = Chaining {
            pairs: Source::Pool(1),
            batch: 4,
            cut: Cut::Uniform,
            worth: Worth::NextValue,
            clip: true,
            weight: 1.0,
            chain: 0.5,
            aggregate: 0.5,
        };
        let nets = nets();
        let mut update = update(&nets, 300, Some(chaining));
        let many = |row| transitions(&[row; 4]);
        let batch = || {
            let base: Vec<_> = [a, b].into_iter().cycle().take(8).collect();
            let first = Transitions { told: say(&[1; 4]), ..many(a) };
            let cut = first.terminal.shallow_clone();
            let joint = Some((say(&[2; 4]), Transitions { told: say(&[2; 4]), ..many(b) }));
            Batch { base: transitions(&base), pairs: Some(Pairs { first, cut, joint }) }
        };
        let mut numbers = BTreeMap::new();
        while !update.is_done() {
            numbers = update.update(&batch(), true).unwrap();
        }
        let values = nets.online.0.value(&look(&[0, 0, 1]), &say(&[1, 2, 2]));
        for i in 0..3 {
            // The joint costs nothing, and each skill is one step: all are worth 1.
            assert!((values.double_value(&[i]) - 1.0).abs() < 0.05, "{values}");
        }
        for name in ["chain_q_loss", "lead_value_loss", "follow_action_loss", "weight_max", "v_mean", "action_accuracy"]
        {
            assert!(numbers.contains_key(name), "{name} is not among {numbers:?}");
        }
    }

    #[test]
    fn a_loss_that_is_no_number_is_named_and_changes_nothing() {
        let _chance = crate::nets::testing::chance();
        let nets = nets();
        let mut update = update(&nets, 10, None);
        let mut base = transitions(&CHAIN_OF_TWO);
        update.update(&Batch { base: transitions(&CHAIN_OF_TWO), pairs: None }, false).unwrap();
        let before: Tensors = update.state().into_iter().map(|(name, tensor)| (name, tensor.copy())).collect();
        base.terminal *= f64::NAN;
        let error = update.update(&Batch { base, pairs: None }, false).unwrap_err();
        assert_eq!((error.step, error.term.as_str()), (2, "q_loss"));
        let statistics = |name: &str| name.ends_with("running_mean") || name.ends_with("running_var");
        assert!(update.state().iter().all(|(name, tensor)| statistics(name) || *tensor == before[name]));
    }
}
