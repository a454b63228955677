//! Sentence encoders: folders as sentence-transformers publishes them, computed by libtorch.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail, ensure};
use serde::Deserialize;
use sha2::{Digest, Sha256};
use tch::{Device, Kind, Tensor};
use tokenizers::utils::truncation::TruncationDirection;
use tokenizers::{Encoding, Tokenizer};

use super::encoder_settings::TextSettings;
use super::home;
use super::pooling::Pooling;
use super::transformer::Transformer;
use super::transformer_config::TransformerConfig;
use crate::data::{plain_file, text_file};

/// The files of the default encoder whose contents set-up vouches for, with their sha256.
const DEFAULT_FILES: [(&str, &str); 2] = [
    ("model.safetensors", "53aa51172d142c89d9012cce15ae4d6cc0ca6895895114379cacb4fab128d9db"),
    ("tokenizer.json", "be50c3628f2bf5bb5e3a7f17b1f74611b2561a3a27eeab05e5aa30f411572037"),
];

/// Texts that are computed together on a CPU, where more gain nothing and waste padding.
const BATCH: usize = 32;
/// The same on a GPU: the joint sentences of a batch go through in a few passes.
const BATCH_ON_GPU: usize = 512;

/// Where set-up puts the default encoder, all-MiniLM-L6-v2.
pub fn default_folder() -> PathBuf {
    home::cache_folder().join("encoders/all-MiniLM-L6-v2")
}

/// Checks that a folder holds the default encoder, unaltered.
///
/// # Errors
/// When a file is missing or has another sha256.
pub(crate) fn verify_default(folder: &Path) -> anyhow::Result<()> {
    for (name, expected) in DEFAULT_FILES {
        let path = folder.join(name);
        let found = format!("{:x}", Sha256::digest(read(&path)?));
        ensure!(found == expected, "{} has sha256 {found}, not {expected}", path.display());
    }
    Ok(())
}

/// How much of a text an encoder reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TokenCount {
    /// Tokens that are read, the two that mark start and end included.
    pub(crate) used: usize,
    /// Tokens at the end of the text that are left out because it is too long.
    pub(crate) truncated: usize,
}

/// A frozen encoder of sentences.
pub struct SentenceEncoder {
    tokenizer: Tokenizer,
    transformer: Transformer,
    pooling: Vec<Pooling>,
    normalize: bool,
    lower_case: bool,
    unread: Vec<String>,
    longest: usize,
    padding: i64,
    width: usize,
    digest: String,
    device: Device,
}

/// One entry of `modules.json`.
#[derive(Deserialize)]
struct Module {
    path: String,
    #[serde(rename = "type")]
    kind: String,
}

