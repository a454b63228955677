//! Chains of instructions, link by link: where does an agent that can do each step fail to do them one after the other?

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::rollout::Rollout;
use crate::agent::{Decision, ExpertPolicy, Policy};
use crate::domain::{Role, Scene, Subtask, World};
use crate::house::House;
use crate::house::grading::{Grader, Grading};
use crate::language::instruction;

/// A chain that can be followed from a state.
#[derive(Clone, Debug)]
pub struct Chain {
    /// Where.
    pub scene: Arc<Scene>,
    /// The state in which it begins.
    pub start: World,
    /// The instructions, in order.
    pub links: Vec<String>,
    /// What grades each link, one subtask a link; without it links end after [`UNGRADED`] steps.
    pub graded: Option<(Vec<Role>, Vec<Subtask>)>,
}

/// The steps that a link has which nobody grades.
pub const UNGRADED: u32 = 20;
/// The most steps of a graded link: this many times the expert's, and some to turn around.
const PATIENCE: u32 = 2;
/// Steps that every link has beyond that.
const SLACK: u32 = 8;

/// How a link came out.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// It was reached: the links before it were done.
    pub reached: bool,
    /// It was done; `None` where nobody grades it.
    pub done: Option<bool>,
    /// Its steps.
    pub steps: u32,
    /// The state in which it began.
    pub entry: World,
    /// The state in which it ended.
    pub exit: World,
    /// V of the exit state under the next link's instruction: the reward that eq. 4 puts at the end of this link.
    pub handover: Option<f32>,
}

/// A chain that was followed.
#[derive(Clone, Debug, PartialEq)]
pub struct Play {
    /// Who followed it.
    pub acts: String,
    /// How each link came out.
    pub outcomes: Vec<Outcome>,
    /// For every step, how warm each link was: V under its instruction, or without critics the probability that its
    /// instruction gives to what was done.
    pub heat: Vec<Vec<f32>>,
    /// The heat is V.
    pub by_value: bool,
    /// The link in force at every step.
    pub in_force: Vec<usize>,
}

/// Splits a text into the links of a chain: at semicolons, line breaks, full stops and the word "then".
pub fn split(text: &str) -> Vec<String> {
    let mut text = text.replace(['\n', '\r', '.', '!', '?'], ";");
    for joint in [", and then ", " and then ", ", then ", " then "] {
        text = text.replace(joint, ";");
    }
    let parts = text.split(';').map(|part| part.trim().trim_start_matches("then ").trim_matches([',', ' ']));
    parts.filter(|part| !part.is_empty()).map(instruction::normalise).collect()
}

impl Chain {
    fn house(&self, world: &World) -> House {
        House::new(self.scene.clone(), world.clone())
    }

    fn grader(&self) -> Option<Grader> {
        let (roles, subtasks) = self.graded.as_ref()?;
        Some(Grader::new(Grading::Class, roles, subtasks, None))
    }

    /// All links as one instruction.
    pub fn whole(&self) -> String {
        self.links.join(" ")
    }

    /// The steps that the expert takes for each link, each from the expert's own end of the one before; with the state in which
    /// each begins. `None` where nobody grades the chain, or the expert fails.
    pub fn expert(&self) -> Option<Vec<(u32, World, Grader)>> {
        let mut rollout = Rollout::new(self.house(&self.start), self.whole(), Some(self.grader()?), None);
        let mut expert = ExpertPolicy::new();
        expert.begin(0);
        let mut entries = vec![(0, self.start.clone(), rollout.grader.clone()?)];
        let mut since = 0;
        while rollout.end().is_none() && rollout.steps() < 1000 {
            let tick = rollout.step(&mut expert).ok()?;
            if tick.completed_one {
                if let Some(entry) = entries.last_mut() {
                    entry.0 = tick.step - since;
                }
                since = tick.step;
                if entries.len() < self.links.len() {
                    entries.push((0, rollout.house.world().clone(), rollout.grader.clone()?));
                }
            }
        }
        (entries.len() == self.links.len() && rollout.end().is_some()).then_some(entries)
    }

