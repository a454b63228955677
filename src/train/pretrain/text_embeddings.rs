//! The text stage: what policy and critic are conditioned on, and the joint sentences of the pairs to chain.

use std::sync::atomic::{AtomicBool, Ordering};

use tch::{Device, Tensor};

use super::spec::Pretraining;
use crate::algo::chain::PairSource;
use crate::data::items::Items;
use crate::language::vocabulary::Vocabulary;
use crate::train::metrics::{ProgressLogger, Scalars};
use crate::train::training_data::{ChainingPool, ConditioningTable, EmbeddingTable, joint_text};

/// Texts that are embedded at once.
const CHUNK: usize = 256;

/// What items are conditioned on, by their texts.
pub(super) struct Texts {
    pub(crate) conditioning: ConditioningTable,
    /// Pairs of texts to chain, where they are drawn beforehand.
    pub(crate) pool: Option<ChainingPool>,
    /// The words that the agent knows, where it reads words.
    pub(crate) vocabulary: Option<Vocabulary>,
}

/// Embeds every text of the items; nothing when it was stopped.
pub(super) fn embed_texts(
    spec: &Pretraining,
    items: &Items,
    logger: &mut dyn ProgressLogger,
    stop: &AtomicBool,
) -> anyhow::Result<Option<Texts>> {
    let vocabulary = spec.preset.policy.attention.as_ref().map(|attention| {
        let texts = items.training.iter().map(|span| items.texts[span.text as usize].as_str());
        Vocabulary::of(texts, attention.vocabulary_size)
    });
    let conditioning = if spec.preset.policy.goal_channels.is_some() {
        ConditioningTable::Goals
    } else if let Some(vocabulary) = &vocabulary {
        ConditioningTable::TokenIds(items.texts.iter().map(|text| vocabulary.numbers(text)).collect())
    } else {
        let Some(embeddings) = embed(spec, &items.texts, logger, stop)? else { return Ok(None) };
        ConditioningTable::SentenceEmbeddings(EmbeddingTable::new(&embeddings, spec.device)?)
    };
    let pool = match spec.preset.chaining.as_ref().map(|chaining| chaining.pairs) {
        Some(PairSource::Pool(count)) => {
            let pairs = ChainingPool::draw(items, spec.preset.seed, count);
            let texts: Vec<String> = pairs.iter().map(|&pair| joint_text(items, pair)).collect();
            let Some(joint) = embed(spec, &texts, logger, stop)? else { return Ok(None) };
            Some(ChainingPool::new(items, pairs, &joint, spec.device)?)
        }
        _ => None,
    };
    Ok(Some(Texts { conditioning, pool, vocabulary }))
}

/// Sentence embeddings [texts, width] in this machine's memory; nothing when it was stopped.
fn embed(
    spec: &Pretraining,
    texts: &[String],
    logger: &mut dyn ProgressLogger,
    stop: &AtomicBool,
) -> anyhow::Result<Option<Tensor>> {
    let mut embeddings = Vec::new();
    let mut embedder = spec.embedder()?;
    for (i, chunk) in texts.chunks(CHUNK).enumerate() {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let chunk: Vec<&str> = chunk.iter().map(String::as_str).collect();
        embeddings.push(embedder.embed(&chunk)?.to_device(Device::Cpu));
        logger.log(&Scalars::new("text_embeddings", (i * CHUNK + chunk.len()) as u64, texts.len() as u64))?;
    }
    anyhow::ensure!(!embeddings.is_empty(), "no trajectory has an annotation");
    Ok(Some(Tensor::cat(&embeddings, 0)))
}
