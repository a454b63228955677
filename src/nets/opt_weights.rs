//! The weights of an OPT folder: one safetensors file or several with an index, under the names of any of its heads.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use serde::Deserialize;
use sha2::{Digest, Sha256};
use tch::{Device, Kind};

use super::opt_config::OptConfig;
use super::weights::{self, TensorSpec, Tensors, WeightsError};
use crate::data::plain_file;

/// `model.safetensors.index.json`: the file of each tensor.
#[derive(Deserialize)]
struct ShardIndex {
    weight_map: BTreeMap<String, String>,
}

/// What a causal model's and a bare decoder's tensors are called before their own names.
const PREFIXES: [&str; 2] = ["model.decoder.", "decoder."];

/// The output layer, where it is not the word embeddings.
pub(super) const HEAD: &str = "lm_head.weight";

/// Reads a folder's tensors, named as in the decoder, checks them against what the model needs, and adds the files to a hash.
///
/// # Errors
/// When there is no safetensors file, one is damaged, or any tensor is missing, unknown or of another shape.
pub(super) fn read(folder: &Path, config: &OptConfig, device: Device, hash: &mut Sha256) -> anyhow::Result<Tensors> {
    let mut tensors = Tensors::new();
    let (listed, files) = files(folder)?;
    for path in files {
        let bytes = plain_file::read(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        hash.update(&bytes);
        let (read, _) =
            weights::parse(&bytes).map_err(|reason| WeightsError::Malformed { path: path.clone(), reason })?;
        drop(bytes);
        // Half-precision files are computed with as they are where a device does so, and in 32 bits on a CPU.
        let prepared = read.into_iter().map(|(name, tensor)| {
            let keeps = device != Device::Cpu || !tensor.is_floating_point();
            let kind = if keeps { tensor.kind() } else { Kind::Float };
            (plain(&name).to_owned(), tensor.to_kind(kind).to_device(device))
        });
        let read: Tensors = prepared.collect();
        weights::check_finite(&path, &read)?;
        for (name, tensor) in read {
            ensure!(tensors.insert(name.clone(), tensor).is_none(), "{}: {name} is there twice", path.display());
        }
    }
    if config.tie_word_embeddings {
        tensors.remove(HEAD);
    }
    let kind = tensors.get("embed_tokens.weight").map_or(Kind::Float, tch::Tensor::kind);
    weights::check(&listed, &tensors, &specs(config, kind))?;
    Ok(tensors)
}

/// A tensor's name in the decoder.
fn plain(name: &str) -> &str {
    PREFIXES.iter().find_map(|prefix| name.strip_prefix(prefix)).unwrap_or(name)
}

/// The file that names a folder's tensors, and all files that hold them.
fn files(folder: &Path) -> anyhow::Result<(PathBuf, Vec<PathBuf>)> {
    let whole = folder.join("model.safetensors");
    if whole.is_file() {
        return Ok((whole.clone(), vec![whole]));
    }
    let index = folder.join("model.safetensors.index.json");
    ensure!(
        index.is_file(),
        "{} holds neither model.safetensors nor model.safetensors.index.json: OPT's weights are read from safetensors files alone",
        folder.display()
    );
    let text = plain_file::read(&index).with_context(|| format!("{} cannot be read", index.display()))?;
    let shards: ShardIndex = serde_json::from_slice(&text).with_context(|| index.display().to_string())?;
    let names: BTreeSet<String> = shards.weight_map.into_values().collect();
    let stray = names.iter().find(|name| Path::new(name).file_name().is_none_or(|file| file != name.as_str()));
    if let Some(stray) = stray {
        anyhow::bail!("{}: {stray:?} is no file of this folder", index.display());
    }
    Ok((index, names.into_iter().map(|name| folder.join(name)).collect()))
}

/// Names, shapes and types of all tensors.
fn specs(config: &OptConfig, kind: Kind) -> BTreeMap<String, TensorSpec> {
    let mut specs = BTreeMap::new();
    let (hidden, word) = (config.hidden_size, config.word_width());
    let mut add = |name: String, shape: &[i64]| {
        specs.insert(name, TensorSpec { kind, shape: shape.to_vec() });
    };
    add("embed_tokens.weight".into(), &[config.vocab_size, word]);
    // The first two positions are left over from its authors' numbering.
    add("embed_positions.weight".into(), &[config.max_position_embeddings + 2, hidden]);
    if config.projects_words() {
        add("project_in.weight".into(), &[hidden, word]);
        add("project_out.weight".into(), &[word, hidden]);
    }
    if !config.tie_word_embeddings {
        add(HEAD.into(), &[config.vocab_size, word]);
    }
    let mut norms = Vec::new();
    for layer in 0..config.num_hidden_layers {
        let name = |part: &str| format!("layers.{layer}.{part}");
        for (part, to, from) in [
            ("self_attn.q_proj", hidden, hidden),
            ("self_attn.k_proj", hidden, hidden),
            ("self_attn.v_proj", hidden, hidden),
            ("self_attn.out_proj", hidden, hidden),
            ("fc1", config.ffn_dim, hidden),
            ("fc2", hidden, config.ffn_dim),
        ] {
            add(name(&format!("{part}.weight")), &[to, from]);
            if config.enable_bias {
                add(name(&format!("{part}.bias")), &[to]);
            }
        }
        norms.extend(["self_attn_layer_norm", "final_layer_norm"].map(name));
    }
    norms.extend(config.has_final_norm().then(|| "final_layer_norm".to_owned()));
    for norm in norms.iter().filter(|_| config.layer_norm_elementwise_affine) {
        add(format!("{norm}.weight"), &[hidden]);
        add(format!("{norm}.bias"), &[hidden]);
    }
    specs
}
