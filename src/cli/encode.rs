//! `sprint encode`: draws and encodes every frame of datasets ahead of a training.

use std::path::PathBuf;

use clap::Args;

use super::exit_status::ExitStatus;
use super::progress::Progress;
use super::stop;
use super::streams::say;
use crate::agent::checkpoint::Networks;
use crate::agent::config::CheckpointConfig;
use crate::data::Dataset;
use crate::language::count::counted;
use crate::nets::device::best_device;
use crate::nets::frozen::FrameEncoder;
use crate::nets::resnet18::ResNet18;
use crate::train::feature_cache::features;
use crate::train::frame_store::FrameStore;

/// Encodes datasets.
#[derive(Args)]
pub(crate) struct Encode {
    /// Dataset folders
    #[arg(required = true, num_args = 1..)]
    data: Vec<PathBuf>,
    #[command(flatten)]
    encoder: Encoder,
}

#[derive(Args)]
#[group(required = true, multiple = false)]
struct Encoder {
    /// Use this checkpoint's visual encoder
    #[arg(long, value_name = "DIR")]
    checkpoint: Option<PathBuf>,
    /// Use torchvision's ResNet-18: its weights as a safetensors file
    #[arg(long, value_name = "FILE")]
    resnet18: Option<PathBuf>,
}

impl Encode {
    /// Writes the feature maps that are missing into each dataset's cache folder.
    ///
    /// # Errors
    /// When the datasets or the encoder cannot be read, or a cache not be written.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let encoder = self.encoder.load()?;
        let datasets = self.data.iter().map(|folder| Dataset::open(folder)).collect::<anyhow::Result<Vec<_>>>()?;
        let frame_store = FrameStore::open(&datasets)?;
        let stop = stop::on_signals()?;
        let mut progress = Progress::new();
        let begun = std::time::Instant::now();
        let features = features(&*encoder, &datasets, &frame_store, &mut progress, &stop)?;
        progress.end();
        let Some(features) = features else {
            say("stopped; the same command goes on from here");
            return Ok(ExitStatus::Interrupted);
        };
        let size = (features.len() as f64 * features.width() as f64) / 1e9;
        let seconds = begun.elapsed().as_secs_f64();
        say(&format!("{}, {size:.2} GB of features, in {seconds:.0} s", counted(features.len(), "frame")));
        Ok(ExitStatus::Ok)
    }
}

impl Encoder {
    fn load(&self) -> anyhow::Result<Box<dyn FrameEncoder>> {
        let device = best_device();
        match (&self.checkpoint, &self.resnet18) {
            (Some(folder), _) => {
                Networks::load(folder, &CheckpointConfig::read(folder)?, device)?.visual_encoder.frozen()
            }
            (None, Some(file)) => Ok(Box::new(ResNet18::read(file, device)?)),
            (None, None) => anyhow::bail!("name --checkpoint or --resnet18"),
        }
    }
}
