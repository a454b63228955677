//! The model card: a checkpoint's `README.md`, written from its configuration and what was measured.

use std::fmt::Write;

use super::validation::ValidationReport;
use crate::agent::config::{CheckpointConfig, Provenance, SourceCheckpoint};
use crate::nets::precision::Precision;

fn method(config: &CheckpointConfig) -> &'static str {
    match config.method.as_deref() {
        Some("iql") => "implicit Q-learning",
        Some("sprint") => "implicit Q-learning with skills chained across trajectories",
        Some("et") => "behaviour cloning of an Episodic Transformer",
        Some("am") => "Actionable Models: it is shown the state to reach",
        _ => "behaviour cloning",
    }
}

/// The visual encoder's sizes, in words.
fn visual_encoder(config: &CheckpointConfig) -> String {
    match &config.visual_encoder {
        Some(spec) => format!(
            "{input} x {input} pixels to {features} x 7 x 7, channels {channels:?}",
            input = spec.image_size,
            features = spec.features(),
            channels = spec.channels
        ),
        None => "ResNet-18 as torchvision publishes it, 224 x 224 pixels to 512 x 7 x 7".into(),
    }
}

/// What its policy is conditioned on, in words.
fn conditioning(config: &CheckpointConfig) -> String {
    let policy = &config.policy;
    match (&policy.goal_channels, &policy.attention) {
        (Some(_), _) => "is shown the last frames of the state to reach".into(),
        (None, Some(_)) => "reads the instruction word by word".into(),
        (None, None) => format!(
            "reads the instruction as a sentence embedding ({}, {} numbers)",
            config.sentence_encoder.name, policy.embedding
        ),
    }
}

/// How it decides, in words, where not by the logits alone.
fn deciding(config: &CheckpointConfig) -> String {
    let strength = config.logit_adjustment.as_ref().map(|adjustment| adjustment.strength).filter(|&it| it > 0.0);
    let adjusted = strength.map(|strength| {
        format!(
            "{:.0} % of the log frequency of each action among its labels is taken off the action's logit \
             (`logit_adjustment`)",
            100.0 * strength
        )
    });
    let scaled = config.advantage_scale.map(|scale| {
        format!("a choice of advantage A by its critic is exp({scale} A) times as likely (`advantage_scale`)")
    });
    let ways: Vec<String> = adjusted.into_iter().chain(scaled).collect();
    if ways.is_empty() { String::new() } else { format!(" When it decides, {}.", ways.join(", and ")) }
}

/// Method, data, steps and seed, in words.
fn origin(config: &CheckpointConfig) -> String {
    let Provenance { preset, dataset, trajectories, seed, policy_steps, precision, .. } = &config.provenance;
    let method = method(config);
    let width = match precision {
        Precision::Full => "",
        Precision::Mixed => " in mixed precision",
    };
    let encoder = match (&config.visual_encoder, &config.provenance.visual_encoder_from) {
        (Some(_), None) => format!("{} steps of the visual encoder, ", config.provenance.visual_encoder_steps),
        _ => String::new(),
    };
    let trained = match config.provenance.averaged_checkpoints {
        None => format!(
            "Trained with the preset `{preset}` ({method}) on {trajectories} demonstrations (datasets `{dataset}`): \
             {encoder}{policy_steps} steps of the policy{width}, seed {seed}."
        ),
        Some(count) => format!(
            "Its policy is the mean of {count} checkpoints' (presets `{preset}`, datasets `{dataset}`); all else is the first \
             one's, which had ({method}) {encoder}{policy_steps} steps of the policy{width} on {trajectories} demonstrations, \
             seed {seed}."
        ),
    };
    trained + &source_checkpoints(&config.provenance)
}

/// The checkpoints that its networks came from, in words.
fn source_checkpoints(provenance: &Provenance) -> String {
    let initialised = |network: &str, source: &Option<SourceCheckpoint>| {
        source.as_ref().map(|SourceCheckpoint { name, preset, policy_steps }| {
            format!(
                " Its {network} was initialised from that of `{name}` (preset `{preset}`, {policy_steps} steps of the policy)."
            )
        })
    };
    let steps = provenance.visual_encoder_steps;
    let encoder = provenance.visual_encoder_from.as_ref();
    let encoder = encoder.map(|source| format!(" Its visual encoder is that of `{}` ({steps} steps).", source.name));
    let policy = initialised("policy", &provenance.policy_initialised_from);
    let critic = initialised("critic", &provenance.critic_initialised_from);
    [encoder, policy, critic].into_iter().flatten().collect()
}

/// The card in Markdown; `name` is the checkpoint folder's.
pub(crate) fn card(name: &str, config: &CheckpointConfig, report: &ValidationReport) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "# {name}\n\n\
         A household agent that follows typed instructions. It sees the last {history} frames through a frozen visual encoder \
         ({visual_encoder}), {conditioning} and chooses one of 12 actions and one of 82 object classes.{deciding}\n\n\
         {origin}\n\n\
         ## Measured in generated houses that no training saw\n\n\
         `sprint {command}` measures this at its end.\n\n\
         | | |\n|---|---|\n\
         | one-skill tasks solved, within twice the expert's steps | {agent} |\n\
         | the same tasks by chance | {random} |\n",
        history = config.policy.history,
        visual_encoder = visual_encoder(config),
        conditioning = conditioning(config),
        deciding = deciding(config),
        origin = origin(config),
        command = if config.provenance.averaged_checkpoints.is_some() { "average" } else { "pretrain" },
        agent = report.agent,
        random = report.random,
    );
    for (skill, rate) in &report.by_skill {
        let _ = writeln!(text, "| of these, {skill} | {rate} |");
    }
    if report.follows_both.trials > 0 {
        let _ = write!(
            text,
            "| two objects in view, instructed to take one: takes that one first | {} |\n\
             | takes the other one first | {} |\n\
             | from one start, takes the one and, with the instruction swapped, the other | {} |\n",
            report.instructed_first, report.other_first, report.follows_both
        );
    }
    text.push_str(
        "\n## Limits\n\n\
         It knows only what its last frames show, and the houses and words of its demonstrations. It has no stop \
         action: it does not say when a task is done.\n",
    );
    text
}
