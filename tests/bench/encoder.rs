//! One instruction through the default sentence encoder, on one core; a cached one; and a batch.

mod baseline;

use std::hint::black_box;

use baseline::CriterionBaselines;
use criterion::{Criterion, criterion_group};
use sprint_explorer::nets::device;
use sprint_explorer::nets::embedding_cache::{Embedder, EmbeddingCache};
use sprint_explorer::nets::sentence::{SentenceEncoder, default_folder};

const SHORT: &str = "put a clean mug in the coffee machine";

#[allow(clippy::expect_used, clippy::print_stderr)]
fn encoder(bench: &mut Criterion) {
    device::set_threads(1);
    let folder = default_folder();
    if !folder.join("model.safetensors").exists() {
        eprintln!("skipped: the sentence encoder is not there (`make setup` fetches it)");
        return;
    }
    let load = || SentenceEncoder::load(&folder, tch::Device::Cpu).expect("the encoder loads");
    let encoder = load();
    let mut group = bench.benchmark_group("encoder");
    group.sample_size(50);
    group.bench_function("one short sentence", |bench| {
        bench.iter(|| encoder.encode(&[black_box(SHORT)]).expect("encodes"));
    });
    group.bench_function("32 short sentences", |bench| {
        bench.iter(|| encoder.encode(black_box(&[SHORT; 32])).expect("encodes"));
    });
    let cache_folder = tempfile::tempdir().expect("a temporary folder");
    let cache = EmbeddingCache::open(cache_folder.path(), encoder.digest(), encoder.width()).expect("a cache");
    let mut embedder = Embedder::new(load(), Some(cache));
    group.bench_function("one cached sentence", |bench| {
        bench.iter(|| embedder.embed(&[black_box(SHORT)]).expect("embeds"));
    });
    group.sample_size(10);
    group.bench_function("load", |bench| bench.iter(load));
    group.finish();
}

criterion_group!(benches, encoder);

fn main() -> anyhow::Result<()> {
    let mut baselines = CriterionBaselines::open()?;
    benches();
    Criterion::default().configure_from_args().final_summary();
    baselines.compare_criterion(&[
        "encoder/one short sentence",
        "encoder/32 short sentences",
        "encoder/one cached sentence",
        "encoder/load",
    ])
}