impl SentenceEncoder {
    /// Reads an encoder's folder: `modules.json` and what it names.
    ///
    /// # Errors
    /// When a file is missing, damaged, does not fit the others, or asks for what is not built here; the error names it.
    pub fn load(folder: &Path, device: Device) -> anyhow::Result<SentenceEncoder> {
        ensure!(
            folder.is_dir(),
            "the sentence encoder's folder {} is not there; `make setup` fetches the default encoder",
            folder.display()
        );
        let mut hash = Sha256::new();
        let mut take = |path: PathBuf| -> anyhow::Result<(PathBuf, Vec<u8>)> {
            let bytes = read(&path)?;
            hash.update((bytes.len() as u64).to_le_bytes());
            hash.update(&bytes);
            Ok((path, bytes))
        };
        let (path, bytes) = take(folder.join("modules.json"))?;
        let modules: Vec<Module> = parse(&path, &bytes)?;
        let (mut transformer_at, mut pooling_at, mut normalize) = (None, None, false);
        for module in modules {
            match module.kind.rsplit('.').next().unwrap_or_default() {
                "Transformer" if transformer_at.is_none() => transformer_at = Some(folder.join(module.path)),
                "Pooling" if pooling_at.is_none() => pooling_at = Some(folder.join(module.path).join("config.json")),
                twice @ ("Transformer" | "Pooling") => bail!("{}: {twice} is there twice", path.display()),
                "Normalize" => normalize = true,
                _ => bail!("{}: the module type {:?} is not supported", path.display(), module.kind),
            }
        }
        let root = transformer_at.ok_or_else(|| anyhow!("{} names no Transformer module", path.display()))?;
        let pooling_at = pooling_at.ok_or_else(|| anyhow!("{} names no Pooling module", path.display()))?;
        let pooling_at = take(pooling_at)?.0;
        let config = TransformerConfig::read(&take(root.join("config.json"))?.0)?;
        let (pooling, unread) = Pooling::read(&pooling_at, config.hidden_size)?;
        let own = root.join("sentence_bert_config.json");
        let own = if own.exists() { Some(take(own)?) } else { None };
        let mut settings = TextSettings::read(folder, &root, own)?;
        settings.unread.extend(unread.map(|fields| format!("{fields} (of the pooling)")));
        let (path, bytes) = take(root.join("tokenizer.json"))?;
        let tokenizer = tokenizer(&bytes, &config).with_context(|| path.display().to_string())?;
        let (path, bytes) = take(root.join("model.safetensors"))?;
        let transformer = Transformer::build(&config, &path, &bytes, device)?;
        let most = usize::try_from(config.longest()).unwrap_or(0);
        let told = settings.own_limit.unwrap_or(most).min(most);
        let longest = settings.tokenizer_limit.unwrap_or(told).min(told);
        ensure!(
            longest >= 3,
            "{}: texts of {longest} tokens hold no word (max_seq_length or model_max_length)",
            folder.display()
        );
        // Who cuts texts elsewhere embeds them otherwise. The tokenizer's settings are no part of the digest where they change
        // nothing, so that encoders that trained agents know keep theirs.
        if longest < told {
            hash.update(longest.to_le_bytes());
        }
        for settings in &settings.unread {
            tracing::warn!("{}: settings that are not read: {settings}", folder.display());
        }
        Ok(SentenceEncoder {
            tokenizer,
            transformer,
            width: usize::try_from(config.hidden_size)? * pooling.len(),
            pooling,
            normalize,
            lower_case: settings.lower_case,
            unread: settings.unread,
            longest,
            padding: config.padding(),
            digest: format!("{:x}", hash.finalize()),
            device,
        })
    }

    /// Length of an embedding.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Where the encoder computes, and its results lie.
    pub(crate) fn device(&self) -> Device {
        self.device
    }

    /// Identifies the encoder by the contents of its files: 64 hexadecimal digits.
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// Settings of its folder that nothing here reads, file by file.
    pub(crate) fn unread_settings(&self) -> &[String] {
        &self.unread
    }

    /// Counts a text's tokens, and how many of them are too many.
    ///
    /// # Errors
    /// When the tokenizer refuses the text.
    pub(crate) fn tokens(&self, text: &str) -> anyhow::Result<TokenCount> {
        let (encoding, truncated) = self.tokenize(text)?;
        Ok(TokenCount { used: encoding.len(), truncated })
    }

    /// Embeds texts: `[texts, width]`, a row a text in their order, each independent of the others.
    ///
    /// # Errors
    /// When the tokenizer refuses a text or libtorch fails.
    pub fn encode(&self, texts: &[&str]) -> anyhow::Result<Tensor> {
        let encodings: Vec<Encoding> =
            texts.iter().map(|text| Ok(self.tokenize(text)?.0)).collect::<anyhow::Result<_>>()?;
        if encodings.is_empty() {
            return Ok(Tensor::zeros([0, self.width as i64], (Kind::Float, self.device)));
        }
        // Texts of like length share a batch, so that little of it is padding.
        let mut order: Vec<usize> = (0..texts.len()).collect();
        order.sort_by_key(|&index| encodings[index].len());
        let batches: Vec<Tensor> = order
            .chunks(if self.device == Device::Cpu { BATCH } else { BATCH_ON_GPU })
            .map(|batch| self.embed(&batch.iter().map(|&index| &encodings[index]).collect::<Vec<_>>()))
            .collect::<anyhow::Result<_>>()?;
        let mut place = vec![0i64; texts.len()];
        for (row, &index) in order.iter().enumerate() {
            place[index] = row as i64;
        }
        Ok(Tensor::cat(&batches, 0).index_select(0, &Tensor::from_slice(&place).to_device(self.device)))
    }