    fn limits(&self) -> Vec<u32> {
        match self.expert() {
            Some(entries) => entries.iter().map(|(steps, ..)| PATIENCE * steps + SLACK).collect(),
            None => vec![UNGRADED; self.links.len()],
        }
    }

    /// Follows the chain: told all at once, or link by link as each is done. `stop` ends it early.
    ///
    /// # Errors
    /// Whatever the policy reports.
    pub fn play(&self, policy: &mut dyn Policy, whole: bool, stop: &AtomicBool) -> anyhow::Result<Play> {
        let limits = self.limits();
        let told = |link: usize| if whole { self.whole() } else { self.links[link].clone() };
        let mut rollout = Rollout::new(self.house(&self.start), told(0), self.grader(), None);
        policy.begin(0);
        let mut play = Play {
            acts: policy.name().to_string(),
            outcomes: Vec::new(),
            heat: Vec::new(),
            by_value: false,
            in_force: Vec::new(),
        };
        let all: u32 = limits.iter().sum();
        for (link, &limit) in limits.iter().enumerate() {
            let entry = rollout.house.world().clone();
            let begun = rollout.steps();
            rollout.instruction = told(link);
            let mut done = self.graded.is_some().then_some(false);
            let spent = |rollout: &Rollout| match whole {
                true => rollout.steps() >= all,
                false => rollout.steps() - begun >= limit,
            };
            let failed = play.outcomes.last().is_some_and(|before: &Outcome| before.done == Some(false));
            while !failed && !spent(&rollout) && !stop.load(Ordering::Relaxed) {
                let decision = rollout.decide(policy)?;
                self.feel(policy, &mut rollout, &decision, &mut play)?;
                play.in_force.push(link);
                if rollout.carry_out(decision).completed_one {
                    done = Some(true);
                    break;
                }
            }
            let handover = match self.links.get(link + 1).filter(|_| !failed) {
                Some(next) => value(policy, &mut rollout, next)?,
                None => None,
            };
            let (steps, exit) = (rollout.steps() - begun, rollout.house.world().clone());
            play.outcomes.push(Outcome {
                reached: !failed,
                done: done.filter(|_| !failed),
                steps,
                entry,
                exit,
                handover,
            });
        }
        Ok(play)
    }

    /// How warm every link is before a step.
    fn feel(
        &self,
        policy: &mut dyn Policy,
        rollout: &mut Rollout,
        decision: &Decision,
        play: &mut Play,
    ) -> anyhow::Result<()> {
        let carried = policy.carried();
        let told = rollout.instruction.clone();
        let mut heat = Vec::with_capacity(self.links.len());
        for link in &self.links {
            policy.put_back(carried.clone());
            rollout.instruction.clone_from(link);
            let felt = match policy.values(&mut rollout.situation())? {
                Some(values) => {
                    play.by_value = true;
                    values.state
                }
                None => {
                    let mind = rollout.decide(policy)?.mind;
                    mind.and_then(|mind| mind.actions[decision.action.kind.index()]).unwrap_or(0.0)
                }
            };
            heat.push(felt);
        }
        rollout.instruction = told;
        policy.put_back(carried);
        play.heat.push(heat);
        Ok(())
    }
}

fn value(policy: &mut dyn Policy, rollout: &mut Rollout, told: &str) -> anyhow::Result<Option<f32>> {
    let carried = policy.carried();
    let before = std::mem::replace(&mut rollout.instruction, told.to_string());
    let found = policy.values(&mut rollout.situation());
    rollout.instruction = before;
    policy.put_back(carried);
    Ok(found?.map(|values| values.state))
}

/// How often a link was done from one entry state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rate {
    /// Times it was done.
    pub done: u32,
    /// Of how many.
    pub of: u32,
}

/// What is played to see which link breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draws {
    /// Plays of each link from each entry.
    pub times: u32,
    /// Only this link, from 0.
    pub only: Option<usize>,
}

impl Draws {
    /// Whether a link is played.
    pub fn include(self, link: usize) -> bool {
        self.only.is_none_or(|only| only == link)
    }
}

