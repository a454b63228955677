//! What a glance would show that no glance has shown yet.

use glam::{Vec2, Vec3};

use super::eye;
use super::occupancy::Occupancy;
use crate::domain::Pose;
use crate::house::camera::Camera;

/// Lines of sight that are followed across the frame, how far, and in which strides (metres).
const LINES: usize = 9;
const RANGE: f32 = 3.5;
const STRIDE: f32 = 0.25;
/// Half the camera's angle, and the height (metres) at which things are looked for: of beds, low tables and what lies on them.
const HALF_VIEW: f32 = 30.0;
const LOW: f32 = 0.4;
/// What is as high as this (metres) hides what is behind it.
const TALL: f32 = 1.3;
/// What was looked at only from more than so many times as far may be seen better, if it is within [`CLOSE`] metres.
const FARTHER: f32 = 2.0;
const CLOSE: f32 = 2.0;

/// Shares of the floor plan that a glance covers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Novelty {
    /// What was never looked at.
    pub(crate) unseen: f32,
    /// What was looked at from much farther only.
    pub(crate) nearer: f32,
}

impl Novelty {
    /// What a glance from `pose` would show: with its tilt, things that are low and near may lie below the frame.
    pub(crate) fn of(occupancy: &Occupancy, pose: Pose) -> Novelty {
        let eye = eye::camera(pose).eye();
        let (right, ahead) = (pose.heading.right().step(), pose.heading.step());
        let towards = |(dx, dz): (i16, i16)| Vec2::new(dx.into(), dz.into());
        let (mut unseen, mut nearer, mut all) = (0u32, 0u32, 0u32);
        let drop = eye.y - LOW;
        let frames = |away: f32| ((drop / away).atan().to_degrees() - f32::from(pose.horizon)).abs() <= HALF_VIEW;
        for line in 0..LINES {
            let aside = Camera::SLOPE * (2.0 * line as f32 / (LINES - 1) as f32 - 1.0);
            let along = (towards(ahead) + aside * towards(right)).normalize();
            let mut away = STRIDE;
            while away <= RANGE {
                let cell = eye::cell_under(eye + away * Vec3::new(along.x, 0.0, along.y));
                all += 1;
                match occupancy.looked_from(cell) {
                    _ if !frames(away) => {}
                    None => unseen += 1,
                    Some(from) if away <= CLOSE && from > FARTHER * away => nearer += 1,
                    Some(_) => {}
                }
                if occupancy.top(cell) >= TALL {
                    break;
                }
                away += STRIDE;
            }
        }
        let share = |count: u32| count as f32 / all.max(1) as f32;
        Novelty { unseen: share(unseen), nearer: share(nearer) }
    }

    /// Whether it is worth a glance.
    pub(crate) fn is_worth_a_glance(self) -> bool {
        const LEAST: f32 = 0.1;
        self.unseen + self.nearer >= LEAST
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Heading, Room, World};
    use crate::house::generate;
    use crate::house::render::Renderer;

    #[test]
    fn what_was_looked_at_is_not_new_and_what_lies_behind_is() {
        let (scene, world) = generate::house(Room::Kitchen, 5);
        let mut renderer = Renderer::new(300);
        let mut occupancy = Occupancy::default();
        let novelty = |occupancy: &Occupancy, heading| Novelty::of(occupancy, Pose { heading, ..world.agent });
        let ahead = world.agent.heading;
        assert!(novelty(&occupancy, ahead).unseen > 0.8);
        let mut look = |occupancy: &mut Occupancy, agent: Pose| {
            occupancy.observe(agent, renderer.draw(&scene, &World { agent, ..world.clone() }));
        };
        look(&mut occupancy, world.agent);
        let [front, back] = [ahead, ahead.right().right()].map(|heading| novelty(&occupancy, heading).unseen);
        assert!(front < 0.5 && back > 0.5, "{front} ahead, {back} behind");
        for heading in Heading::ALL {
            for horizon in [0, 30] {
                look(&mut occupancy, Pose { heading, horizon, ..world.agent });
            }
        }
        let back = novelty(&occupancy, ahead.right().right());
        assert!(back.unseen < 0.3, "{back:?}");
    }

    #[test]
    fn what_was_seen_from_afar_may_be_seen_from_nearer() {
        let far = Pose { horizon: 30, ..Pose::default() };
        let mut occupancy = Occupancy::default();
        let ahead = (1..16).map(|z| crate::domain::Cell::new(0, z));
        ahead.for_each(|cell| occupancy.look_at(cell, eye::between(cell, far.cell)));
        let near = Pose { cell: crate::domain::Cell::new(0, 10), ..far };
        assert_eq!(Novelty::of(&occupancy, far).nearer, 0.0);
        assert!(Novelty::of(&occupancy, near).nearer > 0.0);
    }
}
