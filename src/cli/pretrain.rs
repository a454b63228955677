//! `sprint pretrain`: trains an agent on a dataset.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use super::controlled::{ControlledProgress, ControlledRun};
use super::exit_status::ExitStatus;
use super::progress::Progress;
use super::stop;
use super::streams::say;
use super::validate::validate;
use crate::control::Kind;
use crate::nets::device::best_device;
use crate::nets::resnet18;
use crate::train::in_training_eval::InTrainingEval;
use crate::train::memory_agent::MemoryTraining;
use crate::train::memory_agent::preset::MemoryPreset;
use crate::train::memory_need;
use crate::train::preset::{Preset, VisualBackbone};
use crate::train::pretrain::{Pretraining, Sentences, Trained};

/// Trains an agent.
#[derive(Args)]
pub(crate) struct Pretrain {
    /// Dataset folders
    #[arg(required = true, num_args = 1..)]
    data: Vec<PathBuf>,
    /// A method: sprint, l-bc, iql-primitive, am, l-bc-transformer, sprint-no-chain, sprint-no-agg, sprint-concat-agg, sprint-llm-chain, l-bc-agg, sprint-memory; or a preset's
    /// file, which may extend one of these
    #[arg(long)]
    preset: String,
    /// A size other than the preset's own, which suits two CPU cores: paper, narrow (about half as wide), or a
    /// file of such values, which may extend one of these
    #[arg(long)]
    size: Option<String>,
    /// The checkpoint folder to write
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Go on with the training that was begun there
    #[arg(long)]
    resume: bool,
    /// Use this checkpoint's visual encoder instead of training one
    #[arg(long, value_name = "DIR")]
    visual_from: Option<PathBuf>,
    /// Start from this checkpoint's policy instead of a fresh one; of an agent with a memory it is taken as it is, with the
    /// detector, and the critic alone is trained
    #[arg(long, value_name = "DIR")]
    policy_from: Option<PathBuf>,
    /// Start from this checkpoint's critic instead of a fresh one
    #[arg(long, value_name = "DIR")]
    critic_from: Option<PathBuf>,
    /// Steps of the visual encoder's training, instead of the preset's
    #[arg(long, value_name = "N")]
    encoder_steps: Option<u64>,
    /// Steps of the policy's training, instead of the preset's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Compute each update in so many parts, one after the other, which takes less memory; batch norms then see a part at a time
    /// [default: as few as fit]
    #[arg(long, value_name = "N")]
    parts: Option<usize>,
    /// Let the agent play these tasks while it trains: not those it will be evaluated on
    #[arg(long, value_name = "FILE")]
    trials: Option<PathBuf>,
    /// Steps between two trials
    #[arg(long, value_name = "N", default_value_t = 1000, requires = "trials", value_parser = clap::value_parser!(u64).range(1..))]
    trials_every: u64,
    /// Only the first N tasks of the trials
    #[arg(long, value_name = "N", requires = "trials")]
    trials_limit: Option<usize>,
    /// A sentence encoder's folder, or its name in SPRINT_HOME/encoders [default: all-MiniLM-L6-v2, which `make setup` fetched]
    #[arg(long, value_name = "DIR|NAME")]
    encoder: Option<PathBuf>,
}

impl Pretrain {
    /// Trains, measures the result, and writes its model card.
    ///
    /// # Errors
    /// When data or an earlier state cannot be read, or the checkpoint not be written.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        if let Some(preset) = MemoryPreset::named(&self.preset)? {
            return self.run_memory(preset);
        }
        let mut preset = Preset::sized(&self.preset, self.size.as_deref())?;
        if let Some(steps) = self.encoder_steps {
            preset.visual_encoder_training.optimisation.steps = steps;
        }
        if let Some(steps) = self.steps {
            preset.training.steps = steps;
        }
        let device = best_device();
        let begun = if self.resume { Preset::parts_of(&self.out.join("training/preset.toml"))? } else { None };
        let features = match preset.visual_backbone {
            VisualBackbone::House => preset.visual_encoder.features(),
            VisualBackbone::ResNet18 => resnet18::FEATURES,
        };
        if let Some(parts) = self.parts {
            preset.parts = parts;
            preset.check_parts()?;
        }
        let (parts, told) = memory_need::plan(&preset, features, device, self.parts.or(begun))?;
        preset.parts = parts;
        preset.check_parts()?;
        say(&told);
        let sentences = match preset.policy.reads_sentences() {
            true => Some(Sentences::open(self.encoder.as_deref(), device)?),
            false => None,
        };
        let embedder = sentences.as_ref().map(|sentences| sentences.embedder.clone());
        let pretraining = Pretraining {
            preset,
            data: self.data,
            out: self.out,
            resume: self.resume,
            visual_from: self.visual_from,
            policy_from: self.policy_from,
            critic_from: self.critic_from,
            in_training_eval: self.trials.map(|tasks| InTrainingEval {
                tasks,
                limit: self.trials_limit,
                every: self.trials_every,
            }),
            sentences,
            device,
        };
        let stop = stop::on_signals()?;
        let mut progress = Progress::new();
        let run = ControlledRun::listen(Kind::Pretrain, &pretraining.out, &stop, &Arc::default());
        let mut logger = ControlledProgress { inner: &mut progress, control: &run.control };
        if pretraining.run(&mut logger, &stop)? == Trained::Stopped {
            progress.end();
            say("stopped; --resume goes on from here");
            return Ok(ExitStatus::Interrupted);
        }
        validate(&pretraining.out, &pretraining.preset.validation, embedder, progress)?;
        Ok(ExitStatus::Ok)
    }

    fn run_memory(self, preset: MemoryPreset) -> anyhow::Result<ExitStatus> {
        let unused = [
            ("--size", self.size.is_some()),
            ("--critic-from", self.critic_from.is_some()),
            ("--trials", self.trials.is_some()),
            ("--encoder", self.encoder.is_some()),
            ("--parts", self.parts.is_some()),
            ("--steps", self.steps.is_some()),
            ("--encoder-steps", self.encoder_steps.is_some()),
        ];
        if let Some((option, _)) = unused.iter().find(|(_, given)| *given) {
            anyhow::bail!("{option} says nothing to the preset {}: a preset's file that extends it can", preset.name);
        }
        let device = best_device();
        let training = MemoryTraining {
            preset,
            data: self.data,
            out: self.out,
            resume: self.resume,
            detector_from: self.visual_from,
            chooser_from: self.policy_from,
            device,
        };
        let stop = stop::on_signals()?;
        let mut progress = Progress::new();
        let run = ControlledRun::listen(Kind::Pretrain, &training.out, &stop, &Arc::default());
        let mut logger = ControlledProgress { inner: &mut progress, control: &run.control };
        if training.run(&mut logger, &stop)? == Trained::Stopped {
            progress.end();
            say("stopped; --resume goes on from here");
            return Ok(ExitStatus::Interrupted);
        }
        validate(&training.out, &training.preset.validation, None, progress)?;
        Ok(ExitStatus::Ok)
    }
}
