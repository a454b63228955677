//! An exported policy that acts.

use std::path::Path;
use std::sync::{Arc, Mutex};

use anyhow::{Context, anyhow, ensure};
use sha2::{Digest, Sha256};

use super::answer::Answer;
use super::format::{self, Format};
use super::frame_stack::FrameStack;
use super::inputs::{planes, stack, tokens};
use super::model::{Input, Model};
use super::spec::{InstructionSpec, PolicySpec};
use super::{house, remote};
use crate::agent::decision::Decision;
use crate::agent::frame_history::SharedEmbedder;
use crate::agent::policy::{Decisions, Observation, Policy, PolicyState, each_alone};
use crate::agent::policy_source::PolicySource;
use crate::agent::select::Selection;
use crate::agent::sentence_encoders;
use crate::agent::value_estimates::Values;
use crate::data::{json, plain_file};
use crate::nets::device;
use crate::nets::embedding_cache::Embedder;

/// An exported policy.
pub(crate) struct ExportedPolicy {
    name: String,
    spec: PolicySpec,
    model: Box<dyn Model>,
    /// The encoder of instructions, where the policy takes an embedding.
    sentences: Option<SharedEmbedder>,
    /// What was made of the last instruction.
    read: Option<(String, Input)>,
    samples: bool,
    state: FrameStack,
}

impl ExportedPolicy {
    /// The policy of a file; it draws its actions where `samples`, else it takes the likeliest.
    ///
    /// # Errors
    /// When the file or its description cannot be used; says how they do not fit.
    pub(crate) fn source(path: &Path, format: Format, samples: bool) -> anyhow::Result<PolicySource> {
        let spec = PolicySpec::beside(path)?;
        let chosen = hash(path)?;
        let sentences = match &spec.instruction {
            Some(InstructionSpec::Embedding { encoder, size }) => Some(open_encoder(encoder, *size)?),
            _ => None,
        };
        let stem = path.file_stem().map_or_else(|| "policy".into(), |name| name.to_string_lossy());
        let name = format!("{}:{stem}", format.name());
        let make = {
            let (path, name, chosen) = (path.to_owned(), name.clone(), chosen.clone());
            move || -> anyhow::Result<Box<dyn Policy>> {
                let model = format::open(&path, format, &spec)?;
                // What was opened is what the run's manifest names.
                ensure!(hash(&path)? == chosen, "{}: it was replaced while the run was under way", path.display());
                let (name, spec, sentences) = (name.clone(), spec.clone(), sentences.clone());
                let state = FrameStack::new(0);
                Ok(Box::new(ExportedPolicy { name, spec, model, sentences, read: None, samples, state }))
            }
        };
        // What does not fit is told before anything is played.
        make()?;
        Ok(PolicySource::of(&name, Arc::new(make)).with_hash(Some(chosen)))
    }

    fn decide(&mut self, here: &mut Observation<'_>) -> anyhow::Result<Decision> {
        let decided = self.decide_in(here);
        decided.map_err(|error| anyhow!("{} at step {}: {error:#}", self.name, here.step))
    }

    fn decide_in(&mut self, here: &mut Observation<'_>) -> anyhow::Result<Decision> {
        let planes = planes(here.environment.frame()?, &self.spec.frames)?;
        self.state.look(planes, here.step, self.spec.frames.history);
        let frames = Input::Floats(stack(&self.state.seen, &self.spec.frames));
        let inputs = std::iter::once(frames).chain(self.instruction(here.instruction)?).collect();
        let answer = Answer::read(format::run(self.model.as_mut(), &self.spec, inputs)?, &self.spec)?;
        let selection = if self.samples { Selection::Sample(&mut self.state.rng) } else { Selection::Greedy };
        let candidates = here.environment.legal_actions()?;
        let decision = match here.environment.own() {
            Some(view) => remote::decide(&answer, &self.spec, &view, selection)?,
            None => house::decide(&answer, &self.spec, &candidates, selection)?,
        };
        let values = answer.value.map(|state| Values { state, choices: Vec::new() });
        Ok(Decision { values, ..decision })
    }

    /// The instruction as the policy takes it, if it reads any.
    fn instruction(&mut self, text: &str) -> anyhow::Result<Option<Input>> {
        if let Some((known, input)) = &self.read
            && known == text
        {
            return Ok(Some(input.clone()));
        }
        let input = match (&self.spec.instruction, &self.sentences) {
            (Some(InstructionSpec::Tokens { vocabulary, length }), _) => {
                Input::Tokens(tokens(text, vocabulary, *length))
            }
            (Some(InstructionSpec::Embedding { .. }), Some(sentences)) => {
                let mut embedder = sentences.lock().map_err(|_| anyhow!("the sentence encoder failed earlier"))?;
                Input::Floats(Vec::try_from(embedder.embed(&[text])?.reshape([-1]).to_device(tch::Device::Cpu))?)
            }
            _ => return Ok(None),
        };
        self.read = Some((text.to_owned(), input.clone()));
        Ok(Some(input))
    }
}

/// The encoder that a description names.
fn open_encoder(name: &str, size: usize) -> anyhow::Result<SharedEmbedder> {
    device::set_threads(1);
    let folder = sentence_encoders::folder_of(Path::new(name));
    let embedder = Embedder::open(&folder, device::best_device()).context("instruction.embedding.encoder")?;
    let width = embedder.encoder().width();
    ensure!(width == size, "instruction.embedding.size is {size}, but sentences of {name} have {width} numbers");
    Ok(Arc::new(Mutex::new(embedder)))
}

/// SHA-256 over a policy's description and file.
///
/// # Errors
/// When one of them cannot be read.
pub(crate) fn hash(path: &Path) -> anyhow::Result<String> {
    let mut digest = Sha256::new();
    for path in [&PolicySpec::path_of(path), path] {
        digest.update(plain_file::read(path).with_context(|| format!("cannot read {}", path.display()))?);
    }
    Ok(json::hex(&digest.finalize()))
}

impl Policy for ExportedPolicy {
    fn name(&self) -> &str {
        &self.name
    }

    fn slots(&self) -> usize {
        1
    }

    fn check_fits(&self, start: &mut Observation<'_>) -> anyhow::Result<()> {
        match start.environment.own() {
            Some(view) => remote::check(&self.spec, view.space)?,
            None => house::check(&self.spec)?,
        }
        planes(start.environment.frame()?, &self.spec.frames).map(drop)
    }

    fn reset(&mut self, _slot: usize, seed: u64) {
        self.state = FrameStack::new(seed);
    }

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        each_alone(observations, |_, here| self.decide(here))
    }

    fn state(&self, _slot: usize) -> PolicyState {
        PolicyState::Exported(Box::new(self.state.clone()))
    }

    fn restore(&mut self, _slot: usize, state: PolicyState) {
        if let PolicyState::Exported(state) = state {
            self.state = *state;
        }
    }

    fn set_sampling(&mut self, samples: bool) {
        self.samples = samples;
    }
}
