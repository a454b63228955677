//! A language model's folder: its tokenizer and OPT, which goes on with texts and says how likely one is after another.

#[cfg(test)]
mod tests;

use std::path::Path;

use anyhow::{anyhow, ensure};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};
use tch::{Device, Kind, Tensor};
use tokenizers::Tokenizer;

use super::opt::{KeyValues, Opt};
use super::opt_config::OptConfig;
use super::padded_batch::PaddedBatch;
use super::sampling;
use super::{opt_tokenizer, opt_weights};
use crate::language::maker::Sampling;

/// A causal language model with the beginning that its prompts share.
pub(crate) struct LanguageModel {
    tokenizer: Tokenizer,
    /// Put before every text where the tokenizer's file does not say what is.
    start: Option<u32>,
    end: Option<u32>,
    longest: usize,
    opt: Opt,
    digest: String,
    beginning: Vec<u32>,
    /// Of the beginning's tokens, one row.
    beginning_read: KeyValues,
}

/// A text to go on with, and what seeds the draw.
pub(crate) struct Prompt {
    pub(crate) text: String,
    pub(crate) seed: u64,
}

/// What a model went on with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Completion {
    pub(crate) text: String,
    /// Whether the model ended it; otherwise it is cut off.
    pub(crate) ended: bool,
}

impl LanguageModel {
    /// Reads an OPT folder as its authors publish it, with weights as safetensors. Prompts that share tokens with `beginning` are read from
    /// there on.
    ///
    /// # Errors
    /// When a file is missing or damaged, or the folder holds another model, which is said in one sentence.
    pub(crate) fn open(folder: &Path, device: Device, beginning: &str) -> anyhow::Result<LanguageModel> {
        ensure!(folder.is_dir(), "there is no folder {}", folder.display());
        let config = OptConfig::read(folder)?;
        let mut hash = Sha256::new();
        let (tokenizer, start) = opt_tokenizer::read(folder, &config, &mut hash)?;
        let tensors = opt_weights::read(folder, &config, device, &mut hash)?;
        let mut model = LanguageModel {
            tokenizer,
            start,
            end: config.eos_token_id,
            longest: usize::try_from(config.max_position_embeddings)?,
            opt: Opt::of(&tensors, &config)?,
            digest: format!("{:x}", hash.finalize())[..16].to_string(),
            beginning: Vec::new(),
            beginning_read: KeyValues::none(),
        };
        model.beginning_read = model.opt.nothing_read(1);
        let mut tokens = model.tokens(beginning)?;
        tokens.truncate(model.longest);
        tch::no_grad(|| model.read_beginning(tokens));
        Ok(model)
    }

    /// Identifies the model by the contents of its files: 16 hexadecimal digits.
    pub(crate) fn digest(&self) -> &str {
        &self.digest
    }

    /// Where it computes.
    pub(crate) fn device(&self) -> Device {
        self.opt.device()
    }

    /// A text's tokens with what marks its start.
    fn tokens(&self, text: &str) -> anyhow::Result<Vec<u32>> {
        let encoding = self.tokenizer.encode(text, true).map_err(|error| anyhow!("the tokenizer refuses: {error}"))?;
        Ok(self.start.into_iter().chain(encoding.get_ids().iter().copied()).collect())
    }

    fn read_beginning(&mut self, tokens: Vec<u32>) {
        if tokens.is_empty() {
            return;
        }
        let nothing = self.opt.nothing_read(1);
        let batch = PaddedBatch::of(std::slice::from_ref(&tokens), 0, self.device());
        let _states = self.opt.read(&batch.rows(), &nothing, &mut self.beginning_read);
        self.beginning = tokens;
    }

    /// How many first tokens all texts share with the beginning, at most `most`.
    fn shared(&self, texts: &[Vec<u32>], most: usize) -> usize {
        let with = |text: &Vec<u32>| text.iter().zip(&self.beginning).take_while(|(a, b)| a == b).count();
        texts.iter().map(with).min().unwrap_or(0).min(most)
    }

    /// Goes on with prompts until `is_whole` says that nothing more is needed, the model ends, or `sampling` allows no more tokens. What is
    /// drawn for a prompt does not depend on the others.
    ///
    /// # Errors
    /// When a prompt and its answer are longer than the model reads, or the tokenizer refuses.
    pub(crate) fn complete(
        &self,
        prompts: &[Prompt],
        sampling: &Sampling,
        is_whole: &dyn Fn(&str) -> bool,
    ) -> anyhow::Result<Vec<Completion>> {
        if prompts.is_empty() {
            return Ok(Vec::new());
        }
        let texts: Vec<Vec<u32>> =
            prompts.iter().map(|prompt| self.tokens(&prompt.text)).collect::<anyhow::Result<_>>()?;
        let room = sampling.most_tokens as usize;
        texts.iter().try_for_each(|text| self.fits(text.len() + room))?;
        tch::no_grad(|| self.complete_tokens(prompts, &texts, sampling, is_whole))
    }

