//! What the agent sees with: a trained detector, or for an ablation what the simulator knows to be in view and in
//! the hand.

use anyhow::Context;
use serde::{Deserialize, Serialize};
use tch::Device;

use crate::agent::memory::percept::{GRID, Percept, fills_hand, median_depths};
use crate::domain::{Class, Scene, World};
use crate::env::Environment;
use crate::house::view::Frame;
use crate::nets::detector::{DetectorSpec, FrozenDetector};

/// What sees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Sight {
    /// A trained detector.
    #[default]
    Detector,
    /// The simulator: an ablation.
    Simulator,
}

/// Eyes that are at hand.
#[derive(Debug)]
pub(crate) enum Eyes {
    Detector(Box<FrozenDetector>),
    Simulator,
}

/// A frame as it was seen, and whether something was seen in the hand.
pub(crate) struct Seen {
    pub(crate) percept: Percept,
    pub(crate) hand_full: bool,
}

impl Eyes {
    /// Looks at what an environment shows now.
    ///
    /// # Errors
    /// When the environment shows nothing, or the simulator is asked and is another one than House.
    pub(crate) fn look(&self, environment: &mut dyn Environment) -> anyhow::Result<Seen> {
        match self {
            Eyes::Detector(detector) => detected(detector, environment.frame()?),
            Eyes::Simulator => {
                let name = environment.name().to_owned();
                let access = environment.house();
                let house =
                    access.with_context(|| format!("the simulator's truth is House's, and this is {name}"))?.house;
                let frame = house.frame().clone();
                Ok(true_sight(house.scene(), house.world(), &frame))
            }
        }
    }

    /// Looks at a frame of House that was drawn of `world`.
    ///
    /// # Errors
    /// When the detector fails.
    pub(crate) fn look_at(&self, scene: &Scene, world: &World, frame: &Frame) -> anyhow::Result<Seen> {
        match self {
            Eyes::Detector(detector) => detected(detector, frame),
            Eyes::Simulator => Ok(true_sight(scene, world, frame)),
        }
    }

    /// The same eyes for another thread.
    pub(crate) fn share(&self) -> Eyes {
        match self {
            Eyes::Detector(detector) => Eyes::Detector(Box::new(detector.share())),
            Eyes::Simulator => Eyes::Simulator,
        }
    }
}

fn detected(detector: &FrozenDetector, frame: &Frame) -> anyhow::Result<Seen> {
    let said = detector.detect(&[DetectorSpec::image(frame)]).flatten(0, -1).to_device(Device::Cpu);
    let said = Vec::<f32>::try_from(said)?;
    let depth = median_depths(frame);
    let mut detections = Vec::new();
    for (class, places) in said.chunks_exact(GRID * GRID).take(Class::VOCABULARY).enumerate() {
        let Some(class) = Class::from_index(class).filter(|class| class.in_vocabulary()) else { continue };
        let probable = places.iter().enumerate().filter(|(_, probability)| **probability >= Percept::LEAST);
        detections.extend(probable.map(|(place, &probability)| (class, place as u16, probability)));
    }
    let open = said.chunks_exact(GRID * GRID).last().map(<[f32]>::to_vec).unwrap_or_default();
    Ok(Seen { percept: Percept { detections, open, depth }, hand_full: fills_hand(frame) })
}

/// What eyes without fault would make of a frame that was drawn of `world`.
fn true_sight(scene: &Scene, world: &World, frame: &Frame) -> Seen {
    Seen { percept: Percept::of_truth(scene, world, frame), hand_full: world.held.is_some() }
}
