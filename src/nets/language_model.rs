//! A language model's folder: its tokenizer and OPT, which goes on with texts and says how likely one is after another.

use std::path::Path;

use anyhow::{Context, anyhow, ensure};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};
use tch::{Device, Kind, Tensor};
use tokenizers::Tokenizer;
use tokenizers::models::bpe::BPE;
use tokenizers::pre_tokenizers::byte_level::ByteLevel;

use super::opt::{KeyValues, Opt, Rows};
use super::opt_config::OptConfig;
use super::opt_weights;
use super::sampling;
use crate::data::text_file;
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
        let (tokenizer, start) = tokenizer(folder, &config, &mut hash)?;
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
            let longest = batch.ids.size()[1];
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

/// Texts in a rectangle, each with padding before it.
struct PaddedBatch {
    ids: Tensor,
    places: Tensor,
    hidden: Tensor,
}

impl PaddedBatch {
    /// Texts that begin at the place `first`.
    fn of(texts: &[Vec<u32>], first: usize, device: Device) -> PaddedBatch {
        let longest = texts.iter().map(Vec::len).max().unwrap_or(0);
        let (mut ids, mut places, mut padding) = (Vec::new(), Vec::new(), Vec::new());
        for text in texts {
            let pads = longest - text.len();
            ids.extend(std::iter::repeat_n(0, pads).chain(text.iter().map(|&id| i64::from(id))));
            places.extend(std::iter::repeat_n(0, pads).chain((first..first + text.len()).map(|place| place as i64)));
            padding.push(pads as i64);
        }
        let shape = [texts.len() as i64, longest as i64];
        let column = Tensor::arange(longest as i64, (Kind::Int64, Device::Cpu));
        let padded = column.view([1, 1, 1, -1]).lt_tensor(&Tensor::from_slice(&padding).view([-1, 1, 1, 1]));
        let later = column.view([1, -1]).gt_tensor(&column.view([-1, 1])).view([1, 1, longest as i64, longest as i64]);
        PaddedBatch {
            ids: Tensor::from_slice(&ids).view(shape).to_device(device),
            places: Tensor::from_slice(&places).view(shape).to_device(device),
            hidden: padded.logical_or(&later).to_device(device),
        }
    }

    fn rows(&self) -> Rows<'_> {
        Rows { ids: &self.ids, places: &self.places, hidden: &self.hidden }
    }

    fn select(&self, rows: &Tensor) -> PaddedBatch {
        let of = |tensor: &Tensor| tensor.index_select(0, rows);
        PaddedBatch { ids: of(&self.ids), places: of(&self.places), hidden: of(&self.hidden) }
    }

    /// One more token in each row, after those that were read.
    fn next(&self, tokens: &[i64]) -> PaddedBatch {
        let seen = self.hidden.narrow(2, self.hidden.size()[2] - 1, 1);
        let one = Tensor::zeros([tokens.len() as i64, 1, 1, 1], (Kind::Bool, self.ids.device()));
        PaddedBatch {
            ids: Tensor::from_slice(tokens).view([-1, 1]).to_device(self.ids.device()),
            places: self.places.narrow(1, self.places.size()[1] - 1, 1) + 1,
            hidden: Tensor::cat(&[seen, one], 3),
        }
    }
}

