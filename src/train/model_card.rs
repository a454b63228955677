//! The model card: a checkpoint's `README.md`, written from its configuration and what was measured.

use std::fmt::Write;

use super::validation::ValidationReport;
use crate::agent::config::{Beginning, Config, Provenance};
use crate::nets::precision::Precision;

/// The method in words.
fn method(config: &Config) -> &'static str {
    match config.method.as_deref() {
        Some("iql") => "implicit Q-learning",
        Some("sprint") => "implicit Q-learning with skills chained across trajectories",
        Some("et") => "behaviour cloning of an Episodic Transformer",
        Some("am") => "Actionable Models: it is shown the state to reach",
        _ => "behaviour cloning",
    }
}

/// What it sees through, in words.
fn eyes(config: &Config) -> String {
    match &config.visual {
        Some(visual) => format!(
            "{input} x {input} pixels to {features} x 7 x 7, channels {channels:?}",
            input = visual.input,
            features = visual.features(),
            channels = visual.channels
        ),
        None => "ResNet-18 as torchvision publishes it, 224 x 224 pixels to 512 x 7 x 7".into(),
    }
}

/// What it is told, in words.
fn told(config: &Config) -> String {
    let policy = &config.policy;
    match (&policy.goal, &policy.attention) {
        (Some(_), _) => "is shown the last frames of the state to reach".into(),
        (None, Some(_)) => "reads the instruction word by word".into(),
        (None, None) => format!(
            "reads the instruction as a sentence embedding ({}, {} numbers)",
            config.sentence_encoder.name, policy.embedding
        ),
    }
}

/// How it decides, in words, where not by the logits alone.
fn deciding(config: &Config) -> String {
    let logit_adjustment = config
        .logit_adjustment
        .as_ref()
        .map(|logit_adjustment| logit_adjustment.strength)
        .filter(|&strength| strength > 0.0);
    let balanced = logit_adjustment.map(|strength| {
        format!(
            "{:.0} % of what is merely frequent is taken off the actions' logits (`logit_adjustment`)",
            100.0 * strength
        )
    });
    let weighed = config.advantage_scale.map(|weight| {
        format!("a choice of advantage A by its critic is exp({weight} A) times as likely (`advantage_scale`)")
    });
    let ways: Vec<String> = balanced.into_iter().chain(weighed).collect();
    if ways.is_empty() { String::new() } else { format!(" When it decides, {}.", ways.join(", and ")) }
}

/// What it learned from, in words.
fn origin(config: &Config) -> String {
    let Provenance { preset, dataset, trajectories, seed, visual_steps, policy_steps, precision, averaged, .. } =
        &config.provenance;
    let method = method(config);
    let width = match precision {
        Precision::Full => "",
        Precision::Mixed => " in mixed precision",
    };
    let seen = match (&config.visual, &config.provenance.visual_from) {
        (Some(_), None) => format!("{visual_steps} steps of the visual encoder, "),
        _ => String::new(),
    };
    let trained = match averaged {
        None => format!(
            "Trained with the preset `{preset}` ({method}) on {trajectories} demonstrations (datasets `{dataset}`): \
             {seen}{policy_steps} steps of the policy{width}, seed {seed}."
        ),
        Some(count) => format!(
            "Its policy is the mean of {count} checkpoints' (presets `{preset}`, datasets `{dataset}`); all else is the first \
             one's, which had ({method}) {seen}{policy_steps} steps of the policy{width} on {trajectories} demonstrations, \
             seed {seed}."
        ),
    };
    trained + &beginnings(&config.provenance)
}

/// Whose networks it began with, in words.
fn beginnings(provenance: &Provenance) -> String {
    let whose = |beginning: &Beginning| {
        let Beginning { name, preset, policy_steps } = beginning;
        format!("`{name}` (preset `{preset}`, {policy_steps} steps of the policy)")
    };
    let eyes = provenance.visual_from.as_ref();
    let eyes =
        eyes.map(|eyes| format!(" It sees through the eyes of `{}` ({} steps).", eyes.name, provenance.visual_steps));
    let policy = provenance.policy_from.as_ref().map(|from| format!(" Its policy began as that of {}.", whose(from)));
    let critic = provenance.critic_from.as_ref().map(|from| format!(" Its critic began as that of {}.", whose(from)));
    [eyes, policy, critic].into_iter().flatten().collect()
}

/// The card's text.
pub fn card(name: &str, config: &Config, findings: &ValidationReport) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "# {name}\n\n\
         A household agent that follows typed instructions. It sees the last {history} frames through a frozen visual encoder \
         ({eyes}), {told} and chooses one of 12 actions and one of 82 object classes.{deciding}\n\n\
         {origin}\n\n\
         ## Measured in generated houses that no training saw\n\n\
         `sprint {command}` measures this at its end.\n\n\
         | | |\n|---|---|\n\
         | one-skill tasks solved, within twice the expert's steps | {agent} |\n\
         | the same tasks by chance | {random} |\n",
        history = config.policy.history,
        eyes = eyes(config),
        told = told(config),
        deciding = deciding(config),
        origin = origin(config),
        command = if config.provenance.averaged.is_some() { "average" } else { "pretrain" },
        agent = findings.agent,
        random = findings.random,
    );
    for (skill, rate) in &findings.by_skill {
        let _ = writeln!(text, "| of these, {skill} | {rate} |");
    }
    if findings.swapped.trials > 0 {
        let _ = write!(
            text,
            "| two objects in view, told to take one: takes that one first | {} |\n\
             | takes the other one first | {} |\n\
             | from one start, takes the one and, with the instruction swapped, the other | {} |\n",
            findings.named, findings.other, findings.swapped
        );
    }
    text.push_str(
        "\n## Limits\n\n\
         It knows only what its last frames show, and the houses and words of its demonstrations. It has no sign for being \
         done.\n",
    );
    text
}
