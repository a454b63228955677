//! Parity with the authors' library, and what folders may hold.

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