/// Which link breaks: how often each is done from the expert's entry state and from the agent's own.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Trials {
    /// From where the expert begins each link.
    pub expert: Vec<Rate>,
    /// From where the agent itself began it; empty where it never got there.
    pub own: Vec<Rate>,
}

impl Trials {
    /// The link that breaks the chain: the one that is done least often from where the agent itself begins it (where it never
    /// gets there: from where the expert does).
    pub fn weakest(&self) -> Option<usize> {
        let share = |rate: &Rate| (rate.of > 0).then(|| f64::from(rate.done) / f64::from(rate.of));
        let both = self.expert.iter().zip(&self.own).map(|(e, o)| (share(e), share(o)));
        let worst = both.map(|(e, o)| o.or(e).unwrap_or(1.0)).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        worst.filter(|(_, share)| *share < 1.0).map(|(link, _)| link)
    }
}

/// Plays links with drawn actions, from the expert's entry and from the agent's own (as `play` recorded it).
/// `visit` sees what was found after every play.
///
/// # Errors
/// When nobody grades the chain, the expert cannot follow it, or the policy fails.
pub fn trials(
    chain: &Chain,
    play: &Play,
    policy: &mut dyn Policy,
    draws: Draws,
    stop: &AtomicBool,
    visit: &mut dyn FnMut(&Trials),
) -> anyhow::Result<Trials> {
    let entries = chain.expert().ok_or_else(|| {
        anyhow::anyhow!("nobody grades these links, or the expert cannot follow them: use a task's own chain")
    })?;
    let links = chain.links.len();
    let mut found = Trials { expert: vec![Rate::default(); links], own: vec![Rate::default(); links] };
    policy.set_sampling(true);
    for draw in 0..draws.times {
        for (link, (steps, world, grader)) in entries.iter().enumerate().filter(|(link, _)| draws.include(*link)) {
            let own = play.outcomes.get(link).filter(|outcome| outcome.reached).map(|outcome| &outcome.entry);
            // The bindings of the agent's own things differ; what it holds or moved is still of the classes that are asked for.
            let mut starts = vec![(world, grader.clone(), true)];
            starts.extend(own.map(|own| (own, rebound(chain, link, own, grader), false)));
            for (start, grader, by_expert) in starts {
                if stop.load(Ordering::Relaxed) {
                    return Ok(found);
                }
                let house = chain.house(start);
                let mut rollout = Rollout::new(house, chain.links[link].clone(), Some(grader), None);
                policy.begin(u64::from(draw) * 1000 + link as u64);
                let mut done = false;
                while !done && rollout.steps() < PATIENCE * steps + SLACK && !stop.load(Ordering::Relaxed) {
                    done = rollout.step(policy)?.completed_one;
                }
                let rate = if by_expert { &mut found.expert[link] } else { &mut found.own[link] };
                rate.done += u32::from(done);
                rate.of += 1;
                visit(&found);
            }
        }
    }
    policy.set_sampling(false);
    Ok(found)
}

