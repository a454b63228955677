//! `sprint average`: one agent of several.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;

use super::exit_status::ExitStatus;
use super::progress::Progress;
use super::validate::validate;
use crate::agent::average::average;
use crate::agent::sentence_encoders;
use crate::data::ensure_free;
use crate::data::folder_lock::FolderLock;
use crate::nets::device::best_device;
use crate::train::preset::{Preset, ValidationSpec};

/// Averages the policies of checkpoints that were trained on from a common start; all else is the first one's. Of one
/// checkpoint it makes another that decides otherwise.
#[derive(Args)]
pub(crate) struct Average {
    /// Checkpoints; one that is named twice counts twice
    #[arg(required = true, num_args = 1.., value_name = "CHECKPOINT")]
    checkpoints: Vec<PathBuf>,
    /// How much of each action's log frequency among its labels is taken off the action's logit, 0 to 1 [default: as the first]
    #[arg(long, value_name = "STRENGTH")]
    logit_adjustment: Option<f32>,
    /// How much its critic's advantages count when it decides; 0: its policy decides alone [default: as the first]
    #[arg(long, value_name = "SCALE")]
    advantage_scale: Option<f32>,
    /// The checkpoint folder to write
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Tasks in generated houses to measure the result on, and half as many pairs of objects for agents that read to tell apart
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    validate: u32,
}

impl Average {
    /// Averages, measures the result as a training does, and writes its model card.
    ///
    /// # Errors
    /// When a checkpoint cannot be read, does not go with the first, or `out` holds one already.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        ensure_free::check(&self.out)?;
        let device = best_device();
        let (mut config, networks) = average(&self.checkpoints, device)?;
        let first = self.checkpoints[0].display();
        if let Some(strength) = self.logit_adjustment {
            config
                .set_logit_adjustment(strength)
                .with_context(|| format!("--logit-adjustment {strength} for {first}"))?;
        }
        if let Some(weight) = self.advantage_scale {
            config.set_advantage_scale(weight).with_context(|| format!("--advantage-scale {weight} for {first}"))?;
        }
        let sentences = sentence_encoders::open_for(&self.checkpoints[0], device)?;
        let _lock = FolderLock::take(&self.out)?;
        ensure_free::check(&self.out)?;
        networks.save(&self.out, &config)?;
        let tasks = self.validate as usize;
        let swaps = if config.policy.goal_channels.is_some() { 0 } else { tasks / 2 };
        let validation = ValidationSpec { tasks, swaps, ..Preset::named("sprint")?.validation };
        validate(&self.out, &validation, sentences, Progress::new())?;
        Ok(ExitStatus::Ok)
    }
}