/// The tokenizer, from `tokenizer.json` or from the older `vocab.json` and `merges.txt`, for which the start is put by hand.
fn tokenizer(folder: &Path, config: &OptConfig, hash: &mut Sha256) -> anyhow::Result<(Tokenizer, Option<u32>)> {
    let path = folder.join("tokenizer.json");
    let (tokenizer, start, path) = if path.is_file() {
        let bytes = std::fs::read(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        hash.update(&bytes);
        let tokenizer = Tokenizer::from_bytes(text_file::content(&bytes)?);
        let mut tokenizer = tokenizer.map_err(|error| anyhow!("{}: not a tokenizer: {error}", path.display()))?;
        tokenizer.with_truncation(None).map_err(|error| anyhow!("{}: {error}", path.display()))?;
        tokenizer.with_padding(None);
        (tokenizer, None, path)
    } else {
        let (vocabulary, merges) = (folder.join("vocab.json"), folder.join("merges.txt"));
        ensure!(
            vocabulary.is_file() && merges.is_file(),
            "{} holds neither tokenizer.json nor vocab.json with merges.txt",
            folder.display()
        );
        for path in [&vocabulary, &merges] {
            hash.update(std::fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?);
        }
        let [words, pairs] = [&vocabulary, &merges].map(|path| path.display().to_string());
        let model = BPE::from_file(&words, &pairs).build().map_err(|error| anyhow!("{words}: {error}"))?;
        let mut tokenizer = Tokenizer::new(model);
        tokenizer.with_pre_tokenizer(Some(ByteLevel::new(false, true, true)));
        tokenizer.with_decoder(Some(ByteLevel::default()));
        (tokenizer, config.bos_token_id, vocabulary)
    };
    let largest = tokenizer.get_vocab(true).into_values().max().unwrap_or(0).max(start.unwrap_or(0));
    ensure!(
        i64::from(largest) < config.vocab_size,
        "{}: the token {largest} lies beyond the model's vocabulary of {}",
        path.display(),
        config.vocab_size
    );
    Ok((tokenizer, start))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::PathBuf;

    use serde::Deserialize;
    use serde_json::{Value, json};

    use super::*;
    use crate::needed;
    use crate::nets::weights;

    /// Parity cases that transformers wrote.
    #[derive(Deserialize)]
    struct Expected {
        rows: Vec<Row>,
    }

    #[derive(Deserialize)]
    struct Row {
        text: String,
        ids: Vec<u32>,
        last_logits: Vec<f32>,
        mean_token_logprob: f64,
        greedy: Vec<u32>,
    }

    fn greedy(tokens: u32) -> Sampling {
        Sampling { temperature: 0.0, top_p: 1.0, most_tokens: tokens }
    }

    fn fixtures() -> Vec<PathBuf> {
        let layouts = ["fixtures/tiny-opt-13b-layout", "fixtures/tiny-opt-350m-layout"];
        layouts.iter().filter_map(|layout| needed::shared(layout)).collect()
    }

    /// Every layout that is there, for parity alone.
    fn all_layouts() -> Vec<PathBuf> {
        let Some(folder) = needed::shared("fixtures") else { return Vec::new() };
        let folders = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        folders.filter(|folder| folder.file_name().unwrap().to_string_lossy().starts_with("tiny-opt-")).collect()
    }

    fn rows(folder: &Path) -> Vec<Row> {
        let expected: Expected = serde_json::from_slice(&std::fs::read(folder.join("expected.json")).unwrap()).unwrap();
        expected.rows
    }

    fn texts(model: &LanguageModel, rows: &[Row], sampling: Sampling) -> Vec<String> {
        let prompts: Vec<Prompt> =
            rows.iter().enumerate().map(|(seed, row)| Prompt { text: row.text.clone(), seed: seed as u64 }).collect();
        let completions = model.complete(&prompts, &sampling, &|_| false).unwrap();
        completions.into_iter().map(|completion| completion.text).collect()
    }

    /// Tokens, the logits after the last one, likelihoods and what is greedily gone on with are those of the authors' library.
    fn check(model: &LanguageModel, rows: &[Row]) {
        for row in rows {
            let ids = model.tokens(&row.text).unwrap();
            assert_eq!(ids, row.ids, "{:?}", row.text);
            let batch = PaddedBatch::of(&[ids], 0, Device::Cpu);
            let nothing = model.opt.nothing_read(1);
            let states = model.opt.read(&batch.rows(), &nothing, &mut model.opt.nothing_read(1));
            let logits = model.opt.logits(&states.select(1, -1)).get(0);
            let difference = (logits - Tensor::from_slice(&row.last_logits)).abs().max().double_value(&[]);
            assert!(difference < 1e-3, "{:?}: a logit differs by {difference}", row.text);
        }
        let pairs: Vec<_> = rows.iter().map(|row| (String::new(), row.text.clone())).collect();
        for (row, found) in rows.iter().zip(model.mean_log_probabilities(&pairs).unwrap()) {
            assert!((found - row.mean_token_logprob).abs() < 1e-4, "{:?}: {found}", row.text);
        }
        for (row, found) in rows.iter().zip(texts(model, rows, greedy(rows[0].greedy.len() as u32))) {
            assert_eq!(found, model.tokenizer.decode(&row.greedy, true).unwrap(), "{:?}", row.text);
        }
    }

    #[test]
    fn opt_says_what_its_authors_library_says_in_every_layout() {
        for folder in all_layouts() {
            check(&LanguageModel::open(&folder, Device::Cpu, "").unwrap(), &rows(&folder));
        }
    }

    #[test]
    fn a_beginning_that_was_read_before_changes_nothing_that_is_said() {
        for folder in fixtures() {
            let rows = rows(&folder);
            let model = LanguageModel::open(&folder, Device::Cpu, "Put a rinsed bar of soap in the").unwrap();
            assert!(model.beginning.len() > 5);
            check(&model, &rows);
            let soap = &rows[7..8];
            assert!(soap[0].text.starts_with("Put a rinsed bar"));
            check(&model, soap);
        }
    }

    #[test]
    fn what_is_drawn_for_a_prompt_does_not_depend_on_the_others() {
        for folder in fixtures() {
            let model = LanguageModel::open(&folder, Device::Cpu, "P").unwrap();
            let rows = rows(&folder);
            let sampling = Sampling { temperature: 0.8, top_p: 0.9, most_tokens: 12 };
            let together = texts(&model, &rows, sampling);
            assert_eq!(texts(&model, &rows, sampling), together);
            assert_ne!(texts(&model, &rows, greedy(12)), together);
            for (seed, row) in rows.iter().enumerate() {
                let prompts = [Prompt { text: row.text.clone(), seed: seed as u64 }];
                let alone = model.complete(&prompts, &sampling, &|_| false).unwrap();
                assert_eq!(alone[0].text, together[seed], "{:?}", row.text);
            }
        }
    }

    /// A copy of a layout with another configuration and other weights.
    fn altered(folder: &Path, change: impl Fn(&mut Value, &mut weights::Tensors)) -> tempfile::TempDir {
        let copy = tempfile::tempdir().unwrap();
        std::fs::copy(folder.join("tokenizer.json"), copy.path().join("tokenizer.json")).unwrap();
        let mut config = serde_json::from_slice(&std::fs::read(folder.join("config.json")).unwrap()).unwrap();
        let mut tensors = weights::read(&folder.join("model.safetensors")).unwrap();
        change(&mut config, &mut tensors);
        std::fs::write(copy.path().join("config.json"), config.to_string()).unwrap();
        weights::write(&copy.path().join("model.safetensors"), &tensors, &BTreeMap::new()).unwrap();
        copy
    }

    #[test]
    fn other_names_half_precision_and_several_files_hold_the_same_model() {
        let Some(folder) = fixtures().pop() else { return };
        let rows = rows(&folder);
        let bare = altered(&folder, |_, tensors| {
            let bare = |(name, tensor): (String, Tensor)| (name.replace("model.decoder.", "decoder."), tensor);
            *tensors = std::mem::take(tensors).into_iter().map(bare).collect();
            tensors.insert("lm_head.weight".into(), tensors["decoder.embed_tokens.weight"].shallow_clone());
        });
        check(&LanguageModel::open(bare.path(), Device::Cpu, "").unwrap(), &rows);
        let split = altered(&folder, |_, _| ());
        let tensors = weights::read(&split.path().join("model.safetensors")).unwrap();
        let file = |index: usize| format!("model-{index:05}-of-00002.safetensors");
        let map: BTreeMap<&String, String> =
            tensors.keys().enumerate().map(|(index, name)| (name, file(index % 2))).collect();
        for half in [file(0), file(1)] {
            let part = tensors.iter().filter(|(name, _)| map[name] == half);
            let part = part.map(|(name, tensor)| (name.clone(), tensor.shallow_clone())).collect();
            weights::write(&split.path().join(&half), &part, &BTreeMap::new()).unwrap();
        }
        std::fs::remove_file(split.path().join("model.safetensors")).unwrap();
        let index = split.path().join("model.safetensors.index.json");
        std::fs::write(&index, json!({"metadata": {}, "weight_map": map}).to_string()).unwrap();
        check(&LanguageModel::open(split.path(), Device::Cpu, "").unwrap(), &rows);
        std::fs::write(&index, json!({"weight_map": {"a": "../model.safetensors"}}).to_string()).unwrap();
        let error = LanguageModel::open(split.path(), Device::Cpu, "").err().unwrap().to_string();
        assert!(error.contains("no file of this folder"), "{error}");
        let half = altered(&folder, |_, tensors| {
            tensors.values_mut().for_each(|tensor| *tensor = tensor.to_kind(Kind::Half));
        });
        let half = LanguageModel::open(half.path(), Device::Cpu, "").unwrap();
        let whole = LanguageModel::open(&folder, Device::Cpu, "").unwrap();
        let pairs = [(String::new(), rows[0].text.clone())];
        let of = |model: &LanguageModel| model.mean_log_probabilities(&pairs).unwrap()[0];
        assert!((of(&half) - of(&whole)).abs() < 1e-2 && half.digest() != whole.digest());
    }

    /// Switches of the configuration: a model without biases and norm weights is one whose biases are 0 and norm weights 1.
    #[test]
    fn what_the_configuration_leaves_out_counts_for_nothing() {
        for folder in fixtures() {
            let rows = rows(&folder);
            let is_norm = |name: &str| name.contains("layer_norm");
            let neutral = altered(&folder, |_, tensors| {
                for (name, tensor) in tensors.iter_mut().filter(|(name, _)| is_norm(name) || name.ends_with("bias")) {
                    *tensor = if name.ends_with("bias") { tensor.zeros_like() } else { tensor.ones_like() };
                }
            });
            let without = altered(&folder, |config, tensors| {
                config["enable_bias"] = json!(false);
                config["layer_norm_elementwise_affine"] = json!(false);
                config["tie_word_embeddings"] = json!(false);
                tensors.retain(|name, _| !is_norm(name) && !name.ends_with("bias"));
                tensors.insert("lm_head.weight".into(), tensors["model.decoder.embed_tokens.weight"].shallow_clone());
            });
            let said = |folder: &Path| texts(&LanguageModel::open(folder, Device::Cpu, "").unwrap(), &rows, greedy(12));
            assert_eq!(said(without.path()), said(neutral.path()));
            assert_ne!(said(without.path()), said(&folder));
        }
    }

    #[test]
    fn a_folder_that_holds_another_model_is_refused_in_a_sentence() {
        let empty = tempfile::tempdir().unwrap();
        let refusal = |folder: &Path| format!("{:#}", LanguageModel::open(folder, Device::Cpu, "").err().unwrap());
        assert!(refusal(&empty.path().join("none")).starts_with("there is no folder"));
        assert!(refusal(empty.path()).contains("is no folder of an OPT model: it holds no config.json"));
        std::fs::write(empty.path().join("config.json"), r#"{"model_type": "llama"}"#).unwrap();
        assert!(refusal(empty.path()).contains(r#"is no OPT model: its config.json says model_type "llama""#));
        std::fs::write(empty.path().join("config.json"), r#"{"model_type": "opt"}"#).unwrap();
        assert!(refusal(empty.path()).contains("holds neither tokenizer.json nor vocab.json"));
        let Some(folder) = fixtures().pop() else { return };
        let other = |change: &dyn Fn(&mut Value)| refusal(altered(&folder, |config, _| change(config)).path());
        assert!(other(&|config| config["num_hidden_layers"] = json!(4)).contains("missing layers.3."));
        assert!(other(&|config| config["num_hidden_layers"] = json!(2)).contains("unknown layers.2."));
        assert!(other(&|config| config["activation_function"] = json!("mish")).contains("mish"));
        assert!(other(&|config| config["hidden_size"] = json!(-3)).contains("hidden_size is -3"));
        let few = other(&|config| config["vocab_size"] = json!(300));
        assert!(few.contains("vocabulary of 300"), "{few}");
    }
}
