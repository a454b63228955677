//! Damages a file: single bytes, numbers and words in a text, and values in a JSON document or in a line of one.

use rand::Rng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

/// Numbers at which programs stumble.
const NUMBERS: [&str; 22] = [
    "0",
    "-1",
    "1",
    "7",
    "90",
    "127",
    "128",
    "255",
    "256",
    "32767",
    "32768",
    "65535",
    "65536",
    "-32769",
    "2147483648",
    "4294967296",
    "9007199254740993",
    "18446744073709551615",
    "-9223372036854775808",
    "1e308",
    "1e-320",
    "0.5",
];
/// Texts at which programs stumble.
const TEXTS: [&str; 10] = ["", " ", "\u{0}", "../../etc", "/", "Mug", "ä\u{301}\u{200f}", "NaN", "a\nb", "#|\u{1b}[2J"];
/// No input grows beyond this.
const LONGEST: usize = 1 << 20;

/// A damaged copy of an input; `other` is another one of the same kind.
pub(crate) fn damaged(input: &[u8], other: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = input.to_vec();
    for _ in 0..rng.random_range(1..=4) {
        bytes = match rng.random_range(0..10) {
            0..=4 => structure(&bytes, rng).unwrap_or_else(|| flip(bytes, other, rng)),
            5 | 6 => number(&bytes, rng).unwrap_or_else(|| flip(bytes, other, rng)),
            _ => flip(bytes, other, rng),
        };
        bytes.truncate(LONGEST);
    }
    bytes
}

fn flip(mut bytes: Vec<u8>, other: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let at = rng.random_range(0..=bytes.len());
    let end = (at + rng.random_range(0..=32)).min(bytes.len());
    match rng.random_range(0..8) {
        0 => bytes.truncate(at),
        1 if at < bytes.len() => bytes[at] ^= 1 << rng.random_range(0..8),
        2 if at < bytes.len() => bytes[at] = rng.random(),
        3 => drop(bytes.drain(at..end)),
        4 => bytes.insert(at, rng.random()),
        5 => {
            let twice = bytes[at..end].to_vec();
            bytes.splice(at..at, twice);
        }
        6 if at + 8 <= bytes.len() => {
            let word: u64 = *[0, 1, u64::MAX, 1 << 31, 1 << 40, 1 << 63].choose(rng).unwrap();
            bytes[at..at + 8].copy_from_slice(&word.to_le_bytes());
        }
        _ => {
            let from = rng.random_range(0..=other.len());
            bytes.truncate(at);
            bytes.extend(&other[from..]);
        }
    }
    bytes
}

/// Replaces one run of digits.
fn number(bytes: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    let digit = |at: usize| bytes.get(at).is_some_and(|byte| byte.is_ascii_digit() || b".-".contains(byte));
    let starts: Vec<usize> = (0..bytes.len()).filter(|&at| digit(at) && (at == 0 || !digit(at - 1))).collect();
    let start = *starts.choose(rng)?;
    let end = (start..).find(|&at| !digit(at))?;
    Some([&bytes[..start], NUMBERS.choose(rng)?.as_bytes(), &bytes[end..]].concat())
}

/// Changes one value of a JSON document, or of one line of several.
fn structure(bytes: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    if let Ok(mut document) = serde_json::from_slice::<Value>(bytes) {
        change(&mut document, rng);
        return serde_json::to_vec(&document).ok();
    }
    let mut lines: Vec<Vec<u8>> = bytes.split_inclusive(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect();
    let at = rng.random_range(0..lines.len().max(1));
    let mut document: Value = serde_json::from_slice(lines.get(at)?).ok()?;
    match rng.random_range(0..6) {
        0 => drop(lines.remove(at)),
        1 => lines.insert(at, lines[at].clone()),
        _ => {
            change(&mut document, rng);
            lines[at] = serde_json::to_vec(&document).ok()?;
            lines[at].push(b'\n');
        }
    }
    Some(lines.concat())
}

fn change(document: &mut Value, rng: &mut ChaCha8Rng) {
    let mut all = Vec::new();
    pointers(document, "", &mut all);
    let twin = document.pointer(all.choose(rng).map_or("", String::as_str)).cloned();
    let Some(value) = document.pointer_mut(all.choose(rng).map_or("", String::as_str)) else { return };
    match (rng.random_range(0..8), &mut *value) {
        (0 | 1, Value::Array(items)) if !items.is_empty() => {
            let at = rng.random_range(0..items.len());
            match rng.random_range(0..3) {
                0 => drop(items.remove(at)),
                1 => items.insert(at, items[at].clone()),
                _ => {
                    let size = items[at].to_string().len().max(1);
                    let more = rng.random_range(1..300).min(LONGEST / size);
                    (0..more).for_each(|_| items.push(items[at].clone()));
                }
            }
        }
        (0 | 1, Value::Object(fields)) if !fields.is_empty() => {
            let name = fields.keys().nth(rng.random_range(0..fields.len())).cloned().unwrap_or_default();
            let field = fields.remove(&name);
            if rng.random_bool(0.3) {
                fields.insert("colour".into(), field.unwrap_or_default());
            }
        }
        (2, Value::String(text)) => {
            *text = text.repeat(rng.random_range(2..3000).min(LONGEST / text.len().max(1)));
        }
        (3, value) => *value = twin.unwrap_or_default(),
        (4, value) => *value = json!(TEXTS.choose(rng)),
        (5, value) => {
            *value = [json!(null), json!([]), json!({}), json!(true)].choose(rng).cloned().unwrap_or_default();
        }
        (_, value) => {
            *value = NUMBERS.choose(rng).and_then(|number| serde_json::from_str(number).ok()).unwrap_or_default();
        }
    }
}

/// Every value of a document.
fn pointers(value: &Value, at: &str, all: &mut Vec<String>) {
    all.push(at.to_owned());
    match value {
        Value::Object(fields) => fields.iter().for_each(|(name, value)| pointers(value, &format!("{at}/{name}"), all)),
        // A long list's places are alike.
        Value::Array(items) => {
            items.iter().take(40).enumerate().for_each(|(i, value)| pointers(value, &format!("{at}/{i}"), all));
        }
        _ => {}
    }
}
