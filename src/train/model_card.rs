//! The model card: a checkpoint's `README.md`, written from its configuration and what was measured.

use std::fmt::Write;

use super::validation::ValidationReport;
use crate::agent::DecisionRule;
use crate::agent::config::{CheckpointConfig, Provenance, SourceCheckpoint};
use crate::agent::memory_agent::config::{CriticProvenance, MemoryConfig, MemoryProvenance};
use crate::agent::memory_agent::eyes::Sight;
use crate::nets::precision::Precision;

fn method(config: &CheckpointConfig) -> &'static str {
    match config.method.as_deref() {
        Some("iql") => "implicit Q-learning",
        Some("sprint") => "implicit Q-learning with skills chained across trajectories",
        Some("transformer-bc" | "et") => "behaviour cloning of a transformer over words and frames",
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
            config.sentence_encoder.as_ref().map_or("unnamed", |encoder| &encoder.name),
            policy.embedding
        ),
    }
}

/// How it decides, in words, where not by the logits alone.
fn deciding(config: &CheckpointConfig) -> String {
    if config.decision == DecisionRule::Paper {
        let guard = if config.loop_guard { "with a loop guard" } else { "without a loop guard" };
        return format!(" It takes the likeliest possible action, then its class, {guard}.");
    }
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
    let unguarded = (!config.loop_guard).then(|| "no loop guard keeps it from repeating itself".to_owned());
    let ways: Vec<String> = adjusted.into_iter().chain(scaled).chain(unguarded).collect();
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
         {origin}\n\n",
        history = config.policy.history,
        visual_encoder = visual_encoder(config),
        conditioning = conditioning(config),
        deciding = deciding(config),
        origin = origin(config),
    );
    let command = if config.provenance.averaged_checkpoints.is_some() { "average" } else { "pretrain" };
    text.push_str(&measured(command, report));
    text.push_str(
        "\n## Limits\n\n\
         It knows only what its last frames show, and the houses and words of its demonstrations. It has no stop \
         action: it does not say when a task is done.\n",
    );
    text
}

/// The card of an agent with a memory.
pub(crate) fn memory_card(name: &str, config: &MemoryConfig, report: &ValidationReport) -> String {
    let MemoryProvenance {
        preset,
        detector_dataset,
        detector_steps,
        dataset,
        trajectories,
        chooser_steps,
        critic,
        seed,
    } = &config.provenance;
    let critic = critic.as_ref().map_or_else(String::new, |critic| {
        let CriticProvenance { dataset, trajectories, steps } = critic;
        format!(" Its critic, {steps} steps on {trajectories} trajectories (datasets `{dataset}`), says what each choice is worth.")
    });
    let sight = match config.sight {
        Sight::Detector => format!(
            "It finds things with a detector ({detector_steps} steps on datasets `{detector_dataset}`) in a frame with depth"
        ),
        Sight::Simulator => "The simulator says what is in view: an ablation".into(),
    };
    let text = format!(
        "# {name}\n\n\
         A household agent that follows typed instructions. It reads the instruction as subtasks (`sprint read`). {sight}, \
         keeps them with the floor on a map of its own, and chooses what to set out to: an interaction with something that it \
         remembers, the edge of what it has seen, a turn or a look. It says when it is done.\n\n\
         Trained with the preset `{preset}` on {trajectories} demonstrations (datasets `{dataset}`): {chooser_steps} steps of \
         the chooser, seed {seed}.{critic}\n\n"
    );
    text + &measured("pretrain", report)
}

/// The table of what was measured; `command` measured it.
fn measured(command: &str, report: &ValidationReport) -> String {
    let mut text = format!(
        "## Measured in generated houses that no training saw\n\n\
         `sprint {command}` measures this at its end.\n\n\
         | | |\n|---|---|\n\
         | one-skill tasks solved, within twice the expert's steps | {agent} |\n\
         | the same tasks by chance | {random} |\n",
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
    text
}
