//! A trained agent that acts in several episodes at once, with one forward pass for all of them.
//!
//! The pass always has the same shape: an empty seat is a row of zeros. A row of a pass of one shape is computed the same
//! way whatever the other rows hold, so a decision depends on its own episode and seat alone; the tests hold this.

use tch::{Device, Kind, Tensor};

use super::checkpoint::Networks;
use super::conditioning;
use super::config::Config;
use super::frame_history::{FrameHistory, SharedEmbedder};
use super::learned::LearnedPolicy;
use super::policy::Observation;
use super::select::Heads;
use super::team::{Decisions, Team};
use crate::nets::frozen::FrameEncoder;
use crate::nets::visual::SIDE;

/// A trained agent with several seats.
pub struct LearnedTeam {
    name: String,
    config: Config,
    networks: Networks,
    sight: Box<dyn FrameEncoder>,
    sentences: SharedEmbedder,
    device: Device,
    samples: bool,
    seats: Vec<FrameHistory>,
    /// What an empty seat shows.
    blank: Vec<u8>,
}

impl LearnedTeam {
    /// Rows of a pass on the CPU: enough to read the weights once for several episodes, few enough to stay in its caches.
    pub const SEATS: usize = 8;

    /// Seats for an agent.
    pub fn new(agent: LearnedPolicy, seats: usize) -> LearnedTeam {
        let LearnedPolicy { name, config, networks, sight, sentences, device, samples, memory: _ } = agent;
        let blank = vec![0; 3 * sight.side() * sight.side()];
        let seats = (0..seats.max(1)).map(|_| FrameHistory::default()).collect();
        LearnedTeam { name, config, networks, sight, sentences, device, samples, seats, blank }
    }

    /// The maps [seats, features, 7, 7] of what each seat sees now.
    fn see(&mut self, situations: &mut [Option<Observation<'_>>]) -> Tensor {
        let image = |(situation, memory): (&mut Option<Observation<'_>>, &mut FrameHistory)| match situation {
            Some(here) => {
                let image = self.sight.image(here.house.frame());
                memory.look(&image, here.step);
                image
            }
            None => self.blank.clone(),
        };
        let images: Vec<Vec<u8>> = situations.iter_mut().zip(&mut self.seats).map(image).collect();
        self.sight.encode(&images)
    }
}

impl Team for LearnedTeam {
    fn name(&self) -> &str {
        &self.name
    }

    fn seats(&self) -> usize {
        self.seats.len()
    }

    fn begin(&mut self, seat: usize, seed: u64) {
        self.seats[seat].begin(seed);
    }

