//! What conditions a trained agent, in the form that its networks take: the instruction, or frames of its goal.

use anyhow::Context;
use tch::{Device, Kind, Tensor};

use super::config::CheckpointConfig;
use super::frame_history::SharedEmbedder;
use super::policy::{Observation, Reading};
use crate::env;
use crate::language::instruction::normalise;
use crate::language::vocabulary::Vocabulary;
use crate::nets::frozen::FrameEncoder;
use crate::nets::visual::SIDE;

/// Words that an agent which reads words takes in: shorter instructions are padded and longer ones cut, so that every pass has
/// one shape.
const WORDS: usize = 128;

/// The instruction's embedding [1, embedding] or its words [1, 128], or the maps of its goal's last frames, like an observation.
///
/// # Errors
/// When the sentence encoder fails, or an agent that is shown its goal has no task to take it from.
pub(crate) fn of(
    observation: &mut Observation<'_>,
    config: &CheckpointConfig,
    visual: &dyn FrameEncoder,
    sentences: Option<&SharedEmbedder>,
    device: Device,
) -> anyhow::Result<Tensor> {
    if config.policy.goal_channels.is_some() {
        return goal_frames(observation, config.policy.history as usize, visual);
    }
    let instruction = normalise(observation.instruction);
    if config.policy.attention.is_some() {
        let mut numbers = words(config, &instruction);
        numbers.resize(WORDS, Vocabulary::PADDING);
        return Ok(Tensor::from_slice(&numbers).unsqueeze(0).to_device(device));
    }
    let sentences = sentences.context("there is no sentence encoder to read the instruction")?;
    let mut embedder = sentences.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))?;
    Ok(embedder.embed(&[&instruction])?.to_device(device).to_kind(Kind::Float))
}

/// How much of an instruction the agent reads; nothing where it is shown its goal, or the sentence encoder fails.
pub(crate) fn reading(
    instruction: &str,
    config: &CheckpointConfig,
    sentences: Option<&SharedEmbedder>,
) -> Option<Reading> {
    let instruction = normalise(instruction);
    match (&config.policy.goal_channels, &config.policy.attention) {
        (Some(_), _) => None,
        (None, Some(_)) => {
            let words = words(config, &instruction).len();
            Some(Reading { tokens: words.min(WORDS), cut: words.saturating_sub(WORDS) })
        }
        (None, None) => {
            let count = sentences?.lock().ok()?.encoder().tokens(&instruction).ok()?;
            Some(Reading { tokens: count.used, cut: count.truncated })
        }
    }
}

/// The numbers of an instruction's words.
fn words(config: &CheckpointConfig, instruction: &str) -> Vec<i64> {
    Vocabulary::new(config.vocabulary.clone().unwrap_or_default()).numbers(instruction)
}

/// Zeros of the same shape, for an empty slot.
pub(crate) fn blank(config: &CheckpointConfig, device: Device) -> Tensor {
    let (policy, features) = (&config.policy, config.features());
    match (policy.goal_channels, &policy.attention) {
        (Some(_), _) => Tensor::zeros([1, policy.history * features, SIDE, SIDE], (Kind::Float, device)),
        (None, Some(_)) => Tensor::zeros([1, WORDS as i64], (Kind::Int64, device)),
        (None, None) => Tensor::zeros([1, policy.embedding], (Kind::Float, device)),
    }
}

fn goal_frames(observation: &mut Observation<'_>, history: usize, visual: &dyn FrameEncoder) -> anyhow::Result<Tensor> {
    let name = observation.environment.name().to_owned();
    let house = observation.environment.house();
    let house = house.with_context(|| format!("the agent is shown its goal by House's expert, and this is {name}"))?;
    let images: Vec<Vec<u8>> = env::goal_frames(&house, history)?.iter().map(|frame| visual.image(frame)).collect();
    let missing = history - images.len();
    let stacked: Vec<Vec<u8>> = (0..history).map(|i| images[i.saturating_sub(missing)].clone()).collect();
    Ok(visual.encode(&stacked).flatten(0, 1).unsqueeze(0))
}