    /// Embeds texts to plain rows of `width` numbers, for callers that do not compute with tensors.
    ///
    /// # Errors
    /// As [`SentenceEncoder::encode`].
    pub(crate) fn encode_rows(&self, texts: &[&str]) -> anyhow::Result<Vec<Vec<f32>>> {
        let values: Vec<f32> = Vec::try_from(self.encode(texts)?.to_device(Device::Cpu).flatten(0, -1))?;
        ensure!(
            values.iter().all(|value| value.is_finite()),
            "the sentence encoder {}… makes NaN or an infinite number of a text: fetch it anew, or use another",
            &self.digest[..16]
        );
        Ok(values.chunks_exact(self.width).map(<[f32]>::to_vec).collect())
    }

    /// A text's tokens with the marks of start and end, and how many were left out.
    fn tokenize(&self, text: &str) -> anyhow::Result<(Encoding, usize)> {
        let refused = |error| anyhow!("the tokenizer refuses the text: {error}");
        let text = text.trim();
        let text = if self.lower_case { text.to_lowercase() } else { text.to_string() };
        let mut words = self.tokenizer.encode(text, false).map_err(refused)?;
        let marks = self.tokenizer.post_process(words.clone(), None, true).map_err(refused)?.len() - words.len();
        let room = self.longest.saturating_sub(marks);
        let truncated = words.len().saturating_sub(room);
        words.truncate(room, 0, TruncationDirection::Right);
        Ok((self.tokenizer.post_process(words, None, true).map_err(refused)?, truncated))
    }

    /// Embeddings of one padded batch.
    fn embed(&self, encodings: &[&Encoding]) -> anyhow::Result<Tensor> {
        let tokens = encodings.iter().map(|encoding| encoding.len()).max().unwrap_or(0);
        let (mut ids, mut mask) = (Vec::new(), Vec::new());
        for encoding in encodings {
            let padding = tokens - encoding.len();
            ids.extend(encoding.get_ids().iter().map(|&id| i64::from(id)));
            ids.resize(ids.len() + padding, self.padding);
            mask.resize(mask.len() + encoding.len(), 1i64);
            mask.resize(mask.len() + padding, 0);
        }
        let shape = [encodings.len() as i64, tokens as i64];
        tch::no_grad(|| {
            let ids = Tensor::from_slice(&ids).f_reshape(shape)?.to_device(self.device);
            let mask = Tensor::from_slice(&mask).f_reshape(shape)?.to_device(self.device);
            let states = self.transformer.forward(&ids, &mask);
            let pooled: Vec<Tensor> = self.pooling.iter().map(|mode| mode.pool(&states, &mask)).collect();
            let pooled = Tensor::cat(&pooled, 1);
            if !self.normalize {
                return Ok(pooled);
            }
            let length = pooled.norm_scalaropt_dim(2.0, 1, true).clamp_min(1e-12);
            Ok(pooled / length)
        })
    }
}

/// The tokenizer, without the truncation and padding that its file may ask for: both depend on the batch.
fn tokenizer(bytes: &[u8], config: &TransformerConfig) -> anyhow::Result<Tokenizer> {
    let mut tokenizer =
        Tokenizer::from_bytes(text_file::content(bytes)?).map_err(|error| anyhow!("not a tokenizer: {error}"))?;
    tokenizer.with_truncation(None).map_err(|error| anyhow!("{error}"))?;
    tokenizer.with_padding(None);
    let largest = tokenizer.get_vocab(true).into_values().max().unwrap_or(0);
    ensure!(
        i64::from(largest) < config.vocab_size,
        "the token {largest} lies beyond the model's vocabulary of {}",
        config.vocab_size
    );
    Ok(tokenizer)
}

fn parse<T: serde::de::DeserializeOwned>(path: &Path, bytes: &[u8]) -> anyhow::Result<T> {
    let text = text_file::content(bytes).with_context(|| path.display().to_string())?;
    serde_json::from_slice(text).with_context(|| path.display().to_string())
}

fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    plain_file::read(path).with_context(|| format!("{} cannot be read", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::needed;

    /// The parity cases that sentence-transformers wrote.
    #[derive(Deserialize)]
    struct Expected {
        sentences: Vec<String>,
        embeddings: Vec<Vec<f32>>,
        #[serde(default)]
        ids: Vec<Vec<u32>>,
    }

    fn minilm() -> Option<SentenceEncoder> {
        let folder = needed::sentence_encoder(&default_folder())?;
        Some(SentenceEncoder::load(&folder, Device::Cpu).unwrap())
    }

    fn check(encoder: &SentenceEncoder, expected: &Path) {
        let expected: Expected = serde_json::from_slice(&std::fs::read(expected).unwrap()).unwrap();
        let texts: Vec<&str> = expected.sentences.iter().map(String::as_str).collect();
        let together = encoder.encode(&texts).unwrap();
        let alone: Vec<Tensor> = texts.iter().map(|text| encoder.encode(&[text]).unwrap()).collect();
        let difference = (&together - Tensor::cat(&alone, 0)).abs().max().double_value(&[]);
        assert!(difference < 1e-5, "a batch's other texts change an embedding by {difference}");
        for (row, embedding) in expected.embeddings.iter().enumerate() {
            let expected = Tensor::from_slice(embedding);
            let cosine = Tensor::cosine_similarity(&together.get(row as i64), &expected, 0, 1e-12).double_value(&[]);
            assert!(cosine >= 0.9999, "{:?}: cosine {cosine}", texts[row]);
            let difference = (together.get(row as i64) - expected).abs().max().double_value(&[]);
            assert!(difference < 1e-4, "{:?}: differs by {difference}", texts[row]);
        }
        for (text, ids) in texts.iter().zip(&expected.ids) {
            assert_eq!(encoder.tokenize(text).unwrap().0.get_ids(), ids, "{text:?}");
        }
    }

    #[test]
    fn minilm_embeds_as_its_authors_library_does() {
        let (Some(expected), Some(encoder)) = (needed::shared("fixtures/minilm/expected.json"), minilm()) else {
            return;
        };
        assert_eq!(encoder.width(), 384);
        check(&encoder, &expected);
    }

    #[test]
    fn mpnet_embeds_as_its_authors_library_does() {
        let Some(folder) = needed::shared("fixtures/tiny-mpnet") else { return };
        let encoder = SentenceEncoder::load(&folder, Device::Cpu).unwrap();
        check(&encoder, &folder.join("expected.json"));
        assert_eq!(encoder.digest().len(), 64);
    }

    #[test]
    fn a_long_text_is_cut_and_the_count_says_by_how_much() {
        let Some(folder) = needed::shared("fixtures/tiny-mpnet") else { return };
        let encoder = SentenceEncoder::load(&folder, Device::Cpu).unwrap();
        assert_eq!(encoder.tokens("").unwrap(), TokenCount { used: 2, truncated: 0 });
        let long = "put the apple in the bowl ".repeat(400);
        let count = encoder.tokens(&long).unwrap();
        assert_eq!(count.used, 64);
        assert!(count.truncated > 1000, "{count:?}");
        assert_eq!(encoder.encode(&[&long]).unwrap().size(), [1, 32]);
        assert_eq!(encoder.encode(&[]).unwrap().size(), [0, 32]);
    }

    #[test]
    fn control_characters_and_other_scripts_embed_without_fuss() {
        let Some(folder) = needed::shared("fixtures/tiny-mpnet") else { return };
        let encoder = SentenceEncoder::load(&folder, Device::Cpu).unwrap();
        let embedded =
            encoder.encode(&["\u{0}\u{1b}[31m\u{7f}", "拿起杯子 🍎", "\u{202e}mug\u{fffd}", "  \n "]).unwrap();
        assert!(embedded.isfinite().all().int64_value(&[]) == 1);
    }

    #[test]
    fn a_folder_that_does_not_fit_together_is_refused_by_file_and_field() {
        let Some(good) = needed::shared("fixtures/tiny-mpnet") else { return };
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("1_Pooling")).unwrap();
        let files = [
            "modules.json",
            "config.json",
            "sentence_bert_config.json",
            "tokenizer.json",
            "model.safetensors",
            "1_Pooling/config.json",
        ];
        for file in files {
            std::fs::copy(good.join(file), folder.path().join(file)).unwrap();
            let mut permissions = std::fs::metadata(folder.path().join(file)).unwrap().permissions();
            std::os::unix::fs::PermissionsExt::set_mode(&mut permissions, 0o600);
            std::fs::set_permissions(folder.path().join(file), permissions).unwrap();
        }
        let check = |file: &str, from: &str, to: &str, parts: &[&str]| {
            let path = folder.path().join(file);
            let whole = std::fs::read_to_string(&path).unwrap();
            assert!(whole.contains(from), "{whole}");
            std::fs::write(&path, whole.replacen(from, to, 1)).unwrap();
            let Err(error) = SentenceEncoder::load(folder.path(), Device::Cpu) else {
                panic!("{file}: {to} is accepted")
            };
            let error = format!("{error:#}");
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
            std::fs::write(&path, whole).unwrap();
        };
        SentenceEncoder::load(folder.path(), Device::Cpu).unwrap();
        check(
            "config.json",
            r#""num_hidden_layers": 3"#,
            r#""num_hidden_layers": 2"#,
            &["model.safetensors", "unknown", "encoder.layer.2."],
        );
        check(
            "config.json",
            r#""num_hidden_layers": 3"#,
            r#""num_hidden_layers": 4"#,
            &["missing", "encoder.layer.3."],
        );
        check("config.json", r#""vocab_size": 221"#, r#""vocab_size": 220"#, &["tokenizer.json", "vocabulary"]);
        check("config.json", r#""hidden_act": "gelu""#, r#""hidden_act": "relu""#, &["config.json", "hidden_act"]);
        check("config.json", r#""model_type": "mpnet""#, r#""model_type": "t5""#, &["model_type", "t5"]);
        check("config.json", r#""hidden_size": 32"#, r#""hidden_size": -1"#, &["config.json", "hidden_size"]);
        check("modules.json", "models.Normalize", "models.Dense", &["modules.json", "Dense"]);
        check("modules.json", "models.Pooling", "models.Normalize", &["modules.json", "no Pooling"]);
        check("tokenizer.json", "{", "[", &["tokenizer.json"]);
        check(
            "1_Pooling/config.json",
            r#""pooling_mode_mean_tokens": true"#,
            r#""pooling_mode_mean_tokens": false"#,
            &["1_Pooling"],
        );
        check("sentence_bert_config.json", "64", "2", &["max_seq_length"]);
        let twice = r#""1_Pooling", "type": "sentence_transformers.models.Pooling"}, {"path": "1_Pooling","#;
        check("modules.json", r#""1_Pooling","#, twice, &["modules.json", "Pooling is there twice"]);
        let digest = SentenceEncoder::load(folder.path(), Device::Cpu).unwrap().digest().to_owned();
        let limited = |limit: &str| {
            let text = format!(r#"{{"model_max_length": {limit}}}"#);
            std::fs::write(folder.path().join("tokenizer_config.json"), text).unwrap();
            SentenceEncoder::load(folder.path(), Device::Cpu).unwrap()
        };
        for (limit, used) in [("1000000000000000019884624838656", 64), ("512", 64), ("7", 7)] {
            let encoder = limited(limit);
            assert_eq!(encoder.tokens(&"put the mug ".repeat(90)).unwrap().used, used, "the smallest limit counts");
            assert_eq!(encoder.digest() == digest, used == 64, "who cuts texts elsewhere embeds otherwise");
        }
        std::fs::remove_file(folder.path().join("tokenizer_config.json")).unwrap();
        std::fs::remove_file(folder.path().join("model.safetensors")).unwrap();
        let error = format!("{:#}", SentenceEncoder::load(folder.path(), Device::Cpu).err().unwrap());
        assert!(error.contains("model.safetensors"), "{error}");
    }
}