    fn fits(&self, tokens: usize) -> anyhow::Result<()> {
        ensure!(
            tokens <= self.longest,
            "a prompt with its answer has {tokens} tokens, and the model reads {}",
            self.longest
        );
        Ok(())
    }

    fn complete_tokens(
        &self,
        prompts: &[Prompt],
        texts: &[Vec<u32>],
        sampling: &Sampling,
        is_whole: &dyn Fn(&str) -> bool,
    ) -> anyhow::Result<Vec<Completion>> {
        let shortest = texts.iter().map(Vec::len).min().unwrap_or(0);
        let shared = self.shared(texts, shortest.saturating_sub(1));
        let beginning = self.beginning_read.first(shared as i64);
        let rest: Vec<Vec<u32>> = texts.iter().map(|text| text[shared..].to_vec()).collect();
        let mut batch = PaddedBatch::of(&rest, shared, self.device());
        let mut kept = self.opt.nothing_read(texts.len() as i64);
        let mut chance: Vec<ChaCha8Rng> = prompts.iter().map(|prompt| ChaCha8Rng::seed_from_u64(prompt.seed)).collect();
        let mut answers = vec![(Vec::new(), Completion { text: String::new(), ended: false }); texts.len()];
        let mut open: Vec<usize> = (0..texts.len()).collect();
        for _ in 0..sampling.most_tokens {
            let states = self.opt.read(&batch.rows(), &beginning, &mut kept);
            let logits = self.opt.logits(&states.select(1, -1)).to_device(Device::Cpu);
            let (mut going_on, mut tokens) = (Vec::new(), Vec::new());
            for (row, &index) in open.iter().enumerate() {
                let logits = Vec::<f32>::try_from(logits.get(row as i64))?;
                let token = sampling::draw(&logits, sampling, &mut chance[index]) as u32;
                let (drawn, answer) = &mut answers[index];
                if Some(token) == self.end {
                    answer.ended = true;
                    continue;
                }
                drawn.push(token);
                let text = self.tokenizer.decode(drawn, true);
                answer.text = text.map_err(|error| anyhow!("the tokenizer cannot write tokens: {error}"))?;
                if !is_whole(&answer.text) {
                    going_on.push(row);
                    tokens.push(i64::from(token));
                }
            }
            if going_on.is_empty() {
                break;
            }
            if going_on.len() < open.len() {
                let rows: Vec<i64> = going_on.iter().map(|&row| row as i64).collect();
                let rows = Tensor::from_slice(&rows).to_device(self.device());
                (batch, kept) = (batch.select(&rows), kept.rows(&rows));
                open = going_on.into_iter().map(|row| open[row]).collect();
            }
            batch = batch.next(&tokens);
        }
        Ok(answers.into_iter().map(|(_, answer)| answer).collect())
    }

    /// The mean log-probability of a text's tokens after another text, for each pair.
    ///
    /// # Errors
    /// When a pair is longer than the model reads, the tokenizer refuses, or a text has no token of its own.
    pub(crate) fn mean_log_probabilities(&self, pairs: &[(String, String)]) -> anyhow::Result<Vec<f64>> {
        if pairs.is_empty() {
            return Ok(Vec::new());
        }
        let (mut texts, mut firsts) = (Vec::new(), Vec::new());
        for (before, after) in pairs {
            let (context, whole) = (self.tokens(before)?, self.tokens(&format!("{before}{after}"))?);
            let first = context.iter().zip(&whole).take_while(|(a, b)| a == b).count();
            ensure!(first > 0 && first < whole.len(), "{after:?} has no token of its own after {before:?}");
            self.fits(whole.len())?;
            texts.push(whole);
            firsts.push(first);
        }
        let shared = self.shared(&texts, firsts.iter().min().map_or(0, |first| first - 1));
        let rest: Vec<Vec<u32>> = texts.iter().map(|text| text[shared..].to_vec()).collect();
        tch::no_grad(|| {
            let batch = PaddedBatch::of(&rest, shared, self.device());
            let beginning = self.beginning_read.first(shared as i64);
            let states = self.opt.read(&batch.rows(), &beginning, &mut self.opt.nothing_read(texts.len() as i64));
            let longest = batch.width();
            let mean = |(row, (text, &first)): (usize, (&Vec<u32>, &usize))| {
                let count = (text.len() - first) as i64;
                // Rows end together; the token before each tells how likely it is.
                let before = states.get(row as i64).narrow(0, longest - 1 - count, count);
                let own = Tensor::from_slice(&text[first..].iter().map(|&id| i64::from(id)).collect::<Vec<_>>());
                let likely = self.opt.logits(&before).log_softmax(-1, Kind::Float);
                likely.gather(1, &own.to_device(self.device()).unsqueeze(1), false).mean(Kind::Double).double_value(&[])
            };
            Ok(texts.iter().zip(&firsts).enumerate().map(mean).collect())
        })
    }
}
