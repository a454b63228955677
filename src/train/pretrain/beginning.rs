//! What a training begins with: fresh networks, or another checkpoint's.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use anyhow::{Context, bail};
use tch::nn::VarStore;

use super::Pretraining;
use crate::agent::checkpoint::Networks;
use crate::agent::config::Config;
use crate::data::ensure_free;
use crate::nets::visual::HouseEncoder;
use crate::nets::visual_encoder::VisualEncoder;
use crate::nets::weights;
use crate::train::frame_store::FrameStore;
use crate::train::metrics::Report;
use crate::train::preset::Sight;
use crate::train::training_state::TrainingState;
use crate::train::visual;

impl Pretraining {
    /// The networks before their first step: fresh ones, with what other checkpoints were asked for.
    pub(crate) fn networks(&self) -> anyhow::Result<Networks> {
        self.check_sentences()?;
        tch::manual_seed(self.preset.seed as i64);
        let networks = Networks::new(self.eyes()?, &self.preset.policy, self.preset.critic.as_ref(), self.device);
        if let Some(folder) = &self.visual_from {
            self.see_as(folder, &networks)?;
        }
        if let Some(folder) = &self.policy_from {
            self.act_as(folder, &networks)?;
        }
        if let Some(folder) = &self.critic_from {
            self.judge_as(folder, &networks)?;
        }
        Ok(networks)
    }

    /// Whether `out` holds a training that can be taken up. That is done when it is asked for, and no other folder that holds
    /// anything is trained into.
    pub(crate) fn check_out(&self, training: &Path) -> anyhow::Result<bool> {
        let begun = ["visual.safetensors", "state.safetensors"].iter().any(|state| training.join(state).exists());
        if begun && !self.resume {
            bail!("{} holds a training already: use --resume, or another folder", self.out.display());
        }
        // A training that is resumed may have kept a checkpoint before its first state.
        let resumed = self.resume && training.exists();
        if !(begun || resumed) {
            ensure_free::check(&self.out)?;
        }
        Ok(begun)
    }

    /// A training that ended before it saved a state is begun anew: what it said of itself is taken back.
    pub(crate) fn take_back(training: &Path) -> anyhow::Result<()> {
        let said = ["preset.toml", "progress.jsonl"].map(|file| training.join(file));
        for file in said.iter().filter(|file| file.exists()) {
            std::fs::remove_file(file).with_context(|| file.display().to_string())?;
        }
        Ok(())
    }

    /// An episodic transformer embeds words by itself; all others are told what the sentence encoder makes of a text.
    fn check_sentences(&self) -> anyhow::Result<()> {
        let embedder = self.sentences.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))?;
        let (own, width) = (self.preset.policy.embedding, embedder.encoder().width());
        anyhow::ensure!(
            own == width as i64 || self.preset.policy.attention.is_some(),
            "the preset's policy.embedding is {own}, the sentence encoder's width is {width}"
        );
        Ok(())
    }

    /// What the agent will see through: a House encoder with fresh weights, or ResNet-18.
    fn eyes(&self) -> anyhow::Result<VisualEncoder> {
        match self.preset.eyes {
            Sight::House => Ok(VisualEncoder::house(&self.preset.visual, self.device)),
            Sight::ResNet18 => VisualEncoder::resnet18(&VisualEncoder::resnet18_file(), self.device),
        }
    }

    /// Trains the visual encoder, where there is one and no other checkpoint's was asked for; false when it was stopped.
    pub(crate) fn train_visual(
        &self,
        networks: &Networks,
        (frame_store, data): (&FrameStore, &str),
        report: &mut dyn Report,
        stop: &AtomicBool,
    ) -> anyhow::Result<bool> {
        let (VisualEncoder::House { store: own, .. }, None) = (&networks.eyes, &self.visual_from) else {
            return Ok(true);
        };
        let path = self.out.join("training/visual.safetensors");
        let state = TrainingState { path: &path, identity: &self.visual_identity(data) };
        // The heads live in a store of their own shape, so the trained encoder is copied out of it.
        let mut store = VarStore::new(self.device);
        let encoder = HouseEncoder::new(&(store.root() / "encoder"), &self.preset.visual);
        let finished = visual::train(&store, &encoder, frame_store, &self.preset, state, report, stop)?;
        store.freeze();
        copy(&store, "encoder.", own)?;
        Ok(finished)
    }

    /// Takes a checkpoint's visual encoder.
    fn see_as(&self, folder: &Path, networks: &Networks) -> anyhow::Result<()> {
        let own =
            networks.eyes.store().context("the preset's eyes are ResNet-18: there is no visual encoder to take")?;
        let given = self.given(folder)?.1.eyes;
        copy(given.store().context("its eyes are no House encoder")?, "", own)
    }

    /// Begins with a checkpoint's policy.
    fn act_as(&self, folder: &Path, networks: &Networks) -> anyhow::Result<()> {
        let (config, given) = self.told_alike(folder)?;
        let (found, own) = (&config.policy, &self.preset.policy);
        let file = folder.join("config.json");
        anyhow::ensure!(found.fits(own), "{}: policy is {found:?}, the preset's is {own:?}", file.display());
        copy(&given.policy_store, "", &networks.policy_store)
    }

    /// Begins with a checkpoint's critic.
    fn judge_as(&self, folder: &Path, networks: &Networks) -> anyhow::Result<()> {
        let own = self.preset.critic.as_ref().context("the preset's method has no critic to begin with another's")?;
        let file = folder.join("config.json");
        let found = Config::read(folder)?.critic.with_context(|| format!("{}: there is no critic", file.display()))?;
        let given = self.told_alike(folder)?.1;
        anyhow::ensure!(found.fits(own), "{}: critic is {found:?}, the preset's is {own:?}", file.display());
        match (&given.critic, &networks.critic) {
            (Some(given), Some(own)) => copy(&given.online_store, "", &own.online_store),
            _ => Ok(()),
        }
    }

    /// A checkpoint that sees and is told as this training's agent.
    fn told_alike(&self, folder: &Path) -> anyhow::Result<(Config, Networks)> {
        let (config, given) = self.given(folder)?;
        let own = self.config("", 0, 0)?.sentence_encoder;
        let found = &config.sentence_encoder;
        anyhow::ensure!(
            found.digest == own.digest,
            "{}: sentence_encoder is {} ({}), this training's is {} ({})",
            folder.join("config.json").display(),
            found.name,
            found.digest,
            own.name,
            own.digest
        );
        Ok((config, given))
    }

    /// A checkpoint whose visual encoder is of the preset's kind and size.
    fn given(&self, folder: &Path) -> anyhow::Result<(Config, Networks)> {
        let config = Config::read(folder)?;
        let file = folder.join("config.json");
        let (found, own) = (config.visual.as_ref(), self.visual());
        anyhow::ensure!(found == own, "{}: visual is {found:?}, the preset's is {own:?}", file.display());
        let networks = Networks::load(folder, &config, self.device)?;
        Ok((config, networks))
    }
}

/// Copies the tensors of one store, those under `prefix`, over another's.
fn copy(from: &VarStore, prefix: &str, to: &VarStore) -> anyhow::Result<()> {
    weights::copy(&from.variables().into_iter().collect(), prefix, to)
}