    fn decide(&mut self, situations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        anyhow::ensure!(situations.len() == self.seats.len(), "{} situations are not one a seat", situations.len());
        let maps = self.see(situations);
        let (history, features) = (self.config.policy.history, self.config.features());
        let floats = (Kind::Float, self.device);
        let mut observations = Vec::new();
        let mut told = Vec::new();
        for ((seat, memory), situation) in (0i64..).zip(&mut self.seats).zip(situations.iter()) {
            match situation {
                Some(here) => {
                    observations.push(memory.observe(maps.narrow(0, seat, 1), here.step, history as usize));
                    let hear = || conditioning::told(here, &self.config, &*self.sight, &self.sentences, self.device);
                    told.push(memory.told(here.instruction, hear)?);
                }
                None => {
                    observations.push(Tensor::zeros([1, history * features, SIDE, SIDE], floats));
                    told.push(conditioning::nothing(&self.config, self.device));
                }
            }
        }
        let (observations, told) = (Tensor::cat(&observations, 0), Tensor::cat(&told, 0));
        let logits = tch::no_grad(|| self.networks.policy.forward(&observations, &told, false));
        let numbers = |tensor: Tensor| -> anyhow::Result<(usize, Vec<f32>)> {
            let width = tensor.size()[1] as usize;
            Ok((width, Vec::<f32>::try_from(tensor.flatten(0, -1).to_device(Device::Cpu))?))
        };
        let ((kinds, mut actions), (classes, objects)) = (numbers(logits.actions)?, numbers(logits.objects)?);
        actions.chunks_exact_mut(kinds).for_each(|row| self.config.logit_adjustment(row));
        let mut decided = Vec::with_capacity(situations.len());
        for (seat, situation) in situations.iter_mut().enumerate() {
            let Some(here) = situation else {
                decided.push(None);
                continue;
            };
            let candidates = here.house.candidates();
            // A pass for each seat alone, so that what is in it depends on no other.
            let of_seat = |all: &Tensor| all.narrow(0, seat as i64, 1);
            let values = self.networks.advice(&self.config, &of_seat(&observations), &of_seat(&told), &candidates)?;
            let heads = Heads {
                actions: &actions[seat * kinds..][..kinds],
                objects: &objects[seat * classes..][..classes],
                advantage_scale: self.config.advantage_scale(values.as_ref()),
            };
            decided.push(Some(Ok(self.seats[seat].decide(&heads, &candidates, self.samples))));
        }
        Ok(decided)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::{Arc, Mutex};

    use super::*;
    use crate::agent::logit_adjustment::LogitAdjustment;
    use crate::agent::{ActionDistribution, Policy};
    use crate::domain::{ActionType, Heading};
    use crate::house::House;
    use crate::house::testing::kitchen_house;
    use crate::nets::device;
    use crate::nets::embedding_cache::Embedder;
    use crate::nets::sentence::default_folder;

    fn shipped(name: &str) -> Option<LearnedPolicy> {
        device::set_threads(1);
        let sentences = Embedder::open(&default_folder(), Device::Cpu).ok()?;
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("checkpoints").join(name);
        LearnedPolicy::load(&folder, Arc::new(Mutex::new(sentences)), Device::Cpu).ok()
    }

    fn turned(heading: Heading) -> House {
        let mut house = kitchen_house();
        let mut world = house.world().clone();
        world.agent.heading = heading;
        house.restore(world);
        house
    }

    /// What the agent thinks in one seat in ten steps, with these other seats taken.
    fn minds(team: &mut LearnedTeam, seat: usize, others: &[usize]) -> Vec<ActionDistribution> {
        let mut houses: Vec<Option<House>> = (0..team.seats()).map(|_| None).collect();
        for &other in others {
            houses[other] = Some(turned(Heading::ALL[other % 4]));
        }
        houses[seat] = Some(turned(Heading::West));
        (0..team.seats()).for_each(|seat| team.begin(seat, seat as u64));
        let mut minds = Vec::new();
        for step in 0..10 {
            let told = ["Take the mug.", "Slice the bread.", "Open the fridge."];
            let mut situations: Vec<Option<Observation<'_>>> = Vec::new();
            for (place, house) in houses.iter_mut().enumerate() {
                let instruction = if place == seat { "Put the apple in the sink." } else { told[place % 3] };
                situations.push(house.as_mut().map(|house| Observation { house, instruction, step, grader: None }));
            }
            let decisions = team.decide(&mut situations).unwrap();
            for (place, decision) in decisions.into_iter().enumerate() {
                let Some(decision) = decision.map(Result::unwrap) else { continue };
                if let Some(house) = &mut houses[place] {
                    house.step(decision.action);
                }
                if place == seat {
                    minds.extend(decision.mind);
                }
            }
        }
        minds
    }

    #[test]
    fn a_decision_depends_on_its_own_seat_alone_bit_for_bit() {
        // The second weighs its policy by its critic.
        for name in ["first", "sprint"] {
            let Some(mut agent) = shipped(name) else {
                eprintln!("skipped: the shipped agents need their sentence encoder");
                return;
            };
            agent.config.advantage_scale = agent.networks.critic.is_some().then_some(10.0);
            let mut team = LearnedTeam::new(agent, LearnedTeam::SEATS);
            for seat in [0, 5] {
                let alone = minds(&mut team, seat, &[]);
                assert_eq!(alone.len(), 10);
                assert_eq!(minds(&mut team, seat, &[1, 2]), alone);
                assert_eq!(minds(&mut team, seat, &[0, 1, 2, 3, 4, 5, 6, 7]), alone);
            }
        }
    }

    /// What a shipped agent thinks first, in one seat of a team; alone it must think the same.
    fn first_thought(name: &str, change: impl Fn(&mut Config)) -> Option<ActionDistribution> {
        let (mut one, mut agent) = (shipped(name)?, shipped(name)?);
        change(&mut one.config);
        change(&mut agent.config);
        let mut team = LearnedTeam::new(agent, LearnedTeam::SEATS);
        let together = minds(&mut team, 3, &[0, 1, 2]).remove(0);
        let mut house = turned(Heading::West);
        one.begin(3);
        let mut here =
            Observation { house: &mut house, instruction: "Put the apple in the sink.", step: 0, grader: None };
        let alone = one.decide(&mut here).unwrap().mind.unwrap();
        // Another shape of the pass may round otherwise, no more.
        for (a, b) in together.actions.iter().zip(alone.actions) {
            assert!((a.unwrap_or(-1.0) - b.unwrap_or(-1.0)).abs() < 1e-4, "{together:?} {alone:?}");
        }
        Some(together)
    }

    #[test]
    fn several_at_once_think_what_one_alone_thinks() {
        let mut ahead = Vec::new();
        let shares: Vec<f32> = (0..ActionType::COUNT).map(|action| if action == 0 { 0.45 } else { 0.05 }).collect();
        for logit_adjustment in [None, Some(LogitAdjustment { strength: 0.5, shares })] {
            let Some(mind) = first_thought("first", |config| config.logit_adjustment = logit_adjustment.clone()) else {
                eprintln!("skipped: the shipped agent needs its sentence encoder");
                return;
            };
            let odds = |action: usize| mind.actions[action].unwrap();
            ahead.push(odds(0) / odds(1));
        }
        // Nine times the share, at half strength: a third of the odds.
        assert!((ahead[0] / ahead[1] - 3.0).abs() < 1e-3, "{ahead:?}");
    }

    #[test]
    fn an_agent_that_weighs_by_its_critic_thinks_otherwise_than_by_its_policy_alone() {
        let [alone, weighed] =
            [None, Some(10.0)].map(|weight| first_thought("sprint", |it| it.advantage_scale = weight));
        let (Some(alone), Some(weighed)) = (alone, weighed) else {
            eprintln!("skipped: the shipped agent needs its sentence encoder");
            return;
        };
        let apart = |(a, b): (&Option<f32>, &Option<f32>)| (a.unwrap_or(0.0) - b.unwrap_or(0.0)).abs() > 1e-3;
        assert!(alone.actions.iter().zip(&weighed.actions).any(apart), "{alone:?} {weighed:?}");
    }
}