/// A grader for a link from another state than the expert's: roles that the expert bound to things are bound to what is held
/// where that is of the class, and are free otherwise.
fn rebound(chain: &Chain, link: usize, world: &World, expert: &Grader) -> Grader {
    let Some((roles, subtasks)) = &chain.graded else { return expert.clone() };
    let held = world.held.map(|held| (crate::domain::Instance::Object(held), world.object(held).map(|o| o.class)));
    let mut roles = roles.clone();
    for role in &mut roles {
        role.bound = held.filter(|(_, class)| *class == Some(role.class)).map(|(instance, _)| instance);
    }
    Grader::new(Grading::Class, &roles, subtasks.get(link..).unwrap_or_default(), None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::RandomPolicy;
    use crate::domain::{Class, SkillKind};
    use crate::house::testing::kitchen;

    fn chain() -> Chain {
        let (scene, start) = kitchen();
        let role = |name: &str| Role { class: Class::named(name).unwrap(), slice: false, bound: None, expert: None };
        let subtask = |skill, receptacle| Subtask { skill, object: 0, receptacle, closes: false, literal: None };
        Chain {
            scene,
            start,
            links: vec!["Pick up the mug.".into(), "Put it in the sink.".into()],
            graded: Some((
                vec![role("Mug"), role("Sink")],
                vec![subtask(SkillKind::Pickup, None), subtask(SkillKind::Put, Some(1))],
            )),
        }
    }

    fn check(text: &str, expected: &[&str]) {
        assert_eq!(split(text), expected, "{text:?}");
    }

    #[test]
    fn a_text_falls_into_links() {
        check("pick up the knife; slice the tomato", &["Pick up the knife.", "Slice the tomato."]);
        check("Take the mug, then put it in the sink.", &["Take the mug.", "Put it in the sink."]);
        check("take the mug\nand wash it\n", &["Take the mug.", "And wash it."]);
        check("open the fridge and then close it. Done", &["Open the fridge.", "Close it.", "Done."]);
        check(" ; . ", &[]);
    }

    #[test]
    fn the_expert_hands_over_at_every_link() {
        let entries = chain().expert().unwrap();
        assert_eq!(entries.len(), 2);
        assert!(entries.iter().all(|(steps, ..)| *steps > 0));
        assert!(entries[1].1.held.is_some(), "the second link begins with the mug in the hand");
    }

    #[test]
    fn a_chain_is_followed_until_a_link_fails() {
        let chain = chain();
        let mut policy = RandomPolicy::new();
        let play = chain.play(&mut policy, false, &AtomicBool::new(false)).unwrap();
        assert_eq!(play.outcomes.len(), 2);
        let first = &play.outcomes[0];
        assert!(first.reached && first.done.is_some() && first.handover.is_none());
        assert_eq!(play.outcomes[1].reached, first.done == Some(true));
        let steps: u32 = play.outcomes.iter().map(|outcome| outcome.steps).sum();
        assert_eq!((play.heat.len(), play.in_force.len()), (steps as usize, steps as usize));
        assert!(play.heat.iter().all(|heat| heat.len() == 2) && !play.by_value);
    }

    #[test]
    fn trials_play_every_link_from_both_entries_and_can_be_stopped() {
        let chain = chain();
        let mut policy = RandomPolicy::new();
        let stop = AtomicBool::new(false);
        let play = chain.play(&mut policy, false, &stop).unwrap();
        let mut seen = 0;
        let found =
            trials(&chain, &play, &mut policy, Draws { times: 2, only: None }, &stop, &mut |_| seen += 1).unwrap();
        assert_eq!(found.expert.iter().map(|rate| rate.of).collect::<Vec<_>>(), [2, 2]);
        assert_eq!(found.own[0].of, 2);
        assert_eq!(found.own[1].of, if play.outcomes[1].reached { 2 } else { 0 });
        assert_eq!(seen, found.expert.iter().chain(&found.own).map(|rate| rate.of).sum::<u32>());
        let one = Draws { times: 3, only: Some(1) };
        let only = trials(&chain, &play, &mut policy, one, &stop, &mut |_| ()).unwrap();
        assert_eq!(only.expert.iter().map(|rate| rate.of).collect::<Vec<_>>(), [0, 3]);
        stop.store(true, Ordering::Relaxed);
        assert_eq!(trials(&chain, &play, &mut policy, one, &stop, &mut |_| ()).unwrap().expert[1].of, 0);
        let ungraded = Chain { graded: None, ..chain };
        assert!(trials(&ungraded, &play, &mut policy, one, &stop, &mut |_| ()).is_err());
    }

    #[test]
    fn the_weakest_link_is_where_the_agent_does_worst() {
        let rate = |done| Rate { done, of: 4 };
        let trials = Trials { expert: vec![rate(4), rate(4), rate(3)], own: vec![rate(4), rate(1), rate(3)] };
        assert_eq!(trials.weakest(), Some(1));
        let perfect = Trials { expert: vec![rate(4)], own: vec![rate(4)] };
        assert_eq!(perfect.weakest(), None);
    }
}
