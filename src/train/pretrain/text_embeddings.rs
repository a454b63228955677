//! The text stage: what policy and critic are conditioned on, and the joint sentences of the pairs to chain.

use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering};

use tch::{Device, Tensor};

use super::spec::Pretraining;
use crate::algo::chain::PairSource;
use crate::data::items::Items;
use crate::data::ranked_chains;
use crate::language::instruction::normalise;
use crate::language::vocabulary::Vocabulary;
use crate::train::chaining_pool::{ChainingPool, Compatibility, Pair, PairEnd};
use crate::train::embedding_table::EmbeddingTable;
use crate::train::frame_store::FrameStore;
use crate::train::metrics::{ProgressLogger, Scalars};
use crate::train::training_data::ConditioningTable;

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
    (items, frame_store): (&Items, &FrameStore),
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
    let pool = match spec.preset.chaining.as_ref().map(|chaining| (chaining.ranked, chaining.pairs)) {
        Some((ranked, source)) if ranked || source != PairSource::InBatch => {
            let (pairs, texts) = match source {
                PairSource::Pool(count) if !ranked => {
                    let share = spec.preset.chaining.as_ref().map_or(0.0, |chaining| chaining.feasible_share);
                    let compatibility = (share > 0.0).then(|| Compatibility::of(frame_store)).transpose()?;
                    let feasible = compatibility.as_ref().map(|compatibility| (share, compatibility));
                    let pairs = ChainingPool::draw(items, spec.preset.seed, count, feasible);
                    let texts = pairs.iter().map(|&pair| ChainingPool::joint_text(items, pair)).collect();
                    (pairs, texts)
                }
                _ => ranked_pairs(spec, items)?,
            };
            let Some(joint) = embed(spec, &texts, logger, stop)? else { return Ok(None) };
            Some(ChainingPool::new(items, pairs, &joint, spec.device)?)
        }
        _ => None,
    };
    Ok(Some(Texts { conditioning, pool, vocabulary }))
}

/// The pairs of the datasets' chains.jsonl whose instructions the items bear, and what a model calls both together.
fn ranked_pairs(spec: &Pretraining, items: &Items) -> anyhow::Result<(Vec<Pair>, Vec<String>)> {
    let learned: HashSet<u32> = items.training.iter().map(|span| span.text).collect();
    let numbers: HashMap<&str, u32> =
        learned.into_iter().map(|number| (items.texts[number as usize].as_str(), number)).collect();
    let (mut pairs, mut texts, mut ranked) = (Vec::new(), Vec::new(), 0);
    for folder in &spec.data {
        for pair in ranked_chains::read(folder)? {
            ranked += 1;
            let both = numbers.get(pair.first.as_str()).zip(numbers.get(pair.second.as_str()));
            let Some((&first, &second)) = both.filter(|_| !pair.text.is_empty()) else { continue };
            pairs.push((PairEnd::Text(first), PairEnd::Text(second)));
            texts.push(normalise(&pair.text));
        }
    }
    tracing::info!("{} of {ranked} ranked pairs are chained", pairs.len());
    anyhow::ensure!(
        !pairs.is_empty(),
        "of {ranked} pairs in chains.jsonl none is of instructions that are learned: rank them with the labels that the preset uses"
    );
    Ok((pairs, texts))
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
