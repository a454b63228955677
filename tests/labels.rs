//! Labels by language models through the program itself: OPT in its process, and models on a server over real sockets.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::{Value, json};
use sprint_explorer::nets::weights::{self, Tensors};
use tch::{Device, Kind, Tensor};

use crate::completions::{Completions, Reply};
use crate::program::{Ended, Sprint, wait_for};
use crate::training;

/// A folder with a few demonstrations of three skills each.
fn demonstrations() -> Sprint {
    let sprint = Sprint::new();
    let ended = sprint.run("collect D --episodes 6 --seed 5 --lengths 3 --annotations 1");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    sprint
}

/// The lines of the labels' file, without its header.
fn labels(sprint: &Sprint) -> Vec<Value> {
    let text = sprint.read("D/labels.jsonl");
    // The program may be in the middle of a line.
    text.lines().skip(1).filter_map(|line| serde_json::from_str(line).ok()).collect()
}

fn texts(sprint: &Sprint) -> BTreeSet<String> {
    labels(sprint).iter().map(|label| label["text"].as_str().unwrap().to_owned()).collect()
}

fn ask(sprint: &Sprint, server: &Completions, more: &str) -> Ended {
    sprint.run(&format!("relabel D --with http --url {} --model wise {more}", server.url))
}

#[test]
fn a_server_labels_every_passage_once_and_each_label_tells_its_maker() {
    let sprint = demonstrations();
    let server = Completions::start(|number, _| Reply::Text(format!(" Do  the THING number {number}")));
    let ended = ask(&sprint, &server, "--name clever");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let asked = server.asked();
    let steps: BTreeSet<String> = asked.iter().map(|asked| asked.steps()).collect();
    assert_eq!(steps.len(), asked.len(), "nothing is asked twice");
    let request = &asked[0];
    assert_eq!(request.path, "/v1/completions");
    assert!(!request.head.to_lowercase().contains("authorization"), "{}", request.head);
    let body = &request.body;
    assert_eq!([&body["model"], &body["temperature"], &body["top_p"]], [&json!("wise"), &json!(0.8), &json!(0.9)]);
    let prompt = body["prompt"].as_str().unwrap();
    assert!(
        prompt.starts_with("Instructions: summarize the following ordered steps describing common household tasks.")
    );
    assert!(prompt.contains("Summary: Look at the vase under the light.") && prompt.ends_with("\nSummary:"));
    let found = labels(&sprint);
    assert!(found.len() >= asked.len());
    let label = &found[0];
    assert_eq!([&label["source"], &label["maker"]["model"]], [&json!("clever"), &json!("wise")]);
    assert_eq!(label["maker"]["sampling"], json!({"temperature": 0.8, "top_p": 0.9, "most_tokens": 60}));
    assert_eq!(label["maker"]["prompt"].as_str().unwrap().len(), 16);
    assert!(texts(&sprint).contains("Do the thing number 0."), "{found:?}");
    let before = asked.len();
    assert_eq!(ask(&sprint, &server, "--name clever").code, Some(0));
    assert_eq!(server.asked().len(), before, "what is there is not asked for again");
    let otherwise = ask(&sprint, &server, "--name clever --temperature 0.1");
    assert_eq!(otherwise.code, Some(1));
    assert!(otherwise.stderr.contains("clever has labels already that were made otherwise"), "{}", otherwise.stderr);
    assert!(
        otherwise.stderr.contains("temperature 0.8") && otherwise.stderr.contains("--name"),
        "{}",
        otherwise.stderr
    );
}

