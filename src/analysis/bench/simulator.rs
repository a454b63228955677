//! House on one core: frames, steps, resets.

use std::convert::Infallible;
use std::hint::black_box;
use std::time::Duration;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::baselines::{Baselines, least};
use crate::agent::random::RandomPolicy;
use crate::domain::{Heading, Room, Scene, World};
use crate::episode::rollout::Rollout;
use crate::house::render::Renderer;
use crate::house::{House, generate};

/// Rounds whose least counts.
pub(super) const ROUNDS: usize = 12;
/// Houses of each room, and poses in each.
const HOUSES: u64 = 4;
const POSES: usize = 16;
const STEPS: u32 = 100;
const RESETS: usize = 1000;

/// The simulator's speed on one core.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct SimulatorSpeed {
    /// Frames of 300 x 300 pixels with colour, depth and instances.
    pub(crate) frames_per_s: f64,
    /// Steps of a policy that acts by chance, with their frames and what can be done in each.
    pub(crate) steps_per_s: f64,
    /// Microseconds for going back to an episode's start.
    pub(crate) reset_us: f64,
}

/// Measures so many rounds of each.
///
/// # Errors
/// When House fails.
pub(super) fn measure(baselines: &mut Baselines, rounds: usize) -> anyhow::Result<SimulatorSpeed> {
    let mut figure = |name: &str, count: usize, once: &mut dyn FnMut()| {
        let Ok(round) = least(rounds, || -> Result<(), Infallible> {
            once();
            Ok(())
        });
        baselines.compare(name, round);
        round / count as u32
    };
    let per_second = |each: Duration| 1.0 / each.as_secs_f64();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let houses = Room::ALL.into_iter().flat_map(|room| (0..HOUSES).map(move |seed| generate::house(room, seed)));
    let houses: Vec<(Scene, Vec<World>)> = houses
        .map(|(scene, world)| {
            let worlds = poses(&scene, &world, &mut rng);
            (scene, worlds)
        })
        .collect();
    let mut renderers: Vec<Renderer> = houses.iter().map(|_| Renderer::new(House::FRAME)).collect();
    let frames = figure("frames/draw", houses.len() * POSES, &mut || {
        for ((scene, worlds), renderer) in houses.iter().zip(&mut renderers) {
            for world in worlds {
                black_box(renderer.draw(scene, world));
            }
        }
    });
    let (scene, world) = generate::house(Room::Kitchen, 0);
    let house = House::new(scene.into(), world.clone());
    let mut rollout = Rollout::in_house(house, "anything".to_owned(), None, Some(STEPS));
    let mut failed = None;
    let steps = figure("steps/by chance", STEPS as usize, &mut || {
        failed = rollout.restart().and_then(|()| rollout.run(&mut RandomPolicy::new(), &mut ())).err();
    });
    failed.map_or(Ok(()), Err)?;
    let house = &mut rollout.env.house;
    let resets = figure("resets/a thousand", RESETS, &mut || {
        for _ in 0..RESETS {
            house.restore(black_box(&world).clone());
        }
    });
    Ok(SimulatorSpeed {
        frames_per_s: per_second(frames),
        steps_per_s: per_second(steps),
        reset_us: resets.as_secs_f64() * 1e6,
    })
}

/// Worlds that differ in where the agent stands and looks.
fn poses(scene: &Scene, world: &World, rng: &mut ChaCha8Rng) -> Vec<World> {
    let mut pose = || {
        let mut world = world.clone();
        world.agent.cell = scene.cells[rng.random_range(0..scene.cells.len())];
        world.agent.heading = Heading::from_quarters(rng.random_range(0..4));
        world.agent.horizon = [0, 15, 30, 30, 45][rng.random_range(0..5)];
        world
    };
    (0..POSES).map(|_| pose()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_figure_of_the_simulator_is_measured_and_compared() {
        let mut baselines = Baselines::shipped().unwrap();
        let speed = measure(&mut baselines, 1).unwrap();
        let all = [speed.frames_per_s, speed.steps_per_s, speed.reset_us];
        assert!(all.iter().all(|figure| figure.is_finite() && *figure > 0.0), "{speed:?}");
        assert_eq!(baselines.into_comparisons().len(), 3);
    }
}