#[test]
fn a_server_that_is_busy_or_drops_the_line_is_asked_again_and_one_that_refuses_is_not() {
    let sprint = demonstrations();
    let server = Completions::start(|number, _| match number {
        0 => Reply::Text("put it away".into()),
        1 => Reply::Other(429, "Retry-After: 0\r\n", "slow down".into()),
        2 => Reply::Nothing,
        3 => Reply::Other(503, "", "loading".into()),
        _ => Reply::Text("put it away".into()),
    });
    let ended = ask(&sprint, &server, "--sample 4 --jobs 1");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(server.asked().len(), 4 + 3);
    let refuses = Completions::start(|_, _| Reply::Other(401, "", r#"{"error": "no key"}"#.into()));
    let mut command = sprint.command(&format!("relabel D --with http --url {} --model other", refuses.url));
    let output = command.env("SPRINT_API_KEY", "my-secret").output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains("401") && said.contains("no key") && said.contains("SPRINT_API_KEY"), "{said}");
    assert!(!said.contains("my-secret"), "{said}");
    assert!(refuses.asked().iter().all(|asked| asked.head.contains("Bearer my-secret")));
    assert!(refuses.asked().len() <= 4, "each that was under way at once, and no more");
    let page = Completions::start(|_, _| Reply::Other(200, "", "<html>Welcome</html>".into()));
    let ended = ask(&sprint, &page, "--name other");
    assert!(ended.stderr.contains("the server's answer is no completion: <html>"), "{}", ended.stderr);
    assert!(labels(&sprint).iter().all(|label| label["source"] == "wise"));
    let nobody = sprint.run("relabel D --with http --model wise");
    assert!(nobody.stderr.contains("--with http needs --url"), "{}", nobody.stderr);
    let nowhere = sprint.run("relabel D --with http --model wise --url localhost");
    assert!(nowhere.stderr.contains("is no server's address"), "{}", nowhere.stderr);
}

#[test]
fn answers_without_a_summary_are_counted_kept_and_neither_asked_for_again_nor_learned() {
    let sprint = demonstrations();
    let server = Completions::start(|number, _| match number {
        1 => Reply::Text(" ...".into()),
        2 => Reply::Other(200, "", r#"{"choices": []}"#.into()),
        _ => Reply::Text("put it away".into()),
    });
    let ended = ask(&sprint, &server, "--sample 5 --jobs 1");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(ended.stderr.contains("5 texts written by wise 1, 2 answers without a summary"), "{}", ended.stderr);
    let malformed: Vec<Value> = labels(&sprint).into_iter().filter(|label| !label["malformed"].is_null()).collect();
    assert!(malformed.iter().all(|label| label["text"] == ""), "{malformed:?}");
    assert!(malformed.iter().any(|label| label["malformed"] == " ...") && malformed.len() >= 2);
    assert_eq!(ask(&sprint, &server, "--sample 5").code, Some(0));
    assert_eq!(server.asked().len(), 5);
}

#[test]
fn a_relabelling_that_was_killed_pays_for_nothing_twice() {
    let sprint = demonstrations();
    let open = std::sync::Arc::new(AtomicBool::new(false));
    let gate = open.clone();
    // It answers three, then keeps whoever asks waiting.
    let server = Completions::start(move |number, asked| {
        while number >= 3 && !gate.load(Ordering::Relaxed) {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        let words = asked.steps().split_whitespace().count();
        Reply::Text(format!("put away {words}"))
    });
    let line = format!("relabel D --with http --url {} --model wise --jobs 1", server.url);
    let mut killed = sprint.command(&line).spawn().unwrap();
    wait_for(|| server.asked().len() == 4 && labels(&sprint).len() >= 3);
    let kept = labels(&sprint);
    killed.kill().unwrap();
    killed.wait().unwrap();
    open.store(true, Ordering::Relaxed);
    let ended = sprint.run(&line);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let asked: Vec<String> = server.asked().iter().map(|asked| asked.steps()).collect();
    let different: BTreeSet<&String> = asked.iter().collect();
    assert_eq!(asked.len(), different.len() + 1, "only the one that was not answered is asked for again");
    let spans: BTreeSet<String> = labels(&sprint)
        .iter()
        .map(|label| [&label["trajectory"], &label["annotator"], &label["skills"]].map(Value::to_string).join(" "))
        .collect();
    assert_eq!(spans.len(), labels(&sprint).len(), "no span is labelled twice");
    assert_eq!(labels(&sprint)[..kept.len()], kept[..], "what was kept stays");
}

/// An OPT folder of chance weights that reads bytes: small, and long enough for the prompt.
fn chance_opt(folder: &Path) {
    let (hidden, inner, vocabulary) = (16, 32, 260);
    let config = json!({
        "model_type": "opt", "hidden_size": hidden, "ffn_dim": inner, "num_attention_heads": 2, "num_hidden_layers": 2,
        "word_embed_proj_dim": hidden, "vocab_size": vocabulary, "max_position_embeddings": 4096,
    });
    // Every byte is a letter of the byte-level alphabet: printable ones are themselves, others follow from U+0100 on.
    let printable = |byte: u32| matches!(byte, 33..=126 | 161..=172 | 174..=255);
    let mut next = 256;
    let letters = (0..256u32).map(|byte| {
        let letter = if printable(byte) {
            byte
        } else {
            next += 1;
            next - 1
        };
        (char::from_u32(letter).unwrap().to_string(), byte + 4)
    });
    let vocab: serde_json::Map<String, Value> = letters.map(|(letter, id)| (letter, json!(id))).collect();
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(folder.join("config.json"), config.to_string()).unwrap();
    std::fs::write(folder.join("vocab.json"), Value::Object(vocab).to_string()).unwrap();
    std::fs::write(folder.join("merges.txt"), "#version: 0.2\n").unwrap();
    tch::manual_seed(3);
    let weight = |shape: &[i64]| Tensor::randn(shape, (Kind::Float, Device::Cpu)) * 0.3;
    let mut tensors = Tensors::new();
    let mut add = |name: String, shape: &[i64]| {
        tensors.insert(format!("model.decoder.{name}"), weight(shape));
    };
    add("embed_tokens.weight".into(), &[vocabulary, hidden]);
    add("embed_positions.weight".into(), &[4098, hidden]);
    let mut norms = vec!["final_layer_norm".to_owned()];
    for layer in 0..2 {
        for (part, to, from) in [("fc1", inner, hidden), ("fc2", hidden, inner)] {
            add(format!("layers.{layer}.{part}.weight"), &[to, from]);
            add(format!("layers.{layer}.{part}.bias"), &[to]);
        }
        for part in ["q_proj", "k_proj", "v_proj", "out_proj"] {
            add(format!("layers.{layer}.self_attn.{part}.weight"), &[hidden, hidden]);
            add(format!("layers.{layer}.self_attn.{part}.bias"), &[hidden]);
        }
        norms.extend(["self_attn_layer_norm", "final_layer_norm"].map(|part| format!("layers.{layer}.{part}")));
    }
    for norm in norms {
        add(format!("{norm}.weight"), &[hidden]);
        add(format!("{norm}.bias"), &[hidden]);
    }
    weights::write(&folder.join("model.safetensors"), &tensors, &Default::default()).unwrap();
}

#[test]
fn opt_labels_the_same_passages_alike_every_time_and_a_folder_without_it_is_refused() {
    let sprint = demonstrations();
    chance_opt(&sprint.path("tiny-opt"));
    let ended = sprint.run("relabel D --with opt --model tiny-opt --sample 4");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let said = |label: &Value| label["text"].as_str().map(str::to_owned).filter(|text| !text.is_empty());
    let of = |source: &str| -> Vec<Value> {
        let ours = labels(&sprint).into_iter().filter(|label| label["source"] == source);
        ours.map(|label| json!([label["trajectory"], label["skills"], said(&label), label["malformed"]])).collect()
    };
    let first = of("tiny-opt");
    assert!(first.len() >= 4);
    let maker = labels(&sprint)[0]["maker"].clone();
    assert_eq!([&maker["model"], &maker["sampling"]["top_p"]], [&json!("tiny-opt"), &json!(0.9)]);
    assert_eq!(maker["files"].as_str().unwrap().len(), 16);
    assert_eq!(sprint.run("relabel D --with opt --model tiny-opt --sample 4 --name again").code, Some(0));
    assert_eq!(of("again"), first, "a passage seeds what is drawn for it");
    let refused = sprint.run("relabel D --with opt --model D");
    assert_eq!(refused.code, Some(1));
    assert!(refused.stderr.contains("D is no folder of an OPT model: it holds no config.json"), "{}", refused.stderr);
    assert!(sprint.run("relabel D --with opt").stderr.contains("--with opt needs --model DIR"));
}

/// The ranked pairs: the lines after the header and the plan.
fn chains(sprint: &Sprint) -> Vec<Value> {
    let pair = |line| serde_json::from_str::<Value>(line).unwrap()["pair"].clone();
    sprint.read("D/chains.jsonl").lines().skip(2).map(pair).collect()
}

#[test]
fn pairs_that_a_server_finds_likely_are_kept_with_its_text() {
    let sprint = demonstrations();
    // A step is as likely as it is short.
    let server = Completions::start(|_, asked| {
        let prompt = asked.body["prompt"].as_str().unwrap();
        if asked.body["echo"] != json!(true) {
            return Reply::Text("do both".into());
        }
        let offsets: Vec<usize> = (0..prompt.chars().count() + 1).collect();
        let step = prompt.rsplit("\n2:").next().unwrap();
        let likely: Vec<Option<f64>> = offsets.iter().map(|&at| (at > 0).then_some(-(step.len() as f64))).collect();
        let told = json!({"tokens": [], "text_offset": offsets, "token_logprobs": likely});
        Reply::Other(200, "", json!({"choices": [{"text": prompt, "logprobs": told}]}).to_string())
    });
    let line = format!("chains D --with http --url {} --model wise --batches 2 --batch-size 40 --keep 0.1", server.url);
    let ended = sprint.run(&line);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(ended.stderr.contains("0 batches ranked before, 2 now, 8 pairs"), "{}", ended.stderr);
    let found = chains(&sprint);
    assert_eq!(found.len(), 8);
    assert!(found.iter().all(|pair| pair["text"] == "Do both." && pair["score"].as_f64().unwrap() < 0.0));
    let lengths: Vec<usize> = found.iter().map(|pair| pair["second"].as_str().unwrap().len()).collect();
    assert!(
        found.iter().zip(&lengths).all(|(pair, length)| pair["score"] == json!(-(*length as f64) - 1.0)),
        "{found:?}"
    );
    let asked = server.asked().len();
    assert_eq!(sprint.run(&line).code, Some(0));
    assert_eq!(server.asked().len(), asked, "what is ranked is not ranked again");
    let otherwise = sprint.run(&line.replace("--keep 0.1", "--keep 0.2"));
    assert!(otherwise.stderr.contains("holds pairs that were ranked otherwise"), "{}", otherwise.stderr);
    let silent = Completions::start(|_, _| Reply::Text("do both".into()));
    std::fs::remove_file(sprint.path("D/chains.jsonl")).unwrap();
    let ended = sprint.run(&line.replace(&server.url, &silent.url));
    assert!(ended.stderr.contains("gives no log-probabilities of a prompt"), "{}", ended.stderr);
}

#[test]
fn pairs_that_opt_ranked_are_what_the_llm_chain_preset_chains() {
    let Some(sprint) = training::demonstrations() else { return };
    let preset = training::TINY.replace("extends = \"sprint\"", "extends = \"sprint-llm-chain\"");
    std::fs::write(sprint.path("tiny.toml"), preset).unwrap();
    let lacking = sprint.run("pretrain D --preset tiny.toml --out agent");
    assert!(lacking.stderr.contains("chains.jsonl is not there; `sprint chains` writes it"), "{}", lacking.stderr);
    chance_opt(&sprint.path("tiny-opt"));
    let ended =
        sprint.run("chains D --with opt --model tiny-opt --labels rules --batches 2 --batch-size 32 --keep 0.5");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let found = chains(&sprint);
    assert_eq!(found.len(), 32);
    for batch in found.chunks(16) {
        let scores: Vec<f64> = batch.iter().map(|pair| pair["score"].as_f64().unwrap()).collect();
        assert!(scores.is_sorted_by(|a, b| a >= b), "the likeliest first: {scores:?}");
    }
    let ended = sprint.run("pretrain D --preset tiny.toml --out chained");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
}
